from dataclasses import dataclass

import numpy as np
import pytest
from material_checks import check_material

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import (
    by_component,
    cofactor,
    determinant,
    inner,
    inverse,
    product,
    tensor_cross,
)
from forceid.pseudorigid.material.formless import NoStress, PerfectGas
from forceid.pseudorigid.material.materials import (
    HadamardGreen,
    MooneyRivlin,
    NeoHookean,
    StVenantKirchhoff,
)
from forceid.pseudorigid.material.ogden import Ogden, divided

F_STAR = np.array([[1.2, 0.3, -0.1], [0.2, 0.9, 0.4], [-0.3, 0.1, 0.7]])
NATURAL = [
    MooneyRivlin.natural(0.6, 0.25, 0.4),
    NeoHookean.natural(1.0, 0.5),
    HadamardGreen.natural(1.3, 0.2, 0.4),
    StVenantKirchhoff(1.3, 0.7),
    Ogden.natural((0.6, 0.2), (2.0, 3.3), (0.25, 0.1), (2.0, 1.5), 0.4),
]
OTHER = [
    NoStress(),
    PerfectGas(1.0, 5 / 3),
    MooneyRivlin(0.6, 0.25, incompressible=True),
    NeoHookean(1.0, incompressible=True),
    HadamardGreen(1.3, 0.2, incompressible=True),
    Ogden((0.6, -0.1), (2.0, -2.0), (0.25,), (2.0,), incompressible=True),
]


def named(material):
    return type(material).__name__


@pytest.mark.parametrize("material", NATURAL + OTHER, ids=named)
def test_every_material_is_consistent_frame_indifferent_and_isotropic(material):
    found = check_material(material, np.random.default_rng(3))
    assert found.gradient < 1e-9
    assert found.hessian < 1e-9
    assert found.consistent
    assert found.frame_indifferent
    assert found.isotropic


@pytest.mark.parametrize("material", NATURAL, ids=named)
def test_natural_state_is_free_of_stress_and_has_the_lame_constants_of_the_table(material):
    found = check_material(material, np.random.default_rng(4))
    assert found.natural
    H = np.random.default_rng(5).standard_normal((3, 3))
    strain = 0.5 * (H + H.T)
    lame = material.lame()
    hooke = lame.lam * np.trace(strain) * np.eye(3) + 2 * lame.mu * strain
    np.testing.assert_allclose(material.hessian(np.eye(3), H), hooke, rtol=0, atol=1e-13)


def test_gas_and_material_without_gamma_are_not_natural():
    for material in OTHER[1:]:
        assert not check_material(material, np.random.default_rng(6)).natural


def test_mooney_rivlin_gives_the_printed_energy_and_force():
    W = MooneyRivlin(a=0.6, b=0.25, c=0.4, d=3.0)
    force = [
        [-0.36841951414309, 1.5813289384359, -1.4621553544093],
        [1.2098937171381, -1.7013132312812, 1.7682849118136],
        [-1.4807849118136, 2.4234402662230, -2.9505981430948],
    ]
    assert W.energy(F_STAR) == pytest.approx(4.20168643334079, rel=1e-14)
    np.testing.assert_allclose(W.gradient(F_STAR), force, rtol=2e-13)


def test_st_venant_kirchhoff_gives_the_printed_energy_and_force():
    W = StVenantKirchhoff(lam=1.3, mu=0.7)
    force = [[0.7126, 0.4088, -0.1113], [0.3493, 0.2086, 0.1582], [-0.2338, 0.0917, -0.0224]]
    assert W.energy(F_STAR) == pytest.approx(0.2506, rel=1e-14)
    np.testing.assert_allclose(W.gradient(F_STAR), force, rtol=1e-13)


def test_st_venant_kirchhoff_has_no_barrier_and_negative_stiffness_below_one_over_root_three():
    W = StVenantKirchhoff(lam=1.3, mu=0.7)
    a = np.array([1.0, 0.6, 0.5, 0.0])
    F = a[:, None, None] * np.eye(3)
    np.testing.assert_allclose(W.energy(F), (9 * 1.3 + 6 * 0.7) / 8 * (a**2 - 1) ** 2, atol=1e-15)
    stiffness = inner(W.hessian(F, np.broadcast_to(np.eye(3), F.shape)), np.eye(3))
    assert stiffness[1] > 0 > stiffness[2]


def test_hadamard_green_as_printed_is_mooney_rivlin():
    W, other = HadamardGreen(1.2, 0.25, 0.4, 3.0), MooneyRivlin(0.6, 0.25, 0.4, 3.0)
    C = F_STAR.T @ F_STAR
    printed = 0.6 * np.trace(C) + 0.125 * (np.trace(C) ** 2 - np.trace(C @ C))
    assert W.energy(F_STAR) == pytest.approx(printed + 0.4 * 0.601**2 - 3 * np.log(0.601), rel=1e-14)
    np.testing.assert_array_equal(W.gradient(F_STAR), other.gradient(F_STAR))
    assert (W.alpha, W.beta) == (1.2, 0.25)


def test_ogden_with_squares_is_mooney_rivlin_in_energy_force_and_stiffness():
    rng = np.random.default_rng(8)
    ogden = Ogden((0.6,), (2.0,), (0.25,), (2.0,), 0.4, 3.0)
    plain = MooneyRivlin(0.6, 0.25, 0.4, 3.0)
    F, H = F_STAR + 0.2 * rng.standard_normal((20, 3, 3)), rng.standard_normal((20, 3, 3))
    F = F[np.linalg.det(F) > 0.1]
    H = H[: len(F)]
    np.testing.assert_allclose(ogden.energy(F), plain.energy(F), rtol=1e-13)
    np.testing.assert_allclose(ogden.gradient(F), plain.gradient(F), atol=1e-12)
    np.testing.assert_allclose(ogden.hessian(F, H), plain.hessian(F, H), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_ogden_stiffness_loses_no_digits_at_close_stretches(gap):
    ogden = Ogden((0.6,), (2.0,), (0.25,), (2.0,), 0.4, 3.0)
    plain = MooneyRivlin(0.6, 0.25, 0.4, 3.0)
    turn = np.linalg.qr(np.random.default_rng(9).standard_normal((3, 3)))[0]
    F = turn @ np.diag([1.1, 1.1 + gap, 0.9]) @ turn.T
    H = np.random.default_rng(10).standard_normal((3, 3))
    np.testing.assert_allclose(ogden.hessian(F, H), plain.hessian(F, H), rtol=0, atol=2e-13)


def test_divided_differences_of_powers_match_extended_precision():
    x = np.longdouble(1.3)
    for gap in (1e-14, 1e-9, 1e-4, 0.7):
        y = np.longdouble(1.3 + gap)
        for p in (-2.0, 0.5, 3.3):
            # the mean of p s^(p-1) between both, by Gauss-Legendre in extended precision
            node, weight = np.polynomial.legendre.leggauss(24)
            s = (x + y) / 2 + (y - x) / 2 * node.astype(np.longdouble)
            exact = float((p * s ** (p - 1) * weight).sum() / 2)
            assert float(divided(np.array(1.3), np.array(1.3 + gap), p)) == pytest.approx(exact, rel=3e-15)


@dataclass(frozen=True)
class Fibers:
    """Isotropic springs and stiffer fibers along e1: not isotropic."""

    stiff: float = 2.0

    def energy(self, F):
        length = (F[..., :, 0] ** 2).sum(-1)
        return inner(F, F) / 2 + self.stiff / 4 * (length - 1) ** 2

    def gradient(self, F):
        out = np.array(F)
        out[..., :, 0] += self.stiff * ((F[..., :, 0] ** 2).sum(-1) - 1)[..., None] * F[..., :, 0]
        return out

    def hessian(self, F, H):
        f, h = F[..., :, 0], H[..., :, 0]
        out = np.array(np.broadcast_to(H, np.broadcast_shapes(F.shape, H.shape)))
        out[..., :, 0] += self.stiff * (
            ((f**2).sum(-1) - 1)[..., None] * h + 2 * (f * h).sum(-1)[..., None] * f
        )
        return out


class Laboratory(Fibers):
    """A force that knows the direction up: not frame indifferent."""

    def energy(self, F):
        return super().energy(F) + 0.3 * F[..., 2, 2]

    def gradient(self, F):
        out = super().gradient(F)
        out[..., 2, 2] += 0.3
        return out


class Mistaken(Fibers):
    """A force that is no derivative of the energy."""

    def gradient(self, F):
        return 1.01 * super().gradient(F)


def test_check_tells_fibers_from_isotropy_and_laboratory_axes_from_frame_indifference():
    rng = np.random.default_rng(11)
    fibers, laboratory, mistaken = (check_material(W(), rng) for W in (Fibers, Laboratory, Mistaken))
    assert (fibers.consistent, fibers.frame_indifferent, fibers.isotropic) == (True, True, False)
    assert (laboratory.consistent, laboratory.frame_indifferent) == (True, False)
    assert not mistaken.consistent
    assert 0.003 < mistaken.gradient < 0.1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: MooneyRivlin(-0.1, 0.25, 0.4, 3.0), "a = -0.1, expected >= 0"),
        (lambda: MooneyRivlin(0.0, 0.0, 0.4, 3.0), r"a \+ b = 0, expected > 0"),
        (lambda: MooneyRivlin(0.6, 0.25), "without the barrier"),
        (lambda: MooneyRivlin(0.6, 0.25, 0.4, 3.0, incompressible=True), "leave c and d out"),
        (lambda: NeoHookean(1.0, -1.0, 3.0), "NeoHookean: c = -1"),
        (lambda: NeoHookean(float("nan"), 1.0, 3.0), "a = nan"),
        (lambda: HadamardGreen(1.0, -0.2, 0.4, 3.0), "HadamardGreen: beta = -0.2"),
        (lambda: StVenantKirchhoff(-1.0, 0.7), r"3 lam \+ 2 mu"),
        (lambda: StVenantKirchhoff(1.0, 0.0), "mu = 0, expected > 0"),
        (lambda: PerfectGas(1.0, 1.0), "gamma = 1, expected > 1"),
        (lambda: PerfectGas(0.0, 1.4), "K = 0, expected > 0"),
        (lambda: Ogden((1.0,), (2.0, 3.0), c=1.0, d=1.0), "exponent for every coefficient"),
        (lambda: Ogden((-1.0,), (2.0,), c=1.0, d=1.0), "alpha gamma = -2"),
    ],
)
def test_constants_out_of_range_are_refused_with_what_to_choose(make, says):
    with pytest.raises(DataError, match=says):
        make()


def test_products_by_components_agree_with_numpy_in_either_layout():
    F, H = np.random.default_rng(12).standard_normal((2, 50, 3, 3))
    for A, B in ((F, H), (by_component(F), by_component(H))):
        np.testing.assert_allclose(product(A, B), F @ H, rtol=0, atol=1e-14)
        np.testing.assert_allclose(determinant(A), np.linalg.det(F), rtol=1e-12)
        np.testing.assert_allclose(inverse(A), np.linalg.inv(F), rtol=1e-9, atol=1e-11)
        # cof(F + sH) is a quadratic in s: its middle coefficient is F x H
        middle = 0.5 * (cofactor(F + H) - cofactor(F - H))
        np.testing.assert_allclose(tensor_cross(A, B), middle, rtol=0, atol=1e-13)
    assert by_component(F)[..., 0, 0].flags.contiguous
