"""Matrices of nodes that have rotations as well, six numbers a node, as those of the places of nodes alone.

Markers show where nodes are. Where a stiffness says so, the rotations follow the places as they do under
forces on the places alone, theta = -K_rr^-1 K_rt u, which leaves the mass of every rigid motion as it is
(Guyan, AIAA J. 3 (1965) 380); without a stiffness they turn with the rigid motion that is nearest to the
places. Source: principal equations 2.1.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import pinvh

from forceid.errors import DataError
from forceid.principal import summation_operator
from forceid.records import Array, Body, Indices
from forceid.rounding import SOLVED


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
    T = rigidly_turning(body.position) if K is None else statically_turning(K)
    found = {name: T.T @ value @ T for name, value in wide.items()}
    return replace(body, **{name: 0.5 * (value + value.T) for name, value in found.items()})


def places_and_turns(count: int) -> tuple[Indices, Indices]:
    """Rows of the places, and of the rotations, among six numbers a node."""
    rows = np.arange(6 * count, dtype=np.intp).reshape(count, 2, 3)
    return rows[:, 0].ravel(), rows[:, 1].ravel()


def statically_turning(K: Array) -> Array:
    """Places and rotations (6 node, 3 node) by the places, where no moment acts on a node.

    >>> K = np.zeros((6, 6))
    >>> K[3:, 3:], K[3:, :3], K[:3, 3:] = 2 * np.eye(3), np.eye(3), np.eye(3)
    >>> statically_turning(K)[3:].tolist()
    [[-0.5, 0.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, -0.5]]
    """
    place, turn = places_and_turns(len(K) // 6)
    T = np.zeros((len(K), len(K) // 2))
    T[place] = np.eye(len(place))
    # on a straight line all nodes may turn about it together, which no place tells: the least turn then
    T[turn] = -pinvh(K[np.ix_(turn, turn)], rtol=SOLVED) @ K[np.ix_(turn, place)]
    return T


def rigidly_turning(position: Array) -> Array:
    """Places and rotations (6 node, 3 node) by the places; all nodes turn as the rigid motion nearest."""
    place, turn = places_and_turns(len(position))
    T = np.zeros((6 * len(position), 3 * len(position)))
    T[place] = np.eye(len(place))
    T[turn] = np.tile(np.linalg.pinv(summation_operator(position))[3:], (len(position), 1))
    return T
