"""Loads that keep to axes of the body, while the motion goes on."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.live import turning
from forceid.estimation.live.run import followed_live, live_pace
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Start
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.records import Body, Motion, Recording

RATE, NOISE, FRAMES = 250.0, 2e-4, 700
TIPS = np.array([[0.2, 0.0, 0.0], [-0.1, 0.15, 0.05], [-0.1, -0.15, 0.0], [0.05, 0.0, -0.1]])
MASS = np.array([0.1, 0.2, 0.2, 0.15])
TIPS = TIPS - MASS @ TIPS / MASS.sum()
INERTIA = np.einsum(
    "n,nab->ab", MASS, (TIPS**2).sum(1)[:, None, None] * np.eye(3) - TIPS[:, :, None] * TIPS[:, None]
)


def pushed_in_body_axes(seed):
    """Times, tracks, and true force and moment (time, 3), world axes, of a body with thrusters that sway."""
    rng = np.random.default_rng(seed)
    pace, phase = 2 * np.pi * rng.uniform(0.5, 3.0, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    size = np.array([[1.0, 0.6, 0.3], [0.02, 0.01, 0.01]]) * rng.uniform(0.7, 1.3, (2, 3))

    def own(t):
        return size * np.sin(pace * np.asarray(t)[..., None, None] + phase)

    def rate(t, s):
        R, force, moment = Rotation.from_quat(s[6:10]), *own(t)
        w = s[10:]
        turning = np.linalg.solve(INERTIA, moment - np.cross(w, INERTIA @ w))
        quat = Rotation.from_quat(s[6:10]).as_quat()
        spin = 0.5 * np.array(
            [
                quat[3] * w[0] + quat[1] * w[2] - quat[2] * w[1],
                quat[3] * w[1] + quat[2] * w[0] - quat[0] * w[2],
                quat[3] * w[2] + quat[0] * w[1] - quat[1] * w[0],
                -quat[:3] @ w,
            ]
        )
        return np.concatenate([s[3:6], R.apply(force) / MASS.sum(), spin, turning])

    t = np.arange(FRAMES) / RATE
    start = np.concatenate([np.zeros(6), [0, 0, 0, 1], 2 * np.pi * rng.normal(0, [0.4, 0.4, 2.5])])
    s = solve_ivp(rate, (0, t[-1]), start, "DOP853", t, rtol=1e-11, atol=1e-12).y.T
    R = Rotation.from_quat(s[:, 6:10])
    x = s[:, None, :3] + np.einsum("tab,nb->tna", R.as_matrix(), TIPS)
    force, moment = (R.apply(one) for one in own(t).swapaxes(0, 1))
    return t, x + NOISE * rng.standard_normal(x.shape), force, moment


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_loads_that_turn_with_the_body_err_at_most_1_2_times_what_the_smoother_errs(seed):
    t, x, *truth = pushed_in_body_axes(seed)
    motion = Motion(t, x, gravity=np.zeros(3), noise_std={"position": NOISE})
    recording = Recording(Body(("a", "b", "c", "d"), TIPS, MASS), motion)
    smooth = estimate_recording(recording, load_settings())
    pace, fed = live_pace(0.3, None, np.inf), zip(t.tolist(), x, strict=True)
    found = list(followed_live(fed, recording, load_settings(), pace, True, lambda _: None))
    inner = slice(100, -100)
    for name, true in zip(("force", "moment"), truth, strict=True):
        error = (np.array([getattr(w, name) for w in found]) - true)[inner]
        claim = np.array([getattr(w, f"{name}_std") for w in found])[inner]
        best = np.sqrt(((getattr(smooth, name) - true)[inner] ** 2).mean())
        assert np.sqrt((error**2).mean()) < 1.2 * best
        assert 0.3 < np.sqrt(((error / claim) ** 2).mean()) < 1.5


def test_a_step_along_axes_of_the_body_is_that_in_the_world_turned_there():
    own = Rotation.random(random_state=2).as_matrix()
    prior = LoadPrior(
        Tuned(Matern(2, np.array([1.0, 0.5, 0.2]), np.array([30.0, 20.0, 40.0]))),
        np.eye(3),
        Start(1.0, 1.0, 1.0),
        body_axes=own,
    )
    for size in (1e-4, 0.3, 2.0):
        turn = size * np.array([0.6, 0.0, 0.8])
        R = Rotation.random(2, random_state=1).as_matrix()
        R[1] = Rotation.from_rotvec(turn).as_matrix() @ R[0]
        step = np.array([0.02])
        (F, *_), (Q, *_), _ = prior.chain(step, R)
        plain = [a[0] for a in prior.chain(step)[:2]]
        ends = []
        for at in R @ own:
            T = np.eye(len(F))
            for i in range(6, len(F), 3):
                T[i : i + 3, i : i + 3] = at
            ends.append(T)
        found = turning.along_with_body(prior, *plain, turn, R[0])
        np.testing.assert_allclose(found[0], ends[1].T @ F @ ends[0], atol=1e-6 * np.abs(F).max())
        np.testing.assert_allclose(found[1], ends[1].T @ Q @ ends[1], atol=1e-6 * np.abs(Q).max())
        written = turning.along_in_numpy(*plain, turn, R[0], own, prior.vectors)
        for one, other in zip(found, written, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(other).max())
