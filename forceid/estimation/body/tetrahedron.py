"""Four markers in place of any number of nodes: the same mass, mean motion and first moments.

A quarter of the mass at each corner of a tetrahedron, stretched to the second moments of the body, moves as
the affine motion nearest to that of the nodes, weighted by mass: S^T M x and the first moments are those of
all nodes, whatever these do beside it, and equal white noise of equal nodes is equal white noise of the
corners. Source: principal equations 2.5; pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.estimation.body.inertia import Inertia
from forceid.records import Array, Body
from forceid.rounding import ROUNDED

SEEN = 0.25  # of every second moment of the nodes that a frame has to see: its noise is twice that of others
CORNERS = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])  # sum 0, sum of squares 4


@dataclass(frozen=True)
class Sums:
    """Over the nodes a frame sees, Z = [1, X]: moved (time, 4, 3) = sum w Z x, rest (time, 4, 4) = sum w Z Z.

    X (node, 3) m is about the mass center, the weight w (node,) the mass that goes with a node, or 1.
    """

    moved: Array
    rest: Array


def affine_maps(sums: Sums, S: Array) -> Array:
    """Maps (time, 4, 3) from Z = [1, X] to positions of every frame, NaN where too few nodes are seen.

    S (4, 4): sum w Z Z of all nodes.
    """
    Q = whitening_basis(S)
    G = Q.T @ sums.rest @ Q
    maps = np.full_like(sums.moved, np.nan)
    whole = np.linalg.eigvalsh(G)[:, 0] > SEEN
    maps[whole] = Q @ np.linalg.solve(G[whole], Q.T @ sums.moved[whole])
    return maps


def whitening_basis(S: Array) -> Array:
    """Q (4, rank) with Q^T S Q = 1, over the directions in which the nodes have any width."""
    scale = np.sqrt(np.append(S[0, 0], np.full(3, max(np.trace(S[1:, 1:]) / 3, np.finfo(float).tiny))))
    size, axes = np.linalg.eigh(S / np.outer(scale, scale))
    wide = size > ROUNDED * size[-1]
    return np.asarray(axes[:, wide] / np.sqrt(size[wide]) / scale[:, None])


def tetrahedron(S: Array) -> Array:
    """Four points (4, 3) of a quarter of the mass each, with mass, center and second moments of S (4, 4).

    >>> P = tetrahedron(np.diag([2.0, 1.0, 4.0, 9.0]))
    >>> np.abs(0.5 * P.T @ P - np.diag([1.0, 4.0, 9.0])).max() < 1e-12, np.abs(P.mean(0)).max() < 1e-12
    (np.True_, np.True_)
    """
    mean = S[0, 1:] / S[0, 0]
    size, axes = np.linalg.eigh(S[1:, 1:] / S[0, 0] - np.outer(mean, mean))
    return np.asarray(mean + CORNERS @ (axes * np.sqrt(np.maximum(size, 0.0))).T)


def four_nodes(body: Body, inertia: Inertia, corners: Array) -> Body:
    """The body as four nodes at corners (4, 3) m about its mass center, and whatever sensors it carries."""
    known: dict[str, Any] = {"mass": np.full(4, inertia.mass / 4)}
    if body.mass is None:
        tensor = inertia.tensor if np.isfinite(inertia.tensor).all() else None
        known = {"total_mass": inertia.mass, "mass_center": inertia.center, "inertia": tensor}
    return Body(
        tuple(f"corner {k + 1}" for k in range(4)),
        corners + inertia.center,
        sensor_position=body.sensor_position,
        sensor_rotation=body.sensor_rotation,
        **known,
    )
