"""Patterns that the motion fixes and a channel may hold in unknown amounts: is the record likelier with them?

A wheel inside, a mass center or an inertia told wrong. The prior of the load has grown to what such a pattern
passed for, so that smaller loads are tried beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.records import Array, Indices
from forceid.significance import OUTLIER, TENTH

MOST_GAINED = 500.0  # log-likelihood beyond which odds are certain, and their numbers too large to hold
SIZES = 10  # of a load, each half of the last: to a thousandth


@dataclass(frozen=True)
class Held:
    """Log-likelihood that a record gains by a pattern; the amounts (column,) likeliest of it, their cov."""

    gained: float
    amounts: Array
    cov: Array


def patterns_held(
    look: Whitened, patterns: Sequence[tuple[Indices | slice, float | Array]], size: float
) -> list[Held]:
    """How far a record holds patterns: each some columns of what a channel may show, and the std of amounts.

    With and without one the load may be of any size up to the one found, and its mean as well, which is of
    this size: each half of the last, as long as the record is likelier with any pattern.
    """
    none: list[float] = []
    each: list[list[tuple[float, Array, Array]]] = [[] for _ in patterns]
    for mean_too in (False, True):
        highest = np.full(len(patterns), -np.inf)
        for share in 0.5 ** np.arange(mean_too, SIZES):
            one = look.filtered(look.prior.scaled(share, size * share**mean_too))
            v = np.nan_to_num(one.innovation)
            own, signals = np.clip(v[:, 0], -OUTLIER, OUTLIER), np.moveaxis(v[:, 1:], 1, 2)
            none.append(float(one.log_likelihood[0]))
            for found, (columns, std) in zip(each, patterns, strict=True):
                amount, cov, volume = amounts(signals[:, :, columns], own, std)
                more = 0.5 * float(amount @ np.linalg.solve(cov, amount)) - volume
                found.append((none[-1] + more, amount, cov))
            level = np.array([found[-1][0] for found in each])
            if not (level > highest + TENTH).any():
                break
            highest = np.maximum(level, highest)
    without = np.logaddexp.reduce(none)
    likeliest = [max(found, key=lambda one: one[0])[1:] for found in each]
    gained = [float(np.logaddexp.reduce([one[0] for one in found]) - without) for found in each]
    return [Held(min(g, MOST_GAINED), *best) for g, best in zip(gained, likeliest, strict=True)]


def amounts(signals: Array, innovation: Array, std: float | Array) -> tuple[Array, Array, float]:
    """How much of each signal (time, 3, column) innovations (time, 3) hold: (column,), and its covariance.

    std: of the amounts, before the record is seen. And half the logarithm by which seeing them narrows them.
    """
    A = signals.reshape(-1, signals.shape[2]) * std  # amounts of one beforehand
    told = A.T @ A + np.eye(len(A.T))
    cov = np.linalg.inv(told) * (std * np.ones(len(told)))[:, None] * std
    return cov @ (A.T @ innovation.ravel() / std), cov, 0.5 * float(np.linalg.slogdet(told)[1])
