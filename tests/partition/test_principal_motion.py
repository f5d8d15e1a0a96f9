"""Momenta of parts at large rotation against the forces at their ties: P' = F, H' = T, at current places."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from forceid.principal.mass import mass_center
from forceid.principal.operator import sum_nodal, summation_operator
from forceid.principal.wrench import resultant

AXIS = np.array([0.3, -0.5, 0.9]) / np.linalg.norm([0.3, -0.5, 0.9])


def principal_balance(time, mass, position, velocity, force, lam, boundary, about=None):
    """The wrench (time, n) of loads less tie forces lam at boundary, and by how much momenta grow faster.

    About a point at rest, or the mass center; the mean wrench of an interval is that of a cubic.
    """
    on_part = np.array(force, dtype=float)
    on_part.reshape(len(time), -1)[:, boundary] -= lam
    point = mass_center(mass, position) if about is None else np.asarray(about)
    wrench = sum_nodal(on_part, position, point)
    impulse = CubicSpline(time, wrench).antiderivative()(time)
    grown = np.diff(resultant(mass, position, velocity, point) - impulse, axis=0)
    return wrench, grown / np.diff(time)[:, None]


def dumbbell(time, spin=5.0, masses=(2.0, 3.0), length=1.0):
    """Two masses on a rod of no mass, cut at the mass center: position, velocity (time, part, node, axis).

    Node 0 of each part carries the mass, node 1 is the tie; the whole drifts with (4, -1) m/s.
    """
    m1, m2 = masses
    out = np.stack([np.cos(spin * time), np.sin(spin * time)], axis=-1)
    turn = np.stack([-np.sin(spin * time), np.cos(spin * time)], axis=-1)
    drift = np.array([4.0, -1.0])
    center = time[:, None] * drift
    arm = (length * m2 / (m1 + m2), -length * m1 / (m1 + m2))
    x = np.stack([np.stack([center + r * out, center], axis=1) for r in arm], axis=1)
    v = np.stack([np.stack([drift + r * spin * turn, drift + 0 * turn], axis=1) for r in arm], axis=1)
    pull = m1 * arm[0] * spin**2 * out  # of part 1 on the tie: it wants outward
    return x, v, pull


def test_a_spinning_dumbbell_pulls_at_its_tie_with_mass_times_radius_times_spin_squared():
    time = np.linspace(0, 2.5, 401)  # two turns
    x, v, pull = dumbbell(time)
    for part, (m, sign) in enumerate(((2.0, 1.0), (3.0, -1.0))):
        still = 0 * x[:, part]
        wrench, residual = principal_balance(
            time, [m, 0.0], x[:, part], v[:, part], still, sign * pull, [2, 3]
        )
        size = np.abs(wrench).max()
        assert size == pytest.approx(2 * 0.6 * 25, rel=1e-3)
        assert np.abs(residual).max() < 1e-6 * size


def test_a_tie_force_that_is_forgotten_is_the_residual():
    time = np.linspace(0, 1.0, 201)
    x, v, pull = dumbbell(time)
    _, residual = principal_balance(time, [2.0, 0.0], x[:, 0], v[:, 0], 0 * x[:, 0], 0 * pull, [2, 3])
    between = 0.5 * (pull[1:] + pull[:-1])
    assert residual[:, :2] == pytest.approx(-between, rel=1e-3, abs=1e-2)


def spun_pair(time):
    """A rigid cloud of nodes cut in two, spun up about an oblique axis through many turns.

    The three nodes of the cut belong to both parts. Accelerations are exact, so are the wrenches that each
    part needs; the ties give part 1 all of it, part 2 is pulled from outside as well.
    """
    rng, aside = np.random.default_rng(7), np.array([2.0, 0.0, 0.0])
    shapes = [rng.standard_normal((6, 3)) + aside, rng.standard_normal((5, 3)) - aside]
    shapes[1][:3] = shapes[0][:3]
    masses = [rng.uniform(0.5, 2.0, len(s)) for s in shapes]
    angle, speed, gain = 6 * time + 2 * time**2, 6 + 4 * time, 4.0
    R = Rotation.from_rotvec(angle[:, None] * AXIS).as_matrix()
    push = np.array([0.5, -2.0, 9.0])  # of the origin, m/s2
    parts = []
    for shape, mass in zip(shapes, masses, strict=True):
        r = np.einsum("tij,nj->tni", R, shape)
        around = np.cross(AXIS, r)
        x = r + 0.5 * time[:, None, None] ** 2 * push
        v = speed[:, None, None] * around + time[:, None, None] * push
        a = gain * around + speed[:, None, None] ** 2 * np.cross(AXIS, around) + push
        parts.append((mass, x, v, a))
    mass, x, _, a = parts[0]
    needed = resultant(mass, x, a)
    center = np.einsum("n,tni->ti", mass, x) / mass.sum()
    lam = np.stack(
        [
            -np.linalg.pinv(summation_operator(xt[:3], c).T) @ g
            for xt, c, g in zip(x, center, needed, strict=True)
        ]
    )
    mass, _, _, a = parts[1]
    outside = mass[:, None] * a
    outside[:, :3] -= lam.reshape(-1, 3, 3)  # what part 2 exerts on the frame is -lam
    return parts, lam, [0 * x, outside]


@pytest.mark.parametrize("about", [None, [0.0, 0.0, 0.0], [1.0, -2.0, 0.5]])
def test_momenta_of_a_pair_that_turns_far_change_as_ties_say(about):
    time = np.linspace(0, 2.0, 801)
    parts, lam, loads = spun_pair(time)
    for (mass, x, v, _), force, tie in zip(parts, loads, (lam, -lam), strict=True):
        wrench, residual = principal_balance(time, mass, x, v, force, tie, np.arange(9), about)
        assert np.abs(residual).max() < 1e-5 * np.abs(wrench).max()


def test_the_balance_closes_with_the_fourth_power_of_the_interval():
    worst = []
    for samples in (201, 401):
        time = np.linspace(0, 2.0, samples)
        parts, lam, loads = spun_pair(time)
        mass, x, v, _ = parts[0]
        _, residual = principal_balance(time, mass, x, v, loads[0], lam, np.arange(9))
        worst.append(np.abs(residual[20:-20]).max())
    assert np.log2(worst[0] / worst[1]) > 3.5


def test_moments_at_the_first_shape_do_not_balance_a_body_that_turns():
    time = np.linspace(0, 2.0, 801)
    parts, lam, loads = spun_pair(time)
    mass, x, v, _ = parts[0]
    still = np.broadcast_to(x[0], x.shape)
    wrench, residual = principal_balance(time, mass, still, v, loads[0], lam, np.arange(9))
    assert np.abs(residual[:, :3]).max() < 1e-5 * np.abs(wrench).max()
    assert np.abs(residual[:, 3:]).max() > 0.1 * np.abs(wrench).max()


def test_ties_leave_the_momenta_of_the_whole_to_the_loads():
    time = np.linspace(0, 1.0, 201)
    parts, lam, loads = spun_pair(time)
    both = [
        principal_balance(time, mass, x, v, force, tie, np.arange(9), about=np.zeros(3))[0]
        for (mass, x, v, _), force, tie in zip(parts, loads, (lam, -lam), strict=True)
    ]
    total = resultant(parts[1][0], parts[1][1], loads[1] / parts[1][0][:, None], np.zeros(3))
    assert both[0] + both[1] == pytest.approx(total, rel=1e-9, abs=1e-9)


def test_momenta_of_a_free_rigid_pair_are_mass_times_velocity_and_inertia_times_spin():
    rng = np.random.default_rng(8)
    x, mass = rng.standard_normal((5, 3)), rng.uniform(1, 2, 5)
    center = mass @ x / mass.sum()
    spin, drift = np.array([1.0, -2.0, 0.5]), np.array([3.0, 0.0, 1.0])
    r = x - center
    J = np.einsum("n,nij->ij", mass, (r**2).sum(1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None])
    linear, angular = np.split(resultant(mass, x, drift + np.cross(spin, r)), 2)
    assert linear == pytest.approx(mass.sum() * drift)
    assert angular == pytest.approx(J @ spin)


def test_a_consistent_mass_matrix_serves_as_well():
    time = np.linspace(0, 2.5, 401)
    x, v, pull = dumbbell(time)
    mass = np.kron(np.diag([2.0, 0.0]), np.eye(2))
    wrench, residual = principal_balance(time, mass, x[:, 0], v[:, 0], 0 * x[:, 0], pull, [2, 3])
    assert np.abs(residual).max() < 1e-6 * np.abs(wrench).max()
