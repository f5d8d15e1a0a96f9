import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.pseudorigid import (
    MooneyRivlin,
    NeoHookean,
    Ogden,
    PerfectGas,
    StVenantKirchhoff,
    cauchy,
    piola,
    viscous,
)

MATERIALS = [
    MooneyRivlin.natural(0.6, 0.25, 0.4),
    NeoHookean(1.0, incompressible=True),
    StVenantKirchhoff(1.3, 0.7),
    Ogden.natural((0.6, 0.2), (2.0, 3.3), (0.25, 0.1), (2.0, 1.5), 0.4),
    PerfectGas(1.0, 1.4),
]
rng = np.random.default_rng(11)
L, R, Q = (Rotation.random(20, rng=rng).as_matrix() for _ in range(3))
F = (L * rng.uniform(0.6, 1.6, (20, 1, 3))) @ R
V = rng.normal(size=F.shape)
VOLUME, ETA = 0.3, 0.2


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_cauchy_stress_is_symmetric_objective_and_piola_by_the_area_as_it_is(material):
    P, sigma = piola(material, F, V, ETA, VOLUME), cauchy(material, F, V, ETA, VOLUME)
    J = np.linalg.det(F)[:, None, None]
    np.testing.assert_allclose(sigma, P @ F.mT / J, atol=1e-13)
    np.testing.assert_allclose(sigma, sigma.mT, atol=1e-12)
    spin = rng.normal(size=(20, 3))
    W = np.cross(np.eye(3), spin[:, None])  # any skew matrix: the frame turns as it goes
    turned, rate = Q @ F, Q @ (V + W @ F)
    np.testing.assert_allclose(cauchy(material, turned, rate, ETA, VOLUME), Q @ sigma @ Q.mT, atol=1e-11)
    np.testing.assert_allclose(piola(material, turned, rate, ETA, VOLUME), Q @ P, atol=1e-11)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_power_of_the_stress_is_the_rate_of_the_energy_and_what_damping_takes(material):
    step, J = 1e-5, np.linalg.det(F)
    stored = (material.energy(F + step * V) - material.energy(F - step * V)) / (2 * step)
    C_rate = F.mT @ V + V.mT @ F
    power = VOLUME * np.einsum("nij,nij->n", piola(material, F, V, ETA, VOLUME), V)
    np.testing.assert_allclose(power, stored + ETA / 2 * (C_rate**2).sum((1, 2)), rtol=1e-6)
    velocity_gradient = V @ np.linalg.inv(F)
    by_area = VOLUME * J * np.einsum("nij,nij->n", cauchy(material, F, V, ETA, VOLUME), velocity_gradient)
    np.testing.assert_allclose(by_area, power, rtol=1e-10)


def test_stress_of_a_pulled_bar_and_of_a_gas_are_those_of_the_textbook():
    lam, mu, a = 1.3, 0.7, 1.2
    uniaxial = cauchy(StVenantKirchhoff(lam, mu), np.diag([a, 1.0, 1.0]))
    G = (a**2 - 1) / 2
    np.testing.assert_allclose(uniaxial, np.diag([a * (lam + 2 * mu) * G, *[lam * G / a] * 2]), atol=1e-15)
    pressure = 2.0 * np.linalg.det(F) ** -1.4
    np.testing.assert_allclose(
        cauchy(PerfectGas(2.0, 1.4), F), -pressure[:, None, None] * np.eye(3), atol=1e-12
    )


def test_damping_resists_no_rotation_and_a_small_strain_as_a_liquid_would():
    spin = np.cross(np.eye(3), rng.normal(size=3))
    np.testing.assert_allclose(viscous(F, spin @ F), 0, atol=1e-13)
    stretch = V + V.mT
    np.testing.assert_allclose(viscous(np.eye(3), V), stretch, atol=1e-15)


def test_cauchy_stress_of_a_body_turned_inside_out_is_refused():
    with pytest.raises(DataError, match="det F is -1"):
        cauchy(StVenantKirchhoff(1.0, 1.0), np.diag([1.0, 1.0, -1.0]))
