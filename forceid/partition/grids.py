"""Boxes cut into boxes: bodies of many equal parts, for examples, tests and studies.

Source: principal equations 5.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from forceid.partition.elements import assemble_elements, box_element
from forceid.partition.operators.topology import boolean_from_positions, compatible, without_fixed
from forceid.partition.system import PartitionedSystem
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices

SAME_PLACE = 1e-6  # m, within which nodes are one


@dataclass(frozen=True)
class Parts:
    """A body in parts that no support holds yet: matrices, Boolean L, positions (node, axis) m, one a part.

    place (node, axis) m: of the assembled nodes.
    """

    stiffness: tuple[Any, ...]
    mass: tuple[Any, ...]
    boolean: tuple[Any, ...]
    position: tuple[Array, ...]
    place: Array

    def system(self, fixed: Flags | None = None) -> PartitionedSystem:
        """The partitioned system, its assembled nodes `fixed` (node,) held."""
        axes, about = self.place.shape[1], self.place.mean(axis=0)
        held = np.zeros(len(self.place)) if fixed is None else fixed
        L, kept = without_fixed(self.boolean, np.flatnonzero(np.repeat(held, axes)))
        modes: list[Any] = [None] * len(L)
        for s, (x, rows) in enumerate(zip(self.position, kept, strict=True)):
            R = summation_operator(x - about)
            if np.linalg.matrix_rank(R) == R.shape[1]:  # else nodes on a line: its zero modes are found
                modes[s] = compatible(R, rows)
        K, M = (
            [m[rows][:, rows] for m, rows in zip(each, kept, strict=True)]
            for each in (self.stiffness, self.mass)
        )
        return PartitionedSystem(K, M, L, modes)


def box_grid(parts: Sequence[int], r: int) -> tuple[list[Array], Indices]:
    """Nodes (node, axis) m of unit boxes in a grid, r elements an edge, and the elements (element, node)."""
    axes = len(parts)
    ticks = np.array(list(product(range(r + 1), repeat=axes)))
    stride = (r + 1) ** np.arange(axes)[::-1]
    first = np.array(list(product(range(r), repeat=axes))) @ stride
    corner = np.array(list(product((0, 1), repeat=axes))) @ stride
    nodes = [np.array(at) + ticks / r for at in product(*map(range, parts))]
    return nodes, first[:, None] + corner


def solid_parts(
    parts: Sequence[int],
    r: int,
    young: float | Sequence[float] = 1000.0,
    poisson: float = 0.3,
    density: float = 2.0,
    thickness: float = 0.1,
) -> Parts:
    """Unit squares in plane stress, or unit cubes, of r elements an edge; young Pa for all, or one a part."""
    nodes, elements = box_grid(parts, r)
    axes = len(parts)
    K, M = (
        assemble_elements(elements, m, axes, len(nodes[0]))
        for m in box_element(np.full(axes, 1 / r), 1.0, poisson, density, thickness)
    )
    size = np.broadcast_to(young, len(nodes)).tolist()
    stiff = {e: e * K for e in set(size)}  # equal parts are one matrix, and will be factored once
    return gathered([stiff[e] for e in size], [M] * len(nodes), nodes)


def gathered(stiffness: list[Any], mass: list[Any], nodes: list[Array]) -> Parts:
    """Parts whose nodes at one place are one."""
    boolean = boolean_from_positions(nodes, SAME_PLACE)
    axes = nodes[0].shape[1]
    place = np.zeros((boolean[0].shape[1] // axes, axes))
    for L, x in zip(boolean, nodes, strict=True):
        place[L.indices[::axes] // axes] = x
    return Parts(tuple(stiffness), tuple(mass), tuple(boolean), tuple(nodes), place)
