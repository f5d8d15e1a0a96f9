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
PIECES = (2, 4)  # of a record, in which a pattern that is none will differ
SIZES = 10  # of a load, each half of the last: to a thousandth


@dataclass(frozen=True)
class Held:
    """Log-likelihood that a record gains by a pattern; the amounts (column,) likeliest of it, their cov.

    apart: what it gains by amounts of their own in each half of the record, and in each quarter.
    """

    gained: float
    apart: tuple[float, ...]
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
    each: list[list[tuple[float, Array, Array, Array]]] = [[] for _ in patterns]
    for mean_too in (False, True):
        highest = np.full(len(patterns), -np.inf)
        for share in 0.5 ** np.arange(mean_too, SIZES):
            one = look.filtered(look.prior.scaled(share, size * share**mean_too))
            v = np.nan_to_num(one.innovation)
            at = np.arange(len(v))
            own, signals = np.clip(v[:, 0], -OUTLIER, OUTLIER), np.moveaxis(v[:, 1:], 1, 2)
            none.append(float(one.log_likelihood[0]))
            for found, (columns, std) in zip(each, patterns, strict=True):
                amount, cov, more = amounts(signals[:, :, columns], own, std)
                apart = [
                    sum(amounts(signals[k][..., columns], own[k], std)[2] for k in np.array_split(at, pieces))
                    for pieces in PIECES
                ]
                found.append((none[-1] + more, amount, cov, none[-1] + np.array(apart, float)))
            level = np.array([found[-1][0] for found in each])
            if not (level > highest + TENTH).any():
                break
            highest = np.maximum(level, highest)
    without = np.logaddexp.reduce(none)
    held = []
    for found in each:
        _, amount, cov, _ = max(found, key=lambda one: one[0])
        gained = float(np.logaddexp.reduce([one[0] for one in found]) - without)
        in_parts = np.logaddexp.reduce([one[3] for one in found]) - without
        held.append(Held(min(gained, MOST_GAINED), tuple(in_parts.tolist()), amount, cov))
    return held


def amounts(signals: Array, innovation: Array, std: float | Array) -> tuple[Array, Array, float]:
    """How much of each signal (time, 3, column) innovations (time, 3) hold: (column,), and its covariance.

    std: of the amounts, before the record is seen. And the log-likelihood that it gains by them.
    """
    A = signals.reshape(-1, signals.shape[2]) * std  # amounts of one beforehand
    told = A.T @ A + np.eye(len(A.T))
    cov = np.linalg.inv(told) * (std * np.ones(len(told)))[:, None] * std
    seen = A.T @ innovation.ravel()
    gained = 0.5 * float(seen @ np.linalg.solve(told, seen) - np.linalg.slogdet(told)[1])
    return cov @ (seen / std), cov, gained
