"""The compiled smoother of long flights beside the passes of the engines, on the same flights."""

from dataclasses import replace

import numpy as np
import pytest
from flights import INERTIA, drawn_flight, flight_of, free_top, prior

from forceid import kalman
from forceid.flight import attitude as turning
from forceid.flight import smoother as flights
from forceid.flight.path import rigid_batch, settling
from forceid.flight.path import rigid_path as long_flight
from forceid.flight.path.reference import trajectory_of
from forceid.flight.path.settling import first_reference
from forceid.flight.smoother import smooth_flight, smooth_long
from forceid.kalman.building.lines import Line
from forceid.motion.pose import exp

pytestmark = pytest.mark.skipif(turning.compiled is None, reason="no compiler was here")
FORCE, MOMENT = prior(std=1.0, rate=20.0), prior(std=0.05, rate=30.0)
LINE = Line(9.0, 0.02, 1e-3, np.array([0.6, 0.0, 0.8]), driven=False)


@pytest.fixture(scope="module")
def flown():
    return drawn_flight(FORCE, MOMENT, np.random.default_rng(3), count=700, step=0.002)[0]


def coupled(flight):
    """As of markers whose middle is not the mass center."""
    cov = flight.pose_cov.copy()
    arm = flight.rotation @ np.array([0.01, -0.02, 0.03])
    J = np.zeros((len(arm), 6, 6))
    J[:, :3, 3:] = -np.cross(arm[:, None], np.eye(3)).swapaxes(1, 2)
    J[:, range(6), range(6)] = 1.0
    return replace(flight, pose_cov=J @ cov @ J.swapaxes(1, 2))


def by_engine(monkeypatch, *arguments, **more):
    with monkeypatch.context() as m:
        m.setattr(flights, "smooth_long", lambda *_: None)
        m.setattr(settling, "SINGLE", 1e-8)
        return smooth_flight(*arguments, kalman.engine("compiled"), **more)


def differences(state, other):
    """Of wrench in standard deviations, of covariances in variances."""
    sd = np.sqrt(np.diagonal(other.wrench_cov, axis1=1, axis2=2))
    wrench = np.hstack([state.force - other.force, state.moment - other.moment])
    wide = np.sqrt(np.diagonal(other.pose_cov, axis1=1, axis2=2))
    return (
        np.abs(wrench / sd).max(),
        np.abs((state.wrench_cov - other.wrench_cov) / (sd[:, :, None] * sd[:, None])).max(),
        np.abs((state.pose_cov - other.pose_cov) / (wide[:, :, None] * wide[:, None])).max(),
    )


@pytest.mark.parametrize("bending", [False, True])
def test_compiled_steps_are_those_in_numpy(flown, bending):
    flight = flown
    if bending:
        wave = np.sin(40 * flight.time)
        flight = replace(
            flight,
            inertia=(1 + 0.1 * wave)[:, None, None] * INERTIA,
            h=1e-4 * wave[:, None] * [1.0, 2.0, -1.0],
        )
    about = first_reference(flight, MOMENT)
    chain = about.chain + 1e-3 * np.random.default_rng(1).standard_normal(about.chain.shape)
    here = trajectory_of(flight, about.rotation, *MOMENT.read(chain))
    for ours, plain in zip(turning.turn_along(here), turning.turn_in_numpy(here), strict=True):
        np.testing.assert_allclose(ours, plain, rtol=0, atol=1e-13 * np.abs(plain).max())


def test_compiled_rotations_turn_there_and_back():
    rng = np.random.default_rng(2)
    size = np.concatenate([np.zeros(3), np.geomspace(1e-12, 3.14, 60)])
    phi = rng.standard_normal((len(size), 3))
    phi *= (size / np.linalg.norm(phi, axis=1))[:, None]
    R = exp(rng.standard_normal((len(size), 3)))
    ahead = turning.turned(phi, R)
    np.testing.assert_allclose(ahead, exp(phi) @ R, atol=1e-14)
    np.testing.assert_allclose(turning.between(ahead, R), phi, atol=1e-13)
    R[4] = np.nan
    assert np.isnan(turning.between(ahead, R)[4]).all()


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("kind", ["plain", "coupled", "line", "gaps in time"])
def test_a_long_flight_is_that_of_the_engine(flown, kind, causal, monkeypatch):
    flight, moment = flown, MOMENT
    if kind == "coupled":
        flight = coupled(flight)
    if kind == "line":
        moment = replace(MOMENT, lines=(LINE,))
    if kind == "gaps in time":
        kept = np.random.default_rng(4).random(len(flight.time)) > 0.2
        names = ("time", "center", "rotation", "pose_cov", "inertia", "h")
        flight = replace(flight, **{name: getattr(flight, name)[kept] for name in names})
    state = smooth_long(flight, FORCE, moment, causal)
    other = by_engine(monkeypatch, flight, FORCE, moment, causal=causal)
    wrench, wrench_cov, pose_cov = differences(state, other)
    assert wrench < long_flight.THOUSANDTH
    assert wrench_cov < 1e-4
    assert pose_cov < 1e-4
    assert state.log_likelihood == pytest.approx(other.log_likelihood, abs=0.01)
    np.testing.assert_allclose(state.omega, other.omega, atol=1e-4 * np.abs(other.omega).max())


def test_eight_stretches_are_one_record(flown, monkeypatch):
    """Under loads so rough that a filter has forgotten its start after 150 samples; after 10 it has not."""
    rough = [
        prior(std=std, rate=150.0, order=1, mean=0.0) for std in (20.0, 2.0)
    ]  # a constant is never forgotten
    whole = smooth_long(coupled(flown), *rough, causal=False)
    monkeypatch.setattr(rigid_batch, "WARM", (150,))
    cut = smooth_long(coupled(flown), *rough, causal=False)
    assert 0 < max(differences(cut, whole)) < 1e-7
    monkeypatch.setattr(
        rigid_batch, "WARM", (10,)
    )  # they do not meet: then it is gone through from end to end
    assert max(differences(smooth_long(coupled(flown), *rough, causal=False), whole)) == 0


def test_what_lanes_cannot_do_goes_through_the_engine():
    flight = free_top(np.random.default_rng(5), count=400)
    assert smooth_long(flight, FORCE, MOMENT, causal=False) is not None
    center, rotation = flight.center.copy(), flight.rotation.copy()
    center[100:104], rotation[100:104] = np.nan, np.nan
    lost = flight_of(flight.time, center, rotation)
    assert smooth_long(lost, FORCE, MOMENT, causal=False) is None
    state = smooth_flight(lost, FORCE, MOMENT, kalman.engine("compiled"))
    assert np.isfinite(state.force).all()
