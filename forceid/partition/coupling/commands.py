"""Dual control: actuator commands for the mean motion and the deformation of a body, in tandem.

Actuators f = B_u c push along rigid modes R and modes Phi, [R^T B_u; Phi^T B_u] c = [tau_alpha; tau_q].
Both can be commanded independently iff that matrix has full row rank. What is left over acts on the residual
modes: the spill Phi_r^T B_u c. Loads M R c are the mean control that no mode feels.
Source: principal equations 2.11 B.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import qr, solve_triangular

from forceid.errors import DataError, EstimationError
from forceid.partition.validation import finite
from forceid.principal.mass import SparseMatrix
from forceid.records import Array

COMMAND_RANK = 1e-10  # of the largest singular value of the scaled matrix, below which nothing is reached
COMMAND_FLOOR = 1e-13  # singular value of a matrix of cosines that is rounding
COMMAND_MISSED = 1e-9  # of its terms, that a combination out of reach may ask for
COMMAND_COUPLED = 1e-8  # Phi^T M R of modes and rigid modes of unit mass, above which the gauge is another


@dataclass(frozen=True)
class Commands:
    """Commands of least effort, what they cannot reach, and what they do beside.

    c (..., actuator): the commands, f = B_u c; spill (..., residual): the loads they make on residual modes.
    rank and condition: of the commanded rows, scaled; infinite where rank falls short of the rows, and
    independent says that it does not. unreachable (combination, command): n with n [tau_alpha; tau_q] = 0
    whatever c, the largest scaled entry 1. name (command,): of the rows, mean 0, ..., mode 0, ...
    """

    c: Array
    spill: Array
    rank: int
    condition: float
    independent: bool
    unreachable: Array
    name: tuple[str, ...]


def solve_commands(
    actuators: ArrayLike | Any,
    R: ArrayLike,
    Phi: ArrayLike,
    tau_alpha: ArrayLike,
    tau_q: ArrayLike,
    residual: ArrayLike | None = None,
    mass: ArrayLike | Any = None,
    effort: ArrayLike | None = None,
    name: Sequence[str] = (),
) -> Commands:
    """Least commands c that push the mean motion with tau_alpha and the modes with tau_q, and their spill.

    actuators B_u (dof, actuator), dense or sparse: nodal loads of each unit command; R (dof, r) rigid modes,
    Phi (dof, m) modes to command, (dof, 0) for none; residual Phi_r (dof, k) modes left alone. tau_alpha
    (..., r) N, N m and tau_q (..., m) N of unit modes. effort: weights (actuator,), or W (actuator, actuator)
    of c^T W c, None = equal; with X = Phi_r^T B_u, W = X^T X plus a little makes spare actuators quiet it.

    Rank and condition are those of the cosines between the columns of B_u and of [R Phi], so that no unit of
    an actuator or of a mode counts; with rotations among the degrees of freedom a meter counts as a radian.
    mass (dof, dof) or (dof,): modes are then tested for the mass gauge, without which the mean and the modes
    push each other. Raises DataError; EstimationError where what is asked for is out of reach, naming the
    combination: all of tau zero asks for nothing and tells them too. Source: principal equations 2.11 B.

    >>> done = solve_commands(np.eye(2), [[1.0], [1.0]], [[1.0], [-1.0]], [3.0], [1.0])
    >>> done.c, done.independent
    (array([2., 1.]), True)
    """
    B = _plain(actuators)
    B = B if isinstance(B, np.ndarray) else B.toarray()
    if B.ndim != 2 or not B.size:
        raise DataError(f"has shape {B.shape}, expected (dof, actuator)", "actuators")
    finite(B, "actuators")
    R, Phi = _modes(R, len(B), "R"), _modes(Phi, len(B), "Phi")
    Phi_r = np.zeros((len(B), 0)) if residual is None else _modes(residual, len(B), "residual")
    if mass is not None:
        _in_mass_gauge(mass, R, np.hstack([Phi, Phi_r]))
    commanded = np.hstack([R, Phi])
    rows, tau = commanded.shape[1], _targets(tau_alpha, tau_q, R.shape[1], Phi.shape[1])
    names = tuple(name) or tuple(
        [f"mean {k}" for k in range(R.shape[1])] + [f"mode {k}" for k in range(Phi.shape[1])]
    )
    if not rows or len(names) != rows:
        raise DataError(f"has {len(names)} entries, expected {rows}, one a command and at least one", "name")

    size, reach = np.linalg.norm(commanded, axis=0), np.linalg.norm(B, axis=0)
    G = commanded.T @ B
    scaled = G / size[:, None] / np.where(reach > 0, reach, 1.0)
    U, s, _ = np.linalg.svd(scaled)
    rank = int((s > max(COMMAND_RANK * s.max(initial=0.0), COMMAND_FLOOR)).sum())
    closed = _readable(U[:, rank:].T)
    _refuse(closed, tau / size, size, names)
    # within its range the system has full row rank, and the least c solves it exactly
    root = _root(effort, B.shape[1])
    A = solve_triangular(root, (U[:, :rank].T @ (G / size[:, None])).T, lower=True)
    Q, T = np.linalg.qr(A)
    y = Q @ solve_triangular(T, ((tau / size).reshape(-1, rows) @ U[:, :rank]).T, trans="T")
    c = solve_triangular(root, y, lower=True, trans="T").T.reshape(*tau.shape[:-1], B.shape[1])
    full = rank == rows
    condition = float(s[0] / s[-1]) if full and rank else np.inf
    return Commands(c, c @ (B.T @ Phi_r), rank, condition, full, closed / size, names)


def mean_control(mass: ArrayLike | Any, R: ArrayLike, tau: ArrayLike) -> Array:
    """Nodal loads f = M R c with R^T f = tau, which move the body as if it were rigid: Phi^T f = 0.

    mass M (dof, dof), dense or sparse, or (dof,) lumped; R (dof, r) rigid modes, K R = 0; tau (..., r) N,
    N m. Returns (..., dof) N; c is the acceleration that all points share. Modes in mass gauge stay at rest,
    at any stiffness; of all loads with that resultant these have least f^T M^-1 f. Raises DataError.
    Source: principal equations 2.11 B, 2.5.

    >>> mean_control([1.0, 3.0], [[1.0], [1.0]], [8.0])
    array([2., 6.])
    """
    R = _modes(R, None, "R")
    target = _targets(tau, np.zeros((*np.shape(tau)[:-1], 0)), R.shape[1], 0)
    MR = _times(mass, R)
    return np.asarray(np.linalg.solve(_mean_mass(MR, R), target[..., None])[..., 0] @ MR.T)


def _modes(given: ArrayLike, dof: int | None, where: str) -> Array:
    """Modes as columns (dof, mode), finite, none of them zero."""
    X = finite(given, where)
    if X.ndim != 2 or (dof is not None and len(X) != dof):
        raise DataError(
            f"has shape {X.shape}, expected ({'dof' if dof is None else dof}, mode), modes as columns", where
        )
    if not X.any(axis=0).all():
        raise DataError(f"is zero in column {int(np.argmin(X.any(axis=0)))}", where, "leave that mode out")
    return X


def _targets(tau_alpha: ArrayLike, tau_q: ArrayLike, mean: int, modes: int) -> Array:
    """Both targets in one (..., command)."""
    parts = []
    for value, count, where in ((tau_alpha, mean, "tau_alpha"), (tau_q, modes, "tau_q")):
        t = finite(value, where)
        if t.ndim == 0 or t.shape[-1] != count:
            raise DataError(f"has shape {t.shape}, expected (..., {count}), one a mode", where)
        parts.append(t)
    try:
        batch = np.broadcast_shapes(*(t.shape[:-1] for t in parts))
    except ValueError:
        raise DataError(
            f"has shape {parts[1].shape}, which does not go with tau_alpha of {parts[0].shape}", "tau_q"
        ) from None
    return np.concatenate([np.broadcast_to(t, (*batch, t.shape[-1])) for t in parts], axis=-1)


def _plain(given: ArrayLike | Any) -> Any:
    """A sparse matrix by rows, anything else as an array."""
    return given.tocsr() if isinstance(given, SparseMatrix) else np.asarray(given, dtype=float)


def _times(mass: ArrayLike | Any, X: Array) -> Array:
    """M X."""
    M = _plain(mass)
    if M.shape not in ((len(X),), (len(X), len(X))):
        raise DataError(f"has shape {M.shape}, expected ({len(X)}, {len(X)}) or ({len(X)},)", "mass")
    finite(M if isinstance(M, np.ndarray) else M.data, "mass")
    return np.asarray(M[:, None] * X if M.ndim == 1 else M @ X)


def _mean_mass(MR: Array, R: Array) -> Array:
    """M_alpha = R^T M R, a DataError where it is not positive definite."""
    M_alpha = R.T @ MR
    unit = np.sqrt(np.abs(np.diag(M_alpha)))
    if not unit.all() or np.linalg.eigvalsh(M_alpha / unit / unit[:, None]).min(initial=1.0) < 1e-13:
        raise DataError("has rigid modes that carry no mass, or that depend on each other", "R")
    return np.asarray(M_alpha)


def _in_mass_gauge(mass: ArrayLike | Any, R: Array, modes: Array) -> None:
    """DataError where the inertia of a mode couples to the mean motion."""
    MR, MX = _times(mass, R), _times(mass, modes)
    own = np.sqrt(np.outer(np.abs((R * MR).sum(axis=0)), np.abs((modes * MX).sum(axis=0))))
    off = np.abs(MR.T @ modes)
    if (off > COMMAND_COUPLED * own).any():
        worst = float((off / np.where(own > 0, own, 1.0)).max())
        raise DataError(
            f"and R couple in the mass, R^T M Phi is {worst:.1e} of modes of unit mass, expected zero: "
            "commands for one would accelerate the other", "Phi or residual",
            "take Phi - R (R^T M R)^-1 R^T M Phi",
        )  # fmt: skip


def _root(effort: ArrayLike | None, count: int) -> Array:
    """Lower Cholesky factor of the weights of c^T W c."""
    W = np.ones(count) if effort is None else np.asarray(effort, dtype=float)
    if W.shape not in ((count,), (count, count)) or not np.isfinite(W).all():
        raise DataError(f"must be ({count},) or ({count}, {count}) finite numbers, one an actuator", "effort")
    try:
        return np.asarray(np.linalg.cholesky(np.diag(W) if W.ndim == 1 else 0.5 * (W + W.T)))
    except np.linalg.LinAlgError:
        raise DataError(
            "is not positive definite", "effort", "add a little to its diagonal: every command costs"
        ) from None


def _readable(rows: Array) -> Array:
    """The row space (combination, command) as few commands each as a reduced form gives, largest entry 1."""
    if not len(rows):
        return rows
    lead = np.sort(qr(rows, mode="r", pivoting=True)[1][: len(rows)])
    rows = np.asarray(np.linalg.solve(rows[:, lead], rows))
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    return np.where(np.abs(rows) < 1e-10, 0.0, rows)


def _refuse(closed: Array, target: Array, size: Array, name: tuple[str, ...]) -> None:
    """EstimationError that names the worst combination that is asked for and that no command makes."""
    asked = np.abs(target @ closed.T)
    if not asked.size or asked.max() <= COMMAND_MISSED * np.linalg.norm(target, axis=-1).max():
        return
    at = np.unravel_index(np.argmax(asked), asked.shape)
    row = closed[at[-1]] / size
    row = row / np.abs(row).max()
    terms = " ".join(f"{v:+.4g} ({n})" for v, n in zip(row, name, strict=True) if v)
    raise EstimationError(
        f"asks for {terms} = {float((target[at[:-1]] * size) @ row):.4g}, a combination that these actuators "
        f"leave at zero whatever their commands; they reach {len(size) - len(closed)} of {len(size)}",
        "tau_alpha, tau_q",
        "add or move actuators, command fewer modes, or ask for zero of that combination",
    )
