"""The sensors on a flying body: what they read, as rows on the states of a flight.

Each channel reads what its instrument says, a bias that stays, or wanders as b' = w, and white noise. The
sensors of an instrument may read on a clock of their own: late by a time that stays, they read y + y' times
that. A sensor stands still in body axes: what bending adds is in `bending.py`. Source: principal equations
4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from forceid.flight.instruments.moved import MOVERS, Moved, Slopes, in_body
from forceid.flight.instruments.protocol import Instrument
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.model import StateSpace
from forceid.records import Array, Flags, Indices


def _nothing() -> Array:
    return np.zeros(1)


@dataclass(frozen=True)
class Sensors:
    """Sensors of one or more instruments on the clock of a flight.

    instruments (kind,); reading (time, kind, sensor, 3), sensor axes, each in the unit of its instrument, NaN
    where not sampled; position (sensor, 3) m from the mass center and rotation (sensor, 3, 3) sensor to body,
    body axes; noise_std and bias_std (kind, sensor): of white noise, and of the bias before anything is read,
    which may be as good as unknown. Of a kind (kind,), or one for all: bias_walk, by which a bias wanders in
    a second (its unit per root of a second); clock_std s, of the time by which it reads later than its
    samples say, zero where the clocks agree; shifted s, by which its readings have been put on later samples;
    number_std: of each number that its instrument brings along, before anything is read.

    `steady` numbers stay through a flight: those that instruments bring along, one instrument after the
    other, then a clock (s) of each kind.
    """

    instruments: tuple[Instrument, ...]
    reading: Array
    position: Array
    rotation: Array
    noise_std: Array
    bias_std: Array
    bias_walk: Array = field(default_factory=_nothing)
    clock_std: Array = field(default_factory=_nothing)
    shifted: Array = field(default_factory=_nothing)
    number_std: Array = field(default_factory=_nothing)

    def __post_init__(self) -> None:
        for name in ("bias_walk", "clock_std", "shifted", "number_std"):
            object.__setattr__(self, name, np.broadcast_to(getattr(self, name), len(self.instruments)))

    @property
    def readings(self) -> Array:
        """All channels side by side, (time, channel): kind by kind, sensor by sensor."""
        return self.reading.reshape(len(self.reading), -1)

    @cached_property
    def used(self) -> Flags:
        """Channels (channel,) that read anything at all: the others get no row and no bias."""
        return np.asarray(np.isfinite(self.readings).any(0))

    @cached_property
    def kind(self) -> Indices:
        """Of every channel used, the place of its instrument among `instruments`."""
        kinds = len(self.instruments)
        return np.asarray(np.repeat(np.arange(kinds), self.readings.shape[1] // kinds)[self.used])

    @cached_property
    def owner(self) -> Indices:
        """The same of every number that an instrument brings along."""
        return np.repeat(np.arange(len(self.instruments)), [len(one.steady) for one in self.instruments])

    @cached_property
    def doubted(self) -> Flags:
        """Steady numbers that have a state: of kinds that read, and clocks only where they are in doubt."""
        read = np.isin(np.arange(len(self.instruments)), self.kind)
        return np.concatenate([read[self.owner], read & (self.clock_std > 0)])

    @property
    def clocked(self) -> Indices:
        """The kinds whose clock is in doubt."""
        return np.flatnonzero(self.doubted[len(self.owner) :])

    @property
    def noise_var(self) -> Array:
        """Variance of every channel used."""
        return np.repeat(self.noise_std.ravel() ** 2, 3)[self.used]

    @property
    def bias_var(self) -> Array:
        """Variance before the first sample of the bias of every channel used."""
        return np.repeat(self.bias_std.ravel() ** 2, 3)[self.used]

    def of(self, instrument: Instrument) -> Array | None:
        """What the sensors of one instrument read (time, sensor, 3); None where there are none."""
        if instrument not in self.instruments:
            return None
        return self.reading[:, self.instruments.index(instrument)]

    def clock(self, steady: Array) -> Array:
        """Of steady numbers, the clocks (kind,) s."""
        return steady[len(self.owner) :]

    def started(self, rotation: Array) -> Array:
        """A guess of the steady numbers along a path of rotations (time, 3, 3)."""
        kinds = enumerate(self.instruments)
        own = [one.start(rotation, self.reading[:, i], self.rotation) for i, one in kinds]
        return np.concatenate([*own, np.zeros(len(self.instruments))])

    def steady_in(self, state: Array) -> Array:
        """Steady numbers in a state (state,), whose last entries they are; zero where one has none."""
        steady, doubted = np.zeros(len(self.doubted)), self.doubted
        if doubted.any():
            steady[doubted] = state[-doubted.sum() :]
        return steady


@dataclass(frozen=True)
class Sensed:
    """What the channels used read without bias, reading (time, channel), and its slopes.

    by (time, channel, 3): by each of MOVERS, world axes; by_steady (time, channel, number): by the steady
    numbers, of which a clock has the rate of what is read.
    """

    reading: Array
    by: Slopes
    by_steady: Array


def sensed(sensors: Sensors, moved: Moved, steady: Array) -> Sensed:
    """What sensors read of a flight, and how that depends on it; steady numbers as given."""
    clock, own = sensors.clock(steady).tolist(), steady[: len(sensors.owner)]
    then = {late: moved.later(late) for late in clock}
    here = {late: in_body(at) for late, at in then.items()}
    read: list[Array] = []
    rows: dict[str, list[Array]] = {v: [] for v in MOVERS}
    by_own = np.zeros((len(moved.H), sensors.reading[0].size, len(steady)))
    for i, instrument in enumerate(sensors.instruments):
        mine = sensors.owner == i
        for S, r in zip(sensors.rotation, sensors.position, strict=True):
            y, slopes = instrument.read(here[clock[i]], S, r, own[mine])
            if mine.any():
                channels = slice(3 * len(read), 3 * len(read) + 3)
                by_own[:, channels, np.flatnonzero(mine)] = slopes["steady"]
            read.append(y)
            for v in MOVERS:
                rows[v].append(slopes[v] if v in slopes else np.zeros((len(y), 3, 3)))
    used, kind = sensors.used, sensors.kind
    y, *d = (np.concatenate(parts, 1)[:, used] for parts in (read, *rows.values()))
    by_steady = by_own[:, used]
    for late, at in then.items():
        same = np.asarray(clock)[kind] == late
        rates = (at.omega, at.T, at.T_rate, at.F_rate)
        rate = sum(
            np.einsum("tcs,ts->tc", slope[:, same], np.broadcast_to(v, at.H.shape))
            for slope, v in zip(d, rates, strict=True)
        )
        by_steady[:, same, len(own) + kind[same]] = rate
    return Sensed(y, dict(zip(MOVERS, d, strict=True)), by_steady)


def read_later(
    rows: Array, sensors: Sensors, clock: Array, loads: tuple[LoadPrior, ...]
) -> tuple[Array, Array]:
    """Rows (time, channel, state) on the states of a sample, of what is read by `clock` (kind,) s later.

    Also the covariance (time, channel, channel) of what the chains of the loads do in between by chance.
    """
    rows, noise = rows.copy(), np.zeros((*rows.shape[:2], rows.shape[1]))
    for i, by in enumerate(clock):
        mine = slice(*np.searchsorted(sensors.kind, (i, i + 1)))
        if by == 0.0 or mine.start == mine.stop:
            continue
        begin = 0
        for load in loads:
            F, Q, P0 = load.chain(np.array([abs(by)]))
            lead, chance, part = F[0], Q[0], slice(begin + 3, begin + len(P0))
            if by < 0:
                lead = np.linalg.inv(lead)
                chance = lead @ chance @ lead.T
            own = rows[:, mine, part].reshape(-1, len(P0) - 3)
            by_chance = (own @ chance[3:, 3:]).reshape(len(rows), -1, len(P0) - 3)
            noise[:, mine, mine] += by_chance @ rows[:, mine, part].swapaxes(1, 2)
            rows[:, mine, part] = (own @ lead[3:, 3:]).reshape(by_chance.shape)
            begin += len(P0)
    return rows, noise


def biases_of(sensors: Sensors, step: Array) -> StateSpace:
    """States that sensors bring along: a bias of each channel, then steady numbers; step (time - 1,) s."""
    doubted, k = sensors.doubted, len(sensors.kind)
    steady_var = np.concatenate([sensors.number_std[sensors.owner], sensors.clock_std])[doubted] ** 2
    walk = np.concatenate([sensors.bias_walk[sensors.kind] ** 2, np.zeros(doubted.sum())])
    n = k + int(doubted.sum())
    return StateSpace(
        np.eye(n), step[:, None, None] * np.diag(walk), np.zeros((0, n)), np.zeros((0, 0)), np.zeros(n),
        np.diag(np.concatenate([sensors.bias_var, steady_var])), np.zeros(n),
    )  # fmt: skip


def with_sensor_channels(
    model: StateSpace, sensors: Sensors, H: Array, noise: Array, by_steady: Array
) -> StateSpace:
    """A model that ends with the states of `biases_of`, with channels of sensors below its own.

    H (time, channel, state): rows of the sensors on the states of the model before those; noise (time,
    channel, channel) beside their own; by_steady (time, channel, number): slopes by the steady numbers.
    """
    T, k, n, m = *H.shape, model.R.shape[-1]
    rows = np.zeros((T, m + k, len(model.x0)))
    rows[:, :m], rows[:, m:, :n], rows[:, m:, n : n + k] = model.H, H, np.eye(k)
    rows[:, m:, n + k :] = by_steady[:, :, sensors.doubted]
    return replace(model, H=rows, R=block_diagonal(model.R, noise + np.diag(sensors.noise_var)))
