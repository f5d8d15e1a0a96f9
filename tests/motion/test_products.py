"""Inertia and angular momentum of a deforming shape, against sums over its nodes."""

import numpy as np
import pytest

from forceid.estimation.body.deformation import fixed
from forceid.motion.products import inertia_products

RNG = np.random.default_rng(3)
MASS = np.array([0.06, 0.02, 0.04, 0.01, 0.03])
SHAPE = RNG.standard_normal((5, 3))
SHAPES = RNG.standard_normal((2, 5, 3))
Q, RATE = 0.1 * RNG.standard_normal((2, 4, 2))


def by_nodes(q, rate):
    x, v = SHAPE + np.einsum("tk,kna->tna", q, SHAPES), np.einsum("tk,kna->tna", rate, SHAPES)
    x = x - np.average(x, axis=1, weights=MASS)[:, None]
    square = np.einsum("n,tna,tnb->tab", MASS, x, x)
    J = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
    return J, np.einsum("n,tna->ta", MASS, np.cross(x, v))


@pytest.mark.parametrize("mass", [MASS, np.kron(np.diag(MASS), np.eye(3))])
def test_products_are_the_sums_over_the_nodes(mass):
    for found, wanted in zip(
        inertia_products(mass, SHAPE, SHAPES).of(Q, RATE), by_nodes(Q, RATE), strict=True
    ):
        np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_slopes_are_those_of_the_sums():
    dJ, by_q, by_rate = inertia_products(MASS, SHAPE, SHAPES).slopes(Q, RATE)
    for k, unit in enumerate(np.eye(2) * 1e-5):
        ahead, behind = by_nodes(Q + unit, RATE), by_nodes(Q - unit, RATE)
        np.testing.assert_allclose(dJ[:, k], (ahead[0] - behind[0]) / 2e-5, atol=1e-9)
        np.testing.assert_allclose(by_q[:, k], (ahead[1] - behind[1]) / 2e-5, atol=1e-9)
        faster, slower = by_nodes(Q, RATE + unit)[1], by_nodes(Q, RATE - unit)[1]
        np.testing.assert_allclose(by_rate[:, k], (faster - slower) / 2e-5, atol=1e-9)


def test_inertia_known_as_a_whole_stays():
    J, h = fixed(np.diag([1.0, 2.0, 3.0]), 2).of(Q, RATE)
    np.testing.assert_array_equal(J, np.tile(np.diag([1.0, 2.0, 3.0]), (4, 1, 1)))
    assert (h == 0).all()
