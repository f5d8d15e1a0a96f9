"""Mechanics of point masses for the scenes: flight, momenta, mean rotation and exact wrench.

Nothing here is shared with the estimators: momenta, mean rotation and spin are written out anew, so that
an error on either side shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import PositiveFloat
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.records import Array, Body

Frequencies = tuple[PositiveFloat, PositiveFloat, PositiveFloat]


@dataclass(frozen=True)
class KnownFlight:
    """A scene at the sampled instants, before any measurement: no noise, no gap.

    position (time, node, 3) m, world axes, gravity (3,) m/s2. truth: variables named as in Estimate.
    """

    body: Body
    position: Array
    gravity: Array
    truth: dict[str, Array]


def solve_ode(rate: Callable[[float, Array], Array], start: Array, time: Array, tolerance: float) -> Array:
    """States (time, state) of `rate(t, state)` from `start` at t = 0, by DOP853 to `tolerance`."""
    end = max(float(time[-1]), np.finfo(float).tiny)
    solution = solve_ivp(rate, (0.0, end), start, "DOP853", time, rtol=tolerance, atol=tolerance)
    return np.asarray(solution.y.T)


def integrate_nodes(
    acceleration: Callable[[float, Array, Array], Array], x0: Array, v0: Array, time: Array
) -> tuple[Array, Array]:
    """Positions and velocities (time, node, axis) of point masses with the given nodal accelerations."""
    n = x0.size

    def rate(t: float, y: Array) -> Array:
        x, v = y[:n].reshape(x0.shape), y[n:].reshape(x0.shape)
        return np.concatenate([y[n:], acceleration(t, x, v).ravel()])

    states = solve_ode(rate, np.concatenate([x0.ravel(), v0.ravel()]), time, 1e-11)
    x, v = states[:, :n], states[:, n:]
    return x.reshape(-1, *x0.shape), v.reshape(-1, *x0.shape)


def inertia_tensor(mass: Array, position: Array) -> Array:
    """Inertia (3, 3) kg m2 of point masses about the origin of `position` (node, 3) m."""
    square = (mass[:, None, None] * position[:, :, None] * position[:, None, :]).sum(0)
    return np.asarray(np.trace(square) * np.eye(3) - square)


def center_of(mass: Array, position: Array) -> Array:
    """Mass center (..., 3) m of point masses at `position` (..., node, 3) m."""
    return np.asarray(np.einsum("n,...na->...a", mass, position) / mass.sum())


def deforming_truth(mass: Array, rest: Array, x: Array, v: Array, load: Array) -> dict[str, Array]:
    """Wrench, momenta and mean motion of point masses, from the loads on the nodes and nothing else.

    mass (node,) kg, rest (node, 3) m, x and v (time, node, 3), load (time, node, 3) N without weight.
    Returns the variables of Estimate: force, moment about the mass center, center, velocity,
    angular_momentum, orientation (mass-weighted Kabsch against `rest`), angular_velocity (its rate),
    deformation (body axes, about its time mean). Source: principal equations 2.4, 4b.
    """
    c, vc = center_of(mass, x), center_of(mass, v)
    r, r_dot = x - c[:, None], v - vc[:, None]
    X = rest - center_of(mass, rest)
    R = kabsch(np.einsum("n,tna,nb->tab", mass, r, X))
    G_dot = np.einsum("n,tna,nb->tab", mass, r_dot, X)
    omega = kabsch_rate(R, np.einsum("n,tna,nb->tab", mass, r, X), G_dot)
    shape = np.einsum("tba,tnb->tna", R, r)
    return {
        "force": load.sum(1),
        "moment": np.cross(r, load).sum(1),
        "center": c,
        "velocity": vc,
        "orientation": Rotation.from_matrix(R).as_quat(canonical=True),
        "angular_velocity": omega,
        "angular_momentum": np.einsum("n,tna->ta", mass, np.cross(r, v)),
        "deformation": shape - shape.mean(0),
    }


def kabsch(G: Array) -> Array:
    """Rotations R (..., 3, 3) that maximize tr(R^T G), G = sum m r X^T (principal equations 4b)."""
    U, _, Vt = np.linalg.svd(G)
    U[..., :, 2] *= np.linalg.det(U @ Vt)[..., None]
    return np.asarray(U @ Vt)


def kabsch_rate(R: Array, G: Array, G_dot: Array) -> Array:
    """Angular velocity (..., 3) rad/s, world axes, of the Kabsch rotation (principal equations 4b)."""
    S, A = R.mT @ G, R.mT @ G_dot
    skew = A - A.mT
    vee = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], -1)
    trace = np.trace(S, axis1=-2, axis2=-1)[..., None, None]
    omega_body = np.linalg.solve(trace * np.eye(3) - S, vee[..., None])
    return np.asarray((R @ omega_body)[..., 0])


def harmonic_flight(
    mass: float, amplitude: Array, frequency: Array, start: tuple[Array, Array], gravity: Array, time: Array
) -> dict[str, Array]:
    """Closed-form flight of a mass center under forces amplitude * sin(2 pi frequency t) along each axis.

    amplitude (line, 3) N and frequency (line, 3) Hz, world axes; start: center (3,) m and velocity (3,)
    m/s at t = 0. Returns force, center and velocity, each (time, 3).
    """
    w = 2.0 * np.pi * frequency
    phase = time[:, None, None] * w
    t = time[:, None]
    center, velocity = start
    return {
        "force": (amplitude * np.sin(phase)).sum(1),
        "velocity": velocity + gravity * t + (amplitude / (mass * w) * (1.0 - np.cos(phase))).sum(1),
        "center": center
        + velocity * t
        + 0.5 * gravity * t**2
        + (amplitude / (mass * w**2) * (phase - np.sin(phase))).sum(1),
    }
