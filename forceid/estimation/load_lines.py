"""Oscillating loads that a solved flight shows beside its smooth ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.kinematics import Kinematics
from forceid.kalman.engines import Engine
from forceid.kalman.flight import Flight, FlightState, Reference, seen_part
from forceid.kalman.lines import Candidate, Line, candidates, find_line, let_drift, near
from forceid.kalman.prior import LoadPrior

MOST_LINES, AT_ONCE = 24, 4  # of both loads together; candidates of one load judged against one prior


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
        shown = state.innovation[:, first : first + 3]
        taken = [line.frequency for line in prior.lines]
        tried = [Candidate(f, named=True) for f in named if not near(f, taken, time)]
        if not named:
            tried = candidates(time, shown, spin, taken)[:AT_ONCE]
        for candidate in tried:
            model, z = seen_part(flight, prior, about)
            for line in find_line(model, engine.filter(model, z), time, prior.axes, candidate):

                def likelihood(
                    line: Line, prior: LoadPrior = prior, about: Reference | None = about
                ) -> float:
                    model, z = seen_part(flight, beside(prior, line), about)
                    return float(engine.log_likelihood(model, z))

                prior = beside(prior, let_drift(likelihood, line, float(np.ptp(time))))
        found.append(prior.lines)
    return Lines(*found)


def mass_hidden(kin: Kinematics) -> bool:
    """Whether a deforming body carries mass where it carries no marker."""
    return bool(len(kin.shapes) and kin.unfollowed.any())


def beside(prior: LoadPrior, line: Line) -> LoadPrior:
    """The prior with one line more."""
    return replace(prior, lines=(*prior.lines, line))
