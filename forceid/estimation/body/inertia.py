"""Mass, its center and the inertia tensor of a body, however a file describes it.

Matrices of nodes that have rotations as well, six numbers a node, are made those of the places alone. Markers
show where nodes are. Where a stiffness says so, the rotations follow the places as they do under forces on
the places alone, theta = -K_rr^-1 K_rt u, which leaves the mass of every rigid motion as it is (Guyan, AIAA
J. 3 (1965) 380); without a stiffness they turn with the rigid motion that is nearest to the places. Source:
principal equations 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import pinvh

from forceid.errors import DataError
from forceid.principal import mass_properties, summation_operator
from forceid.records import Array, Body
from forceid.rounding import SOLVED


@dataclass(frozen=True)
class Inertia:
    """Mass kg, its center (3,) in the axes of the reference shape, and how it moves with the nodes.

    nodal: masses (node,) or matrix (dof, dof), or None for a rigid body known as a whole; weight (node,):
    mass that goes with each node, zeros for such a body; tensor (3, 3) kg m2 of the reference shape; affine
    (dof, dof): a matrix of nodes in space that makes such a body's momenta in any affine motion, None where
    they lie in a plane. line (3,): the direction of the line that the mass lies on or near, None where it
    does not; the tensor is then made the same about all axes, and the true one is larger by beside (3, 3),
    None on a line, see `thin_mass`. point: whether the mass lies on a point.
    """

    mass: float
    center: Array
    tensor: Array
    nodal: Array | None
    weight: Array
    affine: Array | None = None
    line: Array | None = None
    beside: Array | None = None
    point: bool = False

    @property
    def on_line(self) -> bool:
        """Whether all mass lies on a line, to rounding."""
        return self.line is not None and self.beside is None

    @property
    def gyration(self) -> float:
        """Root mean square distance of the mass from its center, m; NaN where no inertia is told."""
        # of mass on a point rounding may leave less than nothing
        return float(np.sqrt(np.maximum(0.5 * np.trace(self.tensor), 0.0) / self.mass))


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
    affine = None
    if body.position is not None:
        affine = affine_mass(body.total_mass, tensor, body.position - center)
    return Inertia(body.total_mass, center, tensor, None, np.zeros(nodes), affine)


def second_moment(tensor: Array) -> Array:
    """Second moment of mass (3, 3) kg m2, the sum of m X X, of a body with this inertia tensor."""
    return np.asarray(0.5 * np.trace(tensor) * np.eye(3) - tensor)


def affine_mass(mass: float, tensor: Array, X: Array) -> Array | None:
    """Mass matrix (dof, dof) of nodes X (node, 3), about the mass center, with these mass and inertia.

    For motions c + F X alone: it has their momentum and angular momentum. None for nodes in a plane. Source:
    pseudo-rigid bodies, section 1.

    >>> from forceid.principal import mass_properties
    >>> X = np.vstack([np.eye(3), np.ones(3)])
    >>> p = mass_properties(affine_mass(2.0, np.diag([3.0, 4.0, 5.0]), X), X)
    >>> round(p.mass, 12), bool(np.abs(p.center).max() < 1e-12), p.inertia.diagonal().round(12).tolist()
    (2.0, True, [3.0, 4.0, 5.0])
    """
    shown = np.hstack([np.ones((len(X), 1)), X])
    if not np.isfinite(tensor).all() or np.linalg.matrix_rank(shown) < 4:
        return None
    back = np.linalg.pinv(shown)
    return np.asarray(np.kron(back.T @ moments_of_whole(mass, tensor) @ back, np.eye(3)))


def moments_of_whole(mass: float, tensor: Array) -> Array:
    """The sum of m Z Z over all mass (4, 4), Z = [1, X], of a body with this inertia about its mass center.

    >>> moments_of_whole(2.0, np.diag([3.0, 4.0, 5.0])).diagonal().tolist()
    [2.0, 3.0, 2.0, 1.0]
    """
    whole = np.zeros((4, 4))
    whole[0, 0], whole[1:, 1:] = mass, second_moment(tensor)
    return whole


def without_node_rotations(body: Body) -> Body:
    """The body with matrices (3 node, 3 node) of the places of its nodes; itself where it has no others.

    DataError where one matrix has rotations and the other has none.
    """
    count = 0 if body.position is None else len(body.position)
    wide = {
        name: value
        for name in ("mass_matrix", "stiffness")
        if (value := getattr(body, name)) is not None and len(value) == 6 * count
    }
    if not wide or body.position is None:
        return body
    M, K = wide.get("mass_matrix"), wide.get("stiffness")
    if M is not None and body.stiffness is not None and K is None:
        what = f"has {len(body.stiffness)} rows where the mass matrix has {len(M)}"
        raise DataError(what, "/body/stiffness", "give rotations of the nodes in both, or in none")
    T = turning_nodes(body.position, K)
    found = {name: T.T @ value @ T for name, value in wide.items()}
    return replace(body, **{name: 0.5 * (value + value.T) for name, value in found.items()})


def turning_nodes(position: Array, K: Array | None) -> Array:
    """Places and rotations (6 node, 3 node) by the places: where no moment acts on a node of stiffness K.

    Without one all nodes turn as the rigid motion nearest.

    >>> K = np.zeros((6, 6))
    >>> K[3:, 3:], K[3:, :3], K[:3, 3:] = 2 * np.eye(3), np.eye(3), np.eye(3)
    >>> turning_nodes(np.zeros((1, 3)), K)[3:].tolist()
    [[-0.5, 0.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, -0.5]]
    """
    rows = np.arange(6 * len(position), dtype=np.intp).reshape(-1, 2, 3)
    place, turn = rows[:, 0].ravel(), rows[:, 1].ravel()
    T = np.zeros((rows.size, len(place)))
    T[place] = np.eye(len(place))
    if K is None:
        T[turn] = np.tile(np.linalg.pinv(summation_operator(position))[3:], (len(position), 1))
    else:  # on a straight line all nodes may turn about it together, unseen: the least turn then
        T[turn] = -pinvh(K[np.ix_(turn, turn)], rtol=SOLVED) @ K[np.ix_(turn, place)]
    return T
