"""Flights with a known wrench, written down: steady force, spin about a principal axis, a breathing shape."""

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
FORCE = np.array([0.6, -0.4, 0.8])  # N
MASS, SPREAD = 0.2, np.array([0.10, 0.16, 0.05])  # kg, m: half distances of the pairs of nodes
AXES = Rotation.from_rotvec([0.5, -0.3, 0.8])  # of the body at time zero
ACROSS = 0.2 * SPREAD[0] ** 2 + 0.2 * SPREAD[1] ** 2  # of MASS / 0.6: see `star`
NOISE = 3e-4


def star(**known):
    """Six nodes in pairs along the principal axes; three pairs of a third of the mass each."""
    position = np.concatenate([np.diag(SPREAD), -np.diag(SPREAD)])
    names = ("front", "left", "top", "rear", "right", "bottom")
    if not known:
        known = {"mass": np.full(6, MASS / 6)}
    return Body(node=names, position=position, **known)


def inertia(axis):
    """Principal moment of inertia of `star` about a principal axis, kg m2."""
    return MASS / 3 * (np.sum(SPREAD**2) - SPREAD[axis] ** 2)


def clock(frames=120, rate=200.0):
    return np.arange(frames) / rate


def spun(time, spin=(6.0, 4.0), axis=2):
    """Rotations that turn about a principal axis by spin[0] t + spin[1] t^2 / 2, and the rate of the spin."""
    angle = spin[0] * time + 0.5 * spin[1] * time**2
    turned = Rotation.from_rotvec(angle[:, None] * np.eye(3)[axis])
    return (AXES * turned).as_matrix(), spin[0] + spin[1] * time


def falling(time, force=FORCE):
    """Mass center under a steady force and weight."""
    t = time[:, None]
    return np.array([1.0, -2.0, 1.5]) + t * [2.0, 0.5, 3.0] + 0.5 * t**2 * (force / MASS + GRAVITY)


def toss(time=None, body=None, seed=0, noise=NOISE, spin=(6.0, 4.0), force=FORCE, stated=True, scale=None):
    """Markers of a body in flight, with its true wrench: steady `force`, and what the spin asks for.

    spin: rate and its steady change, rad/s, rad/s2, about the third principal axis. scale(t): the size of the
    body and its rate, if it breathes: the moment is then the rate of J s^2 omega.
    """
    time = clock() if time is None else time
    body = star() if body is None else body
    R, omega = spun(time, spin)
    s, ds = (np.ones_like(time), np.zeros_like(time)) if scale is None else scale(time)
    center = falling(time, force)
    x = center[:, None] + s[:, None, None] * np.einsum("tab,nb->tna", R, body.position)
    moment = inertia(2) * (s**2 * spin[1] + 2 * s * ds * omega)
    truth = {
        "force": np.tile(force, (len(time), 1)),
        "moment": moment[:, None] * AXES.as_matrix()[:, 2],
        "center": center,
        "orientation": Rotation.from_matrix(R).as_quat(canonical=True),
    }
    x = x + noise * np.random.default_rng(seed).standard_normal(x.shape)
    known = {"position": noise} if stated else {}
    return Recording(body, Motion(time, x, gravity=GRAVITY, noise_std=known), truth)
