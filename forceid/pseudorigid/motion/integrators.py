"""Steps of the master system: kicks and drifts by a table, compiled for the commonest materials.

They change a `State` by n steps of length h. Momenta are updated from forces, never from differences of F,
and every sum is compensated. Source: pseudo-rigid bodies, section 9.
"""

from __future__ import annotations

import numpy as np

from forceid.compiled import engine as compiled
from forceid.pseudorigid.material.materials import HadamardGreen, MooneyRivlin, NeoHookean
from forceid.pseudorigid.motion.splittings import Splitting
from forceid.pseudorigid.motion.system import AffineSystem, State

Law = tuple[float, float, float, float, bool, list[float]]  # a, b, c, d, with Gamma, 1/e


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
