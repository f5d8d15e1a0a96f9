"""Ellipsoids in steady motion: printed sequences, the motion solves the equations, adjoints, refusals."""

import numpy as np
import pytest
from second_harmonics import fastest_spheroid, maclaurin_modes, spheroid_of_excess

from forceid.errors import DataError
from forceid.pseudorigid.steady.ellipsoids import (
    dedekind,
    irrotational,
    jacobi,
    maclaurin,
    riemann_s,
    riemann_sequence,
)
from forceid.pseudorigid.steady.gravity import SelfGravity

# e, Omega^2, T/|W|, L, pulsation^2, 4 B_11 - Omega^2
MACLAURIN = np.array(
    [
        [0.1, 0.0053409521939520, 0.0013397217533822, 0.025401239158884, 1.0732935542472, 1.0582627643480],
        [0.3, 0.048615783581008, 0.012544572723129, 0.078819220820288, 1.1280154130119, 0.98931631126954],
        [0.5, 0.13799364234218, 0.038039941203872, 0.14163363701604, 1.2461552746686, 0.84121652991034],
        [0.7, 0.27734132125266, 0.087648229207578, 0.22833606955578, 1.4349173566482, 0.58685600441779],
        [0.8, 0.36315884756900, 0.13054413183597, 0.29345269617487, 1.5324436624911, 0.40147146995900],
        [0.9, 0.44052888208299, 0.20307266334388, 0.39993856397131, 1.5123485242895, 0.15748817450133],
        [0.95, 0.44264347891627, 0.26864734346195, 0.50074442143549, 1.2862237932553, 0.0088974625127798],
        [0.98, 0.37801785111938, 0.33959709442067, 0.62485854834628, 0.88207779614019, -0.077768765930946],
    ]
)
# a2, a3, Omega^2, L
JACOBI = np.array(
    [
        [0.96, 0.570803567057216, 0.373979456353567, 0.303954713681459],
        [0.9, 0.551872611798609, 0.372566554302050, 0.305107980635113],
        [0.8, 0.517216058580115, 0.366837036679417, 0.309836852407112],
        [0.7, 0.478109761613770, 0.355679207730116, 0.319295183637346],
        [0.6, 0.433781034891506, 0.337329903375693, 0.335618389771884],
        [0.5, 0.383308578573100, 0.309557013747839, 0.362378093396652],
        [0.4, 0.325608686779204, 0.269677785646976, 0.406072788032137],
        [0.3, 0.259446577797375, 0.214887081301127, 0.480079112995400],
        [0.2, 0.183524286188381, 0.143609557116751, 0.618068502410222],
        [0.12, 0.115038031734158, 0.0772806020044428, 0.848769940533763],
    ]
)
# a2, a3, w, l, f
S_TYPE = np.array(
    [
        [0.9, 0.6, 0.627495212938398, -0.0456689016815722, -0.146368025939135],
        [0.8, 0.5, 0.597858491600272, 0.0173043607369603, 0.0593350098880698],
        [0.7, 0.6, 0.632224397650435, -0.134654162991496, -0.453353279542963],
        [0.5, 0.45, 0.583385315692280, -0.0886582752845223, -0.379930180361650],
        [0.4, 0.3, 0.501566983236848, 0.0384729827510391, 0.222446161144796],
    ]
)
IRROTATIONAL = np.array(
    [
        [0.9, 0.946423707844697, 0.516653626991358, -0.513799187063229],
        [0.7, 0.813567048333577, 0.518476456128176, -0.487159086294931],
        [0.5, 0.632524185843576, 0.515733322900200, -0.412586658320160],
    ]
)


def test_maclaurin_spheroids_are_those_printed():
    e, omega_squared, ratio, momentum, pulsation, discriminant = MACLAURIN.T
    found, modes = maclaurin(e), maclaurin_modes(e)
    np.testing.assert_allclose(found.omega_squared, omega_squared, rtol=1e-12)
    np.testing.assert_allclose(found.energy_ratio, ratio, rtol=1e-12)
    np.testing.assert_allclose(found.angular_momentum, momentum, rtol=1e-12)
    np.testing.assert_allclose(modes.pulsation, pulsation, rtol=1e-12)
    np.testing.assert_allclose(modes.discriminant, discriminant, rtol=1e-11)


@pytest.mark.parametrize("e", [1e-8, 1e-4, 0.01])
def test_a_spheroid_that_is_almost_a_sphere_loses_no_digits(e):
    assert abs(maclaurin(e).omega_squared / e**2 / (8 / 15 + 8 / 105 * e**2) - 1) < 0.05 * e**4 + 1e-14
    modes = maclaurin_modes(e)
    assert abs(modes.pulsation - 16 / 15) < e**2 + 1e-14
    np.testing.assert_allclose(np.abs(modes.toroidal), np.sqrt(16 / 15), atol=e)
    np.testing.assert_allclose(np.abs(modes.transverse), np.sqrt(16 / 15), atol=e)


def test_the_maximum_of_omega_squared_is_where_it_is_printed():
    found = fastest_spheroid()
    np.testing.assert_allclose(np.sqrt(1 - found.axes[2] ** 2), 0.929955685456233, rtol=1e-13)
    seen = found.omega_squared, found.axes[2], found.energy_ratio, found.angular_momentum
    printed = 0.449331412123914, 0.367671623990250, 0.237902112262586, 0.452446539677806
    np.testing.assert_allclose(seen, printed, rtol=1e-13)
    assert (maclaurin([0.929, 0.931]).omega_squared < found.omega_squared).all()


def test_the_jacobi_bifurcation_is_where_it_is_printed_and_the_sequence_starts_there():
    found = spheroid_of_excess(2.0)
    np.testing.assert_allclose(np.sqrt(1 - found.axes[2] ** 2), 0.812670010611743, rtol=1e-13)
    seen = found.omega_squared, found.axes[2], found.energy_ratio, found.angular_momentum
    printed = 0.374229674786196, 0.582724166181830, 0.137528147873934, 0.303750998834296
    np.testing.assert_allclose(seen, printed, rtol=1e-13)
    np.testing.assert_allclose(jacobi(1.0).axes, found.axes, rtol=1e-13)
    np.testing.assert_allclose(jacobi(1.0).angular_momentum, found.angular_momentum, rtol=1e-13)


def test_the_dynamical_instability_is_where_the_literature_has_it():
    found = spheroid_of_excess(4.0)
    e = np.sqrt(1 - found.axes[2] ** 2)
    np.testing.assert_allclose(
        [e, found.omega_squared, found.energy_ratio], [0.9529, 0.4402, 0.2738], atol=5e-5
    )
    below, above = maclaurin_modes(e - 1e-6).discriminant, maclaurin_modes(e + 1e-6).discriminant
    assert below > 0 > above


def test_jacobi_ellipsoids_are_those_printed():
    a2, a3, omega_squared, momentum = JACOBI.T
    found = jacobi(a2)
    np.testing.assert_allclose(found.axes[:, 2], a3, rtol=2e-14)
    np.testing.assert_allclose(found.omega_squared, omega_squared, rtol=1e-13)
    np.testing.assert_allclose(found.angular_momentum, momentum, rtol=1e-13)


def test_the_pear_shaped_point_is_on_the_jacobi_sequence():
    found = jacobi(0.432232)
    np.testing.assert_allclose([found.axes[2], found.omega_squared], [0.345069, 0.284030], atol=1e-6)


def test_dedekind_ellipsoids_are_jacobis_at_rest_with_the_spin_inside():
    still, turning = dedekind(JACOBI[:, 0]), jacobi(JACOBI[:, 0])
    assert (still.w == 0).all()
    assert np.isinf(still.f).all()
    np.testing.assert_array_equal(still.axes, turning.axes)
    np.testing.assert_allclose(still.l**2, JACOBI[:, 2], rtol=1e-13)
    np.testing.assert_allclose(still.circulation, turning.angular_momentum, rtol=1e-14)
    np.testing.assert_allclose(still.energy_ratio, turning.energy_ratio, rtol=1e-14)


def test_s_type_ellipsoids_are_those_printed():
    a2, a3, w, l, f = S_TYPE.T  # noqa: E741
    found = riemann_s(a2, a3)
    np.testing.assert_allclose(found.w, w, rtol=1e-13)
    np.testing.assert_allclose(found.l, l, rtol=1e-12)
    np.testing.assert_allclose(found.f, f, rtol=1e-12)


def test_irrotational_ellipsoids_are_those_printed_and_have_no_circulation():
    a2, a3, w, l = IRROTATIONAL.T  # noqa: E741
    found = irrotational(a2)
    np.testing.assert_allclose(found.axes[:, 2], a3, rtol=1e-13)
    np.testing.assert_allclose(found.w, w, rtol=1e-13)
    np.testing.assert_allclose(found.l, l, rtol=1e-13)
    np.testing.assert_allclose(found.circulation, 0, atol=1e-16)
    np.testing.assert_allclose(found.f, -2, rtol=1e-14)


@pytest.mark.parametrize("f", [-5.0, -2.0, -0.7, 0.0, 0.4, 3.0])
def test_a_sequence_of_given_f_meets_the_ellipsoids_of_its_axes(f):
    found = riemann_sequence(np.array([0.35, 0.6, 0.9]), f)
    np.testing.assert_allclose(found.f, f, rtol=1e-13)
    inner_faster = np.abs(found.l) > np.abs(found.w)
    for i, axes in enumerate(found.axes):
        other = riemann_s(axes[1], axes[2], adjoint=bool(inner_faster[i]))
        np.testing.assert_allclose(np.abs([other.w, other.l]), np.abs([found.w[i], found.l[i]]), atol=1e-12)


CASES = [maclaurin(0.7), jacobi(0.6), dedekind(0.6), irrotational(0.5), riemann_s(0.7, 0.6)]


@pytest.mark.parametrize("found", [*CASES, riemann_s(0.8, 0.5, adjoint=True), riemann_sequence(0.4, 3.0)])
def test_the_motion_of_an_ellipsoid_solves_the_master_system_at_its_pressure(found):
    time, h = np.array([0.0, 0.7, 5.0]), 1e-3
    F, dF = found.motion(time)
    np.testing.assert_allclose(np.linalg.det(F), 1, rtol=1e-14)
    rates = [found.motion(time + k * h)[1] for k in (-2, -1, 1, 2)]
    ddF = (rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * h)
    multiplier = 2 * found.pressure / np.cbrt(found.axes.prod() ** 2)  # 2 p_c / rho at unit volume
    cofactor = np.linalg.inv(F).swapaxes(1, 2)
    np.testing.assert_allclose(ddF, multiplier * cofactor - SelfGravity().gradient(F), atol=1e-11)

    # records against the motion: mu = m / 5, pi G rho = 1, G m = 4/3, unit sqrt(G m^3)
    momentum, circulation = dF @ F.swapaxes(1, 2), F.swapaxes(1, 2) @ dF
    unit = 5 * np.sqrt(4 / 3)
    for matrix, of in ((momentum, found.angular_momentum), (circulation, found.circulation)):
        np.testing.assert_allclose(
            (matrix - matrix.swapaxes(1, 2))[:, 1, 0], of * unit, rtol=1e-13, atol=1e-15
        )
    ratio = (dF**2).sum((1, 2)) / 2 / -SelfGravity().energy(F)
    np.testing.assert_allclose(ratio, found.energy_ratio, rtol=1e-12)


def test_records_of_many_ellipsoids_move_together():
    many = riemann_s([0.8, 0.5], [0.5, 0.45])
    F, dF = many.motion(np.array([0.0, 1.0, 2.0]))
    one = riemann_s(0.5, 0.45).motion(2.0)
    assert F.shape == dF.shape == (2, 3, 3, 3)
    np.testing.assert_allclose(F[1, 2], one[0], rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(dF[1, 2], one[1], rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: maclaurin(1.0), r"eccentricity is 1, expected inside \(0, 1\)"),
        (lambda: maclaurin([0.5, 0.0]), r"eccentricity is 0, expected inside \(0, 1\)"),
        (lambda: jacobi(1.2), r"a2 is 1\.2, expected inside \(0, 1\].*order the axes"),
        (lambda: dedekind(-0.1), r"a2 is -0\.1, expected inside"),
        (lambda: riemann_s(0.5, 0.0), "a3 is 0, expected a positive length"),
        (
            lambda: riemann_s([0.8, 0.5], [0.5, 0.9]),
            r"\(0\.5, 0\.9\) have w\^2 .*no S-type ellipsoid has them",
        ),
        (lambda: riemann_sequence(0.5, np.inf), "f is inf, expected finite; call dedekind"),
        (lambda: maclaurin(2.0), "eccentricity is 2"),
    ],
)
def test_bad_ellipsoids_are_refused_in_one_line(make, line):
    with pytest.raises(DataError, match=line) as caught:
        make()
    assert "\n" not in str(caught.value)
