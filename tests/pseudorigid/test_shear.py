import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shears import decompose_shear, held_shear, shear

from forceid.pseudorigid.body import Body
from forceid.pseudorigid.factors.decomposition import polar
from forceid.pseudorigid.material.materials import MooneyRivlin
from forceid.pseudorigid.motion.invariants import energy

BODY = Body(np.diag([1.0, 1.5, 2.2]), MooneyRivlin.natural(0.6, 0.25, 0.4))


def test_polar_factors_in_closed_form_are_those_of_the_decomposition():
    alpha = np.array([-1.3, 0.0, 0.8, 4.0])
    found = decompose_shear(alpha)
    L, U = polar(shear(alpha))
    np.testing.assert_allclose(found.rotation, L, atol=1e-14)
    np.testing.assert_allclose(found.stretch, U, atol=1e-14)
    np.testing.assert_allclose(
        found.rotation, Rotation.from_rotvec(-found.angle[:, None] * [0, 0, 1]).as_matrix()
    )
    np.testing.assert_allclose(found.stretches, np.linalg.svd(shear(alpha))[1], rtol=1e-14)


def test_polar_angle_is_not_the_angle_between_e2_and_its_image():
    found = decompose_shear(0.8)
    assert 2 * np.tan(found.angle) == pytest.approx(0.8)
    image = shear(0.8) @ [0, 1, 0]
    assert np.arctan2(image[0], image[1]) == pytest.approx(np.arctan(0.8))
    assert abs(np.arctan(0.8) - found.angle) > 0.2


def test_held_shear_is_harmonic_at_any_amplitude():
    period = 2 * np.pi / np.sqrt(2 * 0.85 / 1.5)
    for alpha in (0.01, 3.0):
        motion = held_shear(BODY, alpha, 0.0, [0.0, period / 4, period / 2, period])
        np.testing.assert_allclose(motion.alpha, [alpha, 0, -alpha, alpha], atol=1e-14)
        kept = energy(motion.F, motion.dF, BODY.system.E, BODY.material)
        np.testing.assert_allclose(kept, kept[0], rtol=1e-14)


def test_constraint_of_held_shear_does_no_work_and_vanishes_along_it():
    time = np.linspace(0, 5, 400)
    motion = held_shear(BODY, 0.8, 0.3, time)
    np.testing.assert_allclose(motion.constraint[:, 0, 1], 0, atol=1e-14)
    np.testing.assert_allclose(np.einsum("tij,tij->t", motion.constraint, motion.dF), 0, atol=1e-14)
    assert np.abs(motion.constraint).max() > 0.5
    np.testing.assert_allclose(np.gradient(motion.alpha, time)[1:-1], motion.dalpha[1:-1], atol=1e-4)


def test_released_shear_leaves_the_family_of_shears_at_once():
    motion = BODY.simulate(shear(0.8), np.zeros((3, 3)), np.linspace(0, 0.1, 3), "kahan_li_6")
    off = motion.F[-1] - shear(motion.F[-1, 0, 1])
    assert np.abs(off).max() > 5e-4
    # as the acceleration of the master system says
    start = BODY.system.acceleration(shear(0.8))
    np.testing.assert_allclose(off[1, 0], 0.5 * start[1, 0] * 0.1**2, rtol=0.05)
    assert np.abs(start - np.diag(np.diag(start))).max() > 0.3
    assert np.ptp(motion.energy) < 1e-9
    assert np.abs(motion.angular_momentum).max() < 1e-15


def test_stretch_accelerations_at_the_instant_of_the_shear_hold_gamma():
    # section 6: D'' = ... - 2/mu (a + b (3 + alpha^2) - b D^2) D - Gamma'(1) D^-1 / mu, at rest
    body, alpha = Body(1.7, MooneyRivlin(0.6, 0.25, 0.4, 3.0)), 0.8
    L, D, R = np.linalg.svd(shear(alpha))
    along = np.diag(L.T @ body.system.acceleration(shear(alpha)) @ R.T)
    gamma = 2 * 0.4 - 3.0
    printed = -2 / 1.7 * (0.6 + 0.25 * (3 + alpha**2) - 0.25 * D**2) * D - gamma / 1.7 / D
    np.testing.assert_allclose(along, printed, rtol=1e-13)
