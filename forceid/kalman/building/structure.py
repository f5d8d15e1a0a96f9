"""A structure under loads as one linear system: modes, and the priors of the loads that drive them.

q'' + 2 Z W q' + W^2 q = Phi^T B p, with W = 0 for the rigid modes. The state is (q, q', states of the loads).

>>> from forceid.kalman.building.process import discretize, matern
>>> modes = modal(M=np.diag([1.0, 2.0]), K=100.0 * np.array([[1.0, -1.0], [-1.0, 1.0]]), damping=0.01)
>>> (modes.frequency / (2 * np.pi)).round(3).tolist()  # free: one rigid mode
[0.0, 1.949]
>>> force_on_1 = Structure(modes.frequency, modes.damping, modes.shape.T @ [[1.0], [0.0]])
>>> system = drive(force_on_1, [matern(2, std=1.0, rate=30.0)], var_q=1.0, var_rate=1.0)
>>> F, Q = discretize(system, step=1e-3)
>>> F.shape
(6, 6)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh, expm
from scipy.sparse.csgraph import connected_components

from forceid.errors import ConfigError
from forceid.kalman.building.process import Process, block_diagonal, values
from forceid.records import Array, Flags
from forceid.rounding import ROUNDED, SOLVED


@dataclass(frozen=True)
class NormalModes:
    """frequency W (mode,) rad/s, rising; damping ratio Z (mode,); mass-normalized shape Phi (dof, mode).

    Rigid modes have frequency and damping ratio 0; drag (mode,) 1/s is what damps them.
    """

    frequency: Array
    damping: Array
    shape: Array
    drag: Array


@dataclass(frozen=True)
class Structure:
    """Modes as the loads see them: q'' + (2 Z W + drag) q' + W^2 q = participation p.

    frequency W (..., mode) rad/s, 0 for rigid modes; damping ratio Z (..., mode); participation (..., mode,
    load): Phi^T B of mass-normalized shapes, so that the mass is in it (a particle: one mode of frequency 0
    and participation 1/m in its own displacement); drag (..., mode) 1/s.
    """

    frequency: ArrayLike
    damping: ArrayLike
    participation: ArrayLike
    drag: ArrayLike = 0.0


@dataclass(frozen=True)
class System:
    """x' = A x + w of a structure under loads, x = (q, q', load states); A, Qc, P0 (..., state, state).

    loads (load, state): rows that read the loads p; modes: how many q there are.
    """

    A: Array
    Qc: Array
    P0: Array
    loads: Array
    modes: int


def modal(
    M: ArrayLike,
    K: ArrayLike,
    C: ArrayLike | None = None,
    damping: ArrayLike = 0.0,
    tolerance: float = ROUNDED,
) -> NormalModes:
    """Modes of M u'' + C u' + K u = f; each (dof, dof), symmetric, in kg, N s/m, N/m.

    Without C, damping is the ratio of every elastic mode, or (mode,). Of C only the diagonal of Phi^T C Phi
    is kept: exact where damping is proportional. A mode is rigid whose W^2 is below tolerance times the
    largest. Raises ConfigError where M is not positive definite, or K has a negative eigenvalue.
    """
    try:
        square, shape = eigh(np.asarray(K, float), np.asarray(M, float))
    except np.linalg.LinAlgError as e:
        raise ConfigError(
            "is not positive definite", "the mass matrix", "condense the degrees of freedom without mass"
        ) from e
    floor = tolerance * square[-1]
    if square[0] < -floor:
        raise ConfigError(
            f"has the negative eigenvalue {square[0]:.3g} s^-2", "the stiffness matrix", "check its signs"
        )
    rigid = square <= floor
    frequency = np.sqrt(np.where(rigid, 0.0, square))
    elastic = np.where(rigid, 1.0, frequency)
    if C is None:
        return NormalModes(frequency, np.where(rigid, 0.0, damping), shape, np.zeros(len(square)))
    rate = np.einsum("ij,ik,kj->j", shape, np.asarray(C, float), shape)
    return NormalModes(
        frequency, np.where(rigid, 0.0, rate / (2 * elastic)), shape, np.where(rigid, rate, 0.0)
    )


def state_matrices(structure: Structure) -> tuple[Array, Array]:
    """A (..., state, state) and B (..., state, load) of x' = A x + B p, x = (q, q')."""
    W, Z, drag = (values(a) for a in (structure.frequency, structure.damping, structure.drag))
    participation = values(structure.participation)
    lead = np.broadcast_shapes(W.shape, Z.shape, drag.shape)
    m, kind = lead[-1], np.result_type(W, Z, drag)
    if participation.ndim < 2 or participation.shape[-2] != m:
        raise ConfigError(
            f"has shape {participation.shape}, expected ({m}, load)", "participation", "give Phi^T B"
        )
    A = np.zeros((*lead[:-1], 2 * m, 2 * m), kind)
    A[..., :m, m:] = np.eye(m)
    A[..., m:, :m] = -(np.eye(m) * (W**2)[..., None])
    A[..., m:, m:] = -(np.eye(m) * (2 * Z * W + drag)[..., None])
    return A, np.concatenate([np.zeros_like(participation), participation], -2)


def drive(
    structure: Structure,
    loads: Sequence[Process],
    var_q: ArrayLike,
    var_rate: ArrayLike,
    settled: bool = True,
) -> System:
    """The structure under independent loads, one prior for each column of its participation.

    var_q, var_rate, scalar or (mode,): variance at the start of q and q' where nothing better is known: of
    rigid and undamped modes, and of damped ones under a load that is not stationary, on top of their
    stationary response to those that are. Damped modes start at their stationary covariance together with
    the stationary loads (also a constant mean, or a line of constant amplitude), unless settled is False:
    a structure at the moment it is struck or let go. Leading axes of structure and loads broadcast; complex
    parameters as in `process`. Raises ConfigError where loads and participation differ in number. Source:
    principal equations 4e.
    """
    A_q, B = state_matrices(structure)
    if len(loads) != B.shape[-1]:
        raise ConfigError(
            f"number {len(loads)}, expected {B.shape[-1]}", "the loads", "give one prior for each load"
        )
    A_p, Qc, P_p = (block_diagonal(*(getattr(p, name) for p in loads)) for name in ("A", "Qc", "P0"))
    ends = np.cumsum([len(p.output) for p in loads], dtype=int)
    rows = np.zeros((len(loads), A_p.shape[-1]))
    for row, load, end in zip(rows, loads, ends, strict=True):
        row[end - len(load.output) : end] = load.output

    n, coupling = A_q.shape[-1], B @ rows
    lead = np.broadcast_shapes(A_q.shape[:-2], coupling.shape[:-2], A_p.shape[:-2], P_p.shape[:-2])
    A = np.array(np.broadcast_to(block_diagonal(A_q, A_p), (*lead, n + len(rows.T), n + len(rows.T))))
    A = A.astype(np.result_type(A, coupling))
    A[..., :n, n:] = coupling
    Qc = np.broadcast_to(block_diagonal(np.zeros((n, n)), Qc), A.shape)
    P_p = np.broadcast_to(block_diagonal(np.zeros((n, n)), P_p), A.shape)
    P0 = np.empty(A.shape, np.result_type(A, Qc, P_p))
    diffuse = np.concatenate([np.broadcast_to(v, n // 2) for v in (values(var_q), values(var_rate))])
    for k in np.ndindex(lead):
        P0[k] = start_covariance(A[k], Qc[k], P_p[k], diffuse, settled)
    return System(A, Qc, P0, np.pad(rows, [(0, 0), (n, 0)]), n // 2)


def start_covariance(A: Array, Qc: Array, P_loads: Array, diffuse: Array, settled: bool) -> Array:
    """Covariance at the start of a structure under loads; diffuse (2 mode,): variances where unknown."""
    n, P0 = len(diffuse), P_loads.astype(np.result_type(A, P_loads))
    m, real = n // 2, A.real
    damped = (np.diagonal(real[m:n, :m]) < 0) & (np.diagonal(real[m:n, m:n]) < 0) & settled
    steady = n + np.flatnonzero(stationary(real[n:, n:], Qc[n:, n:].real, P_loads[n:, n:].real))
    restless = np.setdiff1d(np.arange(n, len(A)), steady)
    unknown = ~damped | (real[m:n, restless] != 0).any(1)

    q, x = np.flatnonzero(damped), np.concatenate([np.flatnonzero(damped), m + np.flatnonzero(damped)])
    if len(q) and len(steady):
        G, A_p, P_p = (a[np.ix_(i, steady)] for a, i in ((A, m + q), (A, steady), (P0, steady)))
        P_q, cross = response(-A[m + q, q], -A[m + q, m + q], G, A_p, P_p)
        P0[np.ix_(x, x)], P0[np.ix_(x, steady)], P0[np.ix_(steady, x)] = P_q, cross, cross.T
    P0[np.arange(n), np.arange(n)] += np.where(np.tile(unknown, 2), diffuse, 0.0)
    return P0


def response(W2: Array, c: Array, G: Array, A_p: Array, P_p: Array) -> tuple[Array, Array]:
    """Stationary covariance of (q, q'), q'' + c q' + W2 q = G x, and that with x, x' = A_p x + w.

    W2, c (mode,); G (mode, state); A_p and the stationary P_p (state, state). The Lyapunov equation written
    out mode by mode and pair by pair, which has a closed form: a general solver is exact to the largest entry
    only, and loses the rates of a mode that is stiff beside its loads.
    """
    size = np.sqrt(np.diagonal(P_p).real)
    size = np.where(size > 0, size, 1.0)
    G, A_p, P_p = G * size, A_p * size / size[:, None], P_p / size / size[:, None]
    flow = A_p @ A_p - c[:, None, None] * A_p + W2[:, None, None] * np.eye(len(A_p))
    q_p = np.linalg.solve(flow, (G @ P_p)[..., None])[..., 0]
    rate_p = -q_p @ A_p.T
    work, power = q_p @ G.T, rate_p @ G.T  # of the load on mode j with q, q' of mode i
    C, D = c[:, None] + c, W2[:, None] - W2
    power, odd = (power + power.T) / C, (work - work.T) / C
    lag = D / C - 0.5 * (c[:, None] - c)
    q_q = (power + 0.5 * (work + work.T) - lag * odd) / (0.5 * (W2[:, None] + W2) + lag * D / C)
    q_rate = D / C * q_q + odd
    P_q = np.block([[q_q, q_rate], [q_rate.T, power - D / C * q_rate]])
    return 0.5 * (P_q + P_q.T), np.concatenate([q_p, rate_p]) * size


def stationary(A: Array, Qc: Array, P0: Array) -> Flags:
    """Which states (state,) start at a covariance that stays, A P0 + P0 A^T + Qc = 0, group by group."""
    size = np.sqrt(np.diagonal(P0))
    scale = np.abs(A) @ np.outer(size, size)
    change, scale = A @ P0 + P0 @ A.T + Qc, scale + scale.T + np.abs(Qc)
    moves = (np.abs(change) > SOLVED * scale).any(1)
    _, group = connected_components((A != 0) | (Qc != 0) | (P0 != 0), directed=False)
    return ~np.isin(group, group[moves])


def discretize_input(A: ArrayLike, B: ArrayLike, step: ArrayLike) -> tuple[Array, Array]:
    """F and G of x_{k+1} = F x_k + G p_k, for x' = A x + B p with p held over a step (...) in seconds.

    A (..., state, state), B (..., state, load). Exact: the exponential of [[A, B], [0, 0]] step.

    >>> F, G = discretize_input([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], step=0.1)
    >>> F.round(12).tolist(), G.round(12).tolist()
    ([[1.0, 0.1], [0.0, 1.0]], [[0.005], [0.1]])
    """
    A, B, h = np.asarray(A, float), np.asarray(B, float), np.asarray(step, float)[..., None, None]
    n, lead = A.shape[-1], np.broadcast_shapes(A.shape[:-2], B.shape[:-2])
    joint = np.zeros((*lead, n + B.shape[-1], n + B.shape[-1]))
    joint[..., :n, :n], joint[..., :n, n:] = A, B
    both = expm(joint * h)
    return both[..., :n, :n], both[..., :n, n:]
