"""What a load is taken to be before a record is seen: a kernel along each axis, lines beside it, in space.

A prior of another kind is a `Kernel` in a file of its own and a row in `table`; all that it needs in space it
has from `LoadPrior`, and nothing outside of this folder knows which kernel a prior holds.

A load drives a chain Y' = H, H' = load. Its states come in threes along the axes of the prior: Y, H, the
constant mean of the load, the states of the kernel; behind them those of lines. The axes stand still in the
laboratory, or turn with the body: a load that does (a thrust, a leak, a fin) is slow only there, and its
states are kept in world axes all the same. Source: principal equations 4e, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from forceid.flight.channels import MEAN, Channel, Start, load_chain
from forceid.flight.color import root_of
from forceid.flight.pieces import Pieces, drawn, forms_over, split_in_a_row
from forceid.flight.priors.body_fixed import Turning, fix_to_body, start_in_body
from forceid.flight.priors.lines import add_lines, line_rate, line_rows
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.lines import Line
from forceid.kalman.building.process import Process
from forceid.kalman.model import StateSpace, at_all_times
from forceid.records import Array, Indices

INTEGRAL, MOMENTUM, LOAD = slice(0, 3), slice(3, 6), slice(6, None)  # states of Y, H and the load in a chain
CONSTANT = slice(6, 9)  # states of what a load has for good; those of its kernel follow
KERNEL = CONSTANT.stop


class Kernel(Protocol):
    """How a load varies along each axis by itself, as a state-space model: what a new prior has to say."""

    @property
    def std(self) -> Array:
        """Of the load (axis,), in its unit."""

    @property
    def rate(self) -> Array:
        """At which the load forgets itself (axis,), 1/s."""

    @property
    def order(self) -> int:
        """Of the Matern kernel whose spectrum falls as fast: what tells how smooth the load is."""

    @property
    def kinks(self) -> bool:
        """Whether a record that calls for this kernel has a load that kinks."""

    @property
    def rivals(self) -> bool:
        """Whether Matern kernels of other order, rate and size explain a record about as well."""

    @property
    def process(self) -> Process:
        """The load: A, Qc, P0 (axis, state, state), and the row (state,) that reads it."""

    @property
    def slope(self) -> Array:
        """Row (state,) that reads the rate of the load, zero where it has none."""

    def density(self, w: Array) -> Array:
        """Spectral density (..., axis) of the load, two-sided, per Hz, at w (..., 1) rad/s."""

    def of(self, axes: Indices) -> Kernel:
        """The kernels of some axes."""

    def scaled(self, share: Array | float) -> Kernel:
        """The kernels of a load that is so many times as large."""

    def moved(self, by: Array) -> Kernel:
        """For a search: e^by[0] times the level at high frequency, e^by[1] times the rate."""

    def hastened(self, factor: float) -> Kernel:
        """The kernels of loads as large that forget themselves so many times as fast."""

    def unknown(self, std: Array, rate: float) -> Kernel:
        """Kernels for loads of which little is known but std (axis,) and about what rate (1/s)."""

    def numbers(self) -> dict[str, float]:
        """What a result file says of the kernels."""


@dataclass(frozen=True)
class Tuned:
    """A kernel as a record calls for it, and the noise found with it.

    noise (axis,): factor on the stated standard deviation of the measurement; noise_at_limit: on most axes
    that a load moves the likelihood would have taken a smaller one than allowed; pieces: in which the load
    comes, None for one that is of one character throughout.
    """

    kernel: Kernel
    noise: Array = field(default_factory=lambda: np.ones(3))
    noise_at_limit: bool = False
    log_likelihood: float = 0.0
    pieces: Pieces | None = None


@dataclass(frozen=True)
class LoadPrior:
    """A kernel along three axes (columns of `axes`, world), and how unknown the load is at its start.

    lines: that the load holds beside, with directions in world axes, or in those of the body for lines that
    turn with it. body_axes: those (3, 3) of the body, as columns, along which the kernel holds instead and
    with which it turns; `axes` are then the world's.
    """

    tuned: Tuned
    axes: Array
    start: Start
    lines: tuple[Line, ...] = ()
    body_axes: Array | None = None

    @property
    def kernel(self) -> Kernel:
        """How the load varies along each axis."""
        return self.tuned.kernel

    @property
    def vectors(self) -> int:
        """States of the chain that come in threes along the axes: all but those of lines."""
        return KERNEL + 3 * len(self.kernel.process.output)

    @property
    def states(self) -> int:
        """Of the chain."""
        return self.vectors + sum(line.states for line in self.lines)

    @property
    def noise(self) -> Array:
        """The factor (3, 3) on the noise of the channel that was found with it, world axes."""
        return np.asarray(self.axes * self.tuned.noise @ self.axes.T)

    @property
    def rows(self) -> Array:
        """Rows (3, state) that read the load, world axes, out of its chain; lines that turn have others."""
        return self.rows_along(None)

    def rows_along(self, rotation: Array | None) -> Array:
        """The same (time, 3, state) along a rotation (time, 3, 3) of the body, for lines that turn with
        it.
        """
        rows = np.zeros((3, self.states))
        rows[:, CONSTANT] = self.axes
        for share, own in self.weighed(self.kernel.process.output):
            rows[:, own] = share * self.axes
        return line_rows(rows, self.lines, rotation)

    def weighed(self, row: Array) -> list[tuple[float, slice]]:
        """What a row on the states of the kernel is not zero at, and where these are in the chain."""
        return [
            (float(row[k]), slice(KERNEL + 3 * k, KERNEL + 3 * k + 3)) for k in np.flatnonzero(row).tolist()
        ]

    def read(self, chain: Array) -> tuple[Array, Array, Array]:
        """Momentum, load and its rate (time, 3), world axes, in the states of its chain (time, state)."""
        rate = np.zeros((len(chain), 3))
        for share, own in self.weighed(self.kernel.slope):
            rate += share * (chain[:, own] @ self.axes.T)
        for line in line_rate(chain, self.lines):
            rate += line
        return chain[:, MOMENTUM] @ self.axes.T, chain @ self.rows.T, rate

    def chain(
        self, step: Array, rotation: Array | None = None, begin: float = 0.0
    ) -> tuple[Array, Array, Array]:
        """F, Q (time - 1, state, state) and P0 of the chain over steps (time - 1,) s, from the time `begin`.

        Of a clock with one step, F and Q are held once, and read alone.

        Not in world axes: turned together, a strong and a weak axis would lose the weak one to rounding.
        rotation (time, 3, 3): of the body, for a load or a line that turns with it.
        """
        pieces, n, size = self.tuned.pieces, self.vectors, self.states

        def interleave(a: Array) -> Array:
            out = np.zeros((*a.shape[:-3], size, size))
            for axis in range(3):
                out[..., axis:n:3, axis:n:3] = a[..., axis, :, :]
            return out

        def chain(haste: float) -> Process:
            return load_chain(self.kernel.hastened(haste).process, self.start)

        if pieces is None:
            whole = chain(1.0)
            unique, which = np.unique(np.round(step, 12), return_inverse=True)
            F, Q, P0 = (interleave(a) for a in (*discretize_steps(whole, unique), whole.P0))
        else:
            at, unique, which = np.arange(n // 3), step, np.arange(len(step))
            split = split_in_a_row([pieces], step, begin)
            forms = forms_over(chain, at > MEAN, step)([pieces], split)
            of_states = np.repeat(pieces.size[..., None], len(at), -1)
            F, Q, kind, P0 = drawn(forms, of_states, (at == MEAN, at > MEAN), split)
            F, Q, P0 = interleave(F)[kind[0]], interleave(Q)[kind[0]], interleave(P0[0])
        if rotation is not None and (self.body_axes is not None or any(line.turns for line in self.lines)):
            if self.body_axes is None:
                F, Q = F[which], Q[which]
            else:
                F, Q = fix_to_body(F, Q, which, n, step, rotation, self.body_axes)
                P0 = start_in_body(P0, n, rotation[0] @ self.body_axes)
            unique = step
        add_lines((F, Q, P0), self.lines, self.axes, unique, step, rotation)
        if len(F) > 1 and unique is not step:
            F, Q = F[which], Q[which]
        return at_all_times(F, len(step)), at_all_times(Q, len(step)), P0

    def restated(self, chain: Array, was: LoadPrior) -> Array:
        """The chain (time, state) of a prior that `was`, of the same kernel, in the states of this one.

        Lines that are new, behind the others, rest.
        """
        new = self.states - was.states
        if not np.array_equal(self.axes, was.axes):
            turned = chain[:, : was.vectors].reshape(len(chain), -1, 3) @ (was.axes.T @ self.axes)
            chain = np.concatenate([turned.reshape(len(chain), -1), chain[:, was.vectors :]], 1)
        return np.pad(chain, ((0, 0), (0, new)))

    def spectrum(self, w: Array, rotation: Array | None = None) -> Array:
        """Spectral density (frequency, 3) of the load but for lines, two-sided, per Hz, at w (frequency,)
        rad/s.

        Along its axes; of one that turns with a rotation (time, 3, 3), the mean along the axes of the world.
        """
        density = self.kernel.density(w[:, None])
        if self.body_axes is not None and rotation is not None:
            density = density @ ((rotation @ self.body_axes) ** 2).mean(0).T
        return density

    def with_kernel(self, kernel: Kernel) -> LoadPrior:
        """The same with another kernel."""
        return replace(self, tuned=replace(self.tuned, kernel=kernel))

    def scaled(self, share: float, mean: float) -> LoadPrior:
        """That of a load so many times as large, whose mean has a standard deviation too."""
        other = self.with_kernel(self.kernel.scaled(share))
        lines = tuple(replace(line, std=share * line.std) for line in self.lines)
        return replace(other, start=replace(self.start, mean=mean**2), lines=lines)

    def rarely_slow(self, share: float, mean: float) -> LoadPrior:
        """That of a load so many times as large that is as loud at high frequencies, and its mean too."""
        other = self.moved(np.array([0.0, -np.log(share) / (self.kernel.order - 0.5)]))
        return replace(self.scaled(share, mean), tuned=other.tuned)

    def moved(self, by: Array) -> LoadPrior:
        """The same with its kernel moved, for a search: by[0] the level, by[1] the rate, as logarithms."""
        return self.with_kernel(self.kernel.moved(by))

    def alike(self) -> LoadPrior:
        """The same that is along every axis what it is along its strongest."""
        alike = np.full(3, self.kernel.std.argmax())
        pieces = None if self.tuned.pieces is None else self.tuned.pieces.of(alike)
        tuned = replace(self.tuned, kernel=self.kernel.of(alike), pieces=pieces)
        return replace(self, tuned=tuned)

    @property
    def is_alike(self) -> bool:
        """Whether it is so already."""
        kernel = self.kernel
        return self.tuned.pieces is None and not np.ptp(kernel.std) and not np.ptp(kernel.rate)

    def axes_along(self, rotation: Array) -> Array:
        """Axes that the kernel holds along, as columns in world axes: (3, 3), or (time, 3, 3) of one that
        turns with a rotation (time, 3, 3) of the body.
        """
        return self.axes if self.body_axes is None else np.asarray(rotation @ self.body_axes)

    def turning(self, time: Array, rotation: Array) -> Turning:
        """How fast these axes turn with a rotation (time, 3, 3) of the body."""
        axes = self.axes_along(rotation)
        return Turning.of(time, np.broadcast_to(axes, (len(time), 3, 3)))

    def numbers(self, load: str) -> dict[str, float]:
        """What tuning chose, as numbers with names; std in N or N m, rate in 1/s, along the axes it found.

        One (`turns`) where these turn with the body. Of a line, the frequency in Hz, the std along world
        axes, and the bandwidth in 1/s.
        """
        found = {f"{load}_{name}": value for name, value in self.kernel.numbers().items()}
        if self.body_axes is not None:
            found[f"{load}_turns"] = 1.0
        for k, line in enumerate(self.lines, 1):
            found[f"{load}_line_{k}_frequency"] = line.frequency
            found[f"{load}_line_{k}_bandwidth"] = line.bandwidth
            for axis, share in zip("xyz", line.std * np.abs(line.direction), strict=True):
                found[f"{load}_line_{k}_std_{axis}"] = float(share)
        return found


def channel_model(channel: Channel, prior: LoadPrior, rotation: Array | None = None) -> StateSpace:
    """Model of measured channels, z'' = gain * load; rotation (time, 3, 3): for a load that turns with it."""
    step = np.diff(channel.time)
    F, Q, P0 = prior.chain(step, rotation, channel.time[0])
    if channel.drift.any():
        Q = np.array(Q)
        Q[:, :3, :3] += step[:, None, None] * (prior.axes.T @ channel.drift @ prior.axes)
    H = np.zeros((3, len(P0)))
    H[:, :3] = channel.gain * prior.axes
    model = StateSpace(F, Q, H, channel.noise_cov, np.zeros(len(P0)), P0)
    return model if channel.color is None else channel.color.beside(model, root_of(channel.noise_cov), step)
