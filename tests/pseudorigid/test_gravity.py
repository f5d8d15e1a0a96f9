"""Self-gravity as a stored energy: derivatives, equal axes, symmetry, the trajectory that is printed."""

import numpy as np
import pytest
from printed_motions import PRINTED
from scipy.integrate import solve_ivp

from forceid.errors import DataError
from forceid.pseudorigid.steady.gravity import SelfGravity
from forceid.pseudorigid.steady.index_symbols import index_symbols

RNG = np.random.default_rng(71)
GRAVITY = SelfGravity(1.3, 0.7)
BODIES = np.eye(3) + 0.25 * RNG.normal(size=(40, 3, 3))
ALONG = RNG.normal(size=(40, 3, 3))
ROUND = [np.eye(3), np.diag([1.2, 1.2, 0.7]), np.diag([1.2, 0.8, 0.8 + 1e-9]), np.diag([1.1, 1.1, 1e-2])]


def slope(function, step=1e-3):
    """Derivative at 0 to fourth order."""
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


def turn(seed):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def test_the_gradient_is_the_slope_of_the_energy():
    seen = slope(lambda s: GRAVITY.energy(BODIES + s * ALONG))
    np.testing.assert_allclose((GRAVITY.gradient(BODIES) * ALONG).sum((1, 2)), seen, rtol=1e-7, atol=1e-8)


def test_the_hessian_is_the_slope_of_the_gradient():
    seen = slope(lambda s: GRAVITY.gradient(BODIES + s * ALONG))
    np.testing.assert_allclose(GRAVITY.hessian(BODIES, ALONG), seen, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("F", ROUND[:3])
def test_the_hessian_loses_nothing_at_equal_axes(F):
    seen = slope(lambda s: GRAVITY.gradient(F + s * ALONG))
    np.testing.assert_allclose(GRAVITY.hessian(F, ALONG), seen, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("F", [*ROUND, *BODIES[:5]])
def test_the_hessian_is_symmetric_and_stretching_space_scales_all_by_its_power(F):
    G, H = ALONG[0], ALONG[1]
    size = np.abs(GRAVITY.hessian(F, G)).max()
    np.testing.assert_allclose(
        (GRAVITY.hessian(F, G) * H).sum(), (GRAVITY.hessian(F, H) * G).sum(), rtol=1e-10
    )
    # W of degree -1: dW.F = -W, d2W[F] = -2 dW
    np.testing.assert_allclose((GRAVITY.gradient(F) * F).sum(), -GRAVITY.energy(F), rtol=1e-13)
    np.testing.assert_allclose(GRAVITY.hessian(F, F), -2 * GRAVITY.gradient(F), rtol=0, atol=1e-13 * size)


def test_turning_space_or_body_turns_the_force_and_leaves_the_energy():
    P, Q = turn(1), turn(2)
    np.testing.assert_allclose(GRAVITY.energy(P @ BODIES @ Q), GRAVITY.energy(BODIES), rtol=1e-13)
    np.testing.assert_allclose(GRAVITY.gradient(P @ BODIES @ Q), P @ GRAVITY.gradient(BODIES) @ Q, atol=1e-13)
    turned = GRAVITY.hessian(P @ BODIES @ Q, P @ ALONG @ Q)
    np.testing.assert_allclose(turned, P @ GRAVITY.hessian(BODIES, ALONG) @ Q, atol=1e-11)


def test_gravity_exerts_no_torque_and_no_circulation():
    force = GRAVITY.gradient(BODIES)
    space, body = force @ BODIES.swapaxes(1, 2), BODIES.swapaxes(1, 2) @ force
    np.testing.assert_allclose(space, space.swapaxes(1, 2), atol=1e-13)
    np.testing.assert_allclose(body, body.swapaxes(1, 2), atol=1e-13)


def test_the_force_on_a_diagonal_body_is_minus_two_pi_G_rho_A():
    a = np.array([1.4, 0.9, 0.5])
    expected = 2 * 1.3 * 0.7 / a.prod() * index_symbols(*a) * a
    np.testing.assert_allclose(GRAVITY.gradient(np.diag(a)), np.diag(expected), rtol=1e-13, atol=1e-15)


def test_a_ball_and_a_gaussian_cloud_have_their_self_energies():
    G, m, r = 2.0, 3.0, 0.5
    ball = SelfGravity(pi_G_rho=0.75 * G * m / r**3, mu=m * r**2 / 5)
    np.testing.assert_allclose(ball.energy(np.eye(3)), -0.6 * G * m**2 / r, rtol=1e-14)
    cloud = SelfGravity(pi_G_rho=G * m / (8 * np.sqrt(np.pi) * r**3), mu=m * r**2)
    np.testing.assert_allclose(cloud.energy(np.eye(3)), -G * m**2 / (2 * np.sqrt(np.pi) * r), rtol=1e-14)


def test_the_printed_trajectory_of_a_riemann_ellipsoid_is_met():
    F0 = np.diag([1.25, 0.8, 1.0])
    dF0 = F0 @ np.array([[0.1, -0.5, 0.2], [0.7, 0.05, -0.3], [0.1, 0.25, -0.15]])
    drop = SelfGravity()

    def flow(_, y):
        F, dF = y.reshape(2, 3, 3)
        inverse = np.linalg.inv(F)
        pull, Y, cofactor = drop.gradient(F), inverse @ dF, np.linalg.det(F) * inverse.T
        multiplier = (np.trace(Y @ Y) + np.trace(inverse @ pull)) / (inverse * cofactor.T).sum()
        return np.concatenate([dF.ravel(), (multiplier * cofactor - pull).ravel()])

    end = solve_ivp(flow, (0, 1), np.concatenate([F0.ravel(), dF0.ravel()]), "DOP853", rtol=1e-13, atol=1e-14)
    F, dF = end.y[:, -1].reshape(2, 3, 3)
    np.testing.assert_allclose([F, dF], PRINTED["riemann"], rtol=1e-10)
    np.testing.assert_allclose(drop.energy(F0) + (dF0**2).sum() / 2, -3.47923390681306, rtol=1e-14)


@pytest.mark.parametrize(("constants", "name"), [((0.0, 1.0), "pi_G_rho"), ((1.0, np.inf), "mu")])
def test_constants_that_are_not_positive_are_refused_by_name(constants, name):
    with pytest.raises(DataError, match=f"{name} = .*expected > 0"):
        SelfGravity(*constants)
