"""The four-field and the reduced saddle-point systems of a partitioned body at rest, and their deficiency.

Both are regular if and only if no motion of the whole is free. Source: principal equations 2.7, 2.9.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag, null_space

from forceid.partition.operators.flexibility import flexibility_matrices
from forceid.partition.solution.assembly import Assembly
from forceid.records import Array

SINGULAR = 1e-11  # of the largest singular value of a scaled matrix, below which one is zero


def solve_saddle(system: Assembly, f: Array, gap: Array) -> tuple[Array, Array]:
    """Lambda (multiplier,) and alpha under loads f (dof,) that also close gaps (multiplier,) m."""
    top, R_b = system.topology, system.R_b
    n, a = R_b.shape
    if not n:  # one partition
        return np.zeros(0), np.zeros(a)
    saddle = system.saddle
    opened = (top.B.T @ system.inverse(f) + gap) / saddle.unit
    rest = np.zeros(len(top.interface) + system.projection.whole.shape[1])
    x = saddle.solve(np.concatenate([opened, -system.resultant(f), rest]))
    return x[:n], saddle.unit * x[n : n + a]


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
