"""The reduced saddle-point system of a body in partitions, factored. Source: principal equations 2.9."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dsytrf, dsytrf_lwork, dsytrs
from scipy.sparse.linalg import splu

from forceid.errors import EstimationError
from forceid.partition.operators.flexibility import flexibility_matrices
from forceid.partition.operators.inverse import Factor
from forceid.partition.operators.projection import Projection
from forceid.records import Array, Indices

DENSE_SADDLE = 600  # unknowns up to which the saddle-point system is solved as a dense one


@dataclass(frozen=True)
class Saddle:
    """The reduced system, factored: solve (unknown,) -> (unknown,); unit: of flexibility, which scales it."""

    solve: Callable[[Array], Array]
    unit: float


def factored_saddle(projection: Projection, each: Sequence[Factor], which: Indices) -> Saddle:
    """Factors of the reduced system, of a whole that floats with the least alpha and u_f.

    Flexibilities are scaled to one, so that units of stiffness do not decide the rank.
    """
    top, R_b = projection.topology, sp.csr_array(projection.R_b)
    F = flexibility_matrices(top, each, which)
    unit = float(np.mean(np.concatenate([np.diag(block) for block in F])))
    L_f, free = top.L_f, projection.whole
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
