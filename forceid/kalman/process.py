"""Priors of loads as linear stochastic differential equations, and their exact discretization."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_continuous_lyapunov

from forceid.records import Array

TERMS = 24  # of the series of a step, in which the fastest rate turns by 1/8 at most


@dataclass(frozen=True)
class Process:
    """x' = A x + w, white w of spectral density Qc, start covariance P0; each (..., state, state).

    output (state,): the row that reads the load, or its first integral, out of the state.
    """

    A: Array
    Qc: Array
    P0: Array
    output: Array


def matern(order: int, std: ArrayLike, rate: ArrayLike) -> Process:
    """A stationary load whose spectrum falls as |s + rate|^(-2 order): Matern of smoothness order - 1/2.

    order: number of states, the load and its derivatives; std (...): of the load, in its unit; rate (...):
    kappa, 1/s. Starts at its stationary covariance. Source: principal equations 4e.

    >>> load = matern(2, std=1.0, rate=10 * np.pi)
    >>> bool(np.isclose(load.Qc[-1, -1], 4 * (10 * np.pi) ** 3)), bool(np.isclose(load.P0[0, 0], 1.0))
    (True, True)
    """
    std, rate = np.broadcast_arrays(np.asarray(std, float), np.asarray(rate, float))
    A = np.zeros((*rate.shape, order, order))
    A[..., :-1, 1:] = np.eye(order - 1)
    A[..., -1, :] = -np.stack([comb(order, i) * rate ** (order - i) for i in range(order)], -1)
    Qc = np.zeros_like(A)
    q = 2.0 ** (2 * order - 1) * factorial(order - 1) ** 2 / factorial(2 * order - 2)
    Qc[..., -1, -1] = q * std**2 * rate ** (2 * order - 1)
    # the process of unit rate, then derivative i in units of rate^i
    unit = np.diag(np.ones(order - 1), 1)
    unit[-1] = [-comb(order, i) for i in range(order)]
    scale = std[..., None] * rate[..., None] ** np.arange(order)
    P0 = np.asarray(solve_continuous_lyapunov(unit, -np.diag([0.0] * (order - 1) + [q])), float)
    return Process(A, Qc, scale[..., :, None] * P0 * scale[..., None, :], np.eye(order)[0])


def with_mean(load: Process, var: float) -> Process:
    """`load` about a constant mean of variance var at the start; the mean is the first state."""
    A, Qc, P0 = (np.pad(a, [(0, 0)] * (a.ndim - 2) + [(1, 0), (1, 0)]) for a in (load.A, load.Qc, load.P0))
    P0[..., 0, 0] = var
    return Process(A, Qc, P0, np.concatenate([[1.0], load.output]))


def integrate(load: Process, var: float) -> Process:
    """The integral of `load`, of variance var at the start, as a new first state.

    Of a force: the momentum; of that, the first moment of mass m c.
    """
    A, Qc, P0 = (np.pad(a, [(0, 0)] * (a.ndim - 2) + [(1, 0), (1, 0)]) for a in (load.A, load.Qc, load.P0))
    A[..., 0, 1:] = load.output
    P0[..., 0, 0] = var
    return Process(A, Qc, P0, np.eye(A.shape[-1])[0])


def discretize(process: Process, step: ArrayLike) -> tuple[Array, Array]:
    """Transition F and noise covariance Q of a step (...) in seconds, exactly.

    By Taylor series over a short step, then doubling: every entry keeps its own relative accuracy, however
    short the step and however long a gap. (One exponential of Van Loan's block matrix grows as exp(rate *
    step), and loses Q where a step is ten times 1/rate.)

    >>> F, Q = discretize(matern(1, std=2.0, rate=3.0), 0.1)
    >>> bool(np.isclose(F[0, 0], np.exp(-0.3))), bool(np.isclose(Q[0, 0], 4 * (1 - np.exp(-0.6))))
    (True, True)
    """
    h = np.asarray(step, float)[..., None, None]
    A, Qc, h = np.broadcast_arrays(process.A, process.Qc, h)
    turn = (np.abs(np.linalg.eigvals(process.A)).max(-1) * np.asarray(step)).max()
    doublings = int(np.ceil(np.log2(max(8 * turn, 1.0))))
    h = h / 2**doublings
    Ah, dF, dQ = A * h, np.eye(A.shape[-1]), Qc * h
    F, Q = dF, dQ
    for k in range(1, TERMS):
        dF, half = dF @ Ah / k, Ah @ dQ / (k + 1)
        dQ = half + half.swapaxes(-1, -2)
        F, Q = F + dF, Q + dQ
    for _ in range(doublings):
        F, Q = F @ F, Q + F @ Q @ F.swapaxes(-1, -2)
    return F, 0.5 * (Q + Q.swapaxes(-1, -2))
