"""The reduced forms against the master system F'' E = -dW/dF, integrated here; and where they are refused."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forceid.errors import DataError, EstimationError
from forceid.pseudorigid import general_reduced, left_reduced, two_sided
from forceid.pseudorigid.invariants import angular_momentum, circulation
from forceid.pseudorigid.invariants import kinetic_energy as kinetic_energy_of_F

BALL, BLOCK = 1.7 * np.eye(3), np.array([[1.0, 0.2, 0], [0.2, 1.5, -0.1], [0, -0.1, 2.2]])
EVERY = [(left_reduced, BLOCK), (two_sided, BALL), (general_reduced, BLOCK)]
IDS = ["left", "two-sided", "general"]
TIME = np.linspace(0.0, 1.0, 6)


class Springs:
    """W = a |F|^2 + c J^2 - d log J: isotropic. With fiber: + f |F e_1|^4, only frame indifferent."""

    def __init__(self, a=1.0, c=0.5, d=3.0, fiber=0.0):
        self.a, self.c, self.d, self.fiber = a, c, d, fiber

    def energy(self, F):
        J = np.linalg.det(F)
        stretch = (F[..., 0] ** 2).sum(-1)
        return self.a * (F * F).sum((-1, -2)) + self.c * J**2 - self.d * np.log(J) + self.fiber * stretch**2

    def gradient(self, F):
        J = np.linalg.det(F)[..., None, None]
        out = 2 * self.a * F + (2 * self.c * J**2 - self.d) * np.swapaxes(np.linalg.inv(F), -1, -2)
        out[..., 0] += 4 * self.fiber * (F[..., 0] ** 2).sum(-1)[..., None] * F[..., 0]
        return out


def master(E, W, F0, dF0, t, held=False):
    inverse = np.linalg.inv(E)

    def rates(_, y):
        F, dF = y.reshape(2, 3, 3)
        ddF = -W.gradient(F) @ inverse
        if held:
            Y, Fi = np.linalg.solve(F, dF), np.linalg.inv(F)
            push = Fi.T @ inverse
            ddF = ddF + push * (np.trace(Y @ Y) - np.trace(Fi @ ddF)) / np.trace(Fi @ push)
        return np.concatenate([dF.ravel(), ddF.ravel()])

    start = np.concatenate([F0.ravel(), dF0.ravel()])
    run = solve_ivp(rates, (t[0], t[-1]), start, "DOP853", t, rtol=3e-14, atol=1e-15)
    return run.y[:9].T.reshape(-1, 3, 3), run.y[9:].T.reshape(-1, 3, 3)


def near_crossing(E, W, least):
    """A start whose first axes come as near as `least`, at half the time."""
    B = np.array([[0.2, 0.5, -0.3], [-0.1, 0.2, 0.4], [0.3, 0.1, -0.2]])
    F, dF = master(E, W, np.diag([1 + least / 2, 1 - least / 2, 0.8]), -B, np.array([0, 0.5]))
    return F[-1], -dF[-1]


def random_start(seed):
    rng = np.random.default_rng(seed)
    return np.diag([1.3, 1.0, 0.8]) + 0.1 * rng.standard_normal((3, 3)), 0.5 * rng.standard_normal((3, 3))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("form", "E"), EVERY, ids=IDS)
def test_reduced_motion_of_random_bodies_is_that_of_the_master_system(form, E, seed):
    (F0, dF0), W = random_start(seed), Springs()
    F, dF = master(E, W, F0, dF0, TIME)
    motion = form.simulate(E, W, F0, dF0, TIME)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.dF, dF, rtol=0, atol=2e-12)


def test_left_reduced_form_needs_no_isotropy():
    (F0, dF0), W = random_start(4), Springs(fiber=0.3)
    F, dF = master(BLOCK, W, F0, dF0, TIME)
    motion = left_reduced.simulate(BLOCK, W, F0, dF0, TIME)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.dF, dF, rtol=0, atol=2e-12)
    np.testing.assert_allclose(motion.L.swapaxes(1, 2) @ motion.L, np.broadcast_to(np.eye(3), F.shape), atol=1e-14)


def test_left_reduced_form_passes_equal_axes_and_starts_from_them():
    W, B = Springs(), np.array([[0.2, 0.5, -0.3], [-0.1, 0.1, 0.4], [0.3, 0.1, -0.2]])
    F, _ = master(BLOCK, W, np.eye(3), B, TIME)
    motion = left_reduced.simulate(BLOCK, W, np.eye(3), B, TIME)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)


def test_momenta_of_the_three_forms_are_those_of_space():
    (F0, dF0), W, t = random_start(5), Springs(), TIME[:3]
    J, C = angular_momentum(F0, dF0, BALL), circulation(F0, dF0, BALL)
    left, two, general = (form.simulate(BALL, W, F0, dF0, t) for form in (left_reduced, two_sided, general_reduced))

    def apply(A, v, factor=2.0):
        return factor * np.einsum("tab,tb->ta", A, v)

    for found, kept in (
        (apply(left.L, left.m), J),
        (apply(two.L, two.pi, 3.4), J),
        (apply(general.L, general.left), J),
        (apply(two.R.swapaxes(1, 2), two.kappa, 3.4), C),
        (apply(general.R.swapaxes(1, 2), general.right), C),
    ):
        np.testing.assert_allclose(found, np.broadcast_to(kept, found.shape), rtol=0, atol=1e-12)
    for momentum in (two.pi, two.kappa):
        size = np.linalg.norm(momentum, axis=1)
        assert np.ptp(size) < 1e-13


def test_incompressible_ball_keeps_its_volume_and_follows_the_constrained_master_system():
    W, F0 = Springs(), np.array([[1.25, 0.1, 0], [0, 0.8, 0.05], [0, 0, 1.0]])
    Y = np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])
    F, dF = master(BALL, W, F0, F0 @ Y, TIME, held=True)
    motion = two_sided.simulate(BALL, W, F0, F0 @ Y, TIME, incompressible=True)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.dF, dF, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(motion.F), 1, rtol=0, atol=1e-12)


def test_kinetic_energy_in_momenta_is_that_of_F():
    rng = np.random.default_rng(6)
    F, dF = np.diag([2.0, 1.3, 0.7]) + 0.1 * rng.standard_normal((40, 3, 3)), rng.standard_normal((40, 3, 3))
    a, da, pi, kappa, _, _ = two_sided.two_sided_state(F, dF)
    found = two_sided.kinetic_energy(a, da, pi, kappa, 1.7)
    np.testing.assert_allclose(found, kinetic_energy_of_F(dF, BALL), rtol=1e-12)


def test_rates_of_the_two_sided_momenta_are_those_of_the_decomposition():
    rng = np.random.default_rng(7)
    a, omega, lam = np.array([2.0, 1.3, 0.7]), rng.standard_normal(3), rng.standard_normal(3)
    M, K = np.diag((a @ a - a * a) / 2), np.diag(a.prod() / a)
    s, d = two_sided.rates_of_rotation(a, M @ omega + K @ lam, K @ omega + M @ lam)
    np.testing.assert_allclose([s, d], [omega + lam, omega - lam], rtol=1e-13)


def test_rates_of_a_batch_are_those_of_each_body():
    rng = np.random.default_rng(8)
    F, dF = np.diag([2.0, 1.3, 0.7]) + 0.1 * rng.standard_normal((4, 5, 3, 3)), rng.standard_normal((4, 5, 3, 3))
    W = Springs()

    def rates(F, dF):
        yield from left_reduced.left_rates(left_reduced.left_state(F, dF, BLOCK), BLOCK, W)
        yield from two_sided.two_sided_rates(two_sided.two_sided_state(F, dF), 1.7, W, incompressible=True)
        yield from general_reduced.general_rates(general_reduced.general_state(F, dF, BLOCK), BLOCK, W)

    for batch, one in zip(rates(F, dF), rates(F[2, 3], dF[2, 3]), strict=True):
        np.testing.assert_allclose(batch[2, 3], one, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("form", "E"), EVERY[1:], ids=IDS[1:])
def test_axes_that_come_within_a_thousandth_are_still_followed(form, E):
    W = Springs()
    F0, dF0 = near_crossing(E, W, 1e-3)
    t = np.array([0.0, 0.4, 0.7])
    F, _ = master(E, W, F0, dF0, t)
    np.testing.assert_allclose(form.simulate(E, W, F0, dF0, t).F, F, rtol=0, atol=1e-11)


@pytest.mark.parametrize(("form", "E"), EVERY[1:], ids=IDS[1:])
@pytest.mark.parametrize("least", [3e-5, 1e-8, 0.0])
def test_axes_that_coalesce_are_refused_by_time_and_name(form, E, least):
    W = Springs()
    F0, dF0 = near_crossing(E, W, least)
    with pytest.raises(EstimationError, match=r"t = 0\.(499|500)\d* s axes . and . coalesce.*Body\.simulate") as refused:
        form.simulate(E, W, F0, dF0, np.array([0.0, 0.8]))
    before = np.array([0.0, 0.45])
    F, _ = master(E, W, F0, dF0, before)
    np.testing.assert_allclose(form.simulate(E, W, F0, dF0, before).F, F, rtol=0, atol=1e-12)
    assert refused.value.where.endswith("simulate")


@pytest.mark.parametrize(("form", "E"), EVERY[1:], ids=IDS[1:])
def test_a_start_of_equal_axes_is_refused_at_once(form, E):
    with pytest.raises(EstimationError, match="t = 2 s axes 2 and 3 coalesce"):
        form.simulate(E, Springs(), np.eye(3), 0.1 * np.ones((3, 3)), np.array([2.0, 3.0]))


@pytest.mark.parametrize(("form", "E"), [(two_sided, BALL), (general_reduced, np.diag([1.0, 1.5, 2.2]))])
def test_axes_that_nothing_turns_pass_through_each_other(form, E):
    F0, dF0, t = np.diag([1.3, 1.1, 0.8]), np.diag([-0.9, 0.4, 0.9]), np.linspace(0, 1, 11)
    F, _ = master(E, Springs(), F0, dF0, t)
    motion = form.simulate(E, Springs(), F0, dF0, t)
    assert (np.diff(motion.a, axis=1) > 0).any() and (np.diff(motion.a, axis=1) < 0).any()
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("form", "E"), EVERY, ids=IDS)
def test_a_body_that_collapses_is_refused_where_J_reaches_0(form, E):
    with pytest.raises(EstimationError, match=r"t = 0\.5 s .*J"):
        form.simulate(E, Springs(0, 0, 0), np.diag([1.5, 1.2, 0.5]), np.diag([0, 0, -1.0]), np.array([0.0, 1.0]))


@pytest.mark.parametrize(("form", "E"), EVERY, ids=IDS)
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"F0": np.diag([1.0, 1, -1])}, "det F = -1"),
        ({"F0": np.ones(3)}, "finite"),
        ({"dF0": np.full((3, 3), np.nan)}, "finite"),
        ({"second_moment": np.diag([1.0, 1, 0])}, "positive definite"),
        ({"time": np.array([1.0, 0.0])}, "does not rise"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(form, E, change, says):
    F0, dF0 = random_start(9)
    call = {"second_moment": E, "F0": F0, "dF0": dF0, "time": TIME} | change
    with pytest.raises(DataError, match=says):
        form.simulate(material=Springs(), **call)


def test_a_body_or_material_without_the_symmetry_is_refused():
    F0, dF0 = random_start(10)

    class Tethered(Springs):
        def gradient(self, F):
            return super().gradient(F) - np.outer([1.0, 0, 0], [0.0, 1, 0])

    class Rubber(Springs):
        incompressible = True

    with pytest.raises(DataError, match="not mu I.*general_reduced"):
        two_sided.simulate(BLOCK, Springs(), F0, dF0, TIME)
    for form in (two_sided, general_reduced):
        with pytest.raises(DataError, match="isotropic"):
            form.simulate(BALL, Springs(fiber=0.3), F0, dF0, TIME)
    with pytest.raises(DataError, match="rotations of space"):
        left_reduced.simulate(BALL, Tethered(), F0, dF0, TIME)
    for form in (left_reduced, general_reduced):
        with pytest.raises(DataError, match="no constraint"):
            form.simulate(BALL, Rubber(), F0, dF0, TIME)
    with pytest.raises(DataError, match="expected 1 and 0"):
        two_sided.simulate(BALL, Rubber(), F0, dF0, TIME)
