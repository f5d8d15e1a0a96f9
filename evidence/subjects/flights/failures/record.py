"""A flight and its record, healthy or with a fault: what an estimator gets, and what is known of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evidence.subjects.flights.bodies import INERTIA, MASS, NODES, PLACE, Flown, Setup, fly
from forceid.records import Array, Body, Flags, Motion, Recording

NOISE = 3e-4  # m, of one component of one marker


@dataclass(frozen=True)
class Faulty:
    """A record as an estimator gets it, and what is known of it.

    flight: exact; seen (time, node), noise m and place (node, 3) m: what the bound is computed with, which
    are those of the record without its fault; settings: beside method and model; mixed (3, 3): directions of
    the loads asked for, None where the wrench is judged itself; misstated: an input that no motion reveals,
    as the budget of a result calls it, and by how many of the budget's units it is wrong.
    """

    recording: Recording
    flight: Flown
    seen: Flags
    noise: float = NOISE
    place: Array = field(default_factory=lambda: PLACE)
    settings: dict[str, Any] = field(default_factory=dict)
    mixed: Array | None = None
    misstated: tuple[str, float] | None = None

    def with_position(self, x: Array) -> Faulty:
        """The same with other marker tracks (time, node, 3)."""
        return replace(
            self, recording=replace(self.recording, motion=replace(self.recording.motion, position=x))
        )

    def with_body(self, **known: Any) -> Faulty:
        """The same with a body that is claimed otherwise."""
        return replace(self, recording=replace(self.recording, body=replace(self.recording.body, **known)))

    def with_stated(self, **noise_std: float) -> Faulty:
        """The same with the standard deviations of the noise that the file states; none: nothing."""
        motion = replace(self.recording.motion, noise_std=noise_std)
        return replace(self, recording=replace(self.recording, motion=motion))


def measured(
    setup: Setup, rng: np.random.Generator, noise: float = NOISE, place: Array | None = None, **flown: Any
) -> Faulty:
    """The record of a healthy flight with every marker seen and independent errors of the stated size.

    place (node, 3) m: markers elsewhere than on the masses, on a body then known as a whole.
    """
    flight = fly(setup, rng, **flown)
    x, body = flight.position, flight.body
    if place is not None:
        x = flight.truth["center"][:, None] + np.einsum("tab,nb->tna", flight.rotation, place)
        body = whole_body(place)
    seen = np.ones(x.shape[:2], bool)
    x = x + noise * rng.standard_normal(x.shape)
    motion = Motion(flight.time, x, gravity=flight.gravity, noise_std={"position": noise})
    recording = Recording(body, motion, flight.truth)
    return Faulty(recording, flight, seen, noise, PLACE if place is None else place)


def whole_body(place: Array) -> Body:
    """The body known as a whole, with markers at place (node, 3) m that carry no mass."""
    return Body(
        node=NODES[: len(place)], position=place, total_mass=float(MASS.sum()), mass_center=np.zeros(3),
        inertia=INERTIA,
    )  # fmt: skip


def unseen(case: Faulty, lost: Flags) -> Faulty:
    """The case without the samples lost (time, node): a gap, which the bound knows as well."""
    x = case.recording.motion.position
    assert x is not None
    return replace(case, seen=case.seen & ~lost).with_position(np.where(lost[..., None], np.nan, x))
