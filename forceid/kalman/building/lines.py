"""Lines of a load: phasors along fixed directions, beside a load that falls smoothly with frequency.

A load that turns with a spinning body, or is struck by it once a turn, holds lines at multiples of the spin.
Source: principal equations 4e (spin harmonics).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from forceid.kalman.building.process import Process, resonator
from forceid.records import Array, Indices

PER_CYCLE = 8  # frequencies per cycle a record at which the evidence of a line is computed


@dataclass(frozen=True)
class Line:
    """A load direction * a(t): frequency Hz, std of a in units of the load, bandwidth 1/s, direction (3,).

    driven: a keeps its std for ever, and forgets its phase at `bandwidth`; else it rings down from the start
    of the record at that rate, as a nutation or a struck body does. turns: with the body, in whose axes the
    direction stands then; else it stands still in those of the world. loose: std Hz of the frequency about
    that given, 1 / PER_CYCLE of a cycle over the record; zero where it is known, or a phase that drifts
    follows it.
    """

    frequency: float
    std: float
    bandwidth: float
    direction: Array
    driven: bool = True
    turns: bool = False
    loose: float = 0.0

    @cached_property
    def process(self) -> Process:
        """The load along its direction: a and its quadrature."""
        return self.scaled(1.0)

    def scaled(self, share: ArrayLike) -> Process:
        """The process of (...) shares of the load."""
        load = resonator(self.frequency, self.std * np.asarray(share), self.bandwidth)
        if not self.driven:
            load = replace(load, Qc=0 * load.Qc)
        return loosened(load, self.loose) if self.loose else load

    @property
    def states(self) -> int:
        """Of the process."""
        return 2 if self.loose == 0 else 4

    @property
    def taken(self) -> Indices:
        """World axes along which the load acts; one that turns with the body comes along all."""
        return np.arange(3) if self.turns else np.flatnonzero(self.direction)

    @property
    def onward(self) -> Line:
        """The same beyond its record: a loose frequency as a phase that wanders as far over as long."""
        if not self.loose:
            return self
        wander = (2 * np.pi * self.loose) ** 2 / (PER_CYCLE * self.loose)
        return replace(self, bandwidth=wander, driven=True, loose=0.0)

    def along(self, axes: Array) -> Line:
        """The same line seen from other axes, given as columns."""
        return replace(self, direction=self.direction @ axes)


def along_axes(lines: Iterable[Line], axis: Indices | slice = slice(None)) -> list[Process]:
    """Processes (axis,) of lines, by themselves along each axis: lines of one frequency are one of them."""
    found: dict[tuple[float, ...], tuple[Line, Array]] = {}
    for line in lines:
        kind = line.frequency, line.bandwidth, line.driven, line.loose
        alike, var = found.get(kind, (line, np.zeros(3)))
        found[kind] = alike, var + (line.std * line.direction) ** 2
    return [replace(line, std=1.0).scaled(np.sqrt(var[axis])) for line, var in found.values()]


def loosened(line: Process, loose: float) -> Process:
    """A line whose frequency is known to `loose` Hz, 1 / PER_CYCLE of a cycle over the record.

    To first order its phasor gains the derivative by frequency, times the time from the middle of the record:
    two states more, which turn with it and add up. So the record corrects the frequency, and the claim holds
    what is left of its error.
    """
    A, Qc, P0 = line.A, line.Qc, line.P0
    still, var = np.zeros_like(A), (2 * np.pi * loose) ** 2 * P0
    back = -0.5 / PER_CYCLE / loose  # s, from the middle to the start
    A = np.block([[A, np.broadcast_to(np.eye(2), A.shape)], [still, A]])
    P0 = np.block([[P0 + back**2 * var, back * var], [back * var, var]])
    return Process(A, np.block([[Qc, still], [still, still]]), P0, np.append(line.output, [0.0, 0.0]))


def near(frequency: float, taken: Iterable[float], time: Array) -> bool:
    """Whether a line is among those taken, as far as a record of this length tells: to a cycle (Rayleigh)."""
    return any(abs(frequency - f) * np.ptp(time) <= 1 for f in taken)


def axes_left(frequency: float, lines: Iterable[Line], time: Array) -> tuple[int, ...]:
    """World axes along which none of the lines is near a frequency."""
    taken = [line.taken for line in lines if near(frequency, [line.frequency], time)]
    return tuple(set(range(3)).difference(*taken))
