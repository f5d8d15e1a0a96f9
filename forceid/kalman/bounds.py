"""How well anything can be known: steady covariances of filter and smoother, and their closed forms.

A bound belongs to a prior: averaged over loads drawn from it, no estimator does better; on one smooth record
one may.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import ConfigError, EstimationError
from forceid.kalman.covariance import root
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import ROUNDED


@dataclass(frozen=True)
class Steady:
    """Covariances (state, state) far from both ends of a long record, before and after the sample at hand.

    predicted: given all earlier samples; filtered: and the one at hand; smoothed: and all later ones.
    samples: after how many the covariance no longer changes, a power of two.
    """

    predicted: Array
    filtered: Array
    smoothed: Array
    samples: int


def steady(model: StateSpace) -> Steady:
    """Steady covariances of the filter and the smoother of a constant model; x0, u play no part.

    By doubling: one step of Riccati's recursion, composed with itself, spans 2, 4, 8 ... samples, and carries
    along the covariance of the state given earlier samples and the information of later ones; no eigenvectors
    of the pencil, which lose digits where a prior is many times integrated. Starts at model.P0, so that a
    constant that nothing measures keeps its prior.

    Raises ConfigError for a model that changes with time, EstimationError where the covariance never
    settles or R is not positive definite. Source: Anderson (1978), Second-order convergent algorithms for the
    steady-state Riccati equation; Chu, Fan, Lin, Wang (2004).

    >>> level = StateSpace(np.eye(1), np.eye(1), np.eye(1), np.eye(1), np.zeros(1), np.eye(1))
    >>> s = steady(level)  # (sqrt(5) + 1) / 2, (sqrt(5) - 1) / 2 and 1 / sqrt(5)
    >>> print(np.round([s.predicted[0, 0], s.filtered[0, 0], s.smoothed[0, 0]], 6))
    [1.618034 0.618034 0.447214]
    """
    for name in ("F", "Q", "H", "R"):
        if getattr(model, name).ndim != 2:
            raise ConfigError(
                f"changes with time, expected one matrix (got shape {getattr(model, name).shape})",
                f"{name} of the model",
                "take the covariances of kalman.smooth instead",
            )
    root(model.R)
    # meters and newtons per second differ by many decades: a first pass finds the units for the second
    unit = np.ones(len(model.F))
    for _ in range(2):
        F, Q, H = model.F * unit / unit[:, None], model.Q / np.outer(unit, unit), model.H * unit
        P, Y, samples = settle(F, Q, H, model.R, model.P0 / np.outer(unit, unit))
        size = np.sqrt(np.maximum(np.diagonal(P), 0.0))
        found = unit * np.where(size > 0, size, 1.0)
        scale, unit = unit, found
    one = np.eye(len(F))
    K = np.linalg.solve(H @ P @ H.T + model.R, H @ P).T
    filtered = (one - K @ H) @ P @ (one - K @ H).T + K @ model.R @ K.T
    spread, axes = np.linalg.eigh(P)
    C = axes * np.sqrt(np.maximum(spread, 0.0))
    smoothed = C @ np.linalg.solve(one + C.T @ Y @ C, C.T)
    back = np.outer(scale, scale)
    P, filtered, smoothed = (back * 0.5 * (a + a.T) for a in (P, filtered, smoothed))
    return Steady(P, filtered, smoothed, samples)


def settle(F: Array, Q: Array, H: Array, R: Array, P0: Array) -> tuple[Array, Array, int]:
    """Predicted covariance P, information Y of the sample at hand and all later ones, samples spanned."""
    one, n = np.eye(len(F)), len(F)
    A, X, Y = F, Q, H.T @ np.linalg.solve(R, H)
    P = P0
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(np.finfo(float).maxexp):  # doublings: by then what grows has overflowed
            # over 2^k samples a start P comes out as X + A P (1 + Y P)^-1 A^T
            last, P = P, X + A @ P0 @ np.linalg.solve(one + Y @ P0, A.T)
            size = np.sqrt(np.maximum(np.diagonal(P), ROUNDED * np.diagonal(P0)))
            if not np.isfinite(P).all():
                break
            if np.all(np.abs(P - last) <= ROUNDED * np.outer(size, size)):
                return 0.5 * (P + P.T), Y, 2**k
            both = np.linalg.solve(one + X @ Y, np.hstack([X @ A.T, A]))
            X, Y, A = (
                X + A @ both[:, :n],
                Y + A.T @ Y @ both[:, n:],
                A @ both[:, n:],
            )
            X, Y = 0.5 * (X + X.T), 0.5 * (Y + Y.T)
    raise EstimationError(
        "grows without end, expected a steady one: some state is driven, and no measurement shows it",
        "the covariance of the model",
        "measure that state (observability.pbh names it), or give it a prior that returns to zero",
    )


def driven_load_bound(p: int, Q: float, mass: float, r: float) -> float:
    """Smoother variance of a load on a mass whose position is measured; load spectrum Q / w^2p.

    p: 1 for a random walk, 2 for a Matern 3/2 above its rate; Q: N^2 s^(1-2p); r: position noise density
    sigma^2 dt, m^2 s. Source: principal equations 4e.

    >>> print(f"{np.sqrt(driven_load_bound(1, Q=50.0, mass=0.1, r=1e-4**2 / 1000)):.6f} N")
    0.243226 N
    """
    a, power = Q / (mass**2 * r), 2 * p + 4
    return float(Q * a ** (-(2 * p - 1) / power) / (power * np.sin(5 * np.pi / power)))
