"""Parts of a body and the wrenches that pass between them through links: what the motion of the parts tells.

Every part gives what is applied to it, less its inertia, to the links that hold it. Where the links form a
tree each of them passes a known wrench; every independent loop leaves as many components open as a link can
pass, six in space and three in the plane. No stiffness is asked for. Source: principal equations 2.11 A, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components

from forceid.errors import DataError
from forceid.principal.loads import cholesky_root, whitened_fit
from forceid.records import Array, Flags

GROUND = -1  # the part that no balance is asked of
RESULTANT_RANK = 1e-10  # of the largest singular value, below which a direction counts as unseen


@dataclass(frozen=True)
class LinkResultants:
    """The wrench that each link passes from its first part to its second, as far as the motion tells it.

    wrench (..., link, n) N, N m: zero along null_space, so to be read where `determined`; joint_cov
    (..., link * n, link * n): its covariance, all links together, None where none was given; null_space
    (link * n, k): orthonormal wrenches of the links that move nothing; loops: independent ones of the links,
    the ground a part. chi_square (...,): what is left of the balances that repeat each other, with `dof`
    degrees of freedom, in squared units of the wrench where no covariance was given. Source: principal
    equations 2.11 A.
    """

    links: tuple[tuple[int, int], ...]
    wrench: Array
    joint_cov: Array | None
    null_space: Array
    loops: int
    chi_square: Array
    dof: int

    @property
    def cov(self) -> Array | None:
        """Covariance (..., link, n, n) of each link's wrench."""
        if self.joint_cov is None:
            return None
        count, n = self.wrench.shape[-2:]
        split = self.joint_cov.reshape(*self.joint_cov.shape[:-2], count, n, count, n)
        return np.stack([split[..., k, :, k, :] for k in range(count)], axis=-3)

    @property
    def estimable(self) -> Array:
        """The projector (link * n, link * n) that takes wrenches of all links to their determined part."""
        return np.asarray(np.eye(len(self.null_space)) - self.null_space @ self.null_space.T)

    @property
    def determined(self) -> Flags:
        """Which links (link,) have all of their wrench determined."""
        by_link = self.null_space.reshape(len(self.links), self.wrench.shape[-1], -1)
        return np.asarray((np.abs(by_link) < 1e-8).all(axis=(1, 2)))


def link_resultants(
    links: Sequence[tuple[int, int]],
    wrench: ArrayLike,
    cov: ArrayLike | None = None,
    passes: Sequence[ArrayLike | None] | None = None,
) -> LinkResultants:
    """The wrenches of links a -> b from what each part gives away, by weighted least squares.

    wrench (..., part, n): R^T (f - M u''), what is applied to each part less its inertia, N and N m, all
    about one point in one set of axes, n = 6, planar 3; cov (..., part, n, n): its covariance, parts
    independent.
    A link adds g to what its first part gives and takes g from what the second does: g is what the first
    exerts on the second. With `wrench` of the other sign, inertia less applied, it is what the second exerts.
    A part of -1 is the ground. passes: of each link the columns (..., n, k) of wrenches that it can pass, a
    hinge those of forces through its point; None: all.

    Links do not change in time, what they pass may; then null_space is all that some sample leaves open, and
    chi_square NaN where the rank falls below the highest. NaN in, NaN out. Raises DataError.
    Source: principal equations 2.11 A, 4h.

    >>> chain = link_resultants([(0, 1), (1, 2)], [[5.0, 0, 0], [-2.0, 1, 0], [-3.0, -1, 0]])
    >>> chain.wrench.round(12) + 0.0, chain.loops, chain.dof
    (array([[5., 0., 0.],
           [3., 1., 0.]]), 0, 3)
    """
    w = np.asarray(wrench, dtype=float)
    if w.ndim < 2:
        raise DataError(f"has shape {w.shape}, expected (..., part, n)", "wrench")
    parts, n = w.shape[-2:]
    pairs = validated_links(links, parts)
    known = np.isfinite(w).all((-2, -1))
    root = None
    if cov is not None:
        C = np.asarray(cov, dtype=float)
        if C.shape[-3:] != (parts, n, n):
            raise DataError(f"has shape {C.shape}, expected (..., {parts}, {n}, {n})", "cov")
        known = known & np.isfinite(C).all((-3, -2, -1))
        root = cholesky_root(C, "cov")
    E = transmitted(passes, len(pairs), n)
    seen = np.asarray(np.isfinite(E).all((-2, -1)))
    known = known & seen
    E = np.where(seen[..., None, None], E, 0.0)

    A = np.kron(incidence(pairs, parts), np.eye(n)) @ E
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    held = s > RESULTANT_RANK * np.maximum(s[..., :1], 1e-300)
    rank = held.sum(-1)
    V = (Vt * held[..., None]).mT  # row space of A, zero columns for what is unseen
    b, AV = np.where(known[..., None, None], w, 0.0), (A @ V).reshape(*A.shape[:-2], parts, n, -1)
    if root is not None:
        AV = np.linalg.solve(root, AV)
        b = np.linalg.solve(root, b[..., None])[..., 0]
    AV = AV.reshape(*AV.shape[:-3], parts * n, AV.shape[-1])
    b = b.reshape(*b.shape[:-2], parts * n)
    Y, g, misfit = whitened_fit(AV, b, E @ V, rank)

    every = rank == int(rank[seen].max(initial=0))
    determined = known & every
    joint = None if root is None else np.where(known[..., None, None], Y @ Y.mT, np.nan)
    return LinkResultants(
        links=pairs,
        wrench=np.where(known[..., None], g, np.nan).reshape(*g.shape[:-1], len(pairs), n),
        joint_cov=joint,
        null_space=unobserved_directions(E @ (np.eye(E.shape[-1]) - V @ V.mT) @ E.mT, seen),
        loops=loop_count(pairs, parts),
        chi_square=np.where(determined, misfit, np.nan),
        dof=parts * n - int(rank[seen].max(initial=0)),
    )


def validated_links(links: Sequence[tuple[int, int]], parts: int) -> tuple[tuple[int, int], ...]:
    """Links as pairs of two different parts, of which one may be the ground."""
    pairs = tuple((int(a), int(b)) for a, b in links)
    if not pairs:
        raise DataError("is empty, expected one pair of parts at least", "links")
    for k, (a, b) in enumerate(pairs):
        if not all(GROUND <= p < parts for p in (a, b)) or a == b:
            raise DataError(
                f"is ({a}, {b}), expected two of the parts 0 to {parts - 1}, or -1 for the ground",
                f"link {k}",
            )
    return pairs


def incidence(links: Sequence[tuple[int, int]], parts: int) -> Array:
    """+1 where a part is the first of a link, -1 where the second (part, link); the ground has no row."""
    found = np.zeros((parts + 1, len(links)))
    for k, (a, b) in enumerate(links):
        found[a, k], found[b, k] = 1.0, -1.0
    return found[:parts]


def loop_count(links: Sequence[tuple[int, int]], parts: int) -> int:
    """Independent loops: links less what a tree of the parts, with the ground if a link meets it, needs."""
    first, second = np.array(links).T % (parts + 1)  # the ground comes last
    size = parts + int(GROUND in np.array(links))
    graph = sp.coo_array((np.ones(len(links)), (first, second)), (size, size))
    return len(links) - size + int(connected_components(graph, directed=False)[0])


def transmitted(passes: Sequence[ArrayLike | None] | None, links: int, n: int) -> Array:
    """Orthonormal columns (..., link * n, column) of what the links pass, each link's in its own rows."""
    given = [None] * links if passes is None else list(passes)
    if len(given) != links:
        raise DataError(f"has {len(given)} entries, expected {links}, one a link", "passes")
    found = []
    for k, columns in enumerate(given):
        X = np.eye(n) if columns is None else np.asarray(columns, dtype=float)
        if X.ndim < 2 or X.shape[-2] != n:
            raise DataError(f"has shape {X.shape}, expected (..., {n}, k)", f"passes of link {k}")
        known = np.isfinite(X).all((-2, -1), keepdims=True)
        U, s, _ = np.linalg.svd(np.where(known, X, 0.0), full_matrices=False)
        # columns that repeat others stay, as zeros, so that all samples have as many
        basis = U * (s > RESULTANT_RANK * np.maximum(s[..., :1], 1e-300))[..., None, :]
        found.append(np.where(known, basis, np.nan))
    batch = np.broadcast_shapes(*[x.shape[:-2] for x in found])
    E, at = np.zeros((*batch, links * n, sum(x.shape[-1] for x in found))), 0
    for k, x in enumerate(found):
        E[..., k * n : (k + 1) * n, at : at + x.shape[-1]] = x
        at += x.shape[-1]
    return E


def unobserved_directions(projector: Array, known: Flags) -> Array:
    """Orthonormal directions (link * n, k) that the projectors (..., size, size) of known samples hold."""
    size = projector.shape[-1]
    each = projector.reshape(-1, size, size)[np.ravel(known)]
    value, basis = np.linalg.eigh(each.mean(axis=0) if len(each) else np.zeros((size, size)))
    return np.asarray(basis[:, value > 1e-8])
