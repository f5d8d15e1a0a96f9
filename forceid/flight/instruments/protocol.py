"""An instrument: one kind of sensor on a body in flight, as its physics and the words for it.

A sensor of a kind has three axes and stands still in body axes. Each axis reads what `read` says, a bias and
white noise. What an instrument is not asked for is common to all: noise as differences show it where none is
stated, a bias that stays or wanders, a clock that may be late (`sensors.py`), and findings on all three.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forceid.flight.instruments.moved import InBody, Slopes
from forceid.records import Array

Read = Callable[[InBody, Array, Array, Array], tuple[Array, Slopes]]
SteadyStart = Callable[[Array, Array, Array], Array]


@dataclass(frozen=True)
class BentMount:
    """A sensor on a body that bends: modes of amplitudes q, in body axes.

    S (3, 3) and r (3,) m: axes to body and place without bending; shift, tilt (3, mode) of the place for a
    unit of each amplitude; q, rate, second (time, mode): amplitudes and their derivatives; back (time, 3, 3):
    body to the tilted axes; w2, b (mode,): of q'' = -w2 q - 2 b q' + f; d_omega, d_alpha: slopes (time, 3,
    mode) by q and by q', of what bending does to the inertia; steady (number,): as of `read`.
    """

    S: Array
    r: Array
    shift: Array
    tilt: Array
    q: Array
    rate: Array
    second: Array
    back: Array
    w2: Array
    b: Array
    d_omega: tuple[Array, Array]
    d_alpha: tuple[Array, Array]
    steady: Array


Bend = Callable[[InBody, BentMount], tuple[Array, Array, Array, Array | float]]


@dataclass(frozen=True)
class Instrument:
    """A kind of sensor of three axes.

    name: its variable in /motion; unit: as messages write it; plural, singular: what people call it; offset:
    the largest bias at rest, in its unit, that data sheets of the cheapest parts allow; tells: the load that
    it reads almost directly, "" for one that reads how the body stands.

    read(here, S, r, steady): of a sensor with axes S (3, 3) to body at r (3,) m from the mass center, what it
    reads (time, 3) without bias, and the slopes (time, 3, 3) by MOVERS, or without those that are zero.
    bend(here, mount): what modes add to that (time, 3), and its slopes (time, 3, mode) by q, q' and f.

    steady: names of numbers that it brings along, which stay and are found with the flight; read then gives
    slopes (time, 3, number) by "steady" too; start(rotation, reading, mounting), a guess of them, is from
    rotations (time, 3, 3), readings (time, sensor, 3) and mounting (sensor, 3, 3), sensor axes to body.
    """

    name: str
    unit: str
    plural: str
    singular: str
    offset: float
    read: Read
    bend: Bend
    tells: str = ""
    steady: tuple[str, ...] = ()
    start: SteadyStart = lambda *_: np.zeros(0)
