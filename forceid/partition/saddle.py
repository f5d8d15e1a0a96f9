"""The four-field and the reduced saddle-point systems of a partitioned body at rest, and their deficiency.

Both are regular if and only if no motion of the whole is free. Source: principal equations 2.7, 2.9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag, null_space
from scipy.linalg.lapack import dsytrf, dsytrf_lwork, dsytrs
from scipy.sparse.linalg import splu

from forceid.errors import EstimationError
from forceid.partition.operators.flexibility import flexibility_matrices
from forceid.partition.solution.assembly import Assembly
from forceid.records import Array

SINGULAR = 1e-11  # of the largest singular value of a scaled matrix, below which one is zero
DENSE_SADDLE = 600  # unknowns up to which the saddle-point system is solved as a dense one


@dataclass(frozen=True)
class Saddle:
    """The reduced system, factored: solve (unknown,) -> (unknown,); unit: of flexibility, which scales it."""

    solve: Callable[[Array], Array]
    unit: float


def factored_saddle(system: Assembly) -> Saddle:
    """Factors of the reduced system, of a whole that floats with the least alpha and u_f.

    Flexibilities are scaled to one, so that units of stiffness do not decide the rank.
    """
    top, R_b = system.topology, sp.csr_array(system.R_b)
    F = flexibility_matrices(top, *system.factored)
    unit = float(np.mean(np.concatenate([np.diag(block) for block in F])))
    L_f, free = top.L_f, system.projection.whole
    frame = sp.csr_array(L_f.T @ (R_b @ free) / top.count[top.interface][:, None])
    n, a, m = len(top.frame), R_b.shape[1], len(top.interface)
    border = sp.vstack([sp.csr_array((n, free.shape[1])), sp.csr_array(free), frame])
    A = sp.block_array(
        [
            [sp.block_diag([block / unit for block in F]), -R_b, L_f],
            [-R_b.T, sp.csr_array((a, a)), None],
            [L_f.T, None, sp.csr_array((m, m))],
        ]
    )
    A = sp.block_array([[A, border], [border.T, sp.csr_array((free.shape[1], free.shape[1]))]])
    # the frame enters with the sign that keeps the matrix symmetric: its unknown is -u_f, and is not needed
    if A.shape[0] > DENSE_SADDLE:
        return Saddle(splu(sp.csc_array(A)).solve, unit)
    room = int(dsytrf_lwork(A.shape[0], lower=1)[0])
    factor, pivot, zero = dsytrf(A.toarray(order="F"), lower=1, lwork=room, overwrite_a=True)
    if zero:
        raise EstimationError(
            "is singular: a motion or a force is left open", "the saddle-point system",
            "look for a mechanism, or for two partitions that hold each other without stiffness",
        )  # fmt: skip
    return Saddle(lambda right: np.asarray(dsytrs(factor, pivot, right, lower=1)[0]), unit)


def reduced_matrix(system: Assembly) -> Array:
    """[F -R_b L_f; -R_b^T 0 0; L_f^T 0 0], dense; unknowns lambda, alpha, u_f."""
    R_b, L_f = system.R_b, system.topology.L_f.toarray()
    a, m = R_b.shape[1], L_f.shape[1]
    F = block_diag(*flexibility_matrices(system.topology, *system.factored))
    return np.block([[F, -R_b, L_f], [-R_b.T, np.zeros((a, a + m))], [L_f.T, np.zeros((m, a + m))]])


def four_field(system: Assembly) -> Array:
    """The static four-field matrix, dense; unknowns q, alpha, lambda, u_f, in the Euclidean gauge."""
    Phi = block_diag(*[null_space(r.T) if r.shape[1] else np.eye(len(r)) for r in system.rigid_modes])
    K = block_diag(*[k.toarray() for k in system.stiffness])
    B, R_b, L_f = system.topology.B.toarray(), system.R_b, system.topology.L_f.toarray()
    q, a, n, m = Phi.shape[1], R_b.shape[1], len(R_b), L_f.shape[1]
    return np.block(
        [
            [Phi.T @ K @ Phi, np.zeros((q, a)), Phi.T @ B, np.zeros((q, m))],
            [np.zeros((a, q + a)), R_b.T, np.zeros((a, m))],
            [B.T @ Phi, R_b, np.zeros((n, n)), -L_f],
            [np.zeros((m, q + a)), -L_f.T, np.zeros((m, m))],
        ]
    )


def deficiency(matrix: Array) -> int:
    """How many motions or forces a symmetric matrix leaves open, each row and column scaled to one."""
    scale = 1 / np.sqrt(np.maximum(np.abs(matrix).max(axis=0), 1e-300))
    value = np.abs(np.linalg.eigvalsh(matrix * scale * scale[:, None]))
    return int((value < SINGULAR * value.max()).sum())
