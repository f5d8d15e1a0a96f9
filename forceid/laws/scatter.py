"""By how much coefficients differ from flight to flight: a law whose coefficients are drawn anew for each.

Of flight g the scores s of the coefficients about the common fit have mean J d and covariance l J + J T J,
with J their information, d the coefficients less their common values, l the level of the residuals, and T
the variances of the coefficients from flight to flight (random effects; Laird and Ware, Biometrics 38 (1982)
963). T is that of the restricted likelihood, in which d has no part. The common fit then has the covariance
L (sum l J + J T J) L, L the inverse of the sum of J, and as many degrees of freedom as its part of the
variance has by G flights (Satterthwaite, Biometrics Bulletin 2 (1946) 110).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import t

from forceid.records import Array
from forceid.rounding import SOLVED

AT_FIRST = (0.3, 3.0)  # deviations of a coefficient by one flight, from which its scatter is sought
SOUGHT = 1e4  # times those, and their inverse: less is none


@dataclass(frozen=True)
class Scatter:
    """std (term,) of the coefficients from flight to flight; cov (term, term) of their common values, with
    factor (term,): deviations in an interval of which half of what is left lies on either side.
    """

    std: Array
    cov: Array
    factor: Array


def scatter_between(score: Array, information: Array, cov: Array, half: float) -> Scatter:
    """How coefficients scatter by scores (flight, term) and information (flight, term, term) of flights.

    cov (term, term): of the common values if none scatters; half: the quantile of an interval.

    >>> each = np.array([[-3.0], [0.0], [3.0]])  # of one number, known to 1 in each
    >>> found = scatter_between(each, np.ones((3, 1, 1)), np.ones((1, 1)) / 3, 0.975)
    >>> (found.std**2).round(2).tolist(), found.cov.round(2).tolist()  # 9 less 1, over all three
    ([8.0], [[3.0]])
    """
    flights, terms = score.shape
    total = information.sum(0)
    level = float(np.trace(cov @ total)) / terms
    roots = [halves(s, J) for s, J in zip(score, information, strict=True)]
    size = np.sqrt(flights * level / np.diag(total))

    def unlikeliness(log_std: Array) -> float:
        T, square, among, vector = np.exp(2 * log_std), 0.0, np.zeros((terms, terms)), np.zeros(terms)
        for A, z in roots:
            L = np.linalg.cholesky(level * np.eye(len(z)) + (A * T) @ A.T)
            white = np.linalg.solve(L, np.column_stack([A, z]))
            a, y = white[:, :-1], white[:, -1]
            among, vector = among + a.T @ a, vector + a.T @ y
            square += float(y @ y) + 2 * float(np.log(np.diag(L)).sum())
        return square - float(vector @ np.linalg.solve(among, vector)) + float(np.linalg.slogdet(among)[1])

    ends = list(zip(np.log(size / SOUGHT), np.log(size * SOUGHT), strict=True))
    found = [minimize(unlikeliness, np.log(f * size), method="L-BFGS-B", bounds=ends) for f in AT_FIRST]
    std = np.exp(min(found, key=lambda one: one.fun).x)
    back = np.linalg.inv(total)
    own = back @ np.sum([(J * std**2) @ J for J in information], 0) @ back
    whole = cov + own
    share = np.diag(own) / np.diag(whole)
    freedoms = (flights - 1) / np.maximum(share**2, 1 / SOUGHT**2)
    return Scatter(std, whole, np.asarray(t.ppf(half, freedoms)))


def halves(score: Array, information: Array) -> tuple[Array, Array]:
    """What a flight shows of its coefficients: rows A (number, term) and z (number,) of unit information."""
    size, axes = np.linalg.eigh(information)
    kept = size > SOLVED * size[-1]
    root = np.sqrt(size[kept])
    return root[:, None] * axes[:, kept].T, (axes[:, kept].T @ score) / root
