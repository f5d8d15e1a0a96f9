"""Priors of loads as linear stochastic differential equations, and their exact discretization.

A load is the output of x' = A x + w. Parameters may be arrays (...): many loads at once. They may also be
complex, theta + ih of tiny h: the imaginary part of whatever follows is then h times its derivative, exact to
rounding, since no difference is taken (Squire and Trapp 1998). So nothing here takes a modulus or conjugate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb, factorial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from forceid.compiled import engine as compiled
from forceid.records import Array
from forceid.rounding import ITERATIONS


class Diffusion(Protocol):
    """Whatever has x' = A x + w, white w of spectral density Qc: a load, or a structure under loads."""

    @property
    def A(self) -> Array:
        """Rates (..., state, state)."""

    @property
    def Qc(self) -> Array:
        """Spectral density (..., state, state) of w."""

    @property
    def P0(self) -> Array:
        """Covariance (..., state, state) of x at the start."""


@dataclass(frozen=True)
class Process:
    """x' = A x + w, white w of spectral density Qc, start covariance P0; each (..., state, state).

    output (state,): the row that reads the load, or its first integral, out of the state.
    """

    A: Array
    Qc: Array
    P0: Array
    output: Array


def random_walk(density: ArrayLike, var: ArrayLike) -> Process:
    """A load that wanders: variance var (...) at the start, and density (...) more each second.

    Units: load^2 / s and load^2. With density 0, a constant. Source: principal equations 4e.

    >>> F, Q = discretize(random_walk(density=2.0, var=1e6), step=0.5)
    >>> F.tolist(), Q.tolist()
    ([[1.0]], [[1.0]])
    """
    return integrated_wiener(1, density, values(var)[..., None])


def integrated_wiener(order: int, density: ArrayLike, var: ArrayLike) -> Process:
    """A load whose order-th derivative is white noise of density (...): a random walk, integrated.

    order: number of states, the load and its derivatives; density: load^2 / s^(2 order - 1); var: start
    variance of every state, or (..., order) of each; large where nothing is known. Source: principal
    equations 4e.

    >>> load = integrated_wiener(2, density=3.0, var=[100.0, 25.0])
    >>> load.A.tolist(), load.Qc.tolist()
    ([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 3.0]])
    """
    density, var = values(density), values(var)
    var = np.broadcast_to(var, np.broadcast_shapes(var.shape, (*density.shape, order)))
    P0 = var[..., None] * np.eye(order)
    Qc = np.zeros(P0.shape, density.dtype)
    Qc[..., -1, -1] = density
    return Process(np.broadcast_to(np.eye(order, k=1), P0.shape), Qc, P0, np.eye(order)[0])


def matern(order: int, std: ArrayLike, rate: ArrayLike) -> Process:
    """A stationary load whose spectrum falls as |s + rate|^(-2 order): Matern of smoothness order - 1/2.

    order: number of states, the load and its derivatives; std (...): of the load, in its unit; rate (...):
    kappa, 1/s. Starts at its stationary covariance. Source: principal equations 4e.

    >>> load = matern(2, std=1.0, rate=10 * np.pi)
    >>> bool(np.isclose(load.Qc[-1, -1], 4 * (10 * np.pi) ** 3)), bool(np.isclose(load.P0[0, 0], 1.0))
    (True, True)
    """
    std, rate = np.broadcast_arrays(values(std), values(rate))
    A = np.zeros((*rate.shape, order, order), np.result_type(std, rate))
    Qc = np.zeros_like(A)
    A[..., :-1, 1:] = np.eye(order - 1)
    for i in range(order):
        A[..., -1, i] = -comb(order, i) * rate ** (order - i)
    Qc[..., -1, -1] = driving_density(order, std, rate)
    scale = std[..., None] * rate[..., None] ** np.arange(order)
    return Process(A, Qc, scale[..., :, None] * unit_matern(order) * scale[..., None, :], np.eye(order)[0])


@lru_cache
def unit_matern(order: int) -> Array:
    """Covariance (order, order) of a Matern load of unit std and rate, and of its derivatives."""
    # of derivatives i and j it is moment i + j of the spectrum
    moment = np.cumprod([1.0, *((k + 0.5) / (order - k - 1.5) for k in range(order - 1))])
    i, j = np.indices((order, order))
    P0: Array = np.where((i + j) % 2, 0.0, (-1.0) ** ((i - j) // 2) * moment[(i + j) // 2])
    P0.setflags(write=False)
    return P0


def matern_density(order: int, std: ArrayLike, rate: ArrayLike, w: ArrayLike) -> Array:
    """Spectral density (...), two-sided, per Hz, of a Matern load at w (...) rad/s. Source: as `matern`."""
    return np.asarray(
        driving_density(order, values(std), values(rate)) / (values(rate) ** 2 + values(w) ** 2) ** order
    )


def driving_density(order: int, std: Array, rate: Array) -> Array:
    """Spectral density (...) of the white noise that drives a Matern load. Source: as `matern`."""
    q = 2.0 ** (2 * order - 1) * factorial(order - 1) ** 2 / factorial(2 * order - 2)
    return np.asarray(q * std**2 * rate ** (2 * order - 1))


def resonator(frequency: ArrayLike, std: ArrayLike, bandwidth: ArrayLike) -> Process:
    """A load at one line: a phasor that turns at `frequency` (...) Hz and forgets at `bandwidth` (...) 1/s.

    std (...): of the load, in its unit. Two states, the load and its quadrature; stationary, with
    autocovariance std^2 exp(-bandwidth t) cos(2 pi frequency t): half the power lies within bandwidth / 2 pi
    hertz of the line. bandwidth 0: constant amplitude and phase, both unknown. Source: principal
    equations 4e (spin harmonics).

    >>> load = resonator(frequency=10.0, std=2.0, bandwidth=0.0)
    >>> F, Q = discretize(load, step=0.025)  # a quarter turn
    >>> bool(np.allclose(F, [[0, -1], [1, 0]])), bool((Q == 0).all())
    (True, True)
    """
    w, std, b = np.broadcast_arrays(2 * np.pi * values(frequency), values(std), values(bandwidth))
    w, var, b = w[..., None, None], (std**2)[..., None, None], b[..., None, None]
    one = np.eye(2)
    return Process(w * np.array([[0.0, -1.0], [1.0, 0.0]]) - b * one, 2 * b * var * one, var * one, one[0])


def superpose(*loads: Process) -> Process:
    """The sum of independent loads as one load: their states in a row, their outputs added up.

    >>> load = superpose(matern(2, std=1.0, rate=30.0), resonator(10.0, std=0.3, bandwidth=0.1))
    >>> load.A.shape, load.output.tolist()
    ((4, 4), [1.0, 0.0, 1.0, 0.0])
    """
    A, Qc, P0 = (block_diagonal(*(getattr(p, name) for p in loads)) for name in ("A", "Qc", "P0"))
    return Process(A, Qc, P0, np.concatenate([p.output for p in loads]))


def integrate(load: Process, var: ArrayLike) -> Process:
    """The integral of `load`, of variance var (...) at the start, as a new first state.

    Of a force: the momentum; of that, the first moment of mass m c.
    """
    joint = superpose(random_walk(0.0, var), load)
    joint.A[..., 0, 1:] = load.output
    return Process(joint.A, joint.Qc, joint.P0, np.eye(len(joint.output))[0])


def discretize(process: Diffusion, step: ArrayLike) -> tuple[Array, Array]:
    """Transition F and noise covariance Q of a step (...) in seconds, exactly.

    By Taylor series over a short step, then doubling: every entry keeps its own relative accuracy, however
    short the step and however long a gap. (One exponential of Van Loan's block matrix grows as exp(rate *
    step), and loses Q where a step is ten times 1/rate.)

    >>> F, Q = discretize(matern(1, std=2.0, rate=3.0), 0.1)
    >>> bool(np.isclose(F[0, 0], np.exp(-0.3))), bool(np.isclose(Q[0, 0], 4 * (1 - np.exp(-0.6))))
    (True, True)
    """
    h = np.asarray(step, float)[..., None, None]
    if compiled is not None and not np.iscomplexobj(process.A) and not np.iscomplexobj(process.Qc):
        A, Qc = np.broadcast_arrays(process.A, process.Qc)
        kind = np.arange(A[..., 0, 0].size).reshape(A.shape[:-2])
        kind, steps = np.broadcast_arrays(kind, h[..., 0, 0])
        many = compiled.discretized(
            *(a.reshape(-1, *A.shape[-2:]) for a in (A, Qc)), steps.ravel(), kind.ravel()
        )
        return many[0].reshape(*kind.shape, *A.shape[-2:]), many[1].reshape(*kind.shape, *A.shape[-2:])
    turn = np.abs(np.linalg.eigvals(process.A.real)).max(-1)[..., None, None] * h
    doublings = np.ceil(np.log2(np.maximum(8 * turn, 1.0)))
    A, Qc, h = np.broadcast_arrays(process.A, process.Qc, h / 2**doublings)
    Ah, dF, dQ = A * h, np.eye(A.shape[-1]), Qc * h
    F, Q = dF, dQ
    for k in range(1, ITERATIONS):
        dF, half = dF @ Ah / k, Ah @ dQ / (k + 1)
        dQ = half + half.swapaxes(-1, -2)
        before, (F, Q) = (F, Q), (F + dF, Q + dQ)
        if np.array_equal(before[0], F) and np.array_equal(before[1], Q):
            break
    for k in range(int(doublings.max())):
        # a step that is done waits for longer ones: each squaring doubles its rounding
        more = doublings > k
        F, Q = np.where(more, F @ F, F), np.where(more, Q + F @ Q @ F.swapaxes(-1, -2), Q)
    return F, 0.5 * (Q + Q.swapaxes(-1, -2))


def block_diagonal(*blocks: Array, over: Array | None = None) -> Array:
    """Square blocks (..., state, state) along the diagonal; leading axes broadcast.

    over: such a matrix of blocks as large, which is written over and is then the one returned.
    """
    if over is None:
        lead = np.broadcast_shapes(*(b.shape[:-2] for b in blocks))
        size = sum(b.shape[-1] for b in blocks)
        over = np.zeros((*lead, size, size), np.result_type(float, *blocks))
    joint, at = over, 0
    for b in blocks:
        joint[..., at : at + b.shape[-1], at : at + b.shape[-1]] = b
        at += b.shape[-1]
    return joint


def values(a: ArrayLike) -> Array:
    """Numbers as an array of floats, or of complex numbers where they carry a derivative."""
    return np.asarray(a, complex if np.iscomplexobj(a) else float)
