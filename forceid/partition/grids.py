"""Small bodies for examples, tests and studies: bars, boxes cut into boxes, and their elements.

Bar, bilinear quadrilateral in plane stress, trilinear brick. A user's own finite-element code is the source
of stiffness and mass; these make small bodies without one. Source: principal equations 5.3; T. J. R. Hughes,
The Finite Element Method (1987), sections 3.2 to 3.8; consistent masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.partition.assembled import system
from forceid.partition.operators.topology import boolean_from_positions
from forceid.partition.system import PartitionedSystem
from forceid.records import Array, Flags, Indices

GAUSS_POINTS = (-1 / np.sqrt(3), 1 / np.sqrt(3))
SAME_PLACE = 1e-6  # m, within which nodes are one


def bar(ends: Array, axial_stiffness: float, mass: float = 0.0) -> tuple[Array, Array]:
    """Stiffness EA/l e e^T and consistent mass m/6 [2 1; 1 2] of a two-node bar, ends (2, axis) m."""
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    e = along / length
    K = axial_stiffness / length * np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.outer(e, e))
    return K, mass / 6 * np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]), np.eye(len(e)))


def elasticity(young: float, poisson: float, axes: int) -> Array:
    """Stress per strain, Pa: plane stress (3, 3) for two axes, solid (6, 6) for three; shears last."""
    if not -1 < poisson < 0.5:
        raise DataError(f"is {poisson}, expected a number between -1 and 0.5", "poisson")
    if axes == 2:
        C = np.array([[1.0, poisson, 0.0], [poisson, 1.0, 0.0], [0.0, 0.0, (1 - poisson) / 2]])
        return young / (1 - poisson**2) * C
    C = np.full((3, 3), poisson) + (1 - 2 * poisson) * np.eye(3)
    shear = (1 - 2 * poisson) / 2 * np.eye(3)
    zero = np.zeros((3, 3))
    return young / (1 + poisson) / (1 - 2 * poisson) * np.block([[C, zero], [zero, shear]])


def box_element(
    size: Array, young: float, poisson: float, density: float, thickness: float = 1.0
) -> tuple[Array, Array]:
    """Stiffness and consistent mass of a rectangle in plane stress or a brick of edges `size` (axis,) m.

    young Pa, density kg/m3; thickness m of a rectangle. Nodes as `itertools.product((0, 1), repeat=axis)`.
    """
    axes = len(size)
    corner = np.array(list(product((-1.0, 1.0), repeat=axes)))
    C, volume = elasticity(young, poisson, axes), float(np.prod(size)) * (thickness if axes == 2 else 1.0)
    K, M = np.zeros((2, axes * len(corner), axes * len(corner)))
    for point in product(GAUSS_POINTS, repeat=axes):
        factors = (1 + corner * point) / 2
        N = factors.prod(1)
        dN = np.stack([np.delete(factors, a, 1).prod(1) * corner[:, a] / size[a] for a in range(axes)])
        strain = strain_of(dN)
        weight = volume / 2**axes
        K += weight * strain.T @ C @ strain
        M += weight * density * np.kron(np.outer(N, N), np.eye(axes))
    return K, M


def strain_of(dN: Array) -> Array:
    """Strains, shears last, per displacement of the nodes; dN (axis, node) 1/m."""
    axes, nodes = dN.shape
    pairs = [(0, 1)] if axes == 2 else [(1, 2), (0, 2), (0, 1)]
    strain = np.zeros((axes + len(pairs), nodes, axes))
    for a in range(axes):
        strain[a, :, a] = dN[a]
    for k, (a, b) in enumerate(pairs, axes):
        strain[k, :, a], strain[k, :, b] = dN[b], dN[a]
    return strain.reshape(len(strain), -1)


def assemble_elements(elements: Indices, matrices: Array, axes: int, nodes: int) -> Any:
    """Sparse sum of element matrices (element, dof, dof), or of one for all, over nodes (element, node)."""
    dof = (elements[..., None] * axes + np.arange(axes)).reshape(len(elements), -1)
    row, column = np.repeat(dof, dof.shape[1], axis=1), np.tile(dof, (1, dof.shape[1]))
    values = np.broadcast_to(matrices, (len(elements), dof.shape[1], dof.shape[1]))
    size = nodes * axes
    return sp.csr_array((values.ravel(), (row.ravel(), column.ravel())), (size, size))


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
        held = np.flatnonzero(np.zeros(len(self.place)) if fixed is None else fixed)
        axes, about = self.place.shape[1], self.place.mean(axis=0)
        return system(self.stiffness, self.mass, self.boolean, self.position, held, axes, about)


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
