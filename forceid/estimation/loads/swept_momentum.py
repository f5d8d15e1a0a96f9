"""The angular momentum of points about their mass center, integrated: a channel that the moment drives.

Y = integral of sum m u x u' dt, Y'' = T: twice the area that arms sweep, mass by mass, whatever bends.
Frames alone make it: from one to the next an arm u goes straight to v, and sweeps u x v. Source: principal
equations 2.4.
"""

from __future__ import annotations

import numpy as np

from forceid.records import Array


def swept_momentum(position: Array, mass: Array, known: Array | None = None) -> tuple[Array, Array]:
    """Y (time, 3) kg m2, NaN where a mass is not seen, and the arms u (time, node, 3) m.

    position (time, node, 3) m, world axes; mass (node,) kg; known (time, 3): the part of Y that known moments
    make, which is left out.

    >>> t = np.linspace(0, 1, 101)[:, None, None]
    >>> turning = np.concatenate([np.cos(t), np.sin(t), 0 * t], 2) * [[1], [-1]]
    >>> swept_momentum(turning, np.ones(2))[0][-1].round(4).tolist()
    [0.0, 0.0, 2.0]
    """
    seen = np.asarray(np.isfinite(position[:, mass > 0]).all((1, 2)))
    center = np.einsum("n,tna->ta", mass / mass.sum(), np.where(mass[:, None] > 0, position, 0.0))
    arm = np.where(mass[:, None] > 0, position - center[:, None], 0.0)
    u = arm[seen]
    swept = np.einsum("n,tna->ta", mass, np.cross(u[:-1], u[1:]))
    Y = np.full((len(position), 3), np.nan)
    Y[seen] = np.concatenate([np.zeros((1, 3)), np.cumsum(swept, axis=0)])[: len(u)]
    return Y if known is None else Y - known, arm
