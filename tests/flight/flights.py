"""Rigid bodies in free flight: rotation integrated by scipy, loads drawn from their prior."""

import numpy as np
from linear_models import draw
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from forceid.flight.attitude import turn_along
from forceid.flight.channels import Start, load_chain
from forceid.flight.model import Flight
from forceid.flight.path.reference import trajectory_of
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.kalman import StateSpace, discretize, matern

MASS, INERTIA = 0.13, np.diag([3e-4, 5e-4, 7e-4])
GRAVITY = np.array([0.0, 0.0, -9.81])
POSE_STD = np.array([3e-4, 3e-4, 5e-4, 2e-3, 3e-3, 2e-3])  # m, rad
SPIN = np.array([2.0, 25.0, 4.0])  # rad/s, body axes: about the middle axis, which does not stay put


def prior(std, rate, order=2, first=1.0, second=1.0, mean=1e-8, axes=None):
    axes = np.eye(3) if axes is None else axes
    kernel = Matern(order, np.full(3, std), np.full(3, rate))
    return LoadPrior(Tuned(kernel), axes, Start(second, first, mean))


def tumble(time, R0, H, rtol=1e-12):
    """Rotations (time, 3, 3) of R' = [J^-1 H]x R under the angular momentum H(t), world axes, by DOP853.

    In unit quaternions: q' = q Omega / 2, Omega = J^-1 (q* H q) in body axes.
    """
    J = np.diag(INERTIA)

    def rate(t, q):
        x, y, z, w = q
        a, b, c = H(t)
        # R^T H, row by row
        p = ((1 - 2 * (y * y + z * z)) * a + 2 * (x * y + z * w) * b + 2 * (x * z - y * w) * c) / J[0]
        q = (2 * (x * y - z * w) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + x * w) * c) / J[1]
        r = (2 * (x * z + y * w) * a + 2 * (y * z - x * w) * b + (1 - 2 * (x * x + y * y)) * c) / J[2]
        return 0.5 * np.array(
            [w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p, -x * p - y * q - z * r]
        )

    start = Rotation.from_matrix(R0).as_quat()
    q = solve_ivp(rate, time[[0, -1]], start, "DOP853", time, rtol=rtol, atol=rtol / 10).y.T
    return Rotation.from_quat(q).as_matrix()


def seen(time, center, rotation, rng, scale=1.0):
    """The flight as measured, with POSE_STD of white noise."""
    noise = scale * POSE_STD * rng.standard_normal((len(time), 6))
    turned = Rotation.from_rotvec(noise[:, 3:]).as_matrix() @ rotation
    return flight_of(time, center + noise[:, :3], turned, scale)


def steps_of(flight, reference):
    """The rotation's step from each sample of a reference, and its derivatives, as `turn_along` has them."""
    return turn_along(trajectory_of(flight, reference.rotation, *reference.moment.read(reference.chain)))


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


def chains(p, rng, count, step):
    """Twice integrated, integrated and load itself (time, 3) drawn from a prior."""
    path = []
    for axis in range(3):
        start = Start(0.0, 0.0, p.start.mean)
        chain = load_chain(matern(p.kernel.order, p.kernel.std[axis], p.kernel.rate[axis]), start)
        F, Q = discretize(chain, step)
        model = StateSpace(F, Q, chain.output[None], np.zeros((1, 1)), np.zeros(len(F)), chain.P0)
        path.append(draw(model, count, rng)[0])
    x = np.stack(path, -1)
    return x[:, 0], x[:, 1], x[:, 2] + x[:, 3]


def drawn_path(force, moment, rng, count=120, step=0.005, fine=4, spin=SPIN):
    """A flight whose loads are drawn from their priors: time, center, rotation and wrench (time, 6)."""
    time = step / fine * np.arange(fine * (count - 1) + 1)
    moment_of_mass, _, F = chains(force, rng, len(time), step / fine)
    _, H, T = chains(moment, rng, len(time), step / fine)
    R0 = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
    H = H + R0 @ INERTIA @ spin
    rotation = tumble(time[::fine], R0, CubicHermiteSpline(time, H, T), rtol=1e-9)
    t = time[::fine, None]
    center = moment_of_mass[::fine] / MASS + t * [3.0, 0.5, 2.0] + 0.5 * t**2 * GRAVITY
    return time[::fine], center, rotation, np.hstack([F, T])[::fine]


def drawn_flight(force, moment, rng, count=120, step=0.005, fine=4):
    """The same as measured, and its true wrench (time, 6)."""
    time, center, rotation, truth = drawn_path(force, moment, rng, count, step, fine)
    return seen(time, center, rotation, rng), truth
