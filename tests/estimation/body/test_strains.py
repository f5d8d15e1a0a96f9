"""Shapes of an affine body: strains along its own axes, which swing each by itself."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.deforming.strains import strain_axes, strain_shapes
from forceid.estimation.body.kinematics import kinematics
from forceid.principal.operator import summation_operator
from forceid.records import Body, Motion

TIME = np.arange(400) / 400
EYE = np.eye(3)


@pytest.mark.parametrize(("extent", "count"), [([1, 1, 1], 6), ([1, 1, 0], 3), ([1, 0, 0], 1)])
def test_solid_plane_and_line_can_stretch_in_six_three_and_one_ways(extent, count):
    points = np.random.default_rng(1).standard_normal((7, 3)) * extent
    body = points @ Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix().T
    patterns = strain_shapes(body, strain_axes(body)[0])
    assert np.linalg.matrix_rank(patterns.reshape(count, -1)) == count
    for pattern in patterns:  # each is E X with E symmetric
        E = np.linalg.lstsq(body, pattern, rcond=1e-9)[0]
        np.testing.assert_allclose(body @ E, pattern, atol=1e-12)


def test_affine_motion_of_a_solid_is_rigid_motion_and_strains():
    rng = np.random.default_rng(6)
    X, G = rng.standard_normal((7, 3)), rng.standard_normal((3, 3))
    basis = np.column_stack([summation_operator(X), strain_shapes(X, EYE).reshape(6, -1).T])
    field = (X @ G.T + [1.0, 2.0, 3.0]).ravel()
    left = field - basis @ np.linalg.lstsq(basis, field, rcond=None)[0]
    np.testing.assert_allclose(left, 0, atol=1e-12)


def test_axes_are_principal_ones_of_the_mass_within_the_space_of_the_points():
    rng = np.random.default_rng(2)
    flat = rng.standard_normal((6, 3)) * [1.0, 1.0, 0.0]
    A = rng.standard_normal((3, 3))
    axes, moment = strain_axes(flat, A @ A.T)
    np.testing.assert_allclose(axes @ A @ A.T @ axes.T, np.diag(moment), atol=1e-12)
    np.testing.assert_allclose(axes[:, 2], 0, atol=1e-12)


def swinging(seed):
    """Marker tracks of a small free swing of an isotropic body of unequal masses, and its stretch."""
    rng = np.random.default_rng(seed)
    X, mass = 0.1 * rng.standard_normal((8, 3)), rng.uniform(0.05, 0.3, 8)
    X -= mass @ X / mass.sum()
    E = (mass * X.T) @ X
    mu = np.trace(E) / 3 * (2 * np.pi * 6) ** 2

    def rate(_, y):
        F = y[:9].reshape(3, 3)
        strain = 0.5 * (F.T @ F - EYE)
        stress = F @ (mu * np.trace(strain) * EYE + 2 * mu * strain)
        return np.concatenate([y[9:], -(stress @ np.linalg.inv(E)).ravel()])

    A = 0.01 * rng.standard_normal((3, 3))
    start = np.concatenate([(EYE + 0.5 * (A + A.T)).ravel(), np.zeros(9)])
    y = solve_ivp(rate, (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12).y
    x = np.einsum("abt,nb->tna", y[:9].reshape(3, 3, -1), X)
    return Body(tuple("abcdefgh"), X, mass), Motion(TIME, x + 1e-6 * rng.standard_normal(x.shape))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_amplitudes_of_a_free_swing_are_lines_of_one_frequency_each(seed):
    body, motion = swinging(seed)
    q = kinematics(body, motion, load_settings(model="affine")).amplitude
    power = np.abs(np.fft.rfft(np.hanning(len(q))[:, None] * (q - q.mean(0)), axis=0)) ** 2
    alone = [p[max(p.argmax() - 3, 0) : p.argmax() + 4].sum() / p.sum() for p in power.T]
    assert np.sort(alone)[1] > 0.8  # one stretch of the three may be left with what the others do not take
