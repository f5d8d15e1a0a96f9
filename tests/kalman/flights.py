"""Rigid bodies in free flight: rotation integrated by scipy, loads drawn from their prior."""

import numpy as np
from linear_models import draw
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from forceid.kalman import StateSpace, discretize
from forceid.kalman.flight import Flight, LoadPrior
from forceid.kalman.tuning import Start, Tuned, load_chain

MASS, INERTIA = 0.13, np.diag([3e-4, 5e-4, 7e-4])
GRAVITY = np.array([0.0, 0.0, -9.81])
POSE_STD = np.array([3e-4, 3e-4, 5e-4, 2e-3, 3e-3, 2e-3])  # m, rad
SPIN = np.array([2.0, 25.0, 4.0])  # rad/s, body axes: about the middle axis, which does not stay put


def prior(std, rate, order=2, first=1.0, second=1.0, mean=1e-8, axes=None):
    axes = np.eye(3) if axes is None else axes
    tuned = Tuned(order, np.full(3, std), np.full(3, rate), 1.0, False, 0.0)
    return LoadPrior(tuned, axes, Start(second, first, mean))


def tumble(time, R0, H, inertia=INERTIA):
    """Rotations (time, 3, 3) of R' = [J^-1 H]x R under the angular momentum H(t), world axes, by DOP853."""
    J_inv = np.linalg.inv(inertia)

    def rate(t, q):
        R = Rotation.from_quat(q)
        omega = R.apply(J_inv @ R.inv().apply(H(t)))
        return 0.5 * np.append(omega * q[3] + np.cross(omega, q[:3]), -omega @ q[:3])

    start = Rotation.from_matrix(R0).as_quat()
    q = solve_ivp(rate, time[[0, -1]], start, "DOP853", time, rtol=1e-12, atol=1e-13).y.T
    return Rotation.from_quat(q).as_matrix()


def seen(time, center, rotation, rng, scale=1.0):
    """The flight as measured, with POSE_STD of white noise."""
    noise = scale * POSE_STD * rng.standard_normal((len(time), 6))
    turned = Rotation.from_rotvec(noise[:, 3:]).as_matrix() @ rotation
    return flight_of(time, center + noise[:, :3], turned, scale)


def flight_of(time, center, rotation, scale=1.0):
    cov = np.tile(np.diag((scale * POSE_STD) ** 2), (len(time), 1, 1))
    inertia = np.tile(INERTIA, (len(time), 1, 1))
    return Flight(time, center, rotation, cov, MASS, inertia, np.zeros((len(time), 3)), GRAVITY)


def free_top(rng, count=150, step=0.005, scale=1.0):
    """A torque-free, force-free asymmetric top under gravity, measured."""
    time = step * np.arange(count)
    R0 = Rotation.from_rotvec([0.4, -0.2, 0.9]).as_matrix()
    H = R0 @ INERTIA @ SPIN
    center = np.array([1.0, 2.0, 1.5]) + time[:, None] * [3.0, 0.5, 2.0] + 0.5 * time[:, None] ** 2 * GRAVITY
    return seen(time, center, tumble(time, R0, lambda t: H), rng, scale)


def drawn_flight(force, moment, rng, count=120, step=0.005, fine=8):
    """A flight whose loads are drawn from their priors: as measured, and its true wrench (time, 6)."""
    time = step / fine * np.arange(fine * (count - 1) + 1)

    def chains(p):
        path = []
        for axis in range(3):
            start = Start(0.0, 0.0, p.start.mean)
            chain = load_chain(p.tuned.order, p.tuned.std[axis], p.tuned.rate[axis], start)
            F, Q = discretize(chain, step / fine)
            model = StateSpace(F, Q, chain.output[None], np.zeros((1, 1)), np.zeros(len(F)), chain.P0)
            path.append(draw(model, len(time), rng)[0])
        x = np.stack(path, -1)
        return x[:, 0], x[:, 1], x[:, 2] + x[:, 3]

    moment_of_mass, _, F = chains(force)
    _, H, T = chains(moment)
    R0 = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    H = H + R0 @ INERTIA @ SPIN
    rotation = tumble(time, R0, CubicHermiteSpline(time, H, T))
    t = time[:, None]
    center = moment_of_mass / MASS + t * [3.0, 0.5, 2.0] + 0.5 * t**2 * GRAVITY
    flight = seen(time[::fine], center[::fine], rotation[::fine], rng)
    return flight, np.hstack([F, T])[::fine]
