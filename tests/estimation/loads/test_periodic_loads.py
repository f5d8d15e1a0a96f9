"""Records under loads that repeat, estimated with the prior that knows it and with the one that does not."""

from dataclasses import replace
from pathlib import Path

import closed_forms as cf
import numpy as np
import pytest
from repeating_loads import beating

from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.loads import channels
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion
from forceid.flight.priors.periodic import Periodic
from forceid.flight.priors.protocol import Tuned
from forceid.flight.tuning import tune_loads

ROOT = Path(__file__).parents[3]


def test_sensors_alone_refuse_a_load_that_repeats_in_one_line():
    recording = read_motion(ROOT / "data" / "synthetic" / "instrumented.h5")
    alone = replace(recording, motion=replace(recording.motion, position=None))
    with pytest.raises(ConfigError, match="'periodic' is tuned on poses, which sensors alone do not show"):
        estimate_recording(alone, load_settings(load_prior="periodic"))


def recorded(seed, noise=1e-3):
    """A body that turns at constant rate under such a load, by its markers, and the force (time, 3)."""
    time, force, path, _ = beating(seed)
    still = cf.toss(time=time, spin=(6.0, 0.0), seed=seed, noise=noise)
    return cf.seen_as(still, still.motion.position + path[:, None]), force + cf.FORCE


@pytest.mark.long
def test_of_rotating_bodies_whose_load_repeats_the_force_is_told_at_least_as_well_as_with_lines():
    score = {"periodic": [], "matern": []}
    for seed in range(8):
        recording, force = recorded(seed)
        for kind, kept in score.items():
            found = estimate_recording(recording, load_settings(load_prior=kind, model="rigid"))
            inner = slice(len(force) // 8, -len(force) // 8)
            off = (found.force - force)[inner] ** 2
            var = np.diagonal(found.wrench_cov, axis1=1, axis2=2)[inner, :3]
            kept.append([off.mean(), (off / var).mean()])
    (periodic, claim), (plain, _) = (np.sqrt(np.mean(score[kind], 0)) for kind in ("periodic", "matern"))
    assert periodic <= plain
    assert 0.8 < claim < 1.3


@pytest.mark.long
def test_parts_that_joints_hold_may_have_priors_of_loads_that_repeat(monkeypatch):
    def repeating(*channels):
        tuned = tune_loads(*(None if isinstance(one, Tuned) else one for one in channels))  # anew each time
        return replace(tuned, kernel=Periodic(tuned.kernel.std, 5.0, tuned.kernel.rate.max(), 1.0, 4))

    monkeypatch.setattr(channels, "PRIORS", {"matern": tune_loads, "periodic": repeating})
    recording = read_motion(ROOT / "data" / "synthetic" / "two_blocks.h5")
    settings = load_settings(ROOT / "config" / "two_blocks.toml", load_prior="periodic")
    found = estimate_recording(recording, settings).interface
    off = (found.force - recording.truth["joint_force"])[20:-20]
    var = np.diagonal(found.wrench_cov, axis1=2, axis2=3)[20:-20, :, :3]
    assert np.mean(off**2 / var) < 1.3**2
