"""Loads carried between two meshes of one interface, with all six resultants conserved.

Motions go from the structure to the fluid by u_f = H u_s, nodal loads back by lam_s = H^T lam_f, so that the
work is the same. Force and moment are conserved iff H S_s = S_f: rows of H that add up to one, H x_s = x_f.
Where the surfaces differ, the least correction W S_s (S_s^T W S_s)^-1 dg restores them; its transpose
corrects the motion. Source: principal equations 2.11 D, 4c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from forceid.errors import DataError, EstimationError
from forceid.partition.coupling.interpolation import surfaces
from forceid.principal import distribute, summation_operator
from forceid.principal.mass import SparseMatrix
from forceid.principal.operator import sum_nodal
from forceid.records import Array

REPRODUCED = 1e-12  # of one, or of the size of the surfaces, that H S_s - S_f may be off
TRANSFER_ROUNDING = 1e-14  # of the sum of forces, and of it times the size, that is no error of the resultant


@dataclass(frozen=True)
class Reproduction:
    """How far H S_s is from S_f, fluid node by fluid node.

    unity (fluid,): what a translation is off, per unit; offset (fluid,) m: what a rotation about the center
    of the structure is off, per radian, which is the distance from a node to where H puts it. size m: reach
    of the surfaces from that center. exact: no load loses force or moment on its way.
    """

    unity: Array
    offset: Array
    size: float
    exact: bool


@dataclass(frozen=True)
class Transfer:
    """A load carried over, and what it took.

    load (..., structure, axis) N, H^T lam_f + correction; correction (..., structure, axis) N; share (...):
    its norm, of that of the load. error_before, error_after (..., 6): resultant N, N m of the structural
    load less that of the fluid load, without and with correction, about the point `about` (axis,) m, the
    center of the weights; planar (..., 3).
    """

    load: Array
    correction: Array
    share: Array
    error_before: Array
    error_after: Array
    about: Array


def reproduction(H: ArrayLike | Any, structure: ArrayLike, fluid: ArrayLike) -> Reproduction:
    """Whether, and by how much not, H carries every rigid motion: H S_s = S_f, node by node.

    H (fluid, structure) for all axes alike, or (fluid axis, structure axis) between degrees of freedom;
    structure, fluid (node, axis) m. Raises DataError. Source: principal equations 2.11 D.

    >>> reproduction([[0.5, 0.5]], [[0.0, 0.0], [2.0, 0.0]], [[1.0, 0.1]]).offset
    array([0.1])
    """
    x_s, x_f, H = _checked(H, structure, fluid)
    center, axis = x_s.mean(axis=0), x_s.shape[1]
    gap = (H @ summation_operator(x_s, center) - summation_operator(x_f, center)).reshape(len(x_f), axis, -1)
    unity = np.linalg.norm(gap[..., :axis], axis=(1, 2)) / np.sqrt(axis)
    offset = np.linalg.norm(gap[..., axis:], axis=(1, 2)) / np.sqrt(axis - 1)  # [r]x has norm sqrt(2) |r|
    size = _size(x_s, x_f, center)
    exact = bool(unity.max() <= REPRODUCED and offset.max() <= REPRODUCED * size)
    return Reproduction(unity, offset, size, exact)


def transfer_load(
    H: ArrayLike | Any,
    load: ArrayLike,
    structure: ArrayLike,
    fluid: ArrayLike,
    weight: ArrayLike | None = None,
) -> Transfer:
    """Fluid loads lam_f on the nodes of the structure, their six resultants conserved.

    H as in `reproduction`, of `interpolation` or your own; load lam_f (..., fluid, axis) N, tractions times
    area; structure, fluid (node, axis) m at the configuration that the loads act on; weight (structure,) of
    the nodes in the correction, areas say, None = equal. Errors at rounding are left alone. World axes.

    Raises DataError, and EstimationError where a moment is lost that forces at the structural nodes cannot
    make, for they lie on a line. Source: principal equations 2.11 D.

    >>> structure, fluid = [[0.0, 0.0], [2.0, 0.0]], [[1.0, 0.1]]
    >>> done = transfer_load([[0.5, 0.5]], [[1.0, 0.0]], structure, fluid)
    >>> done.error_before.round(12), done.load.round(12).tolist()
    (array([0. , 0. , 0.1]), [[0.5, 0.05], [0.5, -0.05]])
    """
    x_s, x_f, H = _checked(H, structure, fluid)
    lam_f = _field(load, x_f, "load")
    center, axis = _center(x_s, weight), x_s.shape[1]
    flat = lam_f.reshape(-1, lam_f.shape[-2] * axis)
    plain = np.asarray((H.T @ flat.T).T).reshape(*lam_f.shape[:-2], *x_s.shape)
    goal = sum_nodal(lam_f, x_f, center)
    before = sum_nodal(plain, x_s, center) - goal
    total = (np.abs(lam_f).sum(axis=(-2, -1)) + np.abs(plain).sum(axis=(-2, -1)))[..., None]
    # rounding is no moment to restore, for there may be a line that cannot make it
    floor = (
        TRANSFER_ROUNDING * total * np.where(np.arange(before.shape[-1]) < axis, 1.0, _size(x_s, x_f, center))
    )
    correction = _spread(np.where(np.abs(before) <= floor, 0.0, -before), x_s, weight)
    carried = plain + correction
    norm, most = (np.linalg.norm(f, axis=(-2, -1)) for f in (correction, carried))
    share = np.asarray(norm / np.where(most > 0, most, np.inf))
    after = sum_nodal(carried, x_s, center) - goal
    return Transfer(carried, correction, share, before, after, center)


def transfer_motion(
    H: ArrayLike | Any,
    motion: ArrayLike,
    structure: ArrayLike,
    fluid: ArrayLike,
    weight: ArrayLike | None = None,
) -> Array:
    """Structural displacements on the fluid nodes, the transpose of `transfer_load`: the work is the same.

    motion u_s (..., structure, axis) m; the rest as in `transfer_load`. Returns (..., fluid, axis) m: H u_s
    and, where H S_s is not S_f, (S_f - H S_s) times the rigid motion that fits u_s best by weighted squares,
    so that rigid motions arrive as they are. Raises DataError, EstimationError.
    Source: principal equations 2.11 D.

    >>> transfer_motion([[0.5, 0.5]], [[0.0, -1.0], [0.0, 1.0]], [[0.0, 0.0], [2.0, 0.0]], [[1.0, 0.1]])
    array([[-0.1,  0. ]])
    """
    x_s, x_f, H = _checked(H, structure, fluid)
    u_s = _field(motion, x_s, "motion")
    flat = u_s.reshape(-1, x_s.size)
    u_f = np.asarray((H @ flat.T).T)
    if not reproduction(H, x_s, x_f).exact:
        center = _center(x_s, weight)
        S_s, S_f = summation_operator(x_s, center), summation_operator(x_f, center)
        D = _spread(np.eye(S_s.shape[1]), x_s, weight).reshape(S_s.shape[1], -1)
        u_f = u_f + flat @ D.T @ (S_f - H @ S_s).T
    return u_f.reshape(*u_s.shape[:-2], *x_f.shape)


def _field(given: ArrayLike, x: Array, where: str) -> Array:
    """A vector at every node (..., node, axis), finite."""
    field = np.asarray(given, dtype=float)
    if field.shape[-2:] != x.shape or not np.isfinite(field).all():
        raise DataError(f"has shape {field.shape}, expected (..., {len(x)}, {x.shape[1]}), finite", where)
    return field


def _checked(H: ArrayLike | Any, structure: ArrayLike, fluid: ArrayLike) -> tuple[Array, Array, Any]:
    """Nodes of both surfaces, and H between degrees of freedom."""
    x_s, x_f = surfaces(structure, fluid)
    H = sp.csr_array(H.tocsr() if isinstance(H, SparseMatrix) else np.atleast_2d(np.asarray(H, dtype=float)))
    nodal, full = (len(x_f), len(x_s)), (x_f.size, x_s.size)
    if H.shape not in (nodal, full) or not np.isfinite(H.data).all():
        raise DataError(f"has shape {H.shape}, expected {nodal} or {full}, of finite numbers", "H")
    return x_s, x_f, H if H.shape == full else sp.csr_array(sp.kron(H, sp.eye_array(x_s.shape[1])))


def _size(x_s: Array, x_f: Array, center: Array) -> float:
    """Largest distance of a node of either surface from the center."""
    return float(np.linalg.norm(np.concatenate([x_s, x_f]) - center, axis=1).max())


def _center(x_s: Array, weight: ArrayLike | None) -> Array:
    """Center of the weights of the structural nodes, about which force and moment spread each by itself."""
    w = np.ones(len(x_s)) if weight is None else np.asarray(weight, dtype=float)
    if w.shape != (len(x_s),) or not np.isfinite(w).all() or (w < 0).any() or not w.any():
        raise DataError(f"must be {len(x_s)} finite numbers, none negative and not all zero", "weight")
    return np.asarray(w @ x_s / w.sum())


def _spread(wrench: Array, x_s: Array, weight: ArrayLike | None) -> Array:
    """Least nodal forces W S_s (S_s^T W S_s)^-1 g of a wrench about the center of the weights."""
    axis = x_s.shape[1]
    share = np.full(len(x_s), 1 / len(x_s)) if weight is None else np.asarray(weight) / np.sum(weight)
    turning = np.where(np.arange(wrench.shape[-1]) < axis, 0.0, wrench)
    try:
        return np.asarray(share[:, None] * wrench[..., None, :axis] + distribute(turning, x_s, weight))
    except EstimationError as error:
        raise EstimationError(
            "lies on a line or in a point: forces at its nodes make no moment about that, so the moment that "
            "the transfer loses there cannot be restored",
            "structure",
            "add structural nodes off the line",
        ) from error
