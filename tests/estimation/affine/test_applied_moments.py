"""First moments applied to a body of known material, against DOP853 on equations that stand here."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.affine.applied import AppliedPrior, Elastic, flow
from forceid.estimation.body.material import Solid
from forceid.estimation.run import estimate_recording
from forceid.files.result import read_result, write_result
from forceid.pseudorigid import StVenantKirchhoff
from forceid.records import Body, Motion, Recording

EYE, TIME, SIGMA = np.eye(3), np.arange(200) / 400, 3e-4
LAM, MU, ETA = 150.0, 100.0, 0.02
MIDDLE = slice(25, -25)


def stress(F, V):
    strain = (F.T @ F - EYE) / 2
    return F @ (LAM * np.trace(strain) * EYE + 2 * MU * strain + ETA * (F.T @ V + V.T @ F))


@pytest.fixture(scope="module")
def flight():
    """A stiff block that swings at 20 Hz under loads of 2 to 6 Hz: recording, F, F', applied, total."""
    rng = np.random.default_rng(11)
    X = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3) * [0.14, 0.11, 0.09]
    mass = rng.uniform(0.05, 0.1, 8)
    X -= mass @ X / mass.sum()
    inverse = np.linalg.inv((mass * X.T) @ X)
    w, phase, size = (rng.uniform(*ends, (3, 3)) for ends in ((12, 36), (0, 6), (1, 3)))

    def push(t):
        return size * np.sin(w * t + phase)

    def rate(t, y):
        F, V = y.reshape(2, 3, 3)
        return np.concatenate([y[9:], ((push(t) - stress(F, V)) @ inverse).ravel()])

    R, A = Rotation.random(rng=rng).as_matrix(), rng.standard_normal((3, 3))
    start = np.stack([R @ (EYE + 0.03 * (A + A.T)), np.cross(EYE, [1.0, -2.0, 3.0]) @ R]).ravel()
    y = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-11).y
    F, V = y.reshape(2, 3, 3, -1).transpose(0, 3, 1, 2)
    x = np.einsum("tab,nb->tna", F, X) + np.outer(TIME, [1.0, 0, 0])[:, None]
    x += SIGMA * rng.standard_normal(x.shape)
    law = {"name": "st_venant_kirchhoff", "lam": LAM, "mu": MU, "damping": ETA}
    body = Body(tuple("abcdefgh"), X, mass, material=law)
    K = np.array([push(t) for t in TIME])
    all_of_it = K - np.array([stress(f, v) for f, v in zip(F, V, strict=True)])
    motion = Motion(TIME, x, gravity=np.zeros(3), noise_std={"position": SIGMA})
    return Recording(body, motion), F, V, K @ F.mT, all_of_it @ F.mT


@pytest.fixture(scope="module")
def result(flight):
    return estimate_recording(flight[0], load_settings())


def rms(x):
    return np.sqrt(np.mean(x[MIDDLE] ** 2))


def inside(error, cov):
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    return (np.abs(error.reshape(len(std), -1)) < 1.96 * std)[MIDDLE].mean()


@pytest.mark.long
def test_where_stress_rules_what_is_applied_is_told_ten_times_better(flight, result):
    recording, _, _, applied, total = flight
    assert rms(total - applied) > 3 * rms(applied)
    assert result.model == "affine"
    assert rms(result.applied_first_moment - applied) < 0.1 * rms(result.first_moment - applied)
    untold = replace(recording, body=replace(recording.body, material=None))
    plain = estimate_recording(untold, load_settings(model="affine")).first_moment
    assert rms(result.applied_first_moment - applied) < 0.5 * rms(plain - total)
    assert rms(result.first_moment - total) < 0.5 * rms(plain - total)


def test_intervals_hold_what_is_applied_what_acts_and_the_map(flight, result):
    _, F, _, applied, total = flight
    for error, cov in (
        (result.applied_first_moment - applied, result.applied_first_moment_cov),
        (result.first_moment - total, result.first_moment_cov),
        (result.F - F, result.F_cov),
    ):
        assert 0.88 < inside(error, cov) < 0.99


def test_orientation_and_stretch_of_a_result_make_its_map(result, tmp_path):
    write_result(tmp_path / "r.h5", result)
    stored = read_result(tmp_path / "r.h5")
    R = Rotation.from_quat(stored.orientation).as_matrix()
    np.testing.assert_allclose(R @ stored.stretch, stored.F, atol=1e-12)
    np.testing.assert_allclose(stored.applied_first_moment, result.applied_first_moment)
    turned = np.array([a @ b.T for a, b in zip(R[1:], R[:-1], strict=True)])
    steps = Rotation.from_matrix(turned).as_rotvec() / TIME[1]
    half = 0.5 * (stored.spin[1:] + stored.spin[:-1])
    assert rms(steps - half) < 0.02 * rms(half)
    # deformation is about that rotation
    x = stored.center[:, None] + np.einsum("tab,tnb->tna", R, stored.mean_shape + stored.deformation)
    assert np.abs(np.diff(x - stored.center[:, None], axis=0)).max() < 0.05


def test_stress_turns_nothing(result):
    N = result.applied_first_moment
    moment = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
    np.testing.assert_allclose(moment, result.moment, atol=1e-9)


def test_steps_follow_the_equations_of_motion_and_their_slopes_its_differences(flight):
    recording, F, V, *_ = flight
    X, mass = recording.body.position, recording.body.mass
    E, time = (mass * X.T) @ X, TIME[:3]
    law = Solid(StVenantKirchhoff(LAM, MU), ETA)
    rest = np.zeros((3, 9))
    body = Elastic(law, E, time, rest, np.zeros((3, 9, 9)), np.tile(EYE, (3, 1, 1)))
    prior = AppliedPrior(2, 30.0, np.ones(9))
    rng = np.random.default_rng(0)
    x = np.concatenate([F[:3].reshape(3, 9), V[:3].reshape(3, 9), rng.standard_normal((3, 18))], 1)
    Phi, u = flow(body, x, prior)

    def ahead(start):
        """One step by DOP853; the load decays as its prior without noise has it."""

        def rate(_, y):
            f, v, k, dk = y.reshape(4, 3, 3)
            ddk = -(30.0**2) * k - 60.0 * dk
            return np.stack([v, (k - stress(f, v)) @ np.linalg.inv(E), dk, ddk]).ravel()

        return solve_ivp(rate, (0, TIME[1]), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    np.testing.assert_allclose(Phi[0] @ x[0] + u[0], ahead(x[0]), rtol=0, atol=2e-5 * 2 * np.pi * 20)
    for k in (0, 13, 20, 30):
        step = 1e-5 * np.eye(36)[k]
        slope = (ahead(x[0] + step) - ahead(x[0] - step)) / 2e-5
        np.testing.assert_allclose(Phi[0][:, k], slope, rtol=0, atol=1e-4 * np.abs(slope).max())
