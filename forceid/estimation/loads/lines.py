"""Oscillating loads that a solved flight shows beside its smooth ones."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.model import Flight, Reference, seen_part
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

ROUNDS = 4  # of a search about what the last one found


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
    harmonics: Collection[str] = (),
) -> Lines:
    """The lines of the priors, and those that the innovations of a solved flight show beside them.

    named: the only frequencies (Hz) to look at, or none for wherever a line stands out; at harmonics of the
    spin, in the loads of these names alone.
    """
    time, spin = flight.time, 0.0
    if state.reference is not None:
        spin = float(np.mean(np.linalg.norm(state.omega, axis=1))) / (2 * np.pi)
    found = []
    for first, (load, prior) in zip((0, 3), priors.items(), strict=False):
        about, observed = state.reference if first else None, state.innovation[:, first : first + 3]
        tried = [Candidate(f, named=True, known=True) for f in named]
        more = prior
        looked: list[float] = []
        for _ in range(ROUNDS):
            if not named:
                standing = line_candidates(time, observed, spin, more.lines, looked)
                tried = [c for c in standing if load in harmonics or not c.known][:AT_ONCE]
            before = more
            for candidate in tried:
                more = with_line(flight, more, about, engine, candidate)
            looked += [candidate.frequency for candidate in tried]
            if named or len(more.lines) == len(before.lines):
                break
            model, z = seen_part(flight, more, about)
            observed = engine.filter(model, z).innovation
        found.append(more.lines)
    return Lines(*found)


def with_line(
    flight: Flight, prior: LoadPrior, about: Reference | None, engine: Engine, candidate: Candidate
) -> LoadPrior:
    """The prior with the lines at or near a candidate that the record has beside it."""
    if not (left := axes_left(candidate.frequency, prior.lines, flight.time)):
        return prior
    model, z = seen_part(flight, prior, about)
    for line in find_line(model, engine.filter(model, z), flight.time, prior.axes, candidate, left):

        def likelihood(line: Line, prior: LoadPrior = prior) -> float:
            model, z = seen_part(flight, with_another_line(prior, line), about)
            return float(engine.log_likelihood(model, z))

        prior = with_another_line(prior, let_drift(likelihood, line, float(np.ptp(flight.time))))
    return prior


def with_another_line(prior: LoadPrior, line: Line) -> LoadPrior:
    """The prior with one line more."""
    return replace(prior, lines=(*prior.lines, line))
