"""One assembled stiffness taken apart among parts that touch through nodes only.

An entry between two nodes belongs to the one part that holds both. At a node that parts share, what is each
part's own follows from equilibrium: moved as a rigid body, a part alone resists nothing, K_s R_s = 0. Two
nodes that the same parts share and that the stiffness couples are another matter: an edge between parts may
be anyone's, K_s + X and K_t - X fit with any X of X R = 0, and only the elements tell. Shared nodes that the
sum does not couple are taken to be uncoupled in each part. Source: principal equations 2.1, 2.7.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.records import Array, Flags, Indices

NODES_COUPLED = 1e-12  # of the stiffness of both, up to which an entry between two freedoms is rounding
RESISTS = 1e-8  # of what moves a node, that may be left when a part moves as a rigid body


@dataclass(frozen=True)
class NodeCut:
    """Which nodes (node,) each part holds, by number; names of parts and of nodes; dof of a node."""

    nodes: tuple[Indices, ...]
    part: tuple[str, ...]
    node: tuple[str, ...]
    dof: int

    @cached_property
    def holds(self) -> Any:
        """1 where a part holds a node, sparse (node, part)."""
        owner = np.repeat(np.arange(len(self.nodes)), [len(n) for n in self.nodes])
        shape = len(self.node), len(self.nodes)
        return sp.csr_array((np.ones(len(owner)), (np.concatenate(self.nodes), owner)), shape)

    @cached_property
    def count(self) -> Array:
        """Parts that hold each node (node,)."""
        return np.asarray(self.holds.sum(axis=1)).ravel()

    def dofs(self, part: int) -> Indices:
        """The degrees of freedom (dof,) of a part, node-major."""
        return np.asarray((self.nodes[part][:, None] * self.dof + np.arange(self.dof)).ravel())

    def owners(self, node: int) -> str:
        """The parts that hold a node, in words."""
        names = [self.part[s] for s, nodes in enumerate(self.nodes) if node in nodes]
        return " and ".join(names) or "no part"


def separated_stiffness(K: Any, cut: NodeCut, motions: Array) -> list[Any]:
    """The stiffness of every part, sparse; motions (dof, n): rigid ones of all nodes, translations first.

    Raises DataError: two nodes coupled that no part holds both, or that several do; a shared node that
    something besides the parts holds. Source: principal equations 2.1, 2.7.
    """
    check_pairs(K, cut, "stiffness")
    found, held = [], np.zeros((len(cut.node), cut.dof, cut.dof))
    for s, nodes in enumerate(cut.nodes):
        d = cut.dofs(s)
        shared = np.flatnonzero(cut.count[nodes] > 1)
        bare = without_blocks(K[d][:, d], cut.count[nodes] > 1, cut.dof)
        lead = motions[d][:, : cut.dof].reshape(len(nodes), cut.dof, cut.dof)
        moved = np.asarray(bare @ motions[d][:, : cut.dof]).reshape(lead.shape)
        block = -moved[shared] @ np.linalg.inv(lead[shared])
        own = bare + node_blocks(0.5 * (block + block.mT), shared, len(nodes))
        np.add.at(held, nodes[shared], block)
        check_rigid(own, motions[d], nodes, shared, cut, s)
        found.append(sp.csr_array(own))
    check_supports(K, held, cut)
    return found


def separated_mass(M: Any, cut: NodeCut) -> list[Any]:
    """The mass of every part, shared nodes in equal shares; DataError where a consistent mass couples one."""
    check_pairs(M, cut, "mass", alone=True)
    found = []
    for s, nodes in enumerate(cut.nodes):
        d, several = cut.dofs(s), cut.count[nodes] > 1
        whole = M[d][:, d]
        bare = without_blocks(whole, several, cut.dof)
        share = sp.diags_array(np.repeat(1 / cut.count[nodes], cut.dof))
        found.append(sp.csr_array(bare + share @ (whole - bare) if several.any() else whole))
    return found


def check_pairs(A: Any, cut: NodeCut, name: str, alone: bool = False) -> None:
    """Every two nodes that A couples are in one part and no more; alone: and shared nodes are not coupled."""
    entry = sp.coo_array(A)
    size = np.sqrt(np.abs(A.diagonal()))
    size = np.where(size > 0, size, size.max(initial=0.0))
    i, j = entry.row // cut.dof, entry.col // cut.dof
    seen = (i < j) & (np.abs(entry.data) > NODES_COUPLED * size[entry.row] * size[entry.col])
    i, j = i[seen], j[seen]
    both = np.asarray(cut.holds[i].multiply(cut.holds[j]).sum(axis=1)).ravel()
    where = f"assembled {name}"
    for k in np.flatnonzero(both == 0)[:1]:
        a, b = int(i[k]), int(j[k])
        raise DataError(
            f"couples node {cut.node[a]} of {cut.owners(a)} to node {cut.node[b]} of {cut.owners(b)}, "
            "expected parts that touch through shared nodes only",
            where,
            f"name node {cut.node[b]} in {cut.owners(a)} too, or node {cut.node[a]} in {cut.owners(b)}",
        )
    for k in np.flatnonzero(both > 1)[:1]:
        a, b = int(i[k]), int(j[k])
        raise DataError(
            f"couples nodes {cut.node[a]} and {cut.node[b]}, which {cut.owners(a)} share: how much of it is "
            "whose, only the elements tell",
            where,
            "assemble each part by itself and give all of them to from_names",
        )
    touched = (cut.count[i] > 1) | (cut.count[j] > 1)
    for k in np.flatnonzero(touched)[: int(alone)]:
        a = int(i[k] if cut.count[i[k]] > 1 else j[k])
        raise DataError(
            f"couples node {cut.node[a]}, which {cut.owners(a)} share, to others: how much of it is whose, "
            "only the elements tell",
            where,
            "give nodal masses, or assemble each part by itself and give all of them to from_names",
        )


def without_blocks(A: Any, several: Flags, dof: int) -> Any:
    """A of one part without the entries of shared nodes with themselves, and with each other."""
    entry = sp.coo_array(A)
    kept = ~(several[entry.row // dof] & several[entry.col // dof])
    return sp.csr_array((entry.data[kept], (entry.row[kept], entry.col[kept])), A.shape)


def node_blocks(block: Array, at: Indices, nodes: int) -> Any:
    """Blocks (node, dof, dof) on the diagonal, at these of the nodes."""
    dof = block.shape[-1]
    row = at[:, None] * dof + np.arange(dof)
    r, c = (np.broadcast_to(x, block.shape).ravel() for x in (row[:, :, None], row[:, None, :]))
    return sp.csr_array((block.ravel(), (r, c)), (nodes * dof, nodes * dof))


def check_rigid(own: Any, motions: Array, nodes: Indices, shared: Indices, cut: NodeCut, part: int) -> None:
    """Moved as a rigid body, the part resists nothing at the nodes that it shares."""
    left = np.abs(own @ motions).reshape(len(nodes), cut.dof, -1)[shared]
    size = (abs(own) @ np.abs(motions)).reshape(len(nodes), cut.dof, -1)[shared]
    off = left.max(axis=(1, 2), initial=0.0) > RESISTS * size.max(axis=(1, 2), initial=0.0)
    for k in np.flatnonzero(off)[:1]:
        raise DataError(
            f"would have {cut.part[part]} resist rigid motion at node {cut.node[nodes[shared[k]]]}, by "
            f"{left[k].max() / size[k].max():.1e} of what moves it, expected nothing",
            "assembled stiffness",
            "check the positions, or assemble each part by itself and give all of them to from_names",
        )


def check_supports(K: Any, held: Array, cut: NodeCut) -> None:
    """What the parts have of a shared node is all that is there."""
    nodes = np.flatnonzero(cut.count > 1)
    whole = held * 0
    entry = sp.coo_array(K)
    i, same = entry.row // cut.dof, entry.row // cut.dof == entry.col // cut.dof
    np.add.at(whole, (i[same], entry.row[same] % cut.dof, entry.col[same] % cut.dof), entry.data[same])
    over = np.abs(whole - held).max(axis=(1, 2), initial=0.0)[nodes]
    size = np.abs(whole).max(axis=(1, 2), initial=0.0)[nodes]
    for k in np.flatnonzero(over > RESISTS * size)[:1]:
        raise DataError(
            f"holds node {cut.node[nodes[k]]}, which {cut.owners(int(nodes[k]))} share, by {over[k]:.3g} of "
            f"{size[k]:.3g} to nothing in them, expected the stiffness of a body that floats",
            "assembled stiffness",
            "take its supports out, and name the nodes that are held as fixed",
        )
