"""Energies of scenes, by the mechanics that they state: what their conservation is checked with."""

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.scenes.flights.wobbling_drop import area


def spring_energy(springs, x):
    """Energy (J) stored in the springs at positions x (node, axis)."""
    stretch = np.linalg.norm(springs.incidence @ x, axis=1) - springs.rest_length
    return float(0.5 * springs.stiffness @ stretch**2)


def chain_energy(chain, now):
    """Kinetic energy, that of the springs and that of the weight (J) at one instant."""
    J = now.R @ chain.inertia @ now.R.mT
    bend = Rotation.from_matrix(now.R[1:] @ now.R[:-1].mT).as_rotvec()
    kinetic = chain.mass @ (now.velocity**2).sum(1) + np.einsum("ia,iab,ib->", now.omega, J, now.omega)
    weight = -chain.mass @ now.center @ chain.gravity
    return float(0.5 * kinetic + 0.5 * chain.stiffness @ (bend**2).sum(1) + weight)


def drop_energy(parameters, F):
    """W (J) at F (3, 3), zero for the round drop."""
    p, D = parameters, np.asarray(np.linalg.svd(F, compute_uv=False), float)
    J = float(D.prod())
    return p.tension * (area(D)[0] - 1) + 0.5 * p.bulk * (J - 1) ** 2 - 2 / 3 * p.tension * (J - 1)
