"""Linear spectra: closed forms, printed frequencies, adjoint pairs, the flow linearized by differences."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation
from second_harmonics import maclaurin_modes, spheroid_of_excess
from small_strains import lame_frequencies
from turning_points import breathing

from forceid.errors import DataError
from forceid.pseudorigid.steady.ellipsoids import dedekind, irrotational, jacobi, maclaurin, riemann_s
from forceid.pseudorigid.steady.gravity import GasCloud, SelfGravity
from forceid.pseudorigid.steady.natural_modes import natural_modes, spinning_body
from forceid.pseudorigid.steady.spectra import ellipsoid_spectrum, rotating_spectrum


@dataclass(frozen=True)
class Rubber:
    """W = a I1 + b I2 + c J^2 - d log J, written anew so that these tests stand alone."""

    a: float = 0.6
    b: float = 0.25
    c: float = 0.4
    d: float = 3.0

    def energy(self, F):
        C = F.swapaxes(-1, -2) @ F
        first, square = np.trace(C, axis1=-2, axis2=-1), np.trace(C @ C, axis1=-2, axis2=-1)
        J = np.linalg.det(F)
        return self.a * first + self.b * (first**2 - square) / 2 + self.c * J**2 - self.d * np.log(J)

    def gradient(self, F):
        C, J, N = F.swapaxes(-1, -2) @ F, np.linalg.det(F), np.linalg.inv(F).swapaxes(-1, -2)
        first = np.trace(C, axis1=-2, axis2=-1)
        bulk = (2 * self.c * J**2 - self.d)[..., None, None] * N
        return 2 * self.a * F + 2 * self.b * (first[..., None, None] * F - F @ C) + bulk

    def hessian(self, F, H):
        near, far = ((self.gradient(F + s * H) - self.gradient(F - s * H)) for s in (1e-3, 2e-3))
        return (8 * near - far) / 12e-3


RUBBER, NEO_HOOKEAN = Rubber(), Rubber(a=1.0, b=0.0, c=0.5, d=3.0)
AXIS = np.array([0.0, 0.0, 1.0])
ROOT = np.random.default_rng(73).normal(size=(3, 3))
ANY_E = ROOT @ ROOT.T + np.eye(3)


@pytest.mark.parametrize("e", [0.1, 0.5, 0.8, 0.95])
def test_a_spheroid_has_the_second_harmonics_of_the_closed_forms(e):
    spheroid, modes = maclaurin(e), maclaurin_modes(e)
    closed = [*np.abs(modes.toroidal), *np.abs(modes.transverse), np.sqrt(modes.pulsation), spheroid.w]
    found = ellipsoid_spectrum(spheroid)
    np.testing.assert_allclose(found.frequencies, np.sort(closed), rtol=1e-12)
    assert found.growth == 0.0


def test_a_spheroid_past_the_dynamical_instability_grows_at_the_rate_of_the_closed_form():
    found = ellipsoid_spectrum(maclaurin(0.98))
    np.testing.assert_allclose(found.growth, maclaurin_modes(0.98).toroidal.imag.max(), rtol=1e-12)
    e = np.sqrt(1 - spheroid_of_excess(4.0).axes[2] ** 2)
    assert ellipsoid_spectrum(maclaurin(e - 1e-4)).growth == 0.0
    assert ellipsoid_spectrum(maclaurin(e + 1e-4)).growth > 1e-3


def test_a_sphere_at_rest_has_kelvins_frequency_five_times():
    still = np.zeros(3)
    found = rotating_spectrum(SelfGravity(), np.eye(3), np.eye(3), still, still, incompressible=True)
    np.testing.assert_allclose(found.frequencies, np.full(5, np.sqrt(16 / 15)), rtol=1e-13)
    np.testing.assert_allclose(found.multiplier, 4 / 3, rtol=1e-14)
    assert len(found.eigenvalues) == 16
    assert len(found.distinct) == 1


def test_the_jacobi_ellipsoid_has_the_printed_frequencies():
    printed = [0.60567073, 0.79521269, 1.16433304, 1.28577618, 1.41303804]
    np.testing.assert_allclose(ellipsoid_spectrum(jacobi(0.8)).frequencies, printed, atol=5e-9)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (jacobi(0.5), dedekind(0.5)),
        (riemann_s(0.7, 0.6), riemann_s(0.7, 0.6, adjoint=True)),
        (riemann_s(0.4, 0.3), riemann_s(0.4, 0.3, adjoint=True)),
    ],
)
def test_an_ellipsoid_and_its_adjoint_have_one_spectrum(one, other):
    first, second = ellipsoid_spectrum(one), ellipsoid_spectrum(other)
    np.testing.assert_allclose(first.frequencies, second.frequencies, rtol=1e-11)
    np.testing.assert_allclose(first.multiplier, second.multiplier, rtol=1e-13)


@pytest.mark.parametrize("found", [jacobi(0.5), irrotational(0.5), riemann_s(0.7, 0.6)])
def test_turns_of_figure_and_liquid_are_among_the_frequencies(found):
    seen = ellipsoid_spectrum(found).distinct
    for rate in np.abs([found.w, found.l]):
        assert rate == 0 or np.abs(seen / rate - 1).min() < 3e-8
    pressure = 2 * found.pressure / np.cbrt(found.axes.prod() ** 2)
    np.testing.assert_allclose(ellipsoid_spectrum(found).multiplier, pressure, rtol=1e-13)


def steady_s_type(material, e, w, l):  # noqa: E741
    """Stretches of an isotropic body in F = R_z(w t) D R_z(l t)."""

    def left(a):
        swapped = np.array([a[1], a[0], 0.0])
        outward = (w**2 + l**2) * a * [1, 1, 0] + 2 * w * l * swapped
        return np.diagonal(material.gradient(np.diag(a))) - e * outward

    return fsolve(left, np.ones(3), xtol=1e-12)


@pytest.mark.parametrize(
    ("material", "e", "w", "l"),
    [
        (RUBBER, np.array([1.0, 1.0, 2.0]), 0.5, 0.2),
        (RUBBER, np.array([1.0, 1.6, 2.2]), 0.4, 0.0),
        (GasCloud(1.0, 1.5, trap=0.9, pi_G_rho=0.4), np.ones(3), 0.3, -0.2),
    ],
)
def test_the_spectrum_is_that_of_the_flow_in_space_linearized_by_differences(material, e, w, l):  # noqa: E741
    a, late, small = steady_s_type(material, e, w, l), 1.0, 1e-4
    W, Q = (np.cross(rate * AXIS, -np.eye(3)) for rate in (w, l))

    def flow(_, y):
        F, dF = y.reshape(2, -1, 3, 3)
        return np.concatenate([dF.ravel(), (-material.gradient(F) / e).ravel()])

    unit = np.eye(18).reshape(18, 2, 3, 3)
    delta = np.concatenate([small * unit, -small * unit]).swapaxes(0, 1)  # in the rotating frames
    phi = np.diag(a) + delta[0]
    start = np.stack([phi, delta[1] + W @ phi + phi @ Q])
    end = solve_ivp(flow, (0, late), start.ravel(), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    F, dF = end.reshape(2, -1, 3, 3)
    left, right = (Rotation.from_rotvec(-rate * late * AXIS).as_matrix() for rate in (w, l))
    phi = left @ F @ right
    seen = np.stack([phi, left @ dF @ right - W @ phi - phi @ Q], 1).reshape(2, 18, 18)
    map_ = (seen[0] - seen[1]).T / (2 * small)

    found = rotating_spectrum(material, np.diag(e), np.diag(a), w * AXIS, l * AXIS)
    # characteristic polynomials, to which zero modes that come in pairs do no harm
    by_flow, by_theory = np.poly(map_), np.poly(np.exp(found.eigenvalues * late))
    np.testing.assert_allclose(by_flow, by_theory.real, atol=1e-6 * np.abs(by_theory).max())


def test_the_printed_modes_of_mooney_rivlin_are_met():
    found = natural_modes(RUBBER, 1.7 * np.eye(3)).squared
    np.testing.assert_allclose(found, [0, 0, 0, 2, 2, 2, 2, 2, 6.58823529411765], rtol=1e-10, atol=1e-10)
    closed = lame_frequencies(4 * (0.25 + 0.4), 2 * (0.6 + 0.25), 1.7 * np.eye(3))
    np.testing.assert_allclose(closed[3:], [2, 2, 2, 2, 2, 6.58823529411765], rtol=1e-14)


@pytest.mark.parametrize("E", [ANY_E, np.diag([1.0, 1.5, 2.2])])
def test_natural_modes_of_any_second_moment_are_those_of_the_small_strain_constants(E):
    found = natural_modes(RUBBER, E)
    np.testing.assert_allclose(found.squared, lame_frequencies(2.6, 1.7, E), rtol=1e-10, atol=1e-10)
    weight = np.einsum("mab,bc,nac->mn", found.shape, E, found.shape)
    np.testing.assert_allclose(weight, np.eye(9), atol=1e-12)


def test_natural_modes_are_the_spectrum_at_rest():
    still = np.zeros(3)
    spectrum = rotating_spectrum(RUBBER, ANY_E, np.eye(3), still, still)
    np.testing.assert_allclose(
        spectrum.frequencies, np.sqrt(natural_modes(RUBBER, ANY_E).squared[3:]), rtol=1e-10
    )
    assert len(spectrum.eigenvalues) == 18


def test_an_incompressible_body_is_the_limit_of_stiff_ones():
    soft = Rubber(c=0.0, d=0.0)
    limit = natural_modes(soft, ANY_E, incompressible=True).squared
    assert len(limit) == 8
    stiff = [lame_frequencies(lam, 1.7, ANY_E)[:8] for lam in (1e5, 1e6)]
    errors = [np.abs(squared - limit).max() for squared in stiff]
    assert errors[1] < 1e-5
    assert 9 < errors[0] / errors[1] < 11


def test_a_small_breath_has_the_natural_period_and_a_large_one_that_of_the_integrated_radius():
    omega = np.sqrt(6.58823529411765)
    assert abs(breathing(RUBBER, 1.7, 1.001).period * omega / (2 * np.pi) - 1) < 1e-5
    found = breathing(RUBBER, 1.7, 1.4)

    def radius(_, y):
        return [y[1], -RUBBER.gradient(y[0] * np.eye(3))[0, 0] / 1.7]

    end = solve_ivp(radius, (0, found.period / 2), [1.4, 0.0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(end, [found.other, 0.0], atol=1e-11)


def test_the_printed_spinning_neo_hookean_body_is_met():
    found = spinning_body(NEO_HOOKEAN, np.eye(3), 0.3)
    np.testing.assert_allclose(
        found.stretch, [1.01380674255519, 1.01380674255519, 0.990733529383202], rtol=1e-12
    )
    np.testing.assert_allclose(found.angular_momentum, 0.616682466750217, rtol=1e-12)
    assert np.abs(found.spectrum.distinct - 0.3).min() < 1e-7  # the tilt
    assert found.spectrum.growth == 0.0


def test_a_spinning_body_of_any_moments_is_in_balance_and_turns_at_dH_by_dJ():
    E, h = np.diag([1.0, 1.5, 2.2]), 1e-3
    found, less, more = (spinning_body(RUBBER, E, rate) for rate in (0.5, 0.5 - h, 0.5 + h))
    left = np.diagonal(RUBBER.gradient(np.diag(found.stretch))) - 0.25 * np.diag(E) * found.stretch * [
        1,
        1,
        0,
    ]
    np.testing.assert_allclose(left, 0, atol=1e-13)
    slope = (more.energy - less.energy) / (more.angular_momentum - less.angular_momentum)
    np.testing.assert_allclose(slope, 0.5, rtol=1e-5)


STILL = np.zeros(3)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: spinning_body(NEO_HOOKEAN, np.eye(3), 3.0), "rate is 3 1/s, and no steady spin was found"),
        (lambda: spinning_body(NEO_HOOKEAN, ANY_E, 0.3), "second_moment is not diagonal"),
        (
            lambda: natural_modes(Rubber(d=4.0), np.eye(3)),
            "of its forces unbalanced, so it is no equilibrium",
        ),
        (
            lambda: natural_modes(RUBBER, np.diag([1.0, 0.0, 1.0])),
            "has the eigenvalue 0 beside 1",
        ),
        (lambda: ellipsoid_spectrum(jacobi([0.5, 0.6])), r"ellipsoid holds \(2,\) ellipsoids, expected one"),
        (
            lambda: rotating_spectrum(RUBBER, np.eye(3), np.diag([1.2, 1.0, 1.0]), STILL, STILL),
            "of its forces unbalanced, so it is no equilibrium",
        ),
        (
            lambda: rotating_spectrum(RUBBER, np.diag([1.0, 2.0, 3.0]), np.eye(3), STILL, AXIS),
            "lam turns the second moment",
        ),
    ],
)
def test_bad_equilibria_are_refused_in_one_line(make, line):
    with pytest.raises(DataError, match=line) as caught:
        make()
    assert "\n" not in str(caught.value)
