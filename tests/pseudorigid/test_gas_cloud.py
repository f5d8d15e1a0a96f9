"""Gas clouds and motions with turning points: exact laws, printed periods, sizes at rest, refusals."""

import numpy as np
import pytest
from cloud_laws import resting_size, small_motions, spread
from printed_motions import PRINTED
from scipy.integrate import solve_ivp
from turning_points import breathing, oscillation, spheroid_oscillation

from forceid.errors import DataError
from forceid.pseudorigid.steady.gravity import GasCloud

RNG = np.random.default_rng(72)
F0 = np.array([[1.1, 0.2, 0.0], [-0.1, 0.95, 0.15], [0.05, 0.0, 1.05]])
dF0 = np.array([[0.1, -0.4, 0.3], [0.5, 0.0, -0.2], [-0.1, 0.3, -0.05]])
HELD = [
    GasCloud(1.2, 1.45, trap=0.6, pi_G_rho=0.8, mu=0.7),
    GasCloud(1.0, 1.2, trap=1.0, pi_G_rho=0.05),
    GasCloud(1.0, 4 / 3, trap=1.0, pi_G_rho=0.3),
    GasCloud(2.0, 1.6, pi_G_rho=0.7, mu=1.5),
    GasCloud(0.5, 1.4, trap=1.3),
]


def flown(cloud, time):
    """F (time, 3, 3) and dF by DOP853."""

    def flow(_, y):
        F, dF = y.reshape(2, 3, 3)
        return np.concatenate([dF.ravel(), -cloud.gradient(F).ravel() / cloud.mu])

    start = np.concatenate([F0.ravel(), dF0.ravel()])
    y = solve_ivp(flow, (0, time[-1]), start, "DOP853", t_eval=time, rtol=1e-13, atol=1e-14).y
    return np.moveaxis(y.reshape(2, 3, 3, -1), -1, 1)


def slope(function, step=1e-3):
    near, far = function(step) - function(-step), function(2 * step) - function(-2 * step)
    return (8 * near - far) / (12 * step)


@pytest.mark.parametrize("cloud", HELD)
def test_gradient_and_hessian_are_slopes(cloud):
    H = RNG.normal(size=(5, 3, 3))
    seen = slope(lambda s: cloud.energy(F0 + s * H))
    np.testing.assert_allclose((cloud.gradient(F0) * H).sum((1, 2)), seen, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        cloud.hessian(F0, H), slope(lambda s: cloud.gradient(F0 + s * H)), rtol=1e-7, atol=1e-7
    )


def test_the_printed_trajectory_of_a_free_cloud_is_met():
    cloud = GasCloud(1.0)
    F, dF = flown(cloud, [0.0, 1.0])
    np.testing.assert_allclose([F[-1], dF[-1]], PRINTED["gas"], rtol=1e-10)
    np.testing.assert_allclose(cloud.energy(F0) + (dF0**2).sum() / 2, 1.71730364415652, rtol=1e-14)


@pytest.mark.parametrize("trap", [0.0, 0.8])
def test_the_spread_of_a_monatomic_cloud_follows_its_exact_law_in_any_shape_and_spin(trap):
    cloud, time = GasCloud(1.4, trap=trap, mu=1.3), np.linspace(0, 4, 9)
    F, _ = flown(cloud, time)
    np.testing.assert_allclose(spread(cloud, F0, dF0, time), (F * F).sum((1, 2)), rtol=1e-11)


@pytest.mark.parametrize("cloud", HELD)
def test_a_cloud_at_its_resting_size_is_at_rest_and_moves_at_the_frequencies_of_the_closed_form(cloud):
    F = resting_size(cloud) * np.eye(3)
    assert np.abs(cloud.gradient(F)).max() < 1e-13 * np.abs(cloud.hessian(F, F)).max()
    breathe, shear = small_motions(cloud)
    np.testing.assert_allclose(
        cloud.hessian(F, np.eye(3)), breathe * cloud.mu * np.eye(3), rtol=1e-11, atol=1e-12
    )
    H = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(cloud.hessian(F, H), shear * cloud.mu * H, rtol=1e-12, atol=1e-13)


def test_a_trapped_cloud_has_the_printed_frequencies():
    np.testing.assert_allclose(small_motions(GasCloud(1.0, 1.4, trap=1.0)), (3.2, 2.0), rtol=1e-14)
    np.testing.assert_allclose(small_motions(GasCloud(1.0, trap=1.0)), (4.0, 2.0), rtol=1e-14)


def test_the_printed_period_of_a_trapped_cloud_is_met():
    found = breathing(GasCloud(1.0, 1.4, trap=1.0), 1.0, 1.3)
    np.testing.assert_allclose(found.period, 3.49395922400503, rtol=1e-13)


@pytest.mark.parametrize("stretch", [0.2, 0.6, 1.01, 1.3, 4.0])
def test_a_monatomic_cloud_in_a_trap_breathes_with_one_period_at_every_amplitude(stretch):
    found = breathing(GasCloud(1.0, trap=1.0), 1.0, stretch)
    np.testing.assert_allclose(found.period, np.pi, rtol=2e-12)
    np.testing.assert_allclose(found.other, 1 / stretch, rtol=1e-12)


@pytest.mark.parametrize("cloud", HELD[:4])
def test_a_small_breath_has_the_linear_period_and_both_turning_points_give_the_same(cloud):
    rest, omega = resting_size(cloud), np.sqrt(small_motions(cloud)[0])
    assert abs(breathing(cloud, cloud.mu, 1.003 * rest).period * omega / (2 * np.pi) - 1) < 3e-5
    out = breathing(cloud, cloud.mu, 1.2 * rest)
    back = breathing(cloud, cloud.mu, out.other)
    np.testing.assert_allclose([back.other, back.period], [out.start, out.period], rtol=1e-11)


def test_a_gravitating_sphere_breathes_as_the_integrated_radius():
    cloud = GasCloud(1.0, pi_G_rho=0.75)
    found = breathing(cloud, 1.0, 1.4)

    def radius(_, y):
        return [y[1], y[0] ** (2 - 3 * cloud.gamma) - 4 / 3 * 0.75 / y[0] ** 2]

    end = solve_ivp(radius, (0, found.period), [1.4, 0.0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(end, [1.4, 0.0], atol=1e-10)
    # Kepler's law: for gamma = 5/3 the radius moves as a planet of mass 1 with angular momentum 1
    axis = (found.start + found.other) / 2
    np.testing.assert_allclose(found.period, 2 * np.pi * axis**1.5, rtol=1e-12)


def test_a_liquid_spheroid_has_the_printed_period_and_turning_point():
    found = spheroid_oscillation(1.3)
    np.testing.assert_allclose(found.other, 0.766670327997568, rtol=1e-13)
    np.testing.assert_allclose(found.period, 6.26727172211049, rtol=1e-12)
    small = spheroid_oscillation(1.001).period
    np.testing.assert_allclose(small, 6.08366801396042, rtol=1e-5)


def test_a_harmonic_and_a_pendulum_have_their_periods():
    from scipy.special import ellipk

    one = np.ones_like
    np.testing.assert_allclose(oscillation(lambda q: 2 * (q - 3) ** 2, one, 1.0).period, np.pi, rtol=1e-13)
    found = oscillation(lambda q: -np.cos(q - 4), one, 2.0)
    np.testing.assert_allclose(found.period, 4 * ellipk(np.sin(1.0) ** 2), rtol=1e-13)
    np.testing.assert_allclose(found.other, 6.0, rtol=1e-14)


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: GasCloud(-1.0), "K = -1, expected > 0"),
        (lambda: GasCloud(1.0, 1.0), "gamma = 1, expected > 1"),
        (lambda: GasCloud(1.0, trap=-0.5), "trap = -0.5, expected >= 0"),
        (lambda: GasCloud(1.0).energy(np.diag([1.0, 1.0, -1.0])), "det F is -1, expected > 0"),
    ],
)
def test_bad_clouds_are_refused_in_one_line(make, line):
    with pytest.raises(DataError, match=line) as caught:
        make()
    assert "\n" not in str(caught.value)
