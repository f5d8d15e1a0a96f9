"""Oscillating loads that a solved flight shows beside its smooth ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.kinematics import Kinematics
from forceid.estimation.sensitivity import length
from forceid.kalman.channels import Channel
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState
from forceid.kalman.flight_model import Flight, Reference, seen_part
from forceid.kalman.lines import PATIENCE, Candidate, Line, candidates, find_line, let_drift, near
from forceid.kalman.prior import LoadPrior
from forceid.kalman.process import matern
from forceid.records import Array

SHOWN = 5.0  # times its claim, that a load is larger than which shows
MUCH, PART = 10.0, 0.1  # times the claim, and part of the load, that a line is which matters
MOST_LINES = 24  # of both loads together
AT_ONCE, ROUNDS = 4, 4  # candidates of one look at the innovations, and looks under one smooth prior


@dataclass(frozen=True)
class Lines:
    """Lines of the force and of the moment."""

    force: tuple[Line, ...] = ()
    moment: tuple[Line, ...] = ()

    def __len__(self) -> int:
        return len(self.force) + len(self.moment)


NO_LINES = Lines()


def more_lines(
    flight: Flight,
    state: FlightState,
    priors: dict[str, LoadPrior],
    engine: Engine,
    named: tuple[float, ...] = (),
) -> Lines:
    """The lines of the priors, and those that the innovations of a solved flight show beside them.

    named: the only frequencies (Hz) to look at, or none for wherever a line stands out.
    """
    time, spin = flight.time, 0.0
    if state.reference is not None:
        spin = float(np.mean(np.linalg.norm(state.omega, axis=1))) / (2 * np.pi)
    found = []
    for first, prior in zip((0, 3), priors.values(), strict=False):
        about = state.reference if first else None
        shown, tried = state.innovation[:, first : first + 3], [Candidate(f, named=True) for f in named]
        more = prior
        looked: list[float] = []
        for _ in range(ROUNDS):
            taken = [*(line.frequency for line in more.lines), *looked]
            if not named:
                tried = candidates(time, shown, spin, taken)[:AT_ONCE]
            before = more
            for candidate in tried:
                if not near(candidate.frequency, taken, time):
                    more = with_line(flight, more, about, engine, candidate)
            looked += [candidate.frequency for candidate in tried]
            if named or len(more.lines) == len(before.lines):
                break
            model, z = seen_part(flight, more, about)
            shown = engine.filter(model, z).innovation
        found.append(more.lines)
    return Lines(*found)


def with_line(
    flight: Flight, prior: LoadPrior, about: Reference | None, engine: Engine, candidate: Candidate
) -> LoadPrior:
    """The prior with the lines at or near a candidate that the record has beside it."""
    model, z = seen_part(flight, prior, about)
    for line in find_line(model, engine.filter(model, z), flight.time, prior.axes, candidate):

        def likelihood(line: Line, prior: LoadPrior = prior) -> float:
            model, z = seen_part(flight, beside(prior, line), about)
            return float(engine.log_likelihood(model, z))

        prior = beside(prior, let_drift(likelihood, line, float(np.ptp(flight.time))))
    return prior


def mass_hidden(kin: Kinematics) -> bool:
    """Whether a deforming body carries mass where it carries no marker."""
    return bool(len(kin.shapes) and kin.unfollowed.any())


def densities(channel: Channel, prior: LoadPrior, frequency: float) -> tuple[Array, Array]:
    """Spectral densities (3,) along the prior's axes of the noise and of the smooth load, both as a load."""
    tuned, axes, w = prior.tuned, prior.axes, 2 * np.pi * frequency
    span, seen = float(np.ptp(channel.time)), np.isfinite(channel.z).all(1)
    white = channel.var(axes)[seen].mean(0) * span / seen.sum()
    drift = np.einsum("ai,ab,bi->i", axes, channel.drift, axes) / w**2
    smooth = matern(tuned.order, tuned.std, tuned.rate).Qc[:, -1, -1] / (tuned.rate**2 + w**2) ** tuned.order
    return tuned.noise**2 * (white + drift) * w**4 / channel.gain**2, smooth


def smallest_found(channel: Channel, prior: LoadPrior, frequency: float) -> Array:
    """Amplitude (3,) along the prior's axes of a line at `frequency` (Hz) that half of all records show.

    The closed form, for a long record, of the evidence that a line has to gain: against the noise and the
    smooth load at its frequency.
    """
    noise, smooth = densities(channel, prior, frequency)
    information = np.ptp(channel.time) / (2 * (noise + smooth))  # on each of the two quadratures
    gained = 2 * PATIENCE
    for _ in range(20):  # half of it is the likelihood gained, less what two unknown amplitudes cost
        gained = 2 * (PATIENCE + float(np.log1p(gained / 2)))
    return np.asarray(np.sqrt(gained / information))


def unshown_lines(name: str, channel: Channel, prior: LoadPrior, spin: float) -> dict[str, float]:
    """Amplitudes N or N m, by name, of what a load at once or twice the spin (Hz) may add and not be found.

    Less what the smooth prior follows of it; along the axis where the most may hide. None where such a line
    is found, or is not to be seen at this rate.
    """
    slow, fast = 2 / np.ptp(channel.time), 0.5 / np.median(np.diff(channel.time))
    taken, found = [line.frequency for line in prior.lines], {}
    for times, frequency in (("once", spin), ("twice", 2 * spin)):
        if slow < frequency < fast and not near(frequency, taken, channel.time):
            noise, smooth = densities(channel, prior, frequency)
            lost = smallest_found(channel, prior, frequency) * noise / (noise + smooth)
            found[f"{name}_unshown_at_{times}_spin"] = float(lost.max())
    return found


def hidden_lines(tuned: dict[str, float], state: FlightState, mass: float, gravity: Array) -> list[str]:
    """Sentences on a line at the spin that would hide, where it would be much of the load, and of the claim.

    Much: of the load, or of weight, and of what turns the spin around in a radian, where no load shows.
    """
    std = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
    scales = {
        "force": (state.force, std[:, :3], mass * float(np.linalg.norm(gravity)), "N"),
        "moment": (state.moment, std[:, 3:], length(state.H) * length(state.omega), "N m"),
    }
    told = []
    for name, (load, claim, whole, unit) in scales.items():
        size, claimed = length(load), length(claim)
        scale = size if size > SHOWN * claimed else max(size, whole)
        for times in ("once", "twice"):
            hides = tuned.get(f"{name}_unshown_at_{times}_spin", 0.0)
            if hides > MUCH * claimed and hides > PART * scale:
                told.append(
                    f"a {name} of up to {hides:.2g} {unit} at {times} the spin would hide in the noise, and "
                    f"the claim of {claimed:.2g} {unit} leaves it out; if one may act, record faster, or use "
                    "more markers"
                )
    return told


def beside(prior: LoadPrior, line: Line) -> LoadPrior:
    """The prior with one line more."""
    return replace(prior, lines=(*prior.lines, line))
