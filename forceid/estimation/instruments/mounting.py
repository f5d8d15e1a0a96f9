"""How a point of a deforming body moves and tilts with the nodes about it."""

from __future__ import annotations

import numpy as np

from forceid.principal import summation_operator
from forceid.records import Array

AT_NODE = 1e-3  # of the size of the body: nearer than that, a point stands on its node
FADING = 2  # the say of a node falls with its distance to the power of four


def mounted(position: Array, shapes: Array, points: Array) -> tuple[Array, Array]:
    """Displacement and tilt (point, mode, 3) of points for a unit of each of the shapes (mode, node, 3).

    position (node, 3) and points (point, 3) m, reference axes; tilt in rad per unit of amplitude. Those of
    the rigid motion that fits the nodes about a point best, the near ones weighed most: what is screwed on
    there moves so. A point on a node moves as the node does. Source: principal equations 4d.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> moved, tilt = mounted(square, np.cross([0, 0, 0.1], square)[None], np.array([[0.5, 0.5, 0]]))
    >>> moved[0, 0].round(6).tolist(), tilt[0, 0].round(6).tolist()
    ([-0.05, 0.05, 0.0], [0.0, 0.0, 0.1])
    """
    size = float(np.linalg.norm(position - position.mean(0), axis=1).max())
    flat = shapes.reshape(len(shapes), -1).T
    found = []
    for point in points:
        distance = ((position - point) ** 2).sum(1) + (AT_NODE * size) ** 2
        root = np.repeat((distance.min() / distance) ** (FADING / 2), 3)[:, None]
        found.append(
            np.linalg.lstsq(root * summation_operator(position, point), root * flat, rcond=1e-9)[0].T
        )
    both = np.array(found).reshape(len(points), len(shapes), 6)
    return both[..., :3], both[..., 3:]
