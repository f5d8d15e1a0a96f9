"""Who meets a failure of an affine body, with the errors of an answer."""

from __future__ import annotations

import numpy as np

from evidence.stress.failure import Failure
from evidence.subject import Answer, Contestant
from evidence.subjects.affine import contestants as affine_contestants
from evidence.subjects.affine import fliers as affine_fliers
from evidence.subjects.affine import movers as affine_movers
from evidence.subjects.affine.problem import AffineProblem, relative_error
from forceid.errors import EstimationError

MEETS = {
    "flattened": affine_contestants.POLAR,
    "needle": affine_contestants.POLAR,
    "close_values": affine_contestants.RATES,
    "values_meet": affine_contestants.PATHS,
    "axes_meet": affine_movers.CHARTS,
    "collapse": affine_movers.COLLAPSING,
    "nearly_incompressible": affine_movers.STIFF,
    "long_step": affine_movers.FREE,
    "off_volume": affine_movers.HELD_PEERS,
    "alike_moments": affine_movers.RIGID_PEERS,
}


def takers(failure: Failure, short: bool = False) -> tuple[Contestant, ...]:
    """Who meets a failure: everyone who can, what forceid is asked for first; or that only."""
    every = MEETS.get(failure.name, affine_fliers.LOADS)
    return every[:1] if short else every


def errors(problem: AffineProblem, answer: Answer) -> tuple[float, float]:
    """Relative errors of both quantities."""
    motion, rate = answer.found
    if not np.isfinite(motion).any():
        raise EstimationError(next(iter(answer.reasons), "gives nothing"))
    return answer.off or (relative_error(motion, problem.motion), relative_error(rate, problem.rate))


def promised(problem: AffineProblem) -> tuple[float, float]:
    """Relative errors that an answer without a word is held to."""
    return problem.promised
