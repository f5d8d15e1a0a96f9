"""Partitioned systems of a user's own matrices: one of each part, or one of the whole body.

Parts with matrices of their own are tied together by nodes that have one name, or one place. An assembled
stiffness is taken apart where that is told by the matrix alone. Source: principal equations 2.7.
"""

from __future__ import annotations

import difflib
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.partition.operators.inverse import validated_symmetric
from forceid.partition.operators.separation import NodeCut, separated_mass, separated_stiffness
from forceid.partition.operators.topology import (
    boolean_from_names,
    boolean_from_positions,
    compatible,
    one_a_row,
    without_fixed,
)
from forceid.partition.system import PartitionedSystem
from forceid.partition.validation import real_array, real_matrix, real_positions
from forceid.principal import summation_operator
from forceid.records import Array, Indices

PLACES_APART = 1e-6  # of the size of a body, that the places of one node may differ by between parts


def from_names(
    stiffness: Sequence[Any],
    mass: Sequence[Any] | None,
    names: Sequence[Sequence[Hashable]],
    position: Sequence[ArrayLike] | None = None,
    fixed: Iterable[Hashable] = (),
) -> PartitionedSystem:
    """The system of parts with matrices of their own, whose nodes of one name are one node.

    stiffness, mass (dof, dof) of every part, dense or sparse, node-major, or mass (node,) kg, of translations
    only: where nodes have rotations, give positions too. names: of every node of every part; position
    (node, axis) m of every part: rigid modes are then those of the shape, else all zero modes of K. fixed:
    names of nodes held. Assembled nodes are in the order in which they first appear, less those held. Raises
    DataError. Source: principal equations 2.7.

    >>> K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    >>> chain = from_names([K, K], None, [["wall", "a"], ["a", "b"]], fixed=["wall"])
    >>> chain.solve([0.0, 2.0]).u.tolist()
    [2.0, 2.0, 4.0]
    """
    stated: dict[str, Sequence[Any] | None] = {"mass": mass, "names": names, "position": position}
    for name, given in stated.items():
        if given is not None and len(given) != len(stiffness):
            what = f"has {len(given)} entries, expected {len(stiffness)}, one a part"
            raise DataError(what, name, "give one for each part")
    K = [
        validated_symmetric(real_matrix(k, f"stiffness of partition {s}"), s) for s, k in enumerate(stiffness)
    ]
    dof = degrees([k.shape[0] for k in K], [len(part) for part in names])
    at = None if position is None else node_positions(position, names)
    axes = None if at is None else at[0].shape[1]
    M = None
    if mass is not None:
        pairs = enumerate(zip(mass, K, strict=True))
        M = [matrix_of(m, k.shape, dof, axes, f"mass of partition {s}") for s, (m, k) in pairs]
    boolean = boolean_from_names(names, dof)
    order = {name: k for k, name in enumerate(dict.fromkeys(n for part in names for n in part))}
    return system(K, M, boolean, at, numbered(fixed, order, "fixed"), dof)


def from_meshes(
    stiffness: Sequence[Any],
    mass: Sequence[Any] | None,
    position: Sequence[ArrayLike],
    tolerance: float,
    fixed: Sequence[ArrayLike] | None = None,
) -> PartitionedSystem:
    """The system of parts with matrices of their own, whose nodes at one place are one node.

    position (node, axis) m and, if some nodes are held, fixed (node,) of bool, of every part; tolerance m: of
    nodes that are one. All else as in `from_names`.
    """
    x = real_positions(position)
    axes = x[0].shape[1]
    names = [(L.indices[::axes] // axes).tolist() for L in boolean_from_positions(x, tolerance)]
    flags = [np.zeros(len(p), bool) for p in x] if fixed is None else [np.asarray(f, bool) for f in fixed]
    if [f.shape for f in flags] != [p.shape[:1] for p in x]:
        what = f"has shapes {[f.shape for f in flags]}, expected {[p.shape[:1] for p in x]}"
        raise DataError(what, "fixed", "say of every node of every part whether it is held")
    at_rest = {
        n for part, flag in zip(names, flags, strict=True) for n, f in zip(part, flag, strict=True) if f
    }
    return from_names(stiffness, mass, names, x, sorted(at_rest))


def from_assembled(
    stiffness: Any,
    mass: Any,
    parts: Mapping[Any, Iterable[Any]] | Sequence[Any],
    position: ArrayLike | None = None,
    fixed: Iterable[Any] = (),
    names: Sequence[Hashable] | None = None,
) -> PartitionedSystem:
    """The system of one assembled stiffness, where its parts touch through shared nodes only.

    stiffness (dof, dof) of the body that nothing holds, node-major; mass None, (dof, dof), or (node,) kg;
    parts: the nodes of every part, by part, or the part or parts of every node, in order. Nodes are numbers
    from 0, or names. position (node, axis) m. fixed: nodes held. Assembled nodes stay in their order.

    An entry between two nodes is the part's that holds both, and equilibrium tells the rest: K_s R_s = 0. Two
    shared nodes that the stiffness couples, as all along an edge between two meshes, have entries that only
    the elements could divide: a DataError, and such parts are to be assembled one by one, for `from_names`.
    The mass of a shared node is divided equally, as loads are; a consistent mass that couples one is refused
    likewise. Source: principal equations 2.1, 2.7.

    >>> K = np.array([[1.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 2.0]])
    >>> two_springs = from_assembled(K, None, ["left", ("left", "right"), "right"])
    >>> [k.toarray().tolist() for k in two_springs.stiffness]
    [[[1.0, -1.0], [-1.0, 1.0]], [[2.0, -2.0], [-2.0, 2.0]]]
    """
    x = None if position is None else real_positions([position], "position")[0]
    by_part, count = nodes_by_part(parts)
    count = next((len(n) for n in (x, names) if n is not None), count)
    if count is None:
        count = 1 + max(
            (n for part in by_part.values() for n in part if isinstance(n, int | np.integer)), default=-1
        )
    K = real_matrix(stiffness, "assembled stiffness")
    dof = degrees([K.shape[0]], [count])
    axes = None if x is None else x.shape[-1]
    M = None if mass is None else matrix_of(mass, K.shape, dof, axes, "assembled mass")
    try:
        K, M = validated_symmetric(K, 0), None if M is None else validated_symmetric(M, 0, "mass")
    except DataError as e:
        next_step = e.next_step or "correct it where it is made"
        raise DataError(e.what, f"assembled {e.where.split()[0]}", next_step) from e
    label = range(count) if names is None else names
    order = {k: k for k in range(count)} | {name: k for k, name in enumerate(label)}
    nodes = tuple(numbered(part, order, f"part {name}") for name, part in by_part.items())
    cut = NodeCut(nodes, tuple(f"part {name}" for name in by_part), tuple(repr(n) for n in label), dof)
    if (cut.count == 0).any():
        lone = cut.node[int(np.argmin(cut.count))]
        raise DataError(f"leave out node {lone}", "parts", "give every node to a part")
    motions = np.tile(np.eye(dof), (count, 1)) if x is None else rigid_motions(x - x.mean(axis=0), dof)
    stiff = separated_stiffness(K, cut, motions)
    each = None if M is None else separated_mass(M, cut)
    boolean = [one_a_row(cut.dofs(s), K.shape[0]) for s in range(len(nodes))]
    at = None if x is None else [x[part] for part in nodes]
    return system(stiff, each, boolean, at, numbered(fixed, order, "fixed"), dof)


def system(
    K: Sequence[Any], M: Sequence[Any] | None, boolean: Sequence[Any], at: Sequence[Array] | None,
    fixed: Indices, dof: int, about: Array | None = None,
) -> PartitionedSystem:  # fmt: skip
    """The system with nodes (by number) held and, where positions are given, rigid modes about a point."""
    L, kept = without_fixed(boolean, (fixed[:, None] * dof + np.arange(dof)).ravel())
    modes: list[Any] = [None] * len(L)
    if at is not None:
        about = np.concatenate(at).mean(axis=0) if about is None else about
        for s, (x, rows) in enumerate(zip(at, kept, strict=True)):
            R = rigid_motions(x - about, dof)
            if np.linalg.matrix_rank(R) == R.shape[1]:  # else nodes on a line: its zero modes are found
                modes[s] = compatible(R, rows)
    stiff = [k[rows][:, rows] for k, rows in zip(K, kept, strict=True)]
    heavy = None if M is None else [m[rows][:, rows] for m, rows in zip(M, kept, strict=True)]
    return PartitionedSystem(stiff, heavy, L, modes)


def rigid_motions(x: Array, dof: int) -> Array:
    """Rigid motions (dof, n) of nodes (node, axis) m, with nodal rotations where a node has that many dof."""
    axes = x.shape[-1]
    if dof not in (axes, axes + (1 if axes == 2 else 3)):
        what = f"has {axes} axes and {dof} degrees of freedom a node"
        raise DataError(what, "position", "leave it out, and zero modes of the stiffness are found")
    return summation_operator(x, rotations=dof != axes)


def degrees(rows: Sequence[int], nodes: Sequence[int]) -> int:
    """Degrees of freedom of a node, one number for all parts."""
    found = [r / n if n else 0.0 for r, n in zip(rows, nodes, strict=True)]
    if len(set(found)) != 1 or found[0] < 1 or found[0] % 1:
        what = f"has {list(rows)} rows for {list(nodes)} nodes, expected one whole number of rows a node"
        raise DataError(what, "stiffness", "name every node once, in the order of the rows")
    return int(found[0])


def node_positions(position: Sequence[ArrayLike], names: Sequence[Sequence[Hashable]]) -> list[Array]:
    """Positions of every part; nodes of one name are at one place."""
    x = real_positions(position)
    first: dict[Hashable, Array] = {}
    for s, (part, at) in enumerate(zip(names, x, strict=True)):
        if len(at) != len(part):
            what = f"has shape {at.shape}, expected ({len(part)}, axis)"
            raise DataError(what, f"position of partition {s}", "give the place of every node")
    size = float(np.ptp(np.concatenate(x), axis=0).max())
    for s, (part, at) in enumerate(zip(names, x, strict=True)):
        for name, p in zip(part, at, strict=True):
            if np.abs(first.setdefault(name, p) - p).max() > PLACES_APART * size:
                what = f"has node {name!r} at {p.tolist()}, expected {first[name].tolist()}, as before"
                raise DataError(what, f"position of partition {s}", "give another name to another node")
    return x


def matrix_of(mass: Any, shape: tuple[int, int], dof: int, axes: int | None, where: str) -> Any:
    """A mass as sparse rows, of nodal masses on the diagonal of the translations of their nodes."""
    M = real_array(mass, where)
    if M.ndim == 1:
        moves = np.arange(dof) < (min(dof, 3) if axes is None else axes)
        M = sp.diags_array(np.kron(M.astype(float), moves))
    M = real_matrix(M, where)
    if M.shape != shape:
        what = f"has shape {M.shape}, expected {shape}, as the stiffness"
        raise DataError(what, where, "give the mass of the same nodes")
    if (light := M.diagonal()).min(initial=0.0) < 0:
        what = f"is {light.min():g} kg at degree of freedom {int(light.argmin())}, expected zero or more"
        raise DataError(what, where, "correct it")
    return M


def nodes_by_part(
    parts: Mapping[Any, Iterable[Any]] | Sequence[Any],
) -> tuple[dict[Any, list[Any]], int | None]:
    """Nodes by part, and the number of nodes where every node has its part."""
    if isinstance(parts, Mapping):
        for name, nodes in parts.items():
            if isinstance(nodes, str) or not isinstance(nodes, Iterable):
                raise DataError(f"is {nodes!r}, expected its nodes", f"part {name}", "give them in a list")
        return {name: list(nodes) for name, nodes in parts.items()}, None
    found: dict[Any, list[Any]] = {}
    for node, owners in enumerate(parts):
        for part in owners if isinstance(owners, tuple | list | set | frozenset) else (owners,):
            found.setdefault(part, []).append(node)
    return found, len(parts)


def numbered(nodes: Iterable[Any], order: Mapping[Any, int], where: str) -> Indices:
    """Numbers of nodes that are named; DataError: an unknown name, with the nearest one, or a node twice."""
    found = list(nodes)
    for name in found:
        if name not in order:
            alike = [str(n) for n in order if isinstance(n, type(name))]
            near = difflib.get_close_matches(str(name), alike, n=1, cutoff=0.0)
            hint = f"did you mean {near[0]}?" if near else f"nodes are named {next(iter(order))!r} and so on"
            raise DataError(f"names the unknown node {name!r}", where, hint)
    number = np.array([order[name] for name in found], dtype=np.intp)
    _, first = np.unique(number, return_index=True)
    if len(first) < len(number):
        twice = found[int(np.setdiff1d(np.arange(len(number)), first)[0])]
        raise DataError(f"names node {twice!r} twice", where, "name it once")
    return number
