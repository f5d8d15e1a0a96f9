"""From resultants to loads: minimum-norm nodal forces; least-squares loads p of f = B p, and their rank."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from forceid.errors import DataError, EstimationError
from forceid.principal.operator import axis_count, cross_matrix, sum_nodal
from forceid.principal.wrench import transport
from forceid.records import Array, Loads, all_finite


def distribute(
    wrench: ArrayLike, position: ArrayLike, weight: ArrayLike | None = None, about: ArrayLike | None = None
) -> Array:
    """Nodal forces f = W S (S^T W S)^+ g of least f^T W^-1 f that have the given resultant, S^T f = g.

    wrench (..., 6) N, N m about the point `about` (..., 3) m; position (..., node, 3) m; weight (node,),
    none negative: None = all equal (least forces), masses = the pattern of a rigid acceleration, areas =
    pressures. Returns (..., node, 3) N, world axes; planar (..., 3) and (..., node, 2).

    about=None is the center of the weights: with weight=mass the mass center, which is the default point
    of `resultant`; without weights the plain centroid of the nodes, so give `about` there if the wrench
    is about the mass center. NaN in, NaN out. Raises DataError, and EstimationError where the nodes
    cannot carry the moment (about the line that collinear nodes lie on). One distribution among many:
    the true one differs by any self-equilibrated load. Source: principal equations 4c, 5.4.

    >>> distribute([0.0, 2.0, 0.3], [[0.0, 0.0], [0.3, 0.0]], about=[0.0, 0.0])
    array([[0., 1.],
           [0., 1.]])
    """
    g, x = np.asarray(wrench, dtype=float), np.asarray(position, dtype=float)
    axis, node = axis_count(x), x.shape[-2]
    w = np.ones(node) if weight is None else np.asarray(weight, dtype=float)
    if w.shape != (node,) or (w < 0).any() or not w.sum() > 0:
        raise DataError(f"must be {node} numbers, none negative and not all zero", "weight")
    x = np.where(w[:, None] > 0, x, 0.0)  # a gap in a node that takes no load costs nothing
    center = (w @ x) / w.sum()
    if about is not None:
        g = transport(g, np.asarray(about, dtype=float) - center)
    rho = x - center[..., None, :]
    force, moment = g[..., :axis], g[..., axis:]
    reach = np.fmax.reduce(np.abs(x), axis=None, initial=0.0)
    turn = _turn(moment, rho, w, floor=float(w.sum() * (8 * np.finfo(float).eps * reach) ** 2))
    spin = turn[..., None] * np.array([[0.0, -1.0], [1.0, 0.0]]) if axis == 2 else cross_matrix(turn)
    f = w[:, None] * ((force / w.sum())[..., None, :] + rho @ spin.mT)
    left = np.linalg.norm(sum_nodal(f, rho)[..., axis:] - moment, axis=-1)
    size = np.linalg.norm(moment, axis=-1)
    # a force makes moments of rounding about the center, which ask for nothing
    arm = reach if about is None else max(reach, float(np.fmax.reduce(np.abs(about), axis=None)))
    rounding = 1e-13 * arm * np.abs(f).sum(axis=(-2, -1))
    if (left > 1e-6 * size + rounding).any():
        raise EstimationError(
            f"asks for {np.fmax.reduce(left, axis=None):.3g} N m that forces at these nodes cannot make, "
            "for they lie on a line or in a point",
            "wrench",
            "add a node off the line, or distribute the other components only",
        )
    return np.asarray(f)


def _turn(moment: Array, rho: Array, w: Array, floor: float) -> Array:
    """Rigid angular pattern J^+ T of the weighted nodes about their center, (..., 1) planar or (..., 3).

    Principal moments below 1e-12 of the largest, or below floor, are zero; NaN where a node is NaN.
    """
    Q = rho.mT @ (w[:, None] * rho)
    trace = np.trace(Q, axis1=-2, axis2=-1)[..., None, None]
    J = trace if rho.shape[-1] == 2 else trace * np.eye(3) - Q
    known = np.asarray(np.isfinite(J).all(axis=(-2, -1), keepdims=True))
    value, vector = np.linalg.eigh(np.where(known, J, 0.0))
    kept = value > np.maximum(1e-12 * value[..., -1:], floor)
    inverse = np.where(kept, 1 / np.where(kept, value, 1.0), 0.0)
    turn = (vector * inverse[..., None, :]) @ vector.mT @ moment[..., None]
    return np.where(known, turn, np.nan)[..., 0]


def solve_loads(
    wrench: ArrayLike,
    wrench_cov: ArrayLike,
    G: ArrayLike,
    length: float,
    name: Sequence[str] = (),
    tolerance: float = 1e-6,
) -> Loads:
    """Loads p of g = G p by weighted least squares, and which combinations of them the wrench determines.

    wrench g (time, 6) N, N m and wrench_cov (6, 6) or (time, 6, 6); G (6, load) or (time, 6, load):
    the wrench of a unit of each load, S^T B of nodal forces B (dof, load), or `transport([*direction, 0, 0,
    0], point - about)` of one at a point; all about one point and in the same axes, and then the answer does
    not depend on it.
    length m: the rms radius of the mass (`MassProperties.length`), by which moments are divided in the
    rank test; directions below `tolerance` of the largest singular value count as unseen. Planar: 3 for 6.
    Beyond the six, forces on modes of unit shapes may follow, with Phi^T B as rows of G.

    Along unseen directions the load is the one of least norm, and load_cov claims nothing about them:
    read `null_space`, `estimable` and `undetermined` first. With a G that changes in time, estimable
    is what every sample determines; chi_square, with dof = rows - rank, is NaN where the rank falls below
    the highest. NaN in, NaN out. Raises DataError. Source: principal equations 4c.

    >>> G = np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])  # planar: two forces on one line
    >>> p = solve_loads([[2.0, 0.0, 0.0]], np.eye(3), G, length=0.1)
    >>> p.load, p.estimable, p.dof
    (array([[1., 1.]]), array([[1., 1.]]), 2)
    """
    g, C, G = (np.asarray(a, dtype=float) for a in (wrench, wrench_cov, G))
    size, count = G.shape[-2:]
    if g.ndim != 2 or g.shape[1] != size or C.shape[-2:] != (size, size) or size in (0, 1, 2, 4, 5):
        raise DataError(
            f"has shape {g.shape} with covariance {C.shape} and G {G.shape}, expected (time, 6), (..., 6, 6) "
            "and (..., 6, load), or 3 or more for 6",
            "wrench",
        )
    known = all_finite(g) & np.isfinite(C).all((-2, -1)) & np.isfinite(G).all((-2, -1))
    G = np.where(np.isfinite(G).all((-2, -1), keepdims=True), G, 0.0)
    root = cholesky_root(C, "wrench_cov")

    scale = np.ones(size)
    scale[slice(2, 3) if size == 3 else slice(3, 6)] = 1 / length
    _, s, Vt = np.linalg.svd(scale[:, None] * G, full_matrices=False)
    seen = s > tolerance * s[..., :1]
    V = (Vt * seen[..., None]).mT  # row space of G, (..., load, rank), zero columns for what is unseen
    b, rank = np.linalg.solve(root, np.where(known[:, None], g, 0.0)[..., None])[..., 0], seen.sum(axis=-1)
    Y, load, misfit = whitened_fit(np.linalg.solve(root, G @ V), b, V, rank)
    top = int(rank[known].max(initial=0)) if rank.ndim else int(rank)
    estimable, null_space = _row_space(np.broadcast_to(V, (len(g), *V.shape[-2:]))[known], tolerance)
    return Loads(
        name=tuple(name) or tuple(f"p{k}" for k in range(count)),
        load=np.where(known[:, None], load, np.nan),
        load_cov=np.where(known[:, None, None], Y @ Y.mT, np.nan),
        null_space=null_space,
        estimable=estimable,
        chi_square=np.where(known & (rank == top), misfit, np.nan),
        dof=size - top,
    )


def cholesky_root(C: Array, where: str) -> Any:
    """Lower Cholesky factors of covariances (..., n, n), one where these are not known. DataError."""
    known = np.isfinite(C).all((-2, -1), keepdims=True)
    try:
        return np.linalg.cholesky(np.where(known, C, np.eye(C.shape[-1])))
    except np.linalg.LinAlgError as e:
        next_step = "give every component a standard deviation above zero"
        raise DataError("must be positive definite", where, next_step) from e


def whitened_fit(A: Array, b: Array, V: Array, rank: Array) -> tuple[Array, Array, Array]:
    """Least squares A c = b of white rows: Y with Y Y^T the covariance of x = V c, x itself, squared misfit.

    A (..., row, c), b (..., row), V (..., x, c); rank (...): singular directions that count.
    """
    U, s, Wt = np.linalg.svd(A, full_matrices=False)
    held = np.arange(s.shape[-1]) < rank[..., None]
    Y = V @ (Wt.mT * np.where(held, 1 / np.where(held, s, 1.0), 0.0)[..., None, :])
    U = U * held[..., None, :]
    share = U.mT @ b[..., None]
    left = b - (U @ share)[..., 0]
    return Y, (Y @ share)[..., 0], np.asarray((left**2).sum(-1))


def undetermined(loads: Loads, tolerance: float = 1e-6) -> tuple[str, ...]:
    """Names of the loads that the wrench does not determine one by one, only in combination with others.

    >>> G = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    >>> undetermined(solve_loads([[2.0, 1.0, 0.0]], np.eye(3), G, 0.1, name=["bow", "stern", "keel"]))
    ('bow', 'stern')
    """
    hidden = np.linalg.norm(loads.null_space, axis=1) > tolerance
    return tuple(n for n, h in zip(loads.name, hidden, strict=True) if h)


def _row_space(V: Array, tolerance: float) -> tuple[Array, Array]:
    """Estimable rows and null-space columns, by what every sample sees: row spaces V (time, load, rank)."""
    count = V.shape[1]
    mean = np.tensordot(V, V, axes=([0, 2], [0, 2])) / max(len(V), 1)
    value, basis = np.linalg.eigh(mean)
    always = value > 1 - tolerance
    rows = basis[:, always].T
    if len(rows):  # reduced to the form "p0 + p2", with an identity on leading loads
        lead = np.sort(scipy.linalg.qr(rows, mode="r", pivoting=True)[1][: len(rows)])
        rows = np.linalg.solve(rows[:, lead], rows)
        rows[np.abs(rows) < 1e-12] = 0.0
    return rows.reshape(-1, count), basis[:, ~always]
