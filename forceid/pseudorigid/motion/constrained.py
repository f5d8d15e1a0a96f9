"""Bodies with det F = 1: RATTLE and its compositions, the multiplier, and the pressure that it means.

E F'' = -dW/dF + Lambda cof F. One scalar multiplier a step along cof(F_0) E^-1 makes det F_1 = 1 a cubic
equation, solved by Newton's method from zero. Source: pseudo-rigid bodies, sections 8 and 9.
"""

from __future__ import annotations

import numpy as np

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import cofactor, determinant, inner, inverse, product, trace
from forceid.pseudorigid.motion.splittings import Splitting
from forceid.pseudorigid.motion.system import AffineSystem, State
from forceid.records import Array

VOLUME_ITERATIONS = 30
VOLUME_ROUNDING = 4 * float(np.finfo(float).eps)
VOLUME_HELD = 1e-9  # of det F = 1 and of tr F^-1 F' = 0 at the start, by the rate of F


def multiplier(system: AffineSystem, F: Array, V: Array, pull: Array | float = 0.0) -> Array:
    """Lambda (...,) that keeps det F constant; for a homogeneous fluid ball p_c = rho Lambda / 2.

    F, V = F' (..., 3, 3); pull (..., 3, 3) 1/s2: what loads and damping add to F''. Lambda > 0 is pressure,
    Lambda < 0 tension. Units of energy. Source: pseudo-rigid bodies, section 8.

    >>> from forceid.pseudorigid.material.materials import MooneyRivlin
    >>> W = MooneyRivlin(0.5, 0.25, incompressible=True)
    >>> float(multiplier(AffineSystem(W, np.eye(3)), np.eye(3), np.zeros((3, 3))))  # carries Gamma'(1)
    2.0
    """
    C, inv = cofactor(F), inverse(F)
    Y = product(inv, V)
    free = trace(product(Y, Y)) - trace(product(inv, system.acceleration(F) + pull))
    return np.asarray(free / trace(product(inv, system.over_moment(C))))


def driven_acceleration(system: AffineSystem, F: Array, V: Array, pull: Array | float = 0.0) -> Array:
    """F'' (..., 3, 3) with what loads add and, where det F = 1 is imposed, the multiplier.

    That is index reduced: det F drifts with the errors of an integrator.
    """
    free = system.acceleration(F) + pull
    if not system.constrained:
        return free
    return np.asarray(
        free + multiplier(system, F, V, pull)[..., None, None] * system.over_moment(cofactor(F))
    )


def rattle_steps(system: AffineSystem, state: State, h: float, n: int, table: Splitting) -> None:
    """RATTLE n times, composed by `table`: det F = 1 to rounding, J and C exactly, H bounded."""
    push = system.acceleration(state.F) if state.push is None else state.push
    for gamma in table.drift * n:
        step = gamma * h
        normal = system.over_moment(cofactor(state.F))
        state.kick(0.5 * step * push)
        s = volume_root(state.F + (state.F_low + step * state.V), (0.5 * step**2) * normal)
        state.kick((0.5 * step) * s[:, None, None] * normal)
        state.drift(step * state.V)
        state.guard()
        push = system.acceleration(state.F)
        state.kick(0.5 * step * push)
        tangent(system, state)
    state.push = push


def volume_root(A: Array, K: Array) -> Array:
    """The s (...,) next to zero with det(A + s K) = 1; NaN where Newton's method does not find it."""
    p0, p1, p2, p3 = determinant(A) - 1, inner(cofactor(A), K), inner(A, cofactor(K)), determinant(K)
    s = np.zeros_like(p0)
    last = np.full_like(p0, np.inf)
    settled = np.zeros(p0.shape, bool)
    for _ in range(VOLUME_ITERATIONS):
        slope = p1 + s * (2 * p2 + 3 * s * p3)
        step = (p0 + s * (p1 + s * (p2 + s * p3))) / np.where(slope == 0, np.nan, slope)
        s = s - step
        effect = np.abs(step * slope)  # on det F
        settled |= (effect <= VOLUME_ROUNDING) & (effect < 1) | ((effect < 1e-12) & (effect >= 0.5 * last))
        last = effect
        if (settled | ~np.isfinite(s)).all():
            break
    return np.asarray(np.where(settled, s, np.nan))


def tangent(system: AffineSystem, state: State) -> None:
    """Take from V what changes the volume, along cof(F) E^-1: tr F^-1 V = 0."""
    C = cofactor(state.F)
    normal = system.over_moment(C)
    for _ in range(2):  # once in full, once its rounding
        excess = (inner(C, state.V) + inner(C, state.V_low)) / inner(C, normal)
        state.kick(-excess[:, None, None] * normal)


def check_volume(F: Array, V: Array) -> None:
    """DataError unless det F = 1 and tr F^-1 F' = 0 at the start of an incompressible body."""
    J = determinant(F)
    off = np.abs(J - 1)
    if off.max() > VOLUME_HELD:
        worst = float(J.flat[off.argmax()])
        advice = f"divide F0 by det(F0)^(1/3) = {np.cbrt(worst):.10g}"
        raise DataError(f"has det F0 = {worst:.10g}, expected 1", "incompressible body", advice)
    rate = trace(product(inverse(F), V))
    size = np.maximum(np.sqrt(inner(V, V)), 1e-300)
    if (np.abs(rate) / size).max() > VOLUME_HELD:
        worst = float(rate.flat[np.abs(rate / size).argmax()])
        advice = f"subtract {worst / 3:.6g} F0 from dF0"
        what = f"has tr(F0^-1 dF0) = {worst:.6g}, expected 0: its volume changes"
        raise DataError(what, "incompressible body", advice)
