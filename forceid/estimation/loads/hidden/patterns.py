"""Patterns that the motion fixes and a channel may hold in unknown amounts: is the record likelier with them?

A wheel inside, a mass center or an inertia told wrong. The prior of the load was tuned on a record in which
such a pattern passed for a load, or took one away. So smaller loads are tried beside it, as loud as the one
found at high frequencies alone, where patterns are not; and loads as large along every axis as along the
strongest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import TypeAlias

import numpy as np
from scipy.special import huber

from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.records import Array, Indices
from forceid.significance import OUTLIER, TENTH

Smaller: TypeAlias = "Callable[[float, float, bool], tuple[float, Array]]"

MOST_GAINED = 500.0  # log-likelihood beyond which odds are certain, and their numbers too large to hold
QUARTERS = 4  # of a record, in which a pattern that is none will differ
SIZES = 10  # of a load, each half of the last: to a thousandth; to a millionth where the pattern is known


@dataclass(frozen=True)
class Held:
    """Log-likelihood that a record gains by a pattern; the amounts (column,) likeliest of it, their cov.

    apart: what it gains by amounts of their own in all halves of the record, and in all quarters; throughout:
    whether every quarter gains by the amounts of the whole.
    """

    gained: float
    apart: tuple[float, ...]
    throughout: bool
    amounts: Array
    cov: Array


def under_smaller(look: Whitened, size: float) -> Smaller:
    """What a channel shows under a share of the load found, with a mean of a share of this size, and whether
    that is alike along all axes.

    The log-likelihood of the record, and `products_in_parts`; each share is filtered once, whoever asks.
    """

    @cache
    def under(share: float, of_mean: float, alike: bool) -> tuple[float, Array]:
        prior = look.prior.alike() if alike else look.prior
        one = look.filtered(prior.rarely_slow(share, size * of_mean))
        return float(one.log_likelihood[0]), products_in_parts(np.nan_to_num(one.innovation))

    return under


def patterns_held(
    look: Whitened, under: Smaller, patterns: Sequence[tuple[Indices | slice | list[int], float | Array]]
) -> list[Held]:
    """How far a record holds patterns: each some columns of what a channel may show, and the std of amounts.

    under: the channel under smaller loads. With and without a pattern the load may be of any size up to the
    one found, and its mean as well: each half of the last, while the record is likelier with any pattern; and
    so may one that is alike along all axes.
    """
    every, none = np.arange(look.also.shape[2]), list[float]()
    own = [(every[columns], std * np.ones(len(every[columns]))) for columns, std in patterns]
    each: list[list[tuple[Array, Array, Array, bool]]] = [[] for _ in patterns]
    along = (False,) if look.prior.is_alike else (False, True)
    for mean_too, alike in product((False, True), along):
        highest = np.full(len(patterns), -np.inf)
        for share in 0.5 ** np.arange(mean_too, SIZES):
            likely, products = under(float(share), float(share**mean_too), alike)
            none.append(likely)
            for found, (columns, std) in zip(each, own, strict=True):
                amount, cov, more, throughout = amounts(products, columns, std)
                found.append((none[-1] + more, amount, cov, throughout))
            level = np.array([found[-1][0][0] for found in each])
            if not (level > highest + TENTH).any():
                break
            highest = np.maximum(level, highest)
    without, held = np.logaddexp.reduce(none), []
    for found in each:
        _, amount, cov, throughout = max(found, key=lambda one: one[0][0])
        gained, *apart = (np.logaddexp.reduce([one[0] for one in found]) - without).tolist()
        held.append(Held(min(gained, MOST_GAINED), tuple(apart), throughout, amount, cov))
    return held


def likeliest_amounts(look: Whitened, columns: slice, std: float, about: Array) -> Array:
    """How much (column,) a record holds of a pattern that it is known to hold, and that about so much.

    The load may be of any size up to the one found, each half of the last. Under one so small that the
    pattern alone explains the record, most innovations are outliers: here these are held back in what the
    pattern leaves (Huber, Robust Statistics (1981) 7).
    """
    alone, best = replace(look, also=look.also[..., columns]), (-np.inf, about)
    for share in 0.5 ** np.arange(2 * SIZES):
        one = alone.filtered(look.prior.scaled(share, np.sqrt(look.prior.start.mean)))
        seen, *rows = (a.ravel() for a in np.nan_to_num(one.innovation).swapaxes(0, 1))
        S = np.array(rows)
        left = seen - about @ S
        told = S @ S.T + np.eye(len(S)) / std**2
        about = about + np.linalg.solve(told, S @ np.clip(left, -OUTLIER, OUTLIER) - about / std**2)
        cost = huber(OUTLIER, seen - about @ S).sum() + 0.5 * (about @ about) / std**2
        likely = one.log_likelihood[0] + 0.5 * (seen @ seen) - cost - 0.5 * np.linalg.slogdet(told)[1]
        best = max(best, (float(likely), about), key=lambda found: found[0])
    return best[1]


def products_in_parts(innovation: Array) -> Array:
    """Products (1 + 2 + 4, column, column) of whitened innovations (time, column, 3), the first the record's.

    Of a whole record, of its halves and of its quarters.
    """
    own = np.clip(innovation[:, :1], -OUTLIER, OUTLIER)
    rows = np.concatenate([own, innovation[:, 1:]], 1).swapaxes(0, 1)
    quarters = np.stack(
        [(a := part.reshape(len(part), -1)) @ a.T for part in np.array_split(rows, QUARTERS, 1)]
    )
    halves = quarters.reshape(2, -1, *quarters.shape[1:]).sum(1)
    return np.concatenate([quarters.sum(0, keepdims=True), halves, quarters])


def amounts(products: Array, columns: Indices, std: Array) -> tuple[Array, Array, Array, bool]:
    """How much of some signals (column,) innovations hold: (column,), its covariance, and what they gain.

    products: of parts of a record; std (column,): of the amounts, before the record is seen. Gained (3,): the
    log-likelihood by these amounts, and by ones of their own in each half, and in each quarter; and whether
    every quarter gains by these.
    """
    at = 1 + columns
    told = std[:, None] * products[:, at[:, None], at] * std + np.eye(len(std))  # amounts of one beforehand
    seen = products[:, at, 0] * std
    likely = np.linalg.solve(told, seen[..., None])[..., 0]
    gained = 0.5 * ((seen * likely).sum(1) - np.linalg.slogdet(told)[1])
    cov = std[:, None] * np.linalg.inv(told[0]) * std
    throughout = seen @ likely[0] - 0.5 * likely[0] @ (told - np.eye(len(std))) @ likely[0]
    return std * likely[0], cov, np.add.reduceat(gained, [0, 1, 3]), bool((throughout[-QUARTERS:] > 0).all())
