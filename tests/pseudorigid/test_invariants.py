"""Which invariants a body keeps: along its motion, by an integration of the master system of its own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forceid.pseudorigid.motion import invariants

F0 = np.array([[1.1, 0.2, 0], [-0.1, 0.95, 0.15], [0.05, 0, 1.05]])
dF0 = np.array([[0.1, -0.4, 0.3], [0.5, 0, -0.2], [-0.1, 0.3, -0.05]])
BALL, BLOCK = 1.7 * np.eye(3), np.array([[1.0, 0.2, 0], [0.2, 1.5, -0.1], [0, -0.1, 2.2]])


class Gas:
    """W = 1.5 J^(-2/3): knows only det F."""

    def energy(self, F):
        return 1.5 * np.linalg.det(F) ** (-2 / 3)

    def gradient(self, F):
        return -(np.linalg.det(F) ** (-2 / 3))[..., None, None] * np.swapaxes(np.linalg.inv(F), -1, -2)


class Solid(Gas):
    """The gas, with springs |F|^2: isotropic."""

    def energy(self, F):
        return (F * F).sum((-1, -2)) + super().energy(F)

    def gradient(self, F):
        return 2 * F + super().gradient(F)


class Fibered(Solid):
    """The solid with a fiber along e_1: only frame indifferent."""

    def energy(self, F):
        return ((F[..., 0] ** 2).sum(-1)) ** 2 + super().energy(F)

    def gradient(self, F):
        out = super().gradient(F)
        out[..., 0] += 4 * (F[..., 0] ** 2).sum(-1)[..., None] * F[..., 0]
        return out


class Tethered(Solid):
    """The solid pulled toward F = I: not even frame indifferent."""

    def energy(self, F):
        return -F[..., 0, 1] + super().energy(F)

    def gradient(self, F):
        return super().gradient(F) - np.outer([1.0, 0, 0], [0.0, 1, 0])


class StirredFluid(Gas):
    """The gas in a trap |F E^(1/2)|^2: knows det F and F E F^T."""

    def energy(self, F):
        return (F * (F @ BLOCK)).sum((-1, -2)) + super().energy(F)

    def gradient(self, F):
        return 2 * F @ BLOCK + super().gradient(F)


def motion(E, W):
    t = np.linspace(0, 2, 5)
    run = solve_ivp(
        lambda _, y: np.concatenate(
            [y[9:], -np.linalg.solve(E, W.gradient(y[:9].reshape(3, 3)).T).T.ravel()]
        ),
        (0, 2),
        np.concatenate([F0.ravel(), dF0.ravel()]),
        "DOP853",
        t,
        rtol=1e-13,
        atol=1e-14,
    )
    return run.y[:9].T.reshape(-1, 3, 3), run.y[9:].T.reshape(-1, 3, 3)


@pytest.mark.parametrize(
    ("E", "W", "kept"),
    [
        (BLOCK, Tethered(), {"energy"}),
        (BLOCK, Fibered(), {"energy", "momentum"}),
        (BALL, Fibered(), {"energy", "momentum"}),
        (BLOCK, Solid(), {"energy", "momentum"}),
        (BALL, Solid(), {"energy", "momentum", "circulation", "Cauchy"}),
        (BLOCK, Gas(), {"energy", "momentum", "Cauchy"}),
        (BALL, Gas(), {"energy", "momentum", "circulation", "Cauchy"}),
        (BLOCK, StirredFluid(), {"energy", "momentum", "Cauchy"}),
    ],
)
def test_just_the_invariants_that_theory_names_stay(E, W, kept):
    F, dF = motion(E, W)
    value = {
        "energy": invariants.energy(F, dF, E, W),
        "momentum": invariants.angular_momentum(F, dF, E),
        "circulation": invariants.circulation(F, dF, E),
        "Cauchy": invariants.circulation(F, dF, np.eye(3)),
    }
    change = {name: np.abs(v - v[0]).max() for name, v in value.items()}
    assert max(change[name] for name in kept) < 2e-12
    assert min([change[name] for name in value if name not in kept], default=1.0) > 1e-3


def test_momenta_of_the_sample_starts_are_those_of_section_12_8():
    E = np.diag([1.0, 1.5, 2.2])
    np.testing.assert_allclose(invariants.angular_momentum(F0, dF0, E), [0.858, 0.718, 1.031], rtol=1e-14)
    np.testing.assert_allclose(
        invariants.angular_momentum(F0, dF0, BALL), [0.80325, 0.629, 1.5215], rtol=1e-14
    )
    np.testing.assert_allclose(invariants.circulation(F0, dF0, BALL), [0.7565, 0.64175, 1.564], rtol=1e-14)
    np.testing.assert_allclose(invariants.energy(F0, dF0, np.eye(3), Gas()), 1.71730364415652, rtol=1e-14)


def test_momenta_of_a_ball_are_one_another_with_the_roles_of_space_and_body_exchanged():
    rng = np.random.default_rng(0)
    F, dF = rng.standard_normal((2, 50, 3, 3))
    there = invariants.angular_momentum(F.swapaxes(1, 2), dF.swapaxes(1, 2), BALL)
    np.testing.assert_allclose(invariants.circulation(F, dF, BALL), -there, atol=1e-13)
