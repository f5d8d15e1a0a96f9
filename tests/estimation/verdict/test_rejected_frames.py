"""Frames taken out: mistakes cost their information alone, what comes together may have been a motion."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.claims.witness import noisy_flight
from evidence.drawn.records.scored import FORCE, MOMENT, scored
from forceid.config import load_settings
from forceid.estimation.body.cleaning import Dropped
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.tracks import closest_together, judge_rejected


def codes(at, frames=500):
    """What is said of frames taken out, with the level of each finding."""
    gone = np.zeros(frames, bool)
    gone[list(at)] = True
    found = judge_rejected(Dropped(gone, np.zeros(frames, bool), 9.0, 0.1))
    return {finding.code: finding.level for finding in found}


def test_a_few_frames_here_and_there_are_a_note():
    assert codes(()) == {}
    assert codes((100,)) == {"frames-rejected": "ok"}
    assert codes((20, 150, 155, 300, 410)) == {"frames-rejected": "ok"}


def test_frames_that_stand_together_may_be_a_blow():
    assert codes((100, 101, 102))["rejected-together"] == "degraded"
    assert codes((20, 200, 202, 204, 400))["rejected-together"] == "degraded"


def test_more_frames_than_leave_the_noise_as_it_is_degrade():
    assert codes((3, 30), frames=60)["many-rejected"] == "degraded"
    assert "many-rejected" not in codes((3, 90), frames=120)


def test_frames_that_chance_spreads_rarely_stand_together():
    rng = np.random.default_rng(0)
    together = 0
    for _ in range(1000):
        gone = np.zeros(800, bool)
        gone[rng.choice(800, 12, replace=False)] = True
        together += closest_together(gone)[2] < 0.01
    assert together <= 10


def with_wild(recording, at, rng):
    """The recording with whole frames off by 5 to 300 times the noise of a marker."""
    position = recording.motion.position.copy()
    noise = recording.motion.noise_std["position"]
    for frame in at:
        position[frame] += noise * 10 ** rng.uniform(0.7, 2.5) * rng.standard_normal(3)
    return replace(recording, motion=replace(recording.motion, position=position))


@pytest.mark.long
def test_claims_hold_where_one_frame_in_a_hundred_was_wild_and_is_gone():
    over = []
    for seed in range(12):
        recording, rng = noisy_flight(seed, False), np.random.default_rng([seed, 5])
        frames = len(recording.motion.time)
        at = rng.choice(frames, max(1, frames // 100), replace=False)
        found = estimate_recording(with_wild(recording, at, rng), load_settings())
        score = scored(found, recording.truth["force"], recording.truth["moment"])
        if found.verdict.level == "ok":
            over.append([score.over_claim(FORCE), score.over_claim(MOMENT)])
    assert len(over) >= 8
    assert np.max(over) < 2
    assert 0.7 < np.median(over) < 1.3
