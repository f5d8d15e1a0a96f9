"""The summation operator S: rigid motions of a set of nodes, and the resultant S^T f of forces on them.

A planar node has two translations and one rotation, a spatial one three and three; the last axis of
`position` tells which. Degrees of freedom are ordered node-major, resultants force first, moment second.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.records import Array

PAIRS = {2: ((0, 1),), 3: ((1, 2), (2, 0), (0, 1))}  # the axes that each component of a moment takes


def cross_matrix(r: ArrayLike) -> Array:
    """[r]x, the matrix with [r]x b = r x b.

    r (..., 3) gives (..., 3, 3); planar (..., 2) gives the row (..., 1, 2). Source: principal equations 0.

    >>> cross_matrix([1.0, 0.0, 0.0]) @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    """
    r = np.asarray(r, dtype=float)
    if axis_count(r) == 2:
        return np.stack([-r[..., 1], r[..., 0]], axis=-1)[..., None, :]
    X = np.zeros((*r.shape, 3))
    X[..., 2, 1], X[..., 0, 2], X[..., 1, 0] = r[..., 0], r[..., 1], r[..., 2]
    return X - np.swapaxes(X, -1, -2)


def cross(r: Array, b: Array) -> Array:
    """Cross product r x b, by components: (..., 3) gives (..., 3), planar (..., 2) gives (..., 1)."""
    return np.stack([r[..., j] * b[..., k] - r[..., k] * b[..., j] for j, k in PAIRS[r.shape[-1]]], axis=-1)


def axial(G: Array) -> Array:
    """Sum of x x b from G = sum of x b^T: (..., 3, 3) gives (..., 3), planar (..., 2, 2) gives (..., 1)."""
    return np.stack([G[..., j, k] - G[..., k, j] for j, k in PAIRS[G.shape[-1]]], axis=-1)


def axis_count(position: Array) -> int:
    """2 for planar, 3 for spatial coordinates (the last axis); anything else is a DataError."""
    if position.ndim == 0 or position.shape[-1] not in (2, 3):
        raise DataError(
            f"has shape {position.shape}, expected 2 or 3 coordinates on the last axis", "position"
        )
    return int(position.shape[-1])


def summation_operator(position: ArrayLike, about: ArrayLike | None = None, rotations: bool = False) -> Array:
    """The rigid motions of the nodes as columns; its transpose sums nodal forces to force and moment.

    position (..., node, 3) m at the configuration the forces act on; about (..., 3) m, the moment
    point, None = the origin of coordinates; returns (..., dof, 6), three rows a node or six with
    `rotations`. Planar (..., node, 2) gives (..., dof, 3), two rows a node or three (u, v, theta).
    World axes in, world axes out. Raises DataError. Source: principal equations 2.2 and 2.3.

    >>> S = summation_operator([[0.0, 0.0], [0.3, 0.0]])
    >>> S.T @ [0.0, 1.0, 0.0, 1.0]
    array([0. , 2. , 0.3])
    """
    x, p = _nodes(position, about)
    x = x - p
    *batch, node, axis = x.shape
    spin = 1 if axis == 2 else 3
    S = np.zeros((*batch, node, axis + spin if rotations else axis, axis + spin))
    S[..., :axis, :axis] = np.eye(axis)
    S[..., :axis, axis:] = np.swapaxes(cross_matrix(x), -1, -2)
    if rotations:
        S[..., axis:, axis:] = np.eye(spin)
    return S.reshape(*batch, -1, axis + spin)


def sum_nodal(
    nodal: ArrayLike, position: ArrayLike, about: ArrayLike | None = None, weight: ArrayLike | None = None
) -> Array:
    """S^T f for the nodal field f, without forming S or a cross product per node.

    nodal (..., node, 3) N, or (..., node, 6) with nodal moments N m; position and about as in
    `summation_operator`; weight (node,) multiplies the field node by node (mass times acceleration
    without forming it). Returns (..., 6): force N, moment N m; planar (..., 3). World axes.
    """
    (x, p), f = _nodes(position, about), np.asarray(nodal, dtype=float)
    node, axis = x.shape[-2:]
    w = np.ones(node) if weight is None else np.asarray(weight, dtype=float)
    # rows of a record as long vectors: sums over nodes are then one matrix product
    total = f.reshape(*f.shape[:-2], -1) @ np.kron(w[:, None], np.eye(f.shape[-1]))
    lever = x if weight is None else (x.reshape(*x.shape[:-2], -1) * np.repeat(w, axis)).reshape(x.shape)
    force, couple = total[..., :axis], total[..., axis:]
    moment = axial(np.swapaxes(lever, -1, -2) @ f[..., :axis]) - cross(p[..., 0, :], force)
    if couple.shape[-1]:
        moment = moment + couple
    force = np.broadcast_to(force, (*moment.shape[:-1], axis))
    return np.concatenate([force, moment], axis=-1)


def _nodes(position: ArrayLike, about: ArrayLike | None) -> tuple[Array, Array]:
    """Positions of the nodes (..., node, axis) and, to be subtracted from them, the moment point."""
    x = np.asarray(position, dtype=float)
    axis = axis_count(x)
    if x.ndim < 2:
        raise DataError(f"has shape {x.shape}, expected (..., node, {axis})", "position")
    p = np.zeros(axis) if about is None else np.asarray(about, dtype=float)
    if p.ndim == 0 or p.shape[-1] != axis:
        raise DataError(f"has shape {p.shape}, expected (..., {axis}), as the nodes have", "about")
    return x, p[..., None, :]
