"""Motion of one mesh of a surface on the nodes of another: linear shape functions at the closest point.

Source: principal equations 2.11 D.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from forceid.errors import DataError
from forceid.principal.operator import axis_count
from forceid.records import Array, Indices

CHUNK = 512  # fluid nodes looked up at once
FLAT_FACE = 1e-12  # squared sine of the corner of a triangle that is a line


def interpolation(structure: ArrayLike, fluid: ArrayLike, cells: Sequence[Any] | Array | None = None) -> Any:
    """Sparse H (fluid, structure): linear shape functions at the closest point of the structural surface.

    structure (node, axis) m, fluid (node, axis) m; cells: node numbers of lines (2), triangles (3) and
    quadrilaterals (4, four triangles around their center), mixed or not; None = a line through all nodes in
    order, for planar nodes only. A fluid node off the surface gets the motion of its closest point, and
    `reproduction` says how far that is. Raises DataError. Source: principal equations 2.11 D.

    >>> interpolation([[0.0, 0.0], [2.0, 0.0]], [[0.5, 0.0], [3.0, 0.1]]).toarray()
    array([[0.75, 0.25],
           [0.  , 1.  ]])
    """
    x_s, x_f = surfaces(structure, fluid)
    corners, triangle = _triangles(len(x_s), x_s.shape[1], cells)
    points = corners @ x_s
    T = points[triangle]
    middle = T.mean(axis=1)
    radius = np.linalg.norm(T - middle[:, None], axis=-1).max()
    middles = cKDTree(middle)
    near = np.asarray(cKDTree(points[np.unique(triangle)]).query(x_f)[0])
    found, weight = np.empty(len(x_f), dtype=np.intp), np.empty((len(x_f), 3))
    for first in range(0, len(x_f), CHUNK):
        some = slice(first, first + CHUNK)
        # the closest triangle is no farther than the nearest corner, its middle no more than a radius on
        lists: Any = middles.query_ball_point(x_f[some], (1 + 1e-9) * (near[some] + radius))
        node = np.repeat(np.arange(len(lists)), [len(k) for k in lists])
        candidate = np.concatenate([np.sort(k) for k in lists]).astype(np.intp)
        w = _closest(x_f[some][node], T[candidate])
        off = np.linalg.norm(np.einsum("pk,pka->pa", w, T[candidate]) - x_f[some][node], axis=-1)
        order = np.lexsort((off, node))
        best = order[np.searchsorted(node[order], np.arange(len(lists)))]
        found[some], weight[some] = candidate[best], w[best]
    H = sp.csr_array(
        (weight.ravel(), (np.repeat(np.arange(len(x_f)), 3), triangle[found].ravel())),
        shape=(len(x_f), len(points)),
    )
    H = sp.csr_array(H @ corners)
    H.eliminate_zeros()
    return H


def surfaces(structure: ArrayLike, fluid: ArrayLike) -> tuple[Array, Array]:
    """Nodes (node, axis) of both, finite, at least one, with as many coordinates."""
    x_s, x_f = np.asarray(structure, dtype=float), np.asarray(fluid, dtype=float)
    for x, where in ((x_s, "structure"), (x_f, "fluid")):
        if x.ndim != 2 or not len(x) or not np.isfinite(x).all() or axis_count(x) != x_s.shape[-1]:
            raise DataError(
                f"has shape {x.shape}, expected (node, axis), finite, with as many axes as the structure",
                where,
            )
    return x_s, x_f


def _triangles(nodes: int, axis: int, cells: Sequence[Any] | Array | None) -> tuple[Any, Indices]:
    """Points as sparse means of nodes (point, node), and triangles (triangle, 3); a line repeats its end."""
    if cells is None:
        if axis == 3:
            raise DataError(
                "is not given, and spatial nodes need it", "cells", "list the faces by their nodes"
            )
        cells = np.stack([np.arange(nodes - 1), np.arange(1, nodes)], axis=1)
    triangle: list[list[int]] = []
    center: list[list[int]] = []
    for k, cell in enumerate(cells):
        c = [int(i) for i in cell]
        if not 2 <= len(c) <= 4 or min(c) < 0 or max(c) >= nodes:
            raise DataError(f"is {c}, expected 2, 3 or 4 node numbers from 0 to {nodes - 1}", f"cell {k}")
        if len(c) == 4:
            triangle += [[a, b, nodes + len(center)] for a, b in zip(c, [*c[1:], c[0]], strict=True)]
            center.append(c)
        else:
            triangle.append([*c, c[-1]] if len(c) == 2 else c)
    if not triangle:
        raise DataError("is empty: there is no surface to put a node on", "cells")
    corners = np.array(center, dtype=np.intp).reshape(-1, 4)
    row = np.repeat(np.arange(len(corners)), 4)
    mean = sp.csr_array((np.full(corners.size, 0.25), (row, corners.ravel())), shape=(len(corners), nodes))
    return sp.csr_array(sp.vstack([sp.eye_array(nodes), mean])), np.array(triangle, dtype=np.intp)


def _closest(p: Array, T: Array) -> Array:
    """Weights (pair, 3) of the corners T (pair, 3, axis) at the point of each triangle closest to p."""
    best, least = np.zeros((len(p), 3)), np.full(len(p), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        e = T[:, j] - T[:, i]
        long = np.einsum("pa,pa->p", e, e)
        t = np.clip(np.einsum("pa,pa->p", p - T[:, i], e) / np.where(long > 0, long, 1.0), 0.0, 1.0)
        off = ((T[:, i] + t[:, None] * e - p) ** 2).sum(axis=1)
        nearer = off < least
        w = np.zeros((len(p), 3))
        w[:, i], w[:, j] = 1 - t, t
        best, least = np.where(nearer[:, None], w, best), np.minimum(off, least)
    E = T[:, 1:] - T[:, :1]
    a, b, c = ((E[:, i] * E[:, j]).sum(axis=1) for i, j in ((0, 0), (0, 1), (1, 1)))
    det = a * c - b * b
    flat = det > FLAT_FACE * a * c
    safe = np.where(flat, det, 1.0)
    d, e = (np.einsum("pa,pa->p", p - T[:, 0], E[:, i]) for i in (0, 1))
    s, t = (c * d - b * e) / safe, (a * e - b * d) / safe
    inside = flat & (s >= 0) & (t >= 0) & (s + t <= 1)
    return np.where(inside[:, None], np.stack([1 - s - t, s, t], axis=1), best)
