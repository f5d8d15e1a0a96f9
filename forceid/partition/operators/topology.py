"""Which degrees of freedom of the parts are one: assembly L, interface extraction B, interface assembly L_f.

A body is cut into partitions, each with nodes of its own. A Boolean matrix L_s says of every degree of
freedom of partition s which one of the assembled body it is: u_s = L_s u_g. What several partitions share is
the interface. Every partition is tied to it by its own multipliers, lambda, the forces that it exerts on the
interface: unique even where many partitions meet. Source: principal equations 2.7.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from forceid.errors import DataError
from forceid.partition.validation import real_matrix, real_positions
from forceid.records import Array, Indices


@dataclass(frozen=True)
class Topology:
    """Partitions and what they share.

    glob (partition,) of (dof,): the assembled degree of freedom of each one; size: how many of these there
    are. Degrees of freedom of all partitions stand one partition after the other, and so do multipliers.
    """

    glob: tuple[Indices, ...]
    size: int

    @cached_property
    def count(self) -> Indices:
        """Partitions that hold each assembled degree of freedom (size,)."""
        return np.asarray(np.bincount(np.concatenate(self.glob), minlength=self.size), dtype=np.intp)

    @cached_property
    def interface(self) -> Indices:
        """Assembled degrees of freedom (frame,) that partitions share."""
        return np.flatnonzero(self.count > 1)

    @cached_property
    def boundary(self) -> tuple[Indices, ...]:
        """Of each partition, those of its degrees of freedom that it shares."""
        return tuple(np.flatnonzero(self.count[g] > 1) for g in self.glob)

    @cached_property
    def frame(self) -> Indices:
        """Of each multiplier, which of the interface's degrees of freedom it pulls at."""
        place = np.full(self.size, -1)
        place[self.interface] = np.arange(len(self.interface))
        return np.concatenate([place[g[b]] for g, b in zip(self.glob, self.boundary, strict=True)])

    @cached_property
    def dofs(self) -> tuple[slice, ...]:
        """The rows of each partition among those of all."""
        return slices([len(g) for g in self.glob])

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """The multipliers of each partition among all of them."""
        return slices([len(b) for b in self.boundary])

    @property
    def L(self) -> Any:
        """Assembly, sparse (dof, size)."""
        return one_a_row(np.concatenate(self.glob), self.size)

    @cached_property
    def B(self) -> Any:
        """Interface extraction, sparse (dof, multiplier)."""
        at = np.concatenate([d.start + b for d, b in zip(self.dofs, self.boundary, strict=True)])
        return sp.csr_array(one_a_row(at, self.dofs[-1].stop).T)

    @cached_property
    def L_f(self) -> Any:
        """Interface assembly, sparse (multiplier, frame)."""
        return one_a_row(self.frame, len(self.interface))

    def shared(self, load: Array) -> Array:
        """An assembled load (size,) in equal shares on the partitions (dof,): L (L^T L)^-1 f_g."""
        return np.concatenate([load[g] / self.count[g] for g in self.glob])

    def assembled(self, load: Array) -> Array:
        """L^T f: what loads on the partitions (dof,) add up to (size,)."""
        return np.asarray(np.bincount(np.concatenate(self.glob), load, self.size))


def one_a_row(column: Indices, size: int) -> Any:
    """A Boolean matrix, sparse (row, size), with its one 1 a row in these columns."""
    return sp.csr_array((np.ones(len(column)), (np.arange(len(column)), column)), (len(column), size))


def slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    """Consecutive slices of these sizes."""
    ends = np.cumsum([0, *sizes])
    return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(ends))


def topology(boolean: Sequence[Any]) -> Topology:
    """The topology that Boolean matrices L_s (dof, size), dense or sparse, one a partition, describe.

    Each row holds exactly one 1, no partition uses an assembled degree of freedom twice, every one is used,
    and the partitions hang together. Raises DataError. Source: principal equations 2.7.

    >>> two_bars = topology([np.eye(3)[:2], np.eye(3)[1:]])
    >>> two_bars.interface.tolist(), two_bars.L_f.toarray().tolist()
    ([1], [[1.0], [1.0]])
    """
    given = [real_matrix(L, f"Boolean matrix of partition {s}") for s, L in enumerate(boolean)]
    found, size = [], {L.shape[1] for L in given}
    if len(size) != 1:
        what = f"have {sorted(size)} columns, expected one number for all"
        next_step = "give every partition a column for each degree of freedom of the body"
        raise DataError(what, "Boolean matrices", next_step)
    for s, L in enumerate(given):
        where = f"Boolean matrix of partition {s}"
        if not L.shape[0]:
            raise DataError("has no row: nothing of the partition is free", where, "leave the partition out")
        if L.nnz and not np.isin(L.data, (0, 1)).all():
            raise DataError("holds numbers other than 0 and 1", where, "expected one 1 a row")
        ones = np.asarray(L.sum(axis=1)).ravel()
        if (ones != 1).any():
            k = int((ones != 1).argmax())
            what = f"has {ones[k]:.0f} ones in row {k}, expected exactly one"
            raise DataError(what, where, "say of that degree of freedom which one of the body it is")
        L.eliminate_zeros()
        twice = np.flatnonzero(np.bincount(L.indices, minlength=L.shape[1]) > 1)
        if len(twice):
            raise DataError(f"uses the assembled degree of freedom {twice[0]} twice", where, "once at most")
        found.append(L.indices.astype(np.intp))
    return connected(Topology(tuple(found), size.pop()))


def connected(found: Topology) -> Topology:
    """The topology, where every assembled degree of freedom is used and the partitions hang together."""
    unused = np.flatnonzero(found.count == 0)
    if len(unused):
        raise DataError(
            f"leave {len(unused)} assembled degrees of freedom unused, the first {unused[0]}",
            "Boolean matrices",
            "drop their columns",
        )
    L = found.L
    owner = np.repeat(np.arange(len(found.glob)), [len(g) for g in found.glob])
    touch = one_a_row(owner, len(found.glob)).T @ L
    pieces, label = connected_components(touch @ touch.T, directed=False)
    if pieces > 1:
        lone = [np.flatnonzero(label == k).tolist() for k in range(pieces)]
        raise DataError(
            f"fall into {pieces} pieces that share nothing: {', '.join(map(str, lone))}",
            "partitions",
            "solve each piece by itself",
        )
    return found


def boolean_from_names(names: Sequence[Sequence[Hashable]], axes: int) -> list[Any]:
    """Boolean matrices of partitions whose nodes of one name are one node.

    names: of every node of every partition; axes: degrees of freedom a node. Assembled nodes are in the order
    in which they first appear.

    >>> [L.toarray().tolist() for L in boolean_from_names([["a", "b"], ["b", "c"]], axes=1)]
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]
    """
    if axes < 1 or axes % 1:
        raise DataError(f"is {axes}, expected a whole number above zero", "axes", "count the rows of a node")
    order: dict[Hashable, int] = {}
    for name in (name for part in names for name in part):
        if not isinstance(name, Hashable):
            raise DataError(f"hold {name!r}, expected text, numbers or tuples", "names", "name it by a tuple")
        order.setdefault(name, len(order))
    found = []
    for part in names:
        g = (np.array([order[name] for name in part])[:, None] * axes + np.arange(axes)).ravel()
        found.append(one_a_row(g, len(order) * axes))
    return found


def boolean_from_positions(positions: Sequence[ArrayLike], tolerance: float) -> list[Any]:
    """Boolean matrices of partitions (node, axis) m; nodes no farther apart than the tolerance are one."""
    places = real_positions(positions)
    if not tolerance > 0:
        raise DataError(f"is {tolerance}, expected a distance above zero", "tolerance", "give it in meters")
    every = np.concatenate(places)
    near = cKDTree(every).query_pairs(tolerance, output_type="ndarray")
    tie = sp.coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), (len(every), len(every)))
    name = connected_components(tie, directed=False)[1]
    return boolean_from_names([name[d].tolist() for d in slices([len(x) for x in places])], every.shape[1])


def without_fixed(boolean: Sequence[Any], fixed: Indices) -> tuple[list[Any], list[Indices]]:
    """Boolean matrices without the assembled degrees of freedom `fixed`, and which rows of each are left."""
    size = boolean[0].shape[1]
    free = np.setdiff1d(np.arange(size), fixed)
    cut, kept = [], []
    for L in boolean:
        L = sp.csr_array(L)
        rows = np.flatnonzero(~np.isin(L.indices, fixed))
        kept.append(rows)
        cut.append(sp.csr_array(L[rows][:, free]))
    return cut, kept


def compatible(R: Array, kept: Indices) -> Array:
    """Combinations of rigid modes R (dof, mode) that leave the rows not kept at rest, at the rows kept."""
    fixed = np.delete(R, kept, axis=0)
    if not len(fixed):
        return R
    _, size, turned = np.linalg.svd(fixed)
    rank = int((size > 1e-10 * size[0]).sum()) if len(size) else 0
    return np.asarray(R[kept] @ turned[rank:].T)
