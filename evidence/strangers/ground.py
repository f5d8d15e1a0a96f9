"""Rigid bodies that bounce, roll and spin on a floor as scenes. Each is drawn from a generator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.strangers.bodies import Solid, flung, started, words, world
from evidence.strangers.simulated import Camera, Scene

FLOOR = '<geom type="plane" size="0 0 1"/>'


def ground(rng: np.random.Generator, bouncing: bool) -> str:
    """What contacts are like: how long they last, 5 to 40 ms, how far bodies bounce, and friction."""
    half_period, ratio = rng.uniform(0.005, 0.04), rng.uniform(0.05, 0.4) if bouncing else 1.0
    slide, roll = rng.uniform(0.1, 0.7), 10 ** rng.uniform(-4, -2.3)
    stiff = half_period / np.pi / ratio if bouncing else rng.uniform(0.004, 0.01)
    return (
        f'<default><geom condim="6" friction="{slide} 0.005 {roll}" solref="{stiff} {ratio}" '
        'solimp="0.95 0.95 0.001"/></default>'
    )


def touching(
    rng: np.random.Generator, body: Solid, shape: str, settle: Callable[[Any, Any], None], bouncing: bool
) -> Scene:
    """A body that touches the floor with a shape."""
    inside = world(body.inertial + shape + body.sites(rng), beside=FLOOR)
    return Scene(ground(rng, bouncing) + inside, settle, options='integrator="implicitfast" cone="elliptic"')


def bouncing_box(rng: np.random.Generator, camera: Camera) -> Scene:
    """A box that falls on the floor from less than a meter, turning."""
    body = Solid.drawn(rng, rng.uniform(0.04, 0.15, 3), rng.uniform(0.3, 4))
    high = float(np.linalg.norm(body.half)) + rng.uniform(0.2, 0.8)
    start = flung(rng, rng.uniform(0, 1.5), rng.uniform(-5, 5, 3), high)
    return touching(rng, body, f'<geom type="box" size="{words(body.half)}"/>', start, True)


def ball(rng: np.random.Generator, mass: float) -> tuple[Solid, float, str]:
    """A ball of 8 to 30 cm, its radius, and its shape; its mass center is off its middle, a little."""
    radius = rng.uniform(0.04, 0.15)
    body = Solid.drawn(rng, np.full(3, radius / np.sqrt(3)), mass, off=0.2)
    return body, radius, f'<geom type="sphere" size="{radius}"/>'


def bouncing_ball(rng: np.random.Generator, camera: Camera) -> Scene:
    """A ball that falls on the floor from less than a meter, turning."""
    body, radius, shape = ball(rng, rng.uniform(0.1, 2))
    start = flung(rng, rng.uniform(0, 1.5), rng.uniform(-10, 10, 3), radius + rng.uniform(0.2, 0.8))
    return touching(rng, body, shape, start, True)


def rolling(rng: np.random.Generator, camera: Camera) -> Scene:
    """A ball that slides on the floor until friction makes it roll."""
    body, radius, shape = ball(rng, rng.uniform(0.3, 4))
    turn, speed = Rotation.random(random_state=rng), rng.uniform(0.5, 2.5)
    spin = rng.uniform(-2, 2), rng.uniform(-0.5, 1.5) * speed / radius, rng.uniform(-5, 5)
    start = started([0, 0, radius], turn, [speed, 0, 0], turn.inv().apply(spin))
    return touching(rng, body, shape, start, False)


def top(rng: np.random.Generator, camera: Camera) -> Scene:
    """A top that spins on a table, by less than 0.3 rad from a sample to the next."""
    radius, tall, mass = rng.uniform(0.03, 0.08), rng.uniform(0.03, 0.07), rng.uniform(0.05, 0.5)
    half, J = radius * np.array([1, 1, 0.4]), mass * radius**2 * np.diag([0.3, 0.3, 0.5])
    spin, tilt, tip = min(rng.uniform(40, 120), 0.3 * camera.rate), rng.uniform(0.05, 0.3), 0.003
    turn = Rotation.from_euler("zx", [rng.uniform(0, 6), tilt])
    start = started([0, 0, tall * np.cos(tilt) + tip], turn, np.zeros(3), [*rng.uniform(-1, 1, 2), spin])
    shape = f'<geom type="sphere" size="{tip}" pos="0 0 {-tall}"/>'
    return touching(rng, Solid(half, mass, np.zeros(3), J), shape, start, False)
