"""Symmetric compositions of kicks and drifts: which weights, and of what order.

A step alternates kicks of the velocity, weights `kick`, and drifts of F, weights `drift`. A composition of
Verlet (or RATTLE) steps of lengths gamma_i h has drift = gamma. Sources: M. Suzuki, Phys. Lett. A 146 (1990)
319; W. Kahan and R.-C. Li, Math. Comp. 66 (1997) 1089 (s9odr6a, s17odr8a); S. Blanes and P. C. Moan,
J. Comput. Appl. Math. 142 (2002) 313 (the Nystrom method S11, 6, for kicks that depend on F only).
Pseudo-rigid bodies, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass

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
