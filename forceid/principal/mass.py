"""Mass properties M_alpha = S^T M S: total mass, mass center, inertia and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.principal.operator import axial, axis_count, cross_matrix, sum_nodal, summation_operator
from forceid.records import Array


@runtime_checkable
class SparseMatrix(Protocol):
    """Any scipy sparse array or matrix."""

    def tocsr(self) -> Any:
        """The same matrix by rows."""


@dataclass(frozen=True)
class MassProperties:
    """Total mass, its center, and the generalized mass of the rigid motions about the point `about`.

    mass kg; center (..., 3) m; inertia (..., 3, 3) kg m2 about `about`, tensor form, the axes of the
    positions; matrix (..., 6, 6) = M_alpha; about (..., 3) m. Planar: center (..., 2), inertia (...),
    matrix (..., 3, 3).
    """

    mass: float
    center: Array
    inertia: Array
    matrix: Array
    about: Array

    @property
    def length(self) -> Array:
        """Rms distance of the mass from its center (...) m: sqrt(tr J / 2m), the length of rank tests."""
        r2 = ((self.center - self.about) ** 2).sum(axis=-1)
        if self.center.shape[-1] == 2:
            return np.asarray(np.sqrt(self.inertia / self.mass - r2))
        return np.asarray(np.sqrt(np.trace(self.inertia, axis1=-2, axis2=-1) / (2 * self.mass) - r2))


def mass_properties(
    mass: ArrayLike | SparseMatrix, position: ArrayLike, about: ArrayLike | None = None
) -> MassProperties:
    """Mass, center, inertia and M_alpha = S^T M S of nodes at their current positions.

    mass (node,) kg lumped, or (dof, dof) consistent, dense or scipy sparse, node-major, with three dof a
    node or six (planar two or three: the shape tells); position (..., node, 3) m; about (..., 3) m, the
    point of inertia and matrix, None = the mass center. A lumped node without mass may be NaN.
    Consistent bar and solid mass (blocks m_ij I) serves at every orientation; a beam or shell mass does
    not and must be in the current axes, M = T M_0 T^T. Lumping keeps mass and center but not the inertia
    of a coarse mesh. Raises DataError. Source: principal equations 2.6, 4a.

    >>> bar = mass_properties([1.0, 1.0], [[0.0, 0.0], [1.5, 0.0]])
    >>> bar.mass, bar.center.tolist(), float(bar.inertia)
    (2.0, [0.75, 0.0], 1.125)
    """
    x = np.asarray(position, dtype=float)
    M, dof = nodal_mass(mass, x)
    if M.ndim == 1:
        M, x = nodes_with_mass(M, x)
    m, c = _mass_and_center(M, x, dof)
    p = c if about is None else np.asarray(about, dtype=float)
    if M.ndim == 1:
        rho = x - p[..., None, :]
        Q = np.swapaxes(rho, -1, -2) @ (M[:, None] * rho)
        trace = np.trace(Q, axis1=-2, axis2=-1)  # J = tr(Q) I - Q, planar tr(Q)
        J = trace if Q.shape[-1] == 2 else trace[..., None, None] * np.eye(3) - Q
        return _assemble(m, c, p, np.asarray(J))
    S = summation_operator(x, p, rotations=dof > x.shape[-1])
    matrix = S.mT @ mass_times(M, S.mT).mT
    J = matrix[..., x.shape[-1] :, x.shape[-1] :]
    return MassProperties(m, c, J[..., 0, 0] if x.shape[-1] == 2 else J, matrix, p)


def mass_center(mass: ArrayLike | SparseMatrix, position: ArrayLike) -> Array:
    """Instantaneous mass center (..., 3) m of nodes at (..., node, 3) m; mass as in `mass_properties`."""
    x = np.asarray(position, dtype=float)
    M, dof = nodal_mass(mass, x)
    if M.ndim == 1:
        M, x = nodes_with_mass(M, x)
    return _mass_and_center(M, x, dof)[1]


def nodal_mass(mass: ArrayLike | SparseMatrix, position: Array) -> tuple[Any, int]:
    """The mass as (node,) or (dof, dof), dense or by rows, and the dof of one node; checked."""
    axis = axis_count(position)
    M: Any = mass.tocsr() if isinstance(mass, SparseMatrix) else np.asarray(mass, dtype=float)
    node = position.shape[-2] if position.ndim > 1 else 0
    if M.shape == (node,):
        _positive(float(M.sum()), "mass")
        return M, axis
    for dof in (axis, axis + (1 if axis == 2 else 3)):
        if M.shape == (node * dof, node * dof):
            return M, dof
    raise DataError(
        f"has shape {M.shape}, expected ({node},) for the {node} nodes of position, or ({node * axis}, "
        f"{node * axis})",
        "mass",
        "give one mass a node or a node-major mass matrix",
    )


def nodes_with_mass(mass: Array, *nodal: Array) -> tuple[Array, ...]:
    """Lumped mass and nodal fields of the nodes that carry any: a gap in a massless marker costs nothing."""
    keep = mass != 0
    return (mass, *nodal) if keep.all() else (mass[keep], *(f[..., keep, :] for f in nodal))


def mass_times(M: Any, field: Array) -> Array:
    """M f for fields (..., dof) and M (dof, dof), dense or sparse, as one product."""
    product: Array = (M @ field.reshape(-1, M.shape[1]).T).T
    return product.reshape(field.shape)


def _mass_and_center(M: Any, x: Array, dof: int) -> tuple[float, Array]:
    axis = x.shape[-1]
    if M.ndim == 1:
        m = float(M.sum())
        fold = np.kron(M[:, None], np.eye(axis)) / m
        return m, x.reshape(*x.shape[:-2], -1) @ fold
    unit = np.tile(np.eye(axis, dof), x.shape[-2])  # one unit acceleration of all nodes along each axis
    rows = sum_nodal(
        mass_times(M, unit).reshape(axis, -1, dof), x[..., None, :, :]
    )  # S_t^T M S, (..., axis, 6)
    block = rows[..., :axis].reshape(-1, axis, axis)[0]
    m = _positive(float(np.trace(block)) / axis, "mass")
    if np.abs(block - m * np.eye(axis)).max() > 1e-6 * m:
        raise DataError(
            f"gives different masses along the axes, {np.diag(block).tolist()} kg, or couples them",
            "mass",
            "order its dof node-major (all dof of node 0, then of node 1, ...)",
        )
    M_tr = rows[..., axis:]
    if axis == 2:
        return m, np.stack([M_tr[..., 1, 0], -M_tr[..., 0, 0]], axis=-1) / m
    return m, axial(M_tr) / (2 * m)


def _assemble(m: float, center: Array, about: Array, J: Array) -> MassProperties:
    """The record from mass, center and inertia about `about`."""
    axis = center.shape[-1]
    tensor = J[..., None, None] if axis == 2 else J
    M_rt = np.broadcast_to(m * cross_matrix(center - about), (*tensor.shape[:-2], tensor.shape[-1], axis))
    M_tt = np.broadcast_to(m * np.eye(axis), (*tensor.shape[:-2], axis, axis))
    matrix = np.concatenate(
        [np.concatenate([M_tt, M_rt.mT], axis=-1), np.concatenate([M_rt, tensor], axis=-1)], axis=-2
    )
    return MassProperties(m, center, np.asarray(J), matrix, about)


def _positive(m: float, where: str) -> float:
    if not m > 0:
        raise DataError(
            f"totals {m:g} kg, expected a positive total", where, "without mass a motion tells no force"
        )
    return m
