"""Resultants of moving nodes; a wrench and its covariance carried to another moment point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.compiled import engine as compiled
from forceid.errors import DataError
from forceid.principal.mass import SparseMatrix, mass_center, mass_times, nodal_mass, nodes_with_mass
from forceid.principal.operator import axis_count, cross, sum_nodal, summation_operator
from forceid.records import Array

SPATIAL = 6  # numbers of a wrench in space


def resultant(
    mass: ArrayLike | SparseMatrix,
    position: ArrayLike,
    acceleration: ArrayLike,
    about: ArrayLike | None = None,
) -> Array:
    """Net force and moment S^T M a that the surroundings, weight included, exert on the moving nodes.

    mass as in `mass_properties`; position (..., node, 3) m, the *current* one, for the initial one gives
    a wrong moment on a turning body; acceleration (..., node, 3) m/s2, or (..., node, 6) with the angular
    acceleration rad/s2 of nodes that have rotations; about (..., 3) m, None = the instantaneous mass
    center. Returns (..., 6): force N, moment N m, world axes; planar (..., 3). NaN where a node that
    carries mass is NaN. To leave weight out, pass acceleration minus gravity.

    A consistent beam or shell mass turns with the body, M = T M_0 T^T: pass it in the current axes, and
    with changing axes differentiate momenta, the same sums of velocities, since S^T M a then misses the
    change of M. Blocks m_ij I (lumped, bars, solids) are free of this. Raises DataError.
    Source: principal equations 2.1, 2.4, 4a, 4b.

    >>> resultant([2.0, 2.0], [[-1.0, 0.0], [1.0, 0.0]], [[0.0, -3.0], [0.0, 3.0]])
    array([ 0.,  0., 12.])
    """
    x, r = np.asarray(position, dtype=float), np.asarray(acceleration, dtype=float)
    M, dof = nodal_mass(mass, x)
    if r.shape[-2:] != (x.shape[-2], dof):
        raise DataError(
            f"has shape {r.shape}, expected (..., {x.shape[-2]}, {dof}) as position and mass have",
            "acceleration",
        )
    p = mass_center(M, x) if about is None else np.asarray(about, dtype=float)
    if M.ndim == 1:
        M, x, r = nodes_with_mass(M, x, r)
    if x.ndim == 2 and p.ndim == 1:
        S = summation_operator(x, p, rotations=dof > x.shape[-1])
        folded = S * np.repeat(M, dof)[:, None] if M.ndim == 1 else mass_times(M, S.T).T
        flat = r.reshape(-1, len(folded))
        if compiled is not None and folded.shape[1] == SPATIAL and len(flat) > 1:
            found = np.empty((len(flat), SPATIAL))
            compiled.sums(flat, folded.T, found)
            return found.reshape(*r.shape[:-2], SPATIAL)
        return np.asarray(r.reshape(*r.shape[:-2], -1) @ folded)
    if M.ndim == 1:
        return sum_nodal(r, x, p, weight=M)
    return sum_nodal(mass_times(M, r.reshape(*r.shape[:-2], -1)).reshape(r.shape), x, p)


def transport_matrix(arm: ArrayLike) -> Array:
    """T = [[I, 0], [[arm]x, I]], which carries a wrench to a new moment point.

    arm (..., 3) m = old point minus new point; returns (..., 6, 6), planar (..., 3, 3).
    Source: principal equations 4c.
    """
    return summation_operator(np.asarray(arm, dtype=float)[..., None, :], rotations=True).mT


def transport(wrench: ArrayLike, arm: ArrayLike) -> Array:
    """The same wrench with its moment about another point: T_new = T_old + arm x F.

    wrench (..., 6) N, N m; arm (..., 3) m = old point minus new point (c - p to go from the mass center c
    to p); planar (..., 3), (..., 2). Source: principal equations 2.4.

    >>> transport([0.0, 2.0, 0.0], arm=[0.5, 0.0])
    array([0., 2., 1.])
    """
    g, r = np.asarray(wrench, dtype=float), np.asarray(arm, dtype=float)
    axis = axis_count(r)
    moment = g[..., axis:] + cross(r, g[..., :axis])
    return np.concatenate([np.broadcast_to(g[..., :axis], (*moment.shape[:-1], axis)), moment], axis=-1)


def transport_cov(cov: ArrayLike, arm: ArrayLike) -> Array:
    """Covariance (..., 6, 6) of the wrench that `transport` carries by `arm`: T C T^T.

    Source: principal equations 4c.

    >>> transport_cov([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], arm=[2.0, 0.0])[2, 2]
    np.float64(5.0)
    """
    T = transport_matrix(arm)
    return np.asarray(T @ np.asarray(cov, dtype=float) @ T.mT)
