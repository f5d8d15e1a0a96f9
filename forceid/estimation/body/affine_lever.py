"""Whether markers may speak by an affine map for mass that carries none.

The map takes every marker along, and mass beside them by a lever: what the markers do beside the map enters
the momenta by it. A body that keeps its shape between markers and mass errs by no more than all mass moving
as the markers do beside the rigid motion (Cauchy and Schwarz). Where the lever makes more of what is not
affine, the map is the worse guess, however well it fits.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.deformation_residual import Beyond, principal_axes
from forceid.estimation.body.inertia import moments_of_whole
from forceid.estimation.body.kinematics import Kinematics
from forceid.records import Array, Flags


def speaks_for_mass(kin: Kinematics, beyond: Beyond) -> bool:
    """Whether the affine map of `kin` is a better guess of mass without markers than a shape that is kept.

    Always where all mass is seen, which needs no map. With as many shapes as the markers show nothing checks
    the map: then all that moves may be beside it.
    """
    inertia = kin.inertia
    if inertia.nodal is not None and not (inertia.weight[~kin.seen] > 0).any():
        return True
    reach = lever(kin.shape, beyond.kept, second_moment_matrix(kin))
    axes = principal_axes(beyond.y, beyond.of(kin.shapes))
    left = beyond.y - beyond.y @ axes @ axes.T
    dof = beyond.y.shape[1] - axes.shape[1]
    moves = excess(beyond.y, beyond.y.shape[1], beyond.var)
    return reach**2 * (excess(left, dof, beyond.var) if dof else moves) <= moves


def second_moment_matrix(kin: Kinematics) -> Array:
    """The sum of m Z Z over all mass (4, 4), Z = [1, X], about the mass center; NaN where it is not known."""
    inertia, Z = kin.inertia, np.column_stack([np.ones(len(kin.shape)), kin.shape])
    if inertia.nodal is not None:
        return np.asarray(Z.T @ (inertia.weight[:, None] * Z))
    return moments_of_whole(inertia.mass, inertia.tensor)


def lever(X: Array, marked: Flags, moments: Array) -> float:
    """Momentum, linear or angular, that alike and independent motions of markers give an affine body.

    X (node, 3) m about the mass center, marked (node,), moments (4, 4) as of `second_moment_matrix`. Over
    that of a body whose mass all moves as the markers do; infinite where they show no affine map. Eight equal
    masses, all marked, average their errors:

    >>> corners = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])
    >>> round(lever(corners, np.ones(8, bool), np.diag([8.0, 8, 8, 8])) ** 2, 12)
    0.125
    """
    Z = np.column_stack([np.ones(len(X)), X])[marked]
    if not np.isfinite(moments).all() or np.linalg.matrix_rank(Z) < 4:
        return np.inf
    share = moments @ np.linalg.pinv(Z)
    mass, turning = moments[0, 0], float(np.trace(moments[1:, 1:]))
    force = float((share[0] ** 2).sum()) / mass**2
    moment = 2 * float((share[1:] ** 2).sum()) / (3 * mass * turning) if turning > 0 else 0.0
    return float(np.sqrt(max(force, moment)))


def excess(y: Array, dof: int, var: float) -> float:
    """Mean square (m2) per degree of freedom of y (time, freedom), NaN rows left out, beyond the noise."""
    whole = y[np.isfinite(y).all(1)]
    return max(float((whole**2).sum()) / len(whole) / dof - var, 0.0)
