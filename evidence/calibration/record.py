"""One drawn record: body, flight, readings, what is told; the same for a seed and a number, whatever else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.calibration import distributions as of
from evidence.calibration.bodies import Moved, drawn_body, told_body
from evidence.calibration.camera import seen, stated
from evidence.calibration.distributions import Drawn, drawn_kinds
from evidence.calibration.flight import Flown, flown
from evidence.calibration.loads import State, drawn_load
from evidence.vectors import GRAVITY
from forceid.records import Array, Motion, Recording

Again = Callable[[Array], Flown | None]


@dataclass(frozen=True)
class DrawnRecord:
    """A record as its user has it, with the truth; what was drawn, and what the user sets beside the file.

    body, flight: what truly moved; again: the same flight at other times; halved: how often load and spin
    were.
    """

    drawn: Drawn
    recording: Recording
    settings: dict[str, Any]
    body: Moved
    flight: Flown
    again: Again
    halved: int


def drawn_record(seed: int, number: int, frames: of.Span = of.SAMPLES) -> DrawnRecord:
    """Record `number` of a seed, of so many frames."""
    rng = np.random.default_rng([seed, number])
    drawn = drawn_kinds(rng, frames)
    body = drawn_body(drawn, rng)
    time = np.arange(drawn.samples) / drawn.rate
    gravity = GRAVITY if drawn.weight else np.zeros(3)
    turn = Rotation.random(random_state=rng)
    spin = min(of.log_even(rng, of.SPINS), of.TURN * drawn.rate) * of.direction(rng)
    if body.swing is not None:  # which would fly apart
        spin *= min(1.0, np.pi * body.swing / np.linalg.norm(spin))
    speed = min(float(rng.uniform(*of.SPEEDS)), of.ROOM / time[-1])
    at = State(rng.uniform(-1, 1, 3), speed * of.direction(rng), turn.as_matrix(), spin)
    strain = rng.standard_normal((3, 3)) * body.strain
    load = drawn_load(drawn, body, time[-1], at, rng)
    if drawn.held:
        load = replace(load, constant=-body.mass * gravity)

    def flies(times: int) -> Again:
        less, weaker = replace(at, w=at.w / 2**times), load.halved(times)
        return lambda t: flown(body, t, less, turn.as_quat(), (strain + strain.T) / 2, weaker, gravity)

    flight, again, halved = followed(flies, time)
    x = flight.center[:, None] + np.einsum("tab,nb->tna", flight.F, body.markers)
    told, settings = told_body(drawn, body, rng)
    motion = Motion(time, seen(drawn, x, rng), gravity=gravity, noise_std=stated(drawn, rng))
    truth = {"force": flight.force, "moment": flight.moment}
    return DrawnRecord(drawn, Recording(told, motion, truth), settings, body, flight, again, halved)


def followed(flies: Callable[[int], Again], time: Array) -> tuple[Flown, Again, int]:
    """The first flight that a camera can follow, of those under ever less load and spin, and its number."""
    for times in range(of.HALVED):
        again = flies(times)
        found = again(time)
        if found is not None:
            return found, again, times
    raise FloatingPointError("no camera can follow this body")
