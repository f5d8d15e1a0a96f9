"""The reduced forms against the master system, and their momenta against those of space."""

import numpy as np
import pytest
from printed_motions import PRINTED
from reduced_cases import BALL, BLOCK, EVERY, IDS, TIME, Springs, master, random_start

from evidence.subjects.affine.reduced import general_reduced, left_reduced, two_sided
from forceid.pseudorigid.material.formless import PerfectGas
from forceid.pseudorigid.material.materials import MooneyRivlin, NeoHookean, StVenantKirchhoff
from forceid.pseudorigid.motion.invariants import angular_momentum, circulation
from forceid.pseudorigid.steady.gravity import SelfGravity

START = (
    np.array([[1.1, 0.2, 0], [-0.1, 0.95, 0.15], [0.05, 0, 1.05]]),
    np.array([[0.1, -0.4, 0.3], [0.5, 0, -0.2], [-0.1, 0.3, -0.05]]),
)
DIAGONAL = np.diag([1.0, 1.5, 2.2])


@pytest.mark.parametrize(
    ("form", "E", "W", "name"),
    [
        (left_reduced, DIAGONAL, NeoHookean(1.0, 0.5, 3.0), "neo-hookean"),
        (general_reduced, DIAGONAL, NeoHookean(1.0, 0.5, 3.0), "neo-hookean"),
        (two_sided, BALL, MooneyRivlin(0.6, 0.25, 0.4, 3.0), "mooney-rivlin"),
        (two_sided, np.eye(3), PerfectGas(1.0, 5 / 3), "gas"),
        (left_reduced, DIAGONAL, StVenantKirchhoff(1.3, 0.7), "st venant-kirchhoff"),
        (general_reduced, DIAGONAL, StVenantKirchhoff(1.3, 0.7), "st venant-kirchhoff"),
    ],
)
def test_printed_trajectories_come_out_of_the_reduced_forms(form, E, W, name):
    motion = form.simulate(E, W, *START, np.array([0.0, 1.0]))
    np.testing.assert_allclose([motion.F[1], motion.dF[1]], PRINTED[name], rtol=0, atol=1e-12)


def test_printed_riemann_ellipsoid_comes_out_of_the_two_sided_form():
    F0 = np.diag([1.25, 0.8, 1.0])
    dF0 = F0 @ np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])
    time = np.array([0.0, 1.0])
    motion = two_sided.simulate(np.eye(3), SelfGravity(1.0), F0, dF0, time, incompressible=True)
    np.testing.assert_allclose([motion.F[1], motion.dF[1]], PRINTED["riemann"], rtol=0, atol=1e-12)


@pytest.mark.long
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
    np.testing.assert_allclose(
        motion.L.swapaxes(1, 2) @ motion.L, np.broadcast_to(np.eye(3), F.shape), atol=1e-14
    )


def test_left_reduced_form_passes_equal_axes_and_starts_from_them():
    W, B = Springs(), np.array([[0.2, 0.5, -0.3], [-0.1, 0.1, 0.4], [0.3, 0.1, -0.2]])
    F, _ = master(BLOCK, W, np.eye(3), B, TIME)
    motion = left_reduced.simulate(BLOCK, W, np.eye(3), B, TIME)
    np.testing.assert_allclose(motion.F, F, rtol=0, atol=1e-12)


def test_momenta_of_the_three_forms_are_those_of_space():
    (F0, dF0), W, t = random_start(5), Springs(), TIME[:3]
    J, C = angular_momentum(F0, dF0, BALL), circulation(F0, dF0, BALL)
    left, two, general = (
        form.simulate(BALL, W, F0, dF0, t) for form in (left_reduced, two_sided, general_reduced)
    )

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


def test_rates_of_the_two_sided_momenta_are_those_of_the_decomposition():
    rng = np.random.default_rng(7)
    a, omega, lam = np.array([2.0, 1.3, 0.7]), rng.standard_normal(3), rng.standard_normal(3)
    M, K = np.diag((a @ a - a * a) / 2), np.diag(a.prod() / a)
    s, d = two_sided.rates_of_rotation(a, M @ omega + K @ lam, K @ omega + M @ lam)
    np.testing.assert_allclose([s, d], [omega + lam, omega - lam], rtol=1e-13)


def test_rates_of_a_batch_are_those_of_each_body():
    rng = np.random.default_rng(8)
    F, dF = (
        np.diag([2.0, 1.3, 0.7]) + 0.1 * rng.standard_normal((4, 5, 3, 3)),
        rng.standard_normal((4, 5, 3, 3)),
    )
    W = Springs()

    def rates(F, dF):
        yield from left_reduced.left_rates(left_reduced.left_state(F, dF, BLOCK), BLOCK, W)
        yield from two_sided.two_sided_rates(two_sided.two_sided_state(F, dF), 1.7, W, incompressible=True)
        yield from general_reduced.general_rates(general_reduced.general_state(F, dF, BLOCK), BLOCK, W)

    for batch, one in zip(rates(F, dF), rates(F[2, 3], dF[2, 3]), strict=True):
        np.testing.assert_allclose(batch[2, 3], one, rtol=0, atol=1e-12)
