"""Mass, its center and the inertia tensor of a body, however a file describes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import DataError
from forceid.principal.mass import mass_properties
from forceid.records import Array, Body


@dataclass(frozen=True)
class Inertia:
    """Mass kg, its center (3,) in the axes of the reference shape, and how it moves with the nodes.

    nodal: masses (node,) or matrix (dof, dof), or None for a rigid body known as a whole; weight (node,):
    mass that goes with each node, zeros for such a body; tensor (3, 3) kg m2 of the reference shape.
    """

    mass: float
    center: Array
    tensor: Array
    nodal: Array | None
    weight: Array


def inertia_of(body: Body) -> Inertia:
    """Mass, center and inertia tensor of a body, however the file describes it."""
    nodes = len(body.node)
    if body.mass is not None or body.mass_matrix is not None:
        nodal = body.mass if body.mass is not None else body.mass_matrix
        assert nodal is not None
        assert body.position is not None
        p = mass_properties(nodal, body.position)
        weight = nodal if nodal.ndim == 1 else nodal.reshape(nodes, 3, nodes, 3)[:, 0, :, 0].sum(1)
        return Inertia(p.mass, p.center, p.inertia, nodal, weight)
    if body.total_mass is None:
        raise DataError("holds no mass", "/body", "give mass, mass_matrix, or total_mass with inertia")
    center = np.zeros(3) if body.mass_center is None else body.mass_center
    tensor = np.full((3, 3), np.nan) if body.inertia is None else body.inertia
    return Inertia(body.total_mass, center, tensor, None, np.zeros(nodes))
