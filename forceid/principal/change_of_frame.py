"""Is a stiffness objective: does it leave every rigid motion free, and nothing else?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.principal.mass import SparseMatrix
from forceid.principal.operator import summation_operator
from forceid.records import Array

DENSE_DOF = 3000
RESIDUAL_LIMIT = 1e-12


@dataclass(frozen=True)
class Objectivity:
    """What a stiffness lets go free.

    residual: ||K S||_max / ||K||_max, with S about the centroid and rotations in units of the rms
    distance of the nodes from it; nullity of K; rigid: rigid motions among them; mechanisms: the
    others; reasons: one sentence for each thing that is not as it must be, empty for a sound K.
    """

    residual: float
    nullity: int
    rigid: int
    mechanisms: int
    reasons: tuple[str, ...]


def objectivity(
    stiffness: ArrayLike | SparseMatrix, position: ArrayLike, rotations: bool = False
) -> Objectivity:
    """Test K S = 0 and the nullity of K: all rigid motions, and no mechanism beyond them.

    stiffness (dof, dof) N/m, symmetric, dense or scipy sparse, node-major; position (node, 3) m, or
    planar (node, 2), of the unloaded shape: the tangent of a loaded state resists rotation by right,
    K_T S_theta = -[f]x. `rotations`: the nodes have rotational dof. The rank is counted after each dof
    is scaled by its own stiffness, so that neither units nor contrasts decide it. Raises DataError.
    Source: principal equations 2.1, 6.

    >>> bar = np.kron([[1.0, -1.0], [-1.0, 1.0]], [[1.0, 0.0], [0.0, 0.0]])
    >>> check = objectivity(bar, [[0.0, 0.0], [2.0, 0.0]])
    >>> check.nullity, check.mechanisms, check.reasons
    (3, 0, ())
    """
    x = np.asarray(position, dtype=float)
    rho = x - x.mean(axis=0)
    length = float(np.sqrt((rho**2).sum(axis=1).mean())) or 1.0
    S = summation_operator(rho / length, rotations=rotations)  # all motions in meters, as K below
    axis = x.shape[1]
    unit = np.ones((len(x), len(S) // len(x)))
    unit[:, axis:] = 1 / length
    K: Any = stiffness.tocsr() if isinstance(stiffness, SparseMatrix) else np.asarray(stiffness, dtype=float)
    K = scipy.sparse.csr_array(K)
    if K.shape != (len(S), len(S)):
        raise DataError(f"has shape {K.shape}, expected ({len(S)}, {len(S)})", "stiffness")
    K = _scaled(K, unit.ravel())
    largest = float(abs(K).max())
    if not 0 < largest < np.inf:
        raise DataError("must be finite and not all zero", "stiffness")
    residual = float(np.abs(K @ S).max()) / largest

    null = _null_space(K, residual)
    U, s, _ = np.linalg.svd(S, full_matrices=False)
    U = U[:, s > 1e-9 * s[0]]
    _, cosine, Vt = np.linalg.svd(U.T @ null)
    rigid = int((cosine > 1 - 1e-6).sum())
    free = null @ Vt[rigid:].T  # null motions that are not rigid ones
    free -= U @ (U.T @ free)
    reasons = []
    if residual > RESIDUAL_LIMIT:
        reasons.append(
            f"the stiffness resists rigid motion (K S is {residual:.2g} of K, not 0): the body is held, "
            "the shape is not the one of K, or K is the tangent of a loaded state; give K of the free, "
            "unloaded body"
        )
    if free.shape[1]:
        node = int(np.argmax((free.reshape(len(x), -1) ** 2).sum(axis=1)))
        count = "1 motion" if free.shape[1] == 1 else f"{free.shape[1]} motions"
        reasons.append(
            f"the stiffness lets {count} beyond the {rigid} rigid ones go free (a mechanism): node "
            f"{node}, counted from 0, moves most; add a spring or an element that resists it"
        )
    return Objectivity(residual, null.shape[1], rigid, free.shape[1], tuple(reasons))


def _scaled(K: Any, by: Array) -> Any:
    """diag(by) K diag(by)."""
    D = scipy.sparse.diags_array(by)
    return (D @ K @ D).tocsr()


def _null_space(K: Any, residual: float) -> Array:
    """Orthonormal basis (dof, nullity) of the null space of a sparse positive semidefinite K."""
    diagonal = K.diagonal()
    by = 1 / np.sqrt(np.where(diagonal > 1e-300, diagonal, 1.0))
    A = _scaled(K, by)
    dof = A.shape[0]
    zero = np.clip(10 * residual, 10 * dof * np.finfo(float).eps, 1e-9) * float(abs(A).sum(axis=1).max())
    if dof <= DENSE_DOF:
        value, vector = np.linalg.eigh(A.toarray())
    else:
        value, vector = _lowest(A, zero)
    null = vector[:, value < zero] * by[:, None]
    return np.linalg.qr(null / np.linalg.norm(null, axis=0))[0]


def _lowest(A: Any, zero: float) -> tuple[Array, Array]:
    """Eigenpairs of A around zero, by inverse iteration on a block that grows until it holds a larger one."""
    from scipy.sparse.linalg import splu

    dof, size = A.shape[0], 8
    solve = splu((A + zero * scipy.sparse.eye_array(dof)).tocsc()).solve
    while True:
        X = np.cos(np.outer(np.arange(dof), np.arange(1, size + 1)))  # generic, and the same every time
        for _ in range(6):
            X = np.linalg.qr(solve(X))[0]
        value, mix = np.linalg.eigh(X.T @ (A @ X))
        if value[-1] > zero or size >= dof:
            return value, X @ mix
        size *= 2
