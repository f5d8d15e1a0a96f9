"""Steps of the master system: splittings, implicit midpoint, and one that keeps the energy.

Each changes a `State` by n steps of length h. Momenta are updated from forces, never from differences of F,
and every sum is compensated. Source: pseudo-rigid bodies, section 9.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from forceid.compiled import engine as compiled
from forceid.pseudorigid.factors.cofactors import determinant, inner, product, scaled, transpose
from forceid.pseudorigid.material.materials import HadamardGreen, MooneyRivlin, NeoHookean
from forceid.pseudorigid.motion.splittings import SPLITTINGS, Splitting
from forceid.pseudorigid.motion.system import AffineSystem, State, along_basis
from forceid.records import Array, Flags

NEWTON_ITERATIONS = 25
STEP_ROUNDING = 4 * float(np.finfo(float).eps)
KEPT_WITHIN = 1e-5  # of F: below, Newton keeps its derivative
SAME_STRAIN = 1e-5  # of C: below, the midpoint force keeps the energy to rounding by itself

Stepper = Callable[[AffineSystem, State, float, int], None]
Law = tuple[float, float, float, float, bool, list[float]]  # a, b, c, d, with Gamma, 1/e
Force = Callable[[Array], tuple[Array, Callable[[Array], Array]]]


def split_steps(system: AffineSystem, state: State, h: float, n: int, table: Splitting) -> None:
    """A splitting n times: linear group actions, so quadratic invariants J and C are kept exactly."""
    if compiled is not None and (law := compiled_law(system)) is not None:
        compiled_steps(law, state, h, n, table)
        return
    drift = [h * w for w in table.drift] * n
    kick = [h * w for w in table.kick[:-1]] * n
    for i in range(len(table.drift), len(kick), len(table.drift)):
        kick[i] += h * table.kick[-1]  # the last kick of a step and the first of the next are one
    kick.append(h * table.kick[-1])
    push = system.acceleration(state.F) if state.push is None else state.push
    for i, step in enumerate(drift):
        state.kick(kick[i] * push)
        state.drift(step * state.V)
        state.guard()
        push = system.acceleration(state.F)
    state.kick(kick[-1] * push)
    state.push = push


def compiled_law(system: AffineSystem) -> Law | None:
    """Constants of bodies whose splittings are compiled: Mooney-Rivlin and E = diag(e); else nothing."""
    W = system.material
    # a class derived from one of these may mean something else
    if system.columns is None or type(W) not in (MooneyRivlin, NeoHookean, HadamardGreen):
        return None
    assert isinstance(W, MooneyRivlin)
    return W.a, W.b, W.c, W.d, not W.incompressible, system.columns.tolist()


def compiled_steps(law: Law, state: State, h: float, n: int, table: Splitting) -> None:
    """`split_steps`, eight bodies at a time in the registers of the processor."""
    arrays = [
        np.ascontiguousarray(np.moveaxis(X, 0, -1)) for X in (state.F, state.V, state.F_low, state.V_low)
    ]
    stopped = np.zeros(len(state.F), np.int8)
    kick, drift = ([h * w for w in weights] for weights in (table.kick, table.drift))
    compiled.steps(*arrays, stopped, kick, drift, n, *law)
    state.F, state.V, state.F_low, state.V_low = (np.moveaxis(X, -1, 0) for X in arrays)
    state.stopped |= stopped.astype(bool)


def midpoint_steps(system: AffineSystem, state: State, h: float, n: int) -> None:
    """The implicit midpoint rule n times, Newton to rounding: order 2, J and C exactly, any stiffness.

    Z = F + h/2 V + h^2/4 a(Z), V += h a(Z), F += h/2 (V_0 + V_1).
    """
    for _ in range(n):
        known = state.F + (state.F_low + 0.5 * h * state.V)

        def residual(Z: Array, known: Array = known) -> Array:
            return np.asarray(Z - known - 0.25 * h**2 * system.acceleration(Z))

        def slope(Z: Array) -> Array:
            return np.asarray(np.eye(9) + 0.25 * h**2 * system.stiffness(Z))

        Z, failed = solve_step(residual, slope, known, state.stopped)
        state.park(failed)
        Z[state.stopped] = state.F[state.stopped]
        finish(state, h, system.acceleration(Z))


def energy_steps(system: AffineSystem, state: State, h: float, n: int) -> None:
    """The discrete gradient of Gonzalez n times, Newton to rounding: H and J exactly, order 2.

    The force is F_1/2 S with S = 2 dW/dC at the mean of C = F^T F, corrected along Delta C so that its work
    is Delta W. C is kept only where S commutes with F_1/2^T F_1/2. Needs W(QF) = W(F). Source: pseudo-rigid
    bodies, section 9; O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449.
    """
    for _ in range(n):
        F0, W0 = state.F, system.material.energy(state.F)
        known = F0 + (state.F_low + h * state.V)
        change = product(transpose(known), known) - product(transpose(F0), F0)
        worth = np.sqrt(inner(change, change)) > SAME_STRAIN * inner(F0, F0)
        force = partial(discrete_gradient, system, F0, W0=W0, worth=worth)

        def residual(F1: Array, known: Array = known, force: Force = force) -> Array:
            return np.asarray(F1 - known + 0.5 * h**2 * system.over_moment(force(F1)[0]))

        def slope(F1: Array, force: Force = force) -> Array:
            rows = system.over_moment(force(F1)[1](along_basis(F1)[1])).reshape(9, len(F1), 9)
            return np.asarray(np.eye(9) + 0.5 * h**2 * np.moveaxis(rows, 0, -1))

        F1, failed = solve_step(residual, slope, known, state.stopped)
        state.park(failed)
        F1[state.stopped] = state.F[state.stopped]
        finish(state, h, -system.over_moment(force(F1)[0]))


def finish(state: State, h: float, push: Array) -> None:
    """V and F at the end of a step from the force within it."""
    half = 0.5 * h
    push[state.stopped] = 0.0
    state.drift(half * state.V)
    state.kick(h * push)
    state.drift(half * state.V)
    state.guard()
    state.push = None


def discrete_gradient(
    system: AffineSystem, F0: Array, F1: Array, W0: Array, worth: Flags
) -> tuple[Array, Callable[[Array], Array]]:
    """Force (body, 3, 3) whose work from F0 to F1 is W(F1) - W(F0), and its derivative along H by F1."""
    material = system.material
    C0, C1 = product(transpose(F0), F0), product(transpose(F1), F1)
    mean, change = 0.5 * (F0 + F1), C1 - C0
    # any U with U^T U = C serves
    U = transpose(np.asarray(np.linalg.cholesky(0.5 * (C0 + C1)), np.float64))
    U_inv = np.asarray(np.linalg.inv(U), np.float64)
    S = product(U_inv, material.gradient(U))
    S = 0.5 * (S + transpose(S))
    square = np.where(worth, inner(change, change), 1.0)
    miss = np.where(worth, (2 * (material.energy(F1) - W0) - inner(S, change)) / square, 0.0)
    total = S + scaled(miss, change)

    def along(H: Array) -> Array:
        dC = product(transpose(F1), H)
        dC = dC + transpose(dC)
        dU = 0.25 * product(transpose(U_inv), dC)  # of dC/2, the change of the mean of C
        dS = product(U_inv, material.hessian(np.broadcast_to(U, dU.shape), dU) - product(dU, S))
        dS = 0.5 * (dS + transpose(dS))
        dmiss = 2 * inner(material.gradient(F1), H) - inner(dS, change) - inner(S, dC)
        dmiss = np.where(worth, (dmiss - 2 * miss * inner(change, dC)) / square, 0.0)
        return np.asarray(
            0.5 * product(H, total) + product(mean, dS + scaled(dmiss, change) + scaled(miss, dC))
        )

    return product(mean, total), along


def solve_step(
    residual: Callable[[Array], Array], slope: Callable[[Array], Array], start: Array, skip: Flags
) -> tuple[Array, Flags]:
    """Root (body, 3, 3) by Newton's method to rounding, and where it fails; bodies of `skip` are left."""
    Z, size = start.copy(), np.abs(start).max((-2, -1))
    last = np.full(len(Z), np.inf)
    folded = ~(determinant(Z) > 0)  # no material is asked about them
    last[folded] = np.nan
    Z[skip | folded] = np.eye(3)
    done = skip | folded
    derivative = None
    for _ in range(NEWTON_ITERATIONS):
        if derivative is None or (last[~done] > KEPT_WITHIN * size[~done]).any():
            derivative = slope(Z)
        step = np.linalg.solve(derivative, residual(Z).reshape(len(Z), 9, 1)).reshape(Z.shape)
        moved = np.abs(step).max((-2, -1))
        moved[done] = 0.0
        # at rounding steps stop shrinking
        settled = (moved <= STEP_ROUNDING * size) | ((moved < 1e-9 * size) & (moved >= 0.5 * last))
        step[done] = 0.0
        Z = Z - step
        lost = ~done & ~(np.isfinite(moved) & (determinant(Z) > 0))
        Z[lost] = np.eye(3)
        last = np.where(lost, np.nan, moved)
        done |= settled | lost
        if done.all():
            break
    failed = (np.isnan(last) | ~done) & ~skip
    return Z, failed


STEPPERS: dict[str, Stepper] = {
    **{name: partial(split_steps, table=table) for name, table in SPLITTINGS.items()},
    "implicit_midpoint": midpoint_steps,
    "energy": energy_steps,
}
