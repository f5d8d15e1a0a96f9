"""Rigid bodies that bounce, roll and spin on a floor as scenes. Each is drawn from a generator."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.strangers.bodies import Solid, flung, free_start, words, world
from evidence.strangers.simulated import WATCHED_BODY, WEIGHT, Camera, Scene
from forceid.records import Array

GROUND_PLANE = '<geom type="plane" size="0 0 1"/>'
TOUCHING = 'integrator="implicitfast" cone="elliptic"'
Start = tuple[Array, Array]
SLIP_CREEP = 0.02  # m/s: of a slip, below which friction falls off


def bouncing(rng: np.random.Generator, body: Solid, shape: str, start: Start) -> Scene:
    """A body that falls on the floor with a shape; a contact lasts 5 to 40 ms by itself."""
    lasts, ratio = rng.uniform(0.005, 0.04), rng.uniform(0.05, 0.4)
    solref, slide = f"{lasts / np.pi / ratio} {ratio}", rng.uniform(0.1, 0.7)
    inside = world(body.inertial + shape + body.sites(rng), beside=GROUND_PLANE)
    of = f'<default><geom solref="{solref}" friction="{slide}" solimp="0.95 0.95 0.001"/></default>'
    return Scene(of + inside, start, options=TOUCHING)


def sliding(rng: np.random.Generator, body: Solid, radius: float, low: float, start: Start) -> Scene:
    """A body that stays on the floor, on a sphere low m below its origin, with the friction of Coulomb.

    That of the simulator lifts what slides, which then chatters.
    """
    slide, shape = rng.uniform(0.1, 0.7), f'<geom type="sphere" size="{radius}" pos="0 0 {-low}"/>'

    def drive(data: Any) -> None:
        R = data.xmat[WATCHED_BODY].reshape(3, 3)
        touch = data.xpos[WATCHED_BODY] - low * R[:, 2] - [0.0, 0.0, radius]
        slip = (data.qvel[:3] + np.cross(R @ data.qvel[3:6], touch - data.xpos[WATCHED_BODY])) * [1, 1, 0]
        size = np.linalg.norm(slip)
        F = -slide * body.mass * WEIGHT * np.tanh(size / SLIP_CREEP) * slip / max(size, 1e-12)
        data.xfrc_applied[WATCHED_BODY] = np.concatenate([F, np.cross(touch - data.xipos[WATCHED_BODY], F)])

    inside = world(body.inertial + shape + body.sites(rng), beside=GROUND_PLANE)
    of = '<default><geom condim="1" solref="0.006 1" solimp="0.95 0.95 0.001"/></default>'
    return Scene(of + inside, start, drive, options=TOUCHING)


def bouncing_box(rng: np.random.Generator, camera: Camera) -> Scene:
    """A box that falls on the floor from less than a meter, turning."""
    body = Solid.drawn(rng, rng.uniform(0.04, 0.15, 3), rng.uniform(0.3, 4))
    high = float(np.linalg.norm(body.half)) + rng.uniform(0.2, 0.8)
    start = flung(rng, rng.uniform(0, 1.5), rng.uniform(-5, 5, 3), high)
    return bouncing(rng, body, f'<geom type="box" size="{words(body.half)}"/>', start)


def ball(rng: np.random.Generator, mass: float) -> tuple[Solid, float]:
    """A ball of 8 to 30 cm, and its radius; its mass center is off its middle, a little."""
    radius = rng.uniform(0.04, 0.15)
    return Solid.drawn(rng, np.full(3, radius / np.sqrt(3)), mass, off=0.2), radius


def bouncing_ball(rng: np.random.Generator, camera: Camera) -> Scene:
    """A ball that falls on the floor from less than a meter, turning."""
    body, radius = ball(rng, rng.uniform(0.1, 2))
    start = flung(rng, rng.uniform(0, 1.5), rng.uniform(-10, 10, 3), radius + rng.uniform(0.2, 0.8))
    return bouncing(rng, body, f'<geom type="sphere" size="{radius}"/>', start)


def rolling(rng: np.random.Generator, camera: Camera) -> Scene:
    """A ball that slides on the floor until friction makes it roll."""
    body, radius = ball(rng, rng.uniform(0.3, 4))
    turn, speed = Rotation.random(random_state=rng), rng.uniform(0.5, 2.5)
    spin = rng.uniform(-2, 2), rng.uniform(-0.5, 1.5) * speed / radius, rng.uniform(-5, 5)
    start = free_start([0, 0, radius], turn, [speed, 0, 0], turn.inv().apply(spin))
    return sliding(rng, body, radius, 0.0, start)


def top(rng: np.random.Generator, camera: Camera) -> Scene:
    """A top that spins on a table, by less than 0.3 rad from a sample to the next."""
    radius, tall, mass = rng.uniform(0.03, 0.08), rng.uniform(0.03, 0.07), rng.uniform(0.05, 0.5)
    half, J = radius * np.array([1, 1, 0.4]), mass * radius**2 * np.diag([0.3, 0.3, 0.5])
    spin, tilt, tip = min(rng.uniform(40, 120), 0.3 * camera.rate), rng.uniform(0.05, 0.3), 0.003
    turn = Rotation.from_euler("zx", [rng.uniform(0, 6), tilt])
    start = free_start([0, 0, tall * np.cos(tilt) + tip], turn, np.zeros(3), [*rng.uniform(-1, 1, 2), spin])
    return sliding(rng, Solid(half, mass, np.zeros(3), J), tip, tall, start)
