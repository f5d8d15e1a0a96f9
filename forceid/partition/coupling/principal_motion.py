"""Mean motion of one part that turns far: its momenta against the forces on it and at its ties.

P' = F_s, H' = T_s of every partition, with current positions; the force on partition s is f_s - B_s lambda_s.
Held over each interval of time: what the momenta gain, by the mean force. No acceleration is needed, and no
stiffness. Source: principal equations 2.4, 2.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from forceid.errors import DataError
from forceid.partition.validation import finite
from forceid.principal.mass import SparseMatrix, mass_center
from forceid.principal.operator import sum_nodal
from forceid.principal.wrench import momentum
from forceid.records import Array


@dataclass(frozen=True)
class PrincipalBalance:
    """Momenta of a part and what changes them, world axes, about its mass center or a fixed point.

    time (time,) s; momentum (time, 6): P kg m/s, H kg m2/s; wrench (time, 6): force N, moment N m of loads
    and ties; residual (interval, 6) N, N m: the rate at which momenta grow in each interval of time less the
    mean wrench there. Planar (..., 3).
    """

    time: Array
    momentum: Array
    wrench: Array
    residual: Array


def tied_force(force: ArrayLike, lam: ArrayLike, boundary: ArrayLike) -> Array:
    """Nodal forces f - B lambda (time, node, axis) N on a part.

    force (time, node, axis) N: loads; lam (time, multiplier) N: what the part exerts on the interface at its
    degrees of freedom boundary (multiplier,), counted node by node, as in `Topology.boundary`.
    """
    f, at = np.array(force, dtype=float), np.asarray(boundary, dtype=np.intp)
    tie = np.asarray(lam, dtype=float)
    if f.ndim != 3:
        raise DataError(f"has shape {f.shape}, expected (time, node, axis)", "force")
    if tie.shape != (len(f), len(at)):
        raise DataError(
            f"has shape {tie.shape}, expected ({len(f)}, {len(at)}), as times and boundary", "lam"
        )
    flat = f.reshape(len(f), -1)
    if not np.isin(at, np.arange(flat.shape[1])).all() or len(np.unique(at)) < len(at):
        raise DataError(f"names other than different degrees of freedom of {flat.shape[1]}", "boundary")
    flat[:, at] -= tie
    return flat.reshape(f.shape)


def principal_balance(
    time: ArrayLike,
    mass: ArrayLike | SparseMatrix,
    position: ArrayLike,
    velocity: ArrayLike,
    force: ArrayLike,
    lam: ArrayLike,
    boundary: ArrayLike,
    about: ArrayLike | None = None,
) -> PrincipalBalance:
    """Whether loads and tie forces explain how the momenta of a part change, however far it turns.

    time (time,) s, growing; mass (node,) kg or a mass matrix; position (time, node, 3) m, current, velocity
    m/s and force N alike; lam, boundary: as in `tied_force`; about (3,) m a point at rest, None = the mass
    center of the part, wherever it goes. The mean wrench of an interval is that of a cubic through the
    samples, exact to the fourth power of the interval. Raises DataError. Source: principal equations 2.8.
    """
    t, x, v = (np.asarray(given, dtype=float) for given in (time, position, velocity))
    if t.ndim != 1 or len(t) < 2 or not (np.diff(t) > 0).all():
        raise DataError("does not grow from one sample to the next, or has fewer than two", "time")
    on_part = tied_force(force, lam, boundary)
    for name, given in (("position", x), ("velocity", v), ("force", on_part)):
        if given.shape != x.shape or x.ndim != 3 or len(given) != len(t):
            raise DataError(f"has shape {given.shape}, expected ({len(t)}, node, axis) for all", name)
        finite(given, name, "leave those times out")
    if about is not None and np.shape(about) != x.shape[-1:]:
        raise DataError(
            f"has shape {np.shape(about)}, expected ({x.shape[-1]},): a point at rest", "about",
            "leave it out for the mass center; momenta about another moving point change without force",
        )  # fmt: skip
    point = mass_center(mass, x) if about is None else np.asarray(about, dtype=float)
    gained = momentum(mass, x, v, point)
    wrench = sum_nodal(on_part, x, point)
    impulse = CubicSpline(t, wrench).antiderivative()(t)
    residual = np.diff(gained - impulse, axis=0) / np.diff(t)[:, None]
    return PrincipalBalance(t, gained, wrench, residual)
