"""Symmetric compositions of kicks and drifts: which weights, of what order, and their steps.

A step alternates kicks of the velocity, weights `kick`, and drifts of F, weights `drift`. A composition of
Verlet (or RATTLE) steps of lengths gamma_i h has drift = gamma. Momenta are updated from forces, never from
differences of F, and every sum is compensated. Sources: M. Suzuki, Phys. Lett. A 146 (1990) 319; W. Kahan and
R.-C. Li, Math. Comp. 66 (1997) 1089 (s9odr6a, s17odr8a); S. Blanes and P. C. Moan, J. Comput. Appl. Math. 142
(2002) 313 (the Nystrom method S11, 6, for kicks that depend on F only). Pseudo-rigid bodies, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.compiled import engine as compiled
from forceid.pseudorigid.material.materials import HadamardGreen, MooneyRivlin, NeoHookean
from forceid.pseudorigid.motion.system import AffineSystem, State

SUZUKI = 1 / (4 - 4 ** (1 / 3))
HALF_STEPS = {  # the first half of each symmetric table; the middle entry completes the sum to 1
    "verlet": (2, ()),
    "suzuki_4": (4, (SUZUKI, SUZUKI)),
    "kahan_li_6": (
        6,
        (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023),
    ),
    "kahan_li_8": (
        8,
        (
            0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641, 0.15884190655515560090,
            -0.39590389413323757734, 0.18453964097831570709, 0.25837438768632204729, 0.29501172360931029887,
        ),
    ),
}  # fmt: skip
BLANES_MOAN = (  # kicks and drifts of the first half; of each the last completes the sum
    (0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879),
    (0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928),
)
Law = tuple[float, float, float, float, bool, list[float]]  # a, b, c, d, with Gamma, 1/e


@dataclass(frozen=True)
class Splitting:
    """Weights of one step, sums 1: kick (stage + 1,), drift (stage,); its order."""

    order: int
    kick: tuple[float, ...]
    drift: tuple[float, ...]


def composition(order: int, half: tuple[float, ...]) -> Splitting:
    """Verlet steps of the lengths half, the rest, half reversed."""
    gamma = (*half, 1.0 - 2 * sum(half), *half[::-1])
    ends = (0.0, *gamma, 0.0)
    kick = tuple(0.5 * (ends[i] + ends[i + 1]) for i in range(len(gamma) + 1))
    return Splitting(order, kick, gamma)


def nystrom(order: int, kick: tuple[float, ...], drift: tuple[float, ...]) -> Splitting:
    """The symmetric table of which this is the first half."""
    kick = (*kick, 0.5 - sum(kick))
    return Splitting(order, (*kick, *kick[::-1]), (*drift, 1 - 2 * sum(drift), *drift[::-1]))


COMPOSITIONS = {name: composition(*table) for name, table in HALF_STEPS.items()}
SPLITTINGS = COMPOSITIONS | {"blanes_moan_6": nystrom(6, *BLANES_MOAN)}


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
