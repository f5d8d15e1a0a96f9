"""State-space models and data that the races run on: stable, time-invariant, on a regular clock."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from forceid import kalman

Arrays = np.ndarray


def matern_bank(orders: list[int], channels: int, seed: int) -> kalman.StateSpace:
    """Matérn processes of several rates; each channel reads a state, and a little of all the others.

    The channels are as many as processes, and read these, or as many as states. From the start at the
    stationary covariance the gains come to rest within 50 to 100 samples: every engine that notices has the
    same chance.
    """
    rng = np.random.default_rng(seed)
    rates = np.geomspace(0.7, 1.4, len(orders)) if len(orders) > 1 else np.array([1.0])
    parts = [kalman.matern(order, std=1.0, rate=rate) for order, rate in zip(orders, rates, strict=True)]
    F, Q = zip(*(kalman.discretize(part, 0.2) for part in parts), strict=True)
    n = sum(orders)
    H = np.eye(n)[np.cumsum([0, *orders[:-1]]) if channels < n else slice(None)]
    if channels > 1:
        H = H + 0.3 * rng.standard_normal((channels, n)) / np.sqrt(n)
    P0 = block_diag(*(part.P0 for part in parts))
    R = 0.1 * np.eye(channels)
    return kalman.StateSpace(block_diag(*F), block_diag(*Q), H, R, np.zeros(n), P0)


def draw_measurements(model: kalman.StateSpace, samples: int, seed: int, signals: int = 1) -> Arrays:
    """Measurements (time, signal, channel) of independent runs of the model."""
    rng = np.random.default_rng(seed)
    n, m = len(model.x0), len(model.H)
    x = rng.standard_normal((signals, n)) @ root_factor(model.P0).T
    Ft, Ht, Qt = model.F.T.copy(), model.H.T.copy(), root_factor(model.Q).T.copy()
    z = rng.standard_normal((samples, signals, m)) @ root_factor(model.R).T
    for k in range(samples):
        z[k] += x @ Ht
        x = x @ Ft + rng.standard_normal((signals, n)) @ Qt
    return z


def root_factor(P: Arrays) -> Arrays:
    """C with C C^T = P, of a P that may be singular."""
    spread, axes = np.linalg.eigh(P)
    return axes * np.sqrt(np.maximum(spread, 0.0))
