"""The reference shape of a body, its mean shape, and the modes that it brings with it."""

from __future__ import annotations

import numpy as np

from forceid.errors import DataError
from forceid.estimation.body.deforming.modes import (
    Modes,
    deflected_shape,
    elastic_modes,
    given_modes,
    mean_shape,
)
from forceid.estimation.body.inertia import Inertia
from forceid.motion import pose_rank
from forceid.principal import summation_operator
from forceid.records import Array, Body, Flags
from forceid.significance import WILD

SIZE = 3.0  # times the reference shape, or its third, that no body stretches to


def check_scale(x: Array, X: Array) -> None:
    """A DataError where marker tracks x (time, node, 3) are not of the size of the shape X (node, 3).

    A body may bend and stretch; three times its size is a unit that is not what it says.
    """
    seen: Flags = np.asarray(np.isfinite(x).all(2))
    count = np.maximum(seen.sum(1), 1)[:, None]

    def size(a: Array) -> Array:
        a = np.where(seen[..., None], a, 0.0)
        off = np.where(seen[..., None], a - (a.sum(1) / count)[:, None], 0.0)
        return np.asarray(np.sqrt((off**2).sum((1, 2)) / count[:, 0]))

    moving, still = size(x), size(np.broadcast_to(X, x.shape))
    both = (moving > 0) & (still > 0)
    if not both.any():
        return
    ratio = float(np.median(moving[both] / still[both]))
    if not 1 / SIZE < ratio < SIZE:
        raise DataError(
            f"spans {ratio:.2g} times what the reference shape does (median of {both.sum()} frames), "
            "expected about the same",
            "/motion/position",
            "check the units of /motion/position and /body/position",
        )


def rank_of(shape: Array, nodes: Flags) -> int:
    """Rank of the rigid-body modes that the named nodes see."""
    return pose_rank(summation_operator(shape[nodes])) if nodes.any() else 0


def spinning_shape(
    time: Array, x: Array, X: Array, inertia: Inertia, modes: Modes | None, weight: Array, sigma: float
) -> Array:
    """The mean shape, where the record shows that it is not the reference shape; else the reference."""
    shape = mean_shape(x, X, weight)
    frames = np.isfinite(x).all(2).sum(0)
    error = sigma / np.sqrt(frames.clip(1))
    if not (np.abs(shape - X).max(1) > WILD * error).any():
        return X
    hidden = (inertia.weight > 0) & (frames == 0)
    if modes is None or inertia.nodal is None or not hidden.any():
        return shape
    return deflected_shape(time, x, X, modes, inertia.nodal, weight, sigma**2)


def modes_of(body: Body, inertia: Inertia) -> Modes | None:
    """The modes that a body brings with it, as shapes or as a stiffness."""
    nodal = inertia.nodal
    if body.position is None or nodal is None:
        return None if body.mode_shape is None else Modes(body.mode_shape)
    X = body.position - inertia.center
    if body.mode_shape is not None:
        return given_modes(body.mode_shape, body.mode_frequency, nodal, X)
    if body.stiffness is None or rank_of(X, inertia.weight > 0) < 6:  # masses on a line: no mass gauge
        return None
    return elastic_modes(nodal, body.stiffness, X)
