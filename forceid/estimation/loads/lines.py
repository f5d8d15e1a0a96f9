"""Oscillating loads that a solved flight shows beside its smooth ones."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.one_load import OneLoad, errors_link
from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.building.line_search import (
    AT_ONCE,
    Candidate,
    find_line,
    let_drift,
    line_candidates,
)
from forceid.kalman.building.lines import Line, axes_left
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered, StateSpace
from forceid.records import Array

ROUNDS = 4  # of a search about what the last one found
MOST_LINES = 6 * AT_ONCE  # lines of all loads: as many as one look may find of each component


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
    loads: Collection[str] = ("force", "moment"),
    named: tuple[float, ...] = (),
    harmonics: Collection[str] = (),
    counted: Callable[[Lines], Lines] = lambda lines: lines,
) -> Lines | None:
    """The lines of the priors of some loads, and those that the innovations of a solved flight show beside.

    named: the only frequencies (Hz) to look at, or none for wherever a line stands out; at harmonics of the
    spin, in the loads of these names alone. counted: those that are loads. None where there would be more
    than MOST_LINES: what stands out at so many frequencies is no line.
    """
    time, spin, held = flight.time, 0.0, dict(priors)
    linked = state.reference is not None and errors_link(flight)
    if state.reference is not None:
        spin = float(np.mean(np.linalg.norm(state.omega, axis=1))) / (2 * np.pi)

    def standing(load: OneLoad, innovation: Array, looked: list[float]) -> list[Candidate]:
        found = line_candidates(time, load.told(innovation), spin, held[load.name].lines, looked)
        return [c for c in found if load.name in harmonics or not c.known][:AT_ONCE]

    each = [OneLoad(name, flight, state.reference, linked) for name in priors if name in loads]
    tried = [[Candidate(f, named=True, known=True) for f in named] for _ in each]
    if not named:
        tried = [standing(load, state.innovation[:, load.channels], []) for load in each]
    # the strongest first: where errors are linked, a line of one load stands in what shows the other
    strongest = [max((c.stands for c in candidates), default=0.0) for candidates in tried]
    for k in np.argsort(strongest)[::-1]:
        load, candidates, looked = each[k], tried[k], list[float]()
        seen = load.filtered(held, engine) if candidates else None
        if seen is not None and linked and not named:
            candidates = standing(load, seen[1].innovation, looked)
        for _ in range(ROUNDS):
            if seen is None or not candidates:
                break
            before = held[load.name]
            for candidate in candidates:
                found = new_lines(time, held[load.name], candidate, *seen)
                if not found:
                    continue
                held = with_lines(held, load.name, as_they_last(load, held, found, engine))
                seen = load.filtered(held, engine)
                if len(counted(Lines(**{one.name: held[one.name].lines for one in each}))) > MOST_LINES:
                    return None
            looked += [candidate.frequency for candidate in candidates]
            if named or held[load.name] is before:
                break
            candidates = standing(load, seen[1].innovation, looked)
    return counted(Lines(**{one.name: held[one.name].lines for one in each}))


def beyond_rounding(lines: Lines, kin: Kinematics, most: float) -> Lines:
    """Lines that move the body further than rounding, which moves each marker for itself by `most` m."""
    if not most:
        return lines
    most /= np.sqrt(kin.seen.sum())
    arm = float(np.sqrt((kin.shape[kin.seen] ** 2).sum(1).mean()))
    heavy = {"force": kin.inertia.mass, "moment": np.linalg.eigvalsh(kin.inertia.tensor).max() / arm}

    def kept(load: str, each: tuple[Line, ...]) -> tuple[Line, ...]:
        loads = (most * heavy[load] * (2 * np.pi * line.frequency) ** 2 for line in each)
        return tuple(line for line, least in zip(each, loads, strict=True) if np.sqrt(2) * line.std > least)

    return Lines(kept("force", lines.force), kept("moment", lines.moment))


def new_lines(
    time: Array, prior: LoadPrior, candidate: Candidate, model: StateSpace, filtered: Filtered
) -> tuple[Line, ...]:
    """The lines at or near a candidate frequency that a record has beside those of a prior.

    model, filtered: as of `OneLoad.filtered`.
    """
    left = axes_left(candidate.frequency, prior.lines, time)
    return find_line(model, filtered, time, prior.axes, candidate, left) if left else ()


def as_they_last(
    load: OneLoad, priors: dict[str, LoadPrior], lines: tuple[Line, ...], engine: Engine
) -> tuple[Line, ...]:
    """Lines of one oscillation that a load has beside its prior, driven where what it moves says so."""
    alone = replace(load, linked=False)

    def likelihood(tried: tuple[Line, ...]) -> float:
        return float(engine.log_likelihood(*alone.shown(with_lines(priors, load.name, tried))))

    return let_drift(likelihood, lines, float(np.ptp(load.flight.time)))


def with_lines(priors: dict[str, LoadPrior], load: str, lines: tuple[Line, ...]) -> dict[str, LoadPrior]:
    """The priors with more lines of a load."""
    return priors | {load: replace(priors[load], lines=(*priors[load].lines, *lines))}
