"""Which terms of a law the flights ask for, by evidence: no more than is needed.

About its best a law of all terms has a likelihood that is normal in its coefficients, with mean c and
covariance C. To set those of E to zero costs chi-square c_E^T C_EE^-1 c_E, the others at their best. The
evidence of a set of terms, under priors worth one number seen (unit information), is up to a constant

    -2 log evidence = chi-square + terms * log(numbers seen)    (Schwarz 1978; Kass and Wasserman 1995).

A set that is nearly as likely may have other coefficients altogether, where the motion hardly tells its terms
apart: what these differ by belongs to the claim, by how likely each set is (Draper 1995).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forceid.records import Array
from forceid.significance import CHANCE


def price(numbers: int) -> float:
    """Chi-square that one more term has to gain, of that many numbers seen."""
    return float(np.log(max(numbers, 2)))


def cost(value: Array, cov: Array, kept: frozenset[int], numbers: int) -> float:
    """-2 log evidence of the terms kept, over that of all without their price."""
    out = [k for k in range(len(value)) if k not in kept]
    chi_square = float(value[out] @ np.linalg.solve(cov[np.ix_(out, out)], value[out])) if out else 0.0
    return chi_square + len(kept) * price(numbers)


def choose(value: Array, cov: Array, always: Sequence[int], numbers: int) -> tuple[int, ...]:
    """The terms (indices) of most evidence: from all of them and from the fewest on, one in or out at a time.

    value (term,), cov (term, term): of the law of all terms; always: terms that stay.

    >>> choose(np.array([5.0, 0.1, -4.0]), np.eye(3), (), 100)
    (0, 2)
    """
    size = np.sqrt(np.diag(cov))
    scaled, spread, fixed = value / size, cov / np.outer(size, size), frozenset(always)
    every = frozenset(range(len(value)))

    def of(kept: frozenset[int]) -> float:
        return cost(scaled, spread, kept, numbers)

    ends: list[frozenset[int]] = []
    for kept in (every, fixed):
        best = of(kept)
        while True:
            near = sets_beside(kept, every, fixed)
            nearest = near[int(np.argmin([of(one) for one in near]))]
            if not of(nearest) < best:
                break
            kept, best = nearest, of(nearest)
        ends.append(kept)
    return tuple(sorted(ends[int(np.argmin([of(one) for one in ends]))]))


def sets_beside(kept: frozenset[int], every: frozenset[int], fixed: frozenset[int]) -> list[frozenset[int]]:
    """A set of terms, and those that differ by one term in or out, or by one for another."""
    swaps = [kept ^ {i, j} for i in kept - fixed for j in every - kept]
    return [kept, *(kept ^ {k} for k in every - fixed), *swaps]


def of_other_terms(
    value: Array, cov: Array, which: Sequence[int], always: Sequence[int], numbers: int
) -> Array:
    """Covariance (kept, kept) that the terms kept have beside their own, as other sets are nearly as likely.

    value, cov: as of `choose`; which: the terms kept. By the law of total variance, over the neighbors that
    are likelier than CHANCE beside the set: no interval of 95 % is as wide as all that is possible.

    >>> of_other_terms(np.array([5.0, 2.0]), np.array([[1.0, 0.9], [0.9, 1.0]]), (0,), (), 100).round(2)
    array([[1.72]])
    """
    size = np.sqrt(np.diag(cov))
    scaled, spread = value / size, cov / np.outer(size, size)
    told, own = np.linalg.inv(spread), list(which)
    near = sets_beside(frozenset(which), frozenset(range(len(value))), frozenset(always))
    costs = np.array([cost(scaled, spread, kept, numbers) for kept in near])
    weight = np.exp(-0.5 * (costs - costs.min()))
    weight[weight < CHANCE * weight[0]] = 0.0
    found, added = [], []
    for kept in map(sorted, near):
        mean, var = np.zeros(len(value)), np.zeros_like(spread)
        inner = np.ix_(kept, kept)
        var[inner] = np.linalg.inv(told[inner])
        mean[kept] = var[kept] @ told @ scaled
        found.append(mean[own])
        added.append(var[np.ix_(own, own)])
    off, more = np.array(found) - found[0], np.array(added) - added[0]
    joint = np.einsum("m,mij->ij", weight / weight.sum(), more + off[:, :, None] * off[:, None])
    return np.asarray(joint * np.outer(size[own], size[own]))
