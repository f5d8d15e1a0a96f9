"""Parts that joints hold to the ground: pendulums by scipy's DOP853, and what their supports bear."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.inspection import inspect_recording
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
TIME = np.arange(0, 1.5, 0.005)
NOISE = 3e-4
BASE = np.array([0.4, -0.2, 1.1])  # m, world: where the support is


def turn(q, omega):
    """Rate of a quaternion [x y z w] whose body turns at omega, world axes."""
    return 0.5 * np.concatenate([q[3] * omega + np.cross(omega, q[:3]), [-omega @ q[:3]]])


def pendulum(seed, axis=None):
    """Eight masses on a ball joint, or on a hinge about `axis` (reference shape), swinging freely.

    Returns the recording, the place of the joint in the reference shape, and force and moment (time, 3) that
    the ground exerts at it.
    """
    rng = np.random.default_rng(seed)
    X, mass = 0.1 * rng.standard_normal((8, 3)) + [0.15, 0.0, -0.1], rng.uniform(0.05, 0.2, 8)
    at, m = 0.05 * rng.standard_normal(3), mass.sum()
    r = X - at
    J = np.einsum("n,nij->ij", mass, (r**2).sum(1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None])
    arm = mass @ r / m
    e = None if axis is None else np.array(axis) / np.linalg.norm(axis)

    def motion(y):
        R, w = Rotation.from_quat(y[:4]).as_matrix(), y[4:]
        pull = np.cross(arm, m * R.T @ GRAVITY) - np.cross(w, J @ w)  # body axes, about the joint
        dw = np.linalg.solve(J, pull) if e is None else e * (e @ pull) / (e @ J @ e)
        return R, w, dw

    def rates(t, y):
        R, w, dw = motion(y)
        return np.concatenate([turn(y[:4], R @ w), dw])

    w = rng.uniform(-4, 4, 3) if e is None else e * rng.uniform(2, 6)
    start = np.concatenate([Rotation.random(random_state=seed).as_quat(), w])
    y = solve_ivp(rates, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-11, atol=1e-11).y.T
    x, force, moment = np.empty((len(TIME), 8, 3)), np.empty((len(TIME), 3)), np.empty((len(TIME), 3))
    for k, state in enumerate(y):
        R, w, dw = motion(state)
        a = R @ (np.cross(dw, arm) + np.cross(w, np.cross(w, arm)))
        x[k], force[k] = BASE + r @ R.T, m * (a - GRAVITY)
        moment[k] = R @ (J @ dw + np.cross(w, J @ w)) - np.cross(R @ arm, m * GRAVITY)
    x += NOISE * rng.standard_normal(x.shape)
    body = Body(tuple("abcdefgh"), X, mass)
    return Recording(body, Motion(TIME, x, gravity=GRAVITY, noise_std={"position": NOISE})), at, force, moment


def held(at, kind="ball", parts=("ground", "arm"), **more):
    """Settings of one part that a joint holds to the ground."""
    joint = {"name": "support", "parts": parts, "at": tuple(at), "kind": kind, **more}
    return load_settings(part=[{"name": "arm", "nodes": list("abcdefgh")}], joint=[joint])


def central(values):
    n = len(values) // 8
    return values[n:-n]


def rms(values):
    return float(np.sqrt(np.mean(central(values) ** 2)))


@pytest.mark.long
def test_a_ball_joint_bears_what_holds_the_pendulum():
    recording, at, force, _ = pendulum(70)
    found = estimate_recording(recording, held(at)).interface
    assert found.parts == (("ground", "arm"),)
    error, claim = found.force[:, 0] - force, found.force_std[:, 0]
    assert rms(error) < 1.6 * rms(claim)
    assert rms(error) < 0.04 * rms(force)
    assert np.abs(found.point[:, 0] - BASE).max() < 2 * NOISE
    assert found.dof == 3  # no moment passes: three balances test masses and joint


@pytest.mark.long
def test_a_hinge_bears_force_and_the_moment_across_its_axis():
    axis = (0.3, 1.0, -0.2)
    recording, at, force, moment = pendulum(73, axis)
    found = estimate_recording(recording, held(at, "hinge", axis=axis)).interface
    assert rms(found.force[:, 0] - force) < 2e-4 * rms(force)  # all but the angle is known of a hinge
    assert rms(found.moment[:, 0] - moment) < 2 * rms(found.moment_std[:, 0])


@pytest.mark.long
def test_what_the_part_exerts_on_the_ground_is_the_opposite():
    recording, at, force, _ = pendulum(70)
    one = estimate_recording(recording, held(at)).interface
    other = estimate_recording(recording, held(at, parts=("arm", "ground"))).interface
    assert other.parts == (("arm", "ground"),)
    assert np.abs(one.force + other.force).max() < 1e-3 * np.abs(force).max()


@pytest.mark.long
def test_holding_a_pendulum_makes_its_force_more_exact():
    recording, at, force, _ = pendulum(71)
    free = estimate_recording(recording, held(at, "weld", driven=True))
    assert rms(estimate_recording(recording, held(at)).interface.force[:, 0] - force) < rms(
        free.force - force
    )


@pytest.mark.long
def test_a_support_that_moves_is_told():
    recording, at, _, _ = pendulum(74)
    off = at + np.array([0.08, 0.0, 0.0])  # not where it hangs
    found = estimate_recording(recording, held(off)).interface
    assert found.verdict.level != "ok"
    assert {"joint-apart", "balances-open"} & set(found.verdict.codes)


def test_inspection_knows_the_ground():
    recording, at, _, _ = pendulum(70)
    joints = inspect_recording(recording, held(at)).linkage
    assert joints.joint[0].parts == ("ground", "arm")
    assert (joints.joint[0].told, joints.joint[0].passes, joints.spare) == (3, 3, 3)


@pytest.mark.long
def test_no_part_is_called_ground():
    recording, at, _, _ = pendulum(70)
    settings = load_settings(
        part=[{"name": "ground", "nodes": list("abcdefgh")}],
        joint=[{"name": "support", "parts": ("ground", "ground"), "at": tuple(at)}],
    )
    with pytest.raises(ConfigError, match="part ground is named twice"):
        estimate_recording(recording, settings)
