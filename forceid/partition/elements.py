"""Elements for examples and tests: bar, bilinear quadrilateral in plane stress, trilinear brick.

A user's own finite-element code is the source of stiffness and mass; these make small bodies without one.
Source: T. J. R. Hughes, The Finite Element Method (1987), sections 3.2 to 3.8; consistent masses.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.records import Array, Indices

GAUSS_POINTS = (-1 / np.sqrt(3), 1 / np.sqrt(3))


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
