"""Simple shear F = I + alpha e1 e2^T: its decomposition, the body held to it, and the body released from it.

Shear is no invariant manifold of the free body: a body that keeps it is held by forces. Held, E_22 alpha'' =
-2 (a + b) alpha of Mooney-Rivlin is harmonic at any amplitude; released, the master system holds.
Source: pseudo-rigid bodies, section 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.pseudorigid.body import Body
from forceid.pseudorigid.factors.cofactors import EYE, product
from forceid.pseudorigid.material.material_law import check_finite
from forceid.pseudorigid.material.materials import MooneyRivlin
from forceid.pseudorigid.motion.invariants import energy
from forceid.pseudorigid.motion.trajectory import Trajectory
from forceid.pseudorigid.validation import instants, real_values
from forceid.records import Array

E12 = np.outer(EYE[0], EYE[1])


@dataclass(frozen=True)
class ShearDecomposition:
    """Polar factors of a shear and its singular values.

    angle (...,) rad: L turns by -angle about e3; rotation L and stretch U (..., 3, 3), F = L U;
    stretches (..., 3), descending. alpha = 2 tan(angle); the image of e2 turns by
    arctan(alpha), which is not that angle.
    """

    angle: Array
    rotation: Array
    stretch: Array
    stretches: Array


@dataclass(frozen=True)
class HeldShear:
    """A Mooney-Rivlin body held to simple shear.

    time (time,) s; alpha, dalpha (time,); F, dF (time, 3, 3); energy (time,); constraint (time, 3, 3): what
    holds it, F'' E + dW/dF, the generalized force (Euler tensor) of the constraint, zero at e1 e2^T.
    """

    time: Array
    alpha: Array
    dalpha: Array
    F: Array
    dF: Array
    energy: Array
    constraint: Array


def shear(alpha: ArrayLike) -> Array:
    """F = I + alpha e1 e2^T (..., 3, 3)."""
    return np.asarray(EYE + validated_shears(alpha, "alpha")[..., None, None] * E12)


def validated_shears(value: ArrayLike, name: str) -> Array:
    """Finite numbers (...,). DataError."""
    x = real_values(value, name)
    if not np.isfinite(x).all():
        raise DataError("is not finite", name, "give finite shears")
    return x


def decompose_shear(alpha: ArrayLike) -> ShearDecomposition:
    """Polar factors and singular values in closed form. Source: pseudo-rigid bodies, section 6.

    >>> decompose_shear(1.5).stretches
    array([2. , 1. , 0.5])
    """
    x = validated_shears(alpha, "alpha")
    k = np.arctan(x / 2)
    c, s = np.cos(k), np.sin(k)
    L, U = (np.zeros((*x.shape, 3, 3)) for _ in range(2))
    L[..., 0, 0] = L[..., 1, 1] = c
    L[..., 0, 1], L[..., 1, 0] = s, -s
    U[..., 0, 0], U[..., 0, 1], U[..., 1, 0], U[..., 1, 1] = c, s, s, c + x * s
    L[..., 2, 2] = U[..., 2, 2] = 1
    larger = 0.5 * (np.sqrt(4 + x**2) + np.abs(x))
    return ShearDecomposition(k, L, U, np.stack([larger, np.ones_like(x), 1 / larger], -1))


def held_shear(body: Body, alpha: float, dalpha: float, time: ArrayLike) -> HeldShear:
    """Motion of a Mooney-Rivlin body held to shear, exactly: omega^2 = 2 (a + b)/E_22.

    Source: pseudo-rigid bodies, section 6 (i).

    >>> body = Body(np.diag([1.0, 2.0, 3.0]), MooneyRivlin(0.6, 0.4, 0.4, 3.6))
    >>> held_shear(body, 0.3, 0.0, [0.0, np.pi]).alpha
    array([ 0.3, -0.3])
    """
    W, E = body.material, body.system.E
    if not isinstance(W, MooneyRivlin):
        what = f"is {type(W).__name__}; a held shear is solved for Mooney-Rivlin"
        raise DataError(what, "material", "integrate the free body, or take MooneyRivlin")
    t = instants(time)
    check_finite("held shear", alpha=alpha, dalpha=dalpha)
    omega = np.sqrt(2 * (W.a + W.b) / E[1, 1])
    phase = omega * (t - t[0])
    x = alpha * np.cos(phase) + dalpha / omega * np.sin(phase)
    dx = dalpha * np.cos(phase) - alpha * omega * np.sin(phase)
    F, dF = shear(x), dx[:, None, None] * E12
    ddF = (-(omega**2) * x)[:, None, None] * E12
    held = product(ddF, np.broadcast_to(E, F.shape)) + W.gradient(F)
    return HeldShear(t, x, dx, F, dF, energy(F, dF, E, W), held)


def released_shear(body: Body, alpha: ArrayLike, time: ArrayLike, method: str = "verlet") -> Trajectory:
    """Free motion from rest in a shear alpha (...,), by the master system; it leaves shear at once.

    Source: pseudo-rigid bodies, section 6 (ii).
    """
    F0 = shear(alpha)
    return body.simulate(F0, np.zeros_like(F0), time, method)
