"""Recordings that are odd, yet no error: none of them lets a warning of numpy reach the user."""

from contextlib import nullcontext

import numpy as np
import pytest

from evidence.drawn import plate_face
from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.innovations import judge_innovations
from forceid.estimation.witness.stand_in import stand_in
from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
BODY = Body(node=(), total_mass=0.5, mass_center=np.zeros(3), inertia=np.diag([1e-3, 2e-3, 2.5e-3]))
NOISE = np.random.default_rng(0).standard_normal((2, 60, 3))


def flown(samples=60, shaken=(1.0, 1.0, 1.0), turned=(1.0, 1.0, 1.0), speed=(2.0, 0.0, 5.0), spin=3.0):
    """A mean motion that errors shake along some axes only; one of no speed and no spin hangs still."""
    t = np.arange(samples) / 100
    falls = 0.5 * np.outer(t**2, GRAVITY) if any(speed) else np.zeros((samples, 3))
    c = np.outer(t, speed) + falls + 2e-4 * NOISE[0, :samples] * shaken
    half = 0.5 * (np.outer(t * spin, [0.0, 0.0, 1.0]) + 1e-3 * NOISE[1, :samples] * turned)
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    q = np.hstack([half * np.sinc(angle / np.pi), np.cos(angle)])
    return Recording(BODY, Motion(t, gravity=GRAVITY, center=c, orientation=q))


ODD = {
    "an axis without error": flown(shaken=(1.0, 0.0, 1.0)),
    "a planar turn": flown(turned=(0.0, 0.0, 1.0)),
    "no error at all": flown(shaken=(0.0, 0.0, 0.0), turned=(0.0, 0.0, 0.0)),
    "still": flown(shaken=np.zeros(3), turned=np.zeros(3), speed=(0.0, 0.0, 0.0), spin=0.0),
    "seven samples": flown(samples=7),
    "four samples": flown(samples=4),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "method"),
    [*((name, "savgol") for name in ODD), ("still", "smoother"), ("four samples", "smoother")],
)
def test_an_odd_recording_ends_in_an_estimate_or_in_one_error_and_never_in_a_warning(name, method):
    short = pytest.raises(EstimationError) if len(ODD[name].motion.time) < 8 else nullcontext()
    with short:
        assert np.isfinite(estimate_recording(ODD[name], Settings(method=method)).force).any()


@pytest.mark.filterwarnings("error")
def test_innovations_that_are_zero_or_missing_are_judged_without_a_warning():
    time, v = np.arange(200) / 100, np.random.default_rng(1).standard_normal((200, 6))
    zero, missing = v * [1, 1, 0, 1, 1, 1], np.where(np.arange(6) == 2, np.nan, v)
    for odd, nis in ((zero, np.ones(200)), (missing, np.ones(200)), (0 * v, np.zeros(200))):
        said = [f.text for f in judge_innovations(time, odd, nis, np.full(6, np.inf))]
        assert not any("correlated" in text for text in said)


@pytest.mark.long
def test_a_flight_that_does_not_settle_beside_its_lines_is_estimated_without_them():
    # a plate whose bending, unseen by a rigid model, stands out of its innovations as lines
    found = estimate_recording(plate_face.plate_flight(300, 5, "masses"), Settings(model="rigid"))
    assert np.isfinite(found.force).all()
    assert np.isfinite(found.moment).all()
    assert found.verdict.level == "degraded"


def test_a_force_is_given_where_markers_that_bend_let_no_flight_settle():
    recording = plate_face.plate_flight(300, 5, "total mass")
    kin = kinematics(recording.body, recording.motion, Settings(model="rigid"))
    error = EstimationError("does not settle", "the smoother on rotations", "record faster")
    found = stand_in(recording.body, recording.motion, kin, error)
    assert np.isfinite(found.state.force).all()
    assert [f.code for f in found.findings] == ["plain-route-instead"]
