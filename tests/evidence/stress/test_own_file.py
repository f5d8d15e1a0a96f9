"""A recording of one's own under faults: what is done to it, and what is said of it."""

import numpy as np
import pytest

from evidence.stress.own_file import FAULTS, Met, drawn, judged, sentences
from evidence.subjects.flights.bodies import Setup, fly
from forceid.records import Motion, Recording

FLOWN = fly(Setup(), np.random.default_rng(4))
NOISE = 2e-4


@pytest.fixture(scope="module")
def recording():
    x = FLOWN.position + NOISE * np.random.default_rng(5).standard_normal(FLOWN.position.shape)
    motion = Motion(FLOWN.time, x, gravity=FLOWN.gravity, noise_std={"position": NOISE})
    return Recording(FLOWN.body, motion, {"force": FLOWN.truth["force"], "moment": FLOWN.truth["moment"]})


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_does_what_its_level_says(recording, fault):
    level = fault.levels[2]
    found = fault.make(recording, level, np.random.default_rng(1))
    x, y = recording.motion.position, found.motion.position
    changed = {
        "noise": lambda: np.sqrt(np.mean((y - FLOWN.position) ** 2)) / NOISE,
        "gaps": lambda: np.isnan(y).mean(),
        "outliers": lambda: (y != x).any(2).mean(),
        "fewer frames": lambda: len(x) / len(y),
        "late frames": lambda: np.sqrt(3) * np.sqrt(np.mean((y - x) ** 2)) * 200 / speed(x),
        "wrong masses": lambda: np.std(found.body.mass / recording.body.mass - 1),
    }[fault.name]()
    assert changed == pytest.approx(level, rel=0.6 if fault.name == "wrong masses" else 0.25)


def speed(x):
    return np.sqrt(np.mean(np.gradient(x, FLOWN.time, axis=0) ** 2))


def test_the_worst_of_the_seeds_counts_and_a_line_tells_what_is_borne():
    fault = FAULTS[0]
    found = [Met(fault.name, level, "ok", 0.9, 1.0) for level in fault.levels]
    found += [
        Met(fault.name, fault.levels[1], "ok", 2.1, 1.0),
        Met(fault.name, fault.levels[2], "degraded", 9.0, 1.0),
    ]
    rows = judged(found)
    assert [row["outcome"] for row in rows[:3]] == ["right", "silently wrong", "degraded"]
    assert "borne up to 1.5; at 3 silently wrong" in sentences(rows)[0]
    assert len(drawn(rows, "mine").axes[0].patches) == len(fault.levels)


def test_an_estimate_that_is_refused_has_no_error():
    assert Met("gaps", 0.4, "refused", float("nan"), float("nan")).outcome == "refused"
