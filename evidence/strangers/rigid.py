"""Rigid bodies that touch no ground as scenes: thrown, driven, on a pivot. Each is drawn from a generator."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.strangers.bodies import Solid, flung, unit_direction, words, world
from evidence.strangers.simulated import WATCHED_BODY, WEIGHT, WHEEL, Camera, Scene
from forceid.records import Array


def velocity_of(data: Any) -> tuple[Array, Array]:
    """Velocity of the mass center of a free body, and its angular velocity, world axes."""
    w = data.xmat[WATCHED_BODY].reshape(3, 3) @ data.qvel[3:6]
    return data.qvel[:3] + np.cross(w, data.xipos[WATCHED_BODY] - data.xpos[WATCHED_BODY]), w


def aloft(rng: np.random.Generator, body: Solid, speed: float, spin: Array, drag: Any, slow: float) -> Scene:
    """A body in the air. drag (3,): over its weight, at first, along its axes; slow: of a turn, over inertia.

    The drag acts off the mass center, by up to a fifth of its size.
    """
    off = 0.2 * body.half * rng.uniform(-1, 1, 3)
    push, slow = drag * body.mass * WEIGHT / speed**2, slow * float(np.trace(body.inertia))

    def drive(data: Any) -> None:
        v, w = velocity_of(data)
        R = data.xmat[WATCHED_BODY].reshape(3, 3)
        F = -R @ (push * (R.T @ v)) * np.linalg.norm(v)
        T = np.cross(R @ off, F) - slow * np.linalg.norm(w) * w
        data.xfrc_applied[WATCHED_BODY] = np.concatenate([F, T])

    return Scene(world(body.inertial + body.sites(rng)), flung(rng, speed, spin), drive)


def box_in_air(rng: np.random.Generator, camera: Camera) -> Scene:
    """A box that is thrown, with drag of 5 to 100 % of its weight at first."""
    body = Solid.drawn(rng, rng.uniform(0.04, 0.2, 3), np.exp(rng.uniform(np.log(0.2), np.log(5))))
    drag = rng.uniform(0.1, 1) * rng.uniform(0.5, 1, 3)
    spin = rng.uniform(1, 12) * unit_direction(rng)
    return aloft(rng, body, rng.uniform(3, 8), spin, drag, rng.uniform(0, 0.05))


def javelin(rng: np.random.Generator, camera: Camera) -> Scene:
    """Long, thin, thrown; it rolls at up to 20 rad/s, and the air pushes across it."""
    body = Solid.drawn(rng, np.array([rng.uniform(0.4, 1.2), 0.015, 0.015]), rng.uniform(0.3, 1.0))
    spin = np.array([rng.uniform(0, 20), *rng.uniform(-2, 2, 2)])
    return aloft(rng, body, rng.uniform(5, 15), spin, rng.uniform(0.1, 1) * np.array([0.1, 1, 1]), 0.0)


def quadrotor(rng: np.random.Generator, camera: Camera) -> Scene:
    """Four rotors whose thrust jumps two to six times; what turns it is held back by its speed of turn."""
    arm = rng.uniform(0.1, 0.25)
    body = Solid.drawn(rng, np.array([arm, arm, 0.3 * arm]), rng.uniform(0.5, 2.0), off=0.1)
    span = camera.samples / camera.rate
    steps = np.sort(rng.uniform(0, span, int(rng.integers(2, 7))))
    weight = body.mass * WEIGHT
    level, apart = rng.uniform(0.5, 1.6, (len(steps) + 1, 1)), rng.uniform(-0.1, 0.1, (len(steps) + 1, 4))
    thrust = 0.25 * weight * (level + apart)
    places = 0.7 * arm * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    held = body.inertia * rng.uniform(1, 4)

    def drive(data: Any) -> None:
        now = thrust[np.searchsorted(steps, data.time)]
        R, (_, w) = data.xmat[WATCHED_BODY].reshape(3, 3), velocity_of(data)
        up = np.outer(now, [0.0, 0.0, 1.0])
        twist = np.cross(places - body.center, up).sum(0)
        twist[2] += 0.02 * (now @ [1, -1, 1, -1])
        data.xfrc_applied[WATCHED_BODY] = np.concatenate([R @ up.sum(0), R @ (twist - held @ (R.T @ w))])

    start = flung(rng, rng.uniform(0, 2), rng.uniform(-1, 1, 3))
    return Scene(world(body.inertial + body.sites(rng)), start, drive)


def satellite(rng: np.random.Generator, camera: Camera) -> Scene:
    """Weightless, with thrusters that pulse smoothly, and a wheel inside that nobody tells of.

    The wheel holds 2 to 50 % of the angular momentum; it coasts, or a motor turns it up or down.
    """
    body = Solid.drawn(rng, rng.uniform(0.2, 0.6, 3), rng.uniform(20, 100), off=0.2)
    axis, spin = unit_direction(rng), rng.uniform(0.5, 3) * unit_direction(rng)
    own = 0.02 * float(np.trace(body.inertia))
    turning = rng.uniform(0.02, 0.5) * np.linalg.norm(body.inertia @ spin) / own
    motor = float(rng.random() < 0.5) * rng.uniform(-0.3, 0.3) * own * turning
    w, phase = 2 * np.pi * rng.uniform(0.2, 1.5, (2, 3)), rng.uniform(0, 6.28, (2, 3))
    size = np.array([[rng.uniform(0.01, 0.1) * body.mass], [rng.uniform(0, 0.5) * np.trace(body.inertia)]])
    wheel = (
        f'<body pos="{words(body.center)}"><joint name="{WHEEL}" type="hinge" axis="{words(axis)}"/>'
        f'<inertial pos="0 0 0" mass="{0.02 * body.mass}" diaginertia="{words([own] * 3)}"/></body>'
    )

    def drive(data: Any) -> None:
        data.xfrc_applied[WATCHED_BODY] = (size * np.sin(w * data.time + phase)).ravel()
        data.qfrc_applied[-1] = motor

    q, v = flung(rng, rng.uniform(0, 1), spin)
    start = np.append(q, 0.0), np.append(v, turning)
    return Scene(world(body.inertial + body.sites(rng) + wheel), start, drive, gravity=0.0)


def shaker(rng: np.random.Generator, camera: Camera) -> Scene:
    """On soft springs, driven by two to five sines of 1 to 40 Hz, a fifth of the rate at most."""
    body = Solid.drawn(rng, rng.uniform(0.05, 0.2, 3), rng.uniform(0.5, 5))
    soft, turn = (2 * np.pi * rng.uniform(0.5, 3)) ** 2 * body.mass, (2 * np.pi * rng.uniform(0.5, 3)) ** 2
    turn *= np.trace(body.inertia) / 3
    joint = "".join(
        f'<joint type="slide" axis="{axis}" stiffness="{soft}" damping="{0.05 * soft / 20}"/>'
        for axis in ("1 0 0", "0 1 0", "0 0 1")
    )
    joint += f'<joint type="ball" stiffness="{turn}" damping="{0.05 * turn / 20}"/>'
    lines = int(rng.integers(2, 6))
    w = 2 * np.pi * np.exp(rng.uniform(0, np.log(min(40.0, camera.rate / 5)), lines))
    push = body.mass * rng.uniform(1, 10) * rng.standard_normal((lines, 3))
    twist = (body.inertia @ rng.standard_normal((3, lines))).T * rng.uniform(5, 100)
    phase = rng.uniform(0, 6.28, lines)

    def drive(data: Any) -> None:
        data.xfrc_applied[WATCHED_BODY] = np.sin(w * data.time + phase) @ np.hstack([push, twist])

    inside = world(body.inertial + body.sites(rng), joint, of='gravcomp="1"')
    return Scene(inside, (np.zeros(0), np.zeros(0)), drive)


def pendulum(rng: np.random.Generator, camera: Camera) -> Scene:
    """A body that swings on a pivot, a ball or a hinge, with little friction in it."""
    half = rng.uniform(0.03, 0.15, 3)
    body = Solid.drawn(rng, half, rng.uniform(0.3, 5))
    low = np.array([0.0, 0.0, -half[2] - rng.uniform(0.05, 0.5)])
    loose, way = bool(rng.random() < 0.5), rng.uniform(0, 6.28)
    axis = np.array([np.cos(way), np.sin(way), 0.0])
    kind = 'type="ball"' if loose else f'type="hinge" axis="{words(axis)}"'
    slow = rng.uniform(0, 0.1) * body.mass * float(low @ low)
    joint = f'<joint {kind} pos="{words(-low)}" damping="{slow}"/>'
    tilt, speed = rng.uniform(0.2, 2.0), rng.uniform(-2, 2, 3)
    turn = Rotation.from_rotvec(tilt * axis).as_quat(scalar_first=True)
    start = (turn, speed) if loose else (np.array([tilt]), speed[:1])
    return Scene(world(body.inertial + body.sites(rng), joint), start)
