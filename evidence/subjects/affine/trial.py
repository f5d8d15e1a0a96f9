"""One affine body by everyone who takes it on: errors of two quantities, what is claimed, and the verdict."""

from __future__ import annotations

import warnings
from time import process_time
from typing import Any

import numpy as np

from evidence.stress.cell import Trial
from evidence.subjects.affine import contestants as affine_contestants
from evidence.subjects.affine import fliers as affine_fliers
from evidence.subjects.affine import movers as affine_movers
from evidence.subjects.affine.problem import UNKNOWN, Contestant, Problem, relative
from evidence.subjects.flights.failures.failure import Failure
from forceid.errors import ForceIdError

MEETS = {
    "flattened": affine_contestants.POLAR,
    "needle": affine_contestants.POLAR,
    "close_values": affine_contestants.RATES,
    "values_meet": affine_contestants.PATHS,
    "axes_meet": affine_movers.CHARTS,
    "collapse": affine_movers.COLLAPSING,
    "nearly_incompressible": affine_movers.STIFF,
    "long_step": affine_movers.FREE,
    "off_volume": affine_movers.HELD,
    "alike_moments": affine_movers.RIGID,
}


def takers(failure: Failure, short: bool = False) -> tuple[Contestant, ...]:
    """Who meets a failure: everyone who can, what forceid is asked for first; or that only."""
    every = MEETS.get(failure.name, affine_fliers.LOADS)
    return every[:1] if short else every


def attempt_affine(failure: Failure, level: float, seed: int, who: tuple[Contestant, ...]) -> dict[str, Any]:
    """The trials of one problem, as plain numbers under the names of contestants."""
    problem = failure.make(level, np.random.default_rng([seed, 2026]))
    found = {}
    for one in who:
        began = process_time()
        trial = tried(problem, one)
        found[one.name] = {**vars(trial), "seconds": process_time() - began}
    return {"failure": failure.name, "level": level, "seed": seed, "trials": found}


def tried(problem: Problem, who: Contestant) -> Trial:
    """What one contestant makes of a problem.

    What is told of an error is taken for it where that is more than what is promised, and then for a warning.
    """
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found = who.answer(problem)
    except ForceIdError as refusal:
        return Trial("refused", UNKNOWN, UNKNOWN, UNKNOWN, str(refusal))
    except np.linalg.LinAlgError as failed:  # which is how peers refuse
        return Trial("refused", UNKNOWN, UNKNOWN, UNKNOWN, f"LinAlgError: {failed}")
    except Exception as crash:  # an error that is none of ours is a finding, and the map goes on
        return Trial("crashed", UNKNOWN, UNKNOWN, UNKNOWN, f"{type(crash).__name__}: {crash}")
    if not np.isfinite(found.motion).any():
        return Trial("refused", UNKNOWN, UNKNOWN, UNKNOWN, found.reason or "gives nothing")
    error = found.off or (relative(found.motion, problem.motion), relative(found.rate, problem.rate))
    claimed = problem.promised if found.claimed is None else found.claimed
    return Trial(found.verdict, error, claimed, UNKNOWN, found.reason)
