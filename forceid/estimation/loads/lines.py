"""Oscillating loads that a solved flight shows beside its smooth ones."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.one_load import MOVED, OneLoad, errors_link
from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.building.line_candidates import Candidate, is_white, line_candidates
from forceid.kalman.building.line_search import AT_ONCE, find_line, let_drift
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
    link = state.reference is not None and errors_link(flight)
    if state.reference is not None:
        spin = float(np.mean(np.linalg.norm(state.omega, axis=1))) / (2 * np.pi)
    own = {name: state.innovation[:, MOVED[name]] for name in priors}

    def looked_at(name: str) -> OneLoad:
        # what one load leaves unexplained would pass for errors of the other
        explained = all(is_white(own[other]) for other in priors if other != name)
        return OneLoad(name, flight, state.reference, link and explained)

    def standing(load: OneLoad, innovation: Array, looked: list[float]) -> list[Candidate]:
        found = line_candidates(time, load.told(innovation), spin, held[load.name].lines, looked)
        return [c for c in found if load.name in harmonics or not c.known][:AT_ONCE]

    names = [name for name in priors if name in loads]
    tried = {name: [Candidate(f, named=True, known=True) for f in named] for name in names}
    if not named:
        for load in map(looked_at, names):
            tried[load.name] = standing(load, state.innovation[:, load.channels], [])
    strongest = {name: max((c.stands for c in tried[name]), default=0.0) for name in names}
    for name in sorted(names, key=lambda name: -strongest[name]):
        load, candidates, looked = looked_at(name), tried[name], list[float]()
        told_anew = load.linked and not named
        changed = any(held[one] is not priors[one] for one in priors)
        seen = load.filtered(held, engine) if candidates or (told_anew and changed) else None
        if seen is not None and told_anew:
            candidates = standing(load, seen[1].innovation, looked)
        for _ in range(ROUNDS):
            if seen is None or not candidates:
                break
            before = held[name]
            for candidate in candidates:
                found = new_lines(time, held[name], candidate, *seen)
                if not found:
                    continue
                held = with_lines(held, name, as_they_last(load, held, found, engine))
                seen = load.filtered(held, engine)
                own[name] = seen[1].innovation[:, load.own]
                if len(counted(Lines(**{one: held[one].lines for one in names}))) > MOST_LINES:
                    return None
            looked += [candidate.frequency for candidate in candidates]
            if named or held[name] is before:
                break
            candidates = standing(load, seen[1].innovation, looked)
    return counted(Lines(**{name: held[name].lines for name in names}))


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
