"""Slender bodies that tumble: an error of their turn swings far faster than they turn."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

RATE, NOISE = 80.0, 1e-4  # Hz, m


def tumbling_rod(seed, moved):
    """Nine masses near a line, 0.4 m long and some mm wide, told one by one and all of them seen, in flight.

    moved (3,): moment N m in body axes, that rises over the record; told nothing of the errors.
    """
    rng = np.random.default_rng([41, seed])
    X = np.stack([np.linspace(-0.2, 0.2, 9), *rng.uniform(-0.006, 0.006, (2, 9))], 1)
    mass = rng.uniform(0.02, 0.06, 9)
    X -= mass @ X / mass.sum()
    J = np.einsum("n,nab->ab", mass, (X**2).sum(1)[:, None, None] * np.eye(3) - X[:, :, None] * X[:, None])
    time = np.arange(320) / RATE
    omega = [rng.uniform(-4, 4), *10 * np.exp(rng.uniform(-0.3, 0.3)) * rng.standard_normal(2)]

    def moment(t, R):
        return R @ moved * (t / time[-1])

    def rates(t, y):
        R, H = y[:9].reshape(3, 3), y[9:]
        turned = np.cross(R @ np.linalg.solve(J, R.T @ H), R, axisb=0, axisc=0)
        return np.concatenate([turned.ravel(), moment(t, R)])

    begun = np.concatenate([np.eye(3).ravel(), J @ omega])
    path = solve_ivp(rates, time[[0, -1]], begun, "DOP853", time, rtol=1e-10, atol=1e-13).y
    R = path[:9].T.reshape(-1, 3, 3)
    center = np.outer(time, rng.standard_normal(3)) + 0.5 * np.outer(time**2, [0, 0, -9.81])
    x = center[:, None] + np.einsum("tab,nb->tna", R, X) + NOISE * rng.standard_normal((320, 9, 3))
    applied = np.array([moment(*at) for at in zip(time, R, strict=True)])
    truth = {"force": np.zeros((320, 3)), "moment": applied}
    body = Body(tuple("abcdefghi"), X, mass=mass)
    motion = Motion(time, x, gravity=np.array([0.0, 0.0, -9.81]))
    return Recording(body, motion, truth), np.linalg.eigvalsh(J)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.long) for k in range(2, 8))])
def test_the_flight_of_a_slender_body_comes_to_rest_and_errs_as_claimed(seed):
    size = 1e-3  # N m: across the rod 0.1 rad/s2
    direction = np.random.default_rng([42, seed]).standard_normal(3) * [0.0, 1.0, 1.0]
    recording, J = tumbling_rod(seed, size * direction / np.linalg.norm(direction))
    found = estimate_recording(recording, load_settings())
    assert J[1] > 50 * J[0]
    assert found.verdict.level == "ok"
    inner = slice(40, -40)
    for load in ("force", "moment"):
        off, std = (getattr(found, load) - recording.truth[load])[inner], getattr(found, f"{load}_std")[inner]
        assert np.sqrt(np.mean(off**2) / np.mean(std**2)) < 2


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_path_of_a_slender_body_is_known_far_better_than_a_frame_tells(seed):
    recording, _ = tumbling_rod(seed, np.zeros(3))
    found = estimate_recording(recording, load_settings())
    assert "plain-route-instead" not in found.verdict.codes
    R = Rotation.from_quat(found.orientation, scalar_first=False).as_matrix()
    x = found.center[:, None] + np.einsum("tab,nb->tna", R, recording.body.position)
    off = x - recording.motion.position
    assert np.sqrt(np.mean(off**2)) < 1.05 * NOISE
