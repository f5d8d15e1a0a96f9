"""Simple shear F = I + alpha e1 e2^T in closed form: its factors, and a body that is held to it."""

from types import SimpleNamespace

import numpy as np

E12 = np.outer([1.0, 0, 0], [0.0, 1, 0])


def shear(alpha):
    """F (..., 3, 3)."""
    return np.eye(3) + np.asarray(alpha, float)[..., None, None] * E12


def decompose_shear(alpha):
    """angle (...,), rotation and stretch (..., 3, 3) of F = rotation stretch, and its singular values."""
    x = np.asarray(alpha, float)
    k = np.arctan(x / 2)
    c, s = np.cos(k), np.sin(k)
    L, U = (np.zeros((*x.shape, 3, 3)) for _ in range(2))
    L[..., 0, 0] = L[..., 1, 1] = c
    L[..., 0, 1], L[..., 1, 0] = s, -s
    U[..., 0, 0], U[..., 0, 1], U[..., 1, 0], U[..., 1, 1] = c, s, s, c + x * s
    L[..., 2, 2] = U[..., 2, 2] = 1
    larger = 0.5 * (np.sqrt(4 + x**2) + np.abs(x))
    return SimpleNamespace(
        angle=k, rotation=L, stretch=U, stretches=np.stack([larger, np.ones_like(x), 1 / larger], -1)
    )


def held_shear(body, alpha, dalpha, time):
    """A Mooney-Rivlin body held to shear: alpha'' = -omega^2 alpha, omega^2 = 2 (a + b)/E_22."""
    W, E = body.material, body.system.E
    omega = np.sqrt(2 * (W.a + W.b) / E[1, 1])
    phase = omega * np.asarray(time, float)
    x = alpha * np.cos(phase) + dalpha / omega * np.sin(phase)
    dx = dalpha * np.cos(phase) - alpha * omega * np.sin(phase)
    F, dF = shear(x), dx[:, None, None] * E12
    held = (-(omega**2) * x)[:, None, None] * E12 @ E + W.gradient(F)
    return SimpleNamespace(alpha=x, dalpha=dx, F=F, dF=dF, constraint=held)
