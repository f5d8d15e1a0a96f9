"""A body that loads push of which one is known: a plate under it, or a thrust in its axes. DOP853, drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY
from forceid.config import Settings, load_settings
from forceid.records import Array, Body, KnownLoads, Motion, Recording

NAMES = tuple("abcdef")


def sines(rng: np.random.Generator, size: float) -> Callable[[float], Array]:
    """A load (3,) of three sines, rms `size` along each axis."""
    a, w, phase = rng.standard_normal((3, 3)), rng.uniform(2.0, 18.0, (3, 1)), rng.uniform(0, 6.3, (3, 1))
    return lambda t: size * np.sqrt(2 / 3) * (a * np.sin(w * t + phase)).sum(0)


def turn(q: Array, omega: Array) -> Array:
    """Rate of a quaternion [x y z w] whose body turns at omega, world axes."""
    return 0.5 * np.concatenate([q[3] * omega + np.cross(omega, q[:3]), [-omega @ q[:3]]])


def flown(seed: int, on_body: bool = False, noise: float = 1e-3) -> tuple[Recording, Array, Array, Settings]:
    """A body of six masses on a plate of known wrench, or under a thrust in its axes, and unknown loads.

    The unknown loads are three sines each. Returns the recording, the unknown force and moment (time, 3), and
    the settings that know the thrust.
    """
    rng = np.random.default_rng(seed)
    m = rng.uniform(0.5, 40.0)
    size = 0.15 * m ** (1 / 3)
    X, mass = size * rng.standard_normal((6, 3)), rng.uniform(0.5, 1.5, 6)
    mass *= m / mass.sum()
    X -= mass @ X / m
    J = np.einsum("n,nij->ij", mass, (X**2).sum(1)[:, None, None] * np.eye(3) - X[:, :, None] * X[:, None])
    force, moment = sines(rng, 3 * m), sines(rng, 0.5 * m * size)
    plate, twist = sines(rng, 6 * m), sines(rng, 0.5 * m * size)
    at, thrust = 0.1 * size * rng.standard_normal(3), 4 * m * rng.standard_normal(3)

    def pushed(t: float, c: Array, R: Array) -> tuple[Array, Array]:
        if on_body:
            F = R @ thrust
            return force(t) + F, moment(t) + np.cross(R @ at, F)
        F = plate(t) - 0.7 * m * GRAVITY
        return force(t) + F, moment(t) + twist(t) + np.cross(at - c, F)

    def rates(t: float, y: Array) -> Array:
        R = Rotation.from_quat(y[6:10]).as_matrix()
        F, T = pushed(t, y[:3], R)
        omega = R @ np.linalg.solve(J, R.T @ y[10:])
        return np.concatenate([y[3:6], F / m + GRAVITY, turn(y[6:10], omega), T])

    time, q = np.arange(0, 2.0, 0.005), Rotation.random(random_state=seed).as_quat()
    H = Rotation.from_quat(q).as_matrix() @ J @ rng.standard_normal(3)
    start = np.concatenate([0.2 * rng.standard_normal(6), q, H])
    y = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-11, atol=1e-11).y.T
    x = y[:, None, :3] + np.einsum("tab,nb->tna", Rotation.from_quat(y[:, 6:10]).as_matrix(), X)
    x += noise * rng.standard_normal(x.shape)
    motion = Motion(time, x, gravity=GRAVITY, noise_std={"position": noise})
    clock, known, settings = np.arange(-0.01, 2.01, 0.001), None, load_settings()
    if on_body:
        # a point on the body is given in the axes of the reference shape, which may lie anywhere
        X, moved = X + 0.3, tuple(at + 0.3)
        setting = {"name": "thrust", "force": tuple(thrust), "point": moved, "axes": "body"}
        settings = load_settings(known_load=[setting])
    else:
        F = np.array([plate(t) - 0.7 * m * GRAVITY for t in clock])[:, None]
        T = np.array([twist(t) for t in clock])[:, None]
        known = KnownLoads(clock, ("plate",), F, T, point=np.tile(at, (len(clock), 1, 1)))
    recording = Recording(Body(NAMES, X, mass), motion, known_loads=known)
    F, T = (np.array([load(t) for t in time]) for load in (force, moment))
    return recording, F, T, settings
