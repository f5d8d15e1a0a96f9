"""The filter and the smoother: priors tuned on the record, then force and moment along the whole flight."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import reduce

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.cleaning import largest_innovations
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.methods.axes import choose_axes
from forceid.estimation.methods.claims import (
    allow_for_axes,
    allow_for_deforming_loads,
    allow_for_edges,
    allow_for_modes,
    allow_for_priors,
    allow_for_ringing,
    allow_for_slow_errors,
    judge_channels,
    judge_lever,
    judge_spin,
    solution_of,
)
from forceid.estimation.methods.flying import (
    add_instruments,
    beside_more_lines,
    solve,
    tune_on_flight,
    without_wild_frames,
)
from forceid.estimation.methods.problem import Look, Problem, Solution
from forceid.estimation.methods.tuning import (
    cut_force,
    cut_moment,
    find_slow_errors,
    see_motion,
    settle_noise,
    tune_force,
    tune_moment,
)
from forceid.kalman.engines import Engine
from forceid.records import Body, Motion
from forceid.significance import WILD
from forceid.timing import stage

Stage = Callable[[Problem], Problem]

PASS: tuple[Stage, ...] = (
    see_motion,
    tune_force,
    settle_noise,
    find_slow_errors,
    cut_force,
    tune_moment,
    cut_moment,
    cut_force,
    add_instruments,
    solve,
    tune_on_flight,
)
CLAIMS: tuple[Stage, ...] = (
    judge_channels,
    allow_for_ringing,
    allow_for_slow_errors,
    judge_spin,
    allow_for_deforming_loads,
    judge_lever,
    allow_for_edges,
    allow_for_priors,
    allow_for_axes,
    allow_for_modes,
)


def estimate_flight(
    body: Body,
    motion: Motion,
    settings: Settings,
    engine: Engine,
    kin: Kinematics | None = None,
    shown: Look | None = None,
) -> Solution:
    """Wrench and motion by the Kalman smoother, or by the filter if settings.method says so.

    motion: cleaned; kin: its kinematics at the level of the settings, where they are known already; shown:
    what a look at them has shown, where there was one.
    """
    given = kinematics(body, motion, settings) if kin is None else kin
    apart = beside_lines(with_frames_that_agree(Problem(body, motion, settings, engine, given, shown)))
    problem = choose_axes(apart)
    # a load that turns with the body holds harmonics of the spin; one that does not may have lines there
    still = [load for load, prior in problem.priors.items() if prior.body_axes is None]
    if (again := beside_lines(apart, still)) is not apart:
        problem = choose_axes(again)
    with stage("claims"):
        return solution_of(through(CLAIMS, problem))


def through(stages: tuple[Stage, ...], problem: Problem) -> Problem:
    """The problem after one stage after the other."""
    return reduce(lambda so_far, stage: stage(so_far), stages, problem)


def with_frames_that_agree(problem: Problem) -> Problem:
    """The problem solved, again and again until no frame is left that nothing else agrees with."""
    while True:
        solved = through(PASS, problem)
        problem = without_wild_frames(solved)
        if problem.dropped is solved.dropped:
            return problem


def beside_lines(problem: Problem, harmonics: Collection[str] = ()) -> Problem:
    """The problem solved with the lines of its loads, again and again until it shows no further ones.

    At harmonics of the spin, in the loads of these names alone.
    """
    while True:
        more = beside_more_lines(problem, harmonics)
        if more.lines is problem.lines:
            return problem
        try:
            found = with_frames_that_agree(more)
        except EstimationError:  # what does not settle beside lines leaves them in its innovations
            return problem
        if problem.wild is not None and not largest_innovations(found.state).max() < WILD:
            return problem  # an impact holds every line, and stays
        problem = found
