"""The filter and the smoother: priors tuned on the record, then force and moment along the whole flight."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.cleaning import largest_innovations, wild_frames
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.instruments.on_flight import fused
from forceid.estimation.instruments.strain_gauges import with_strain_gauges
from forceid.estimation.loads.channels import DrivenMotion, flight_of
from forceid.estimation.loads.late_moment import by_the_flight, contradicted
from forceid.estimation.loads.lines import Lines, beyond_rounding, more_lines
from forceid.estimation.methods.axes import choose_axes
from forceid.estimation.methods.claims import (
    allow_for_deforming_loads,
    allow_for_edges,
    allow_for_modes,
    allow_for_ringing,
    allow_for_slow_errors,
    judge_channels,
    judge_lever,
    judge_spin,
    solution_of,
)
from forceid.estimation.methods.doubts import allow_for_body, allow_for_priors
from forceid.estimation.methods.problem import Problem, Solution
from forceid.estimation.methods.tuning import (
    cut_force,
    cut_moment,
    find_shared_errors,
    find_slow_errors,
    see_motion,
    settle_noise,
    tune_force,
    tune_moment,
    with_stated_priors,
)
from forceid.flight.model import LOOK_AFTER
from forceid.kalman.engines import Engine
from forceid.motion import log, second_order
from forceid.records import Body, Motion
from forceid.significance import TENTH, WILD
from forceid.timing import stage

Stage = Callable[[Problem], Problem]


@stage("instruments")
def add_instruments(problem: Problem) -> Problem:
    """The flight with its sensors and gauges, and priors that suit all of its channels."""
    body, motion, kin, settings = problem.body, problem.motion, problem.kin, problem.settings
    flight = flight_of(kin, problem.deformation, motion.gravity, bool(motion.readings))
    flight = with_strain_gauges(flight, kin, body, motion, settings)
    apiece = problem.priors
    flight, priors = fused(flight, apiece, kin, body, motion, settings, problem.engine)
    return with_stated_priors(replace(problem, apiece=apiece, flight=flight, priors=priors))


def solve(problem: Problem) -> Problem:
    """The state of the flight, under priors by its own likelihood where it contradicts those of the channels.

    Not where a deformation hides what loads do: the likeliest ones are then too weak.
    """
    kin, flight = problem.kin, problem.flight
    alone = flight.sensors is not None or kin.inertia.line is not None
    fixed = problem.hides or not kin.attitude or alone
    with stage("flight"):
        try:
            problem, why = replace(problem, state=problem.smoothed(flight)), None
            if fixed or not contradicted(problem.state):
                return problem
        except EstimationError as error:
            if fixed:
                raise
            why = error
    with stage("flight_tuning"):
        about = problem.state.reference if why is None else None
        priors = by_the_flight(flight, problem.priors, about, problem.engine)
        if priors is problem.priors and why is not None:
            raise why
        if priors is problem.priors:
            return problem
        problem = with_stated_priors(replace(problem, priors=priors))
        return replace(problem, state=problem.smoothed(flight))


@stage("frames")
def without_wild_frames(problem: Problem) -> Problem:
    """The problem to be solved again without frames that nothing else agrees with; itself where none are."""
    flight, state = problem.flight, problem.state
    again = partial(problem.smoothed, first=state.reference)
    dropped, wild = wild_frames(flight, state, again, problem.apart, problem.dropped)
    problem = replace(problem, wild=wild)
    if not dropped.any:
        return problem
    return replace(problem, dropped=problem.dropped.beside(dropped), near={})


@stage("lines")
def beside_more_lines(problem: Problem, harmonics: Collection[str]) -> Problem:
    """The problem to be solved again with the lines that the innovations show; itself where none are.

    At harmonics of the spin, in the loads of these names alone.
    """
    settings, kin, priors = problem.settings, problem.kin, problem.priors
    if settings.lines == "none" or problem.crowded:
        return problem
    # a moment of deformation that no marker shows turns with the body, and would pass for lines
    loads = ("force",) if len(kin.shapes) and kin.unfollowed.any() else tuple(priors)
    asked = () if isinstance(settings.lines, str) else settings.lines
    counted = partial(beyond_rounding, kin=kin, most=0.0 if asked else problem.rounding)
    more = more_lines(problem.flight, problem.state, priors, problem.engine, loads, asked, harmonics, counted)
    if more is None:
        return replace(problem, crowded=True)
    if not len(problem.lines) < len(more):
        return problem
    return replace(problem, lines=more, near=problem.apiece)


PASS: tuple[Stage, ...] = (
    see_motion,
    tune_force,
    find_shared_errors,
    settle_noise,
    find_slow_errors,
    cut_force,
    tune_moment,
    cut_moment,
    cut_force,
    add_instruments,
    solve,
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
    allow_for_modes,
)


def estimate_flight(
    body: Body,
    motion: Motion,
    settings: Settings,
    engine: Engine,
    kin: Kinematics | None = None,
    shown: DrivenMotion | None = None,
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
    if still and (again := beside_lines(apart, still)) is not apart:
        problem = choose_axes(again)
    with stage("flight"):
        problem = problem.claimed()
    with stage("claims"):
        return solution_of(through(CLAIMS, problem))


def through(stages: tuple[Stage, ...], problem: Problem) -> Problem:
    """The problem after one stage after the other."""
    return reduce(lambda so_far, stage: stage(so_far), stages, problem)


def with_frames_that_agree(problem: Problem) -> Problem:
    """The problem solved, again and again until no frame is left that nothing else agrees with."""
    while True:
        solved = about_its_path(through(PASS, problem))
        problem = without_wild_frames(solved)
        if problem.dropped is solved.dropped:
            return problem


def about_its_path(problem: Problem) -> Problem:
    """The problem solved with poses linearized about its path, where their own errors are too large for it.

    Markers near a line tell the turn about it so badly that a mass center beside the line moves by the square
    of its errors; the path knows it far better. Until no path is nearer any more to the one before.
    """
    least, since, nearest = np.inf, 0, problem
    while since < LOOK_AFTER:
        kin, state, path = problem.kin, problem.state, problem.path
        by_itself = kin.markers is None or kin.deforms or kin.apart or kin.spin is not None
        if by_itself or not kin.attitude:
            return problem
        seen = np.isfinite(kin.pose.cov).all((1, 2))
        off = None if path is None else log(state.rotation[seen] @ path[1][seen].mT)
        apart = second_order(kin.pose.cov[seen], off).max(initial=0.0)
        if not apart > TENTH:
            return problem
        least, since, nearest = (apart, 0, problem) if apart < least else (least, since + 1, nearest)
        problem = through(PASS, replace(problem, path=(state.center, state.rotation), near={}))
    return nearest


def shows_body(problem: Problem, lines: Lines) -> bool:
    """Whether the record shows a mass center or an inertia, told as numbers, elsewhere: what that makes turns
    with the body, and lines would be found in its place, each at the cost of a flight. It is taken first.

    lines: that would be found.
    """
    found = {"force": lines.force, "moment": lines.moment}
    held = {"force": problem.lines.force, "moment": problem.lines.moment}
    shown = {"force": problem.motion.position is not None, "moment": True}
    taken = {"force": problem.body.center_off, "moment": problem.body.inertia_off}
    asked = [load for load in found if found[load] and not held[load] and shown[load] and taken[load] is None]
    if problem.kin.inertia.nodal is not None or not problem.kin.attitude or not asked:
        return False
    judged, *_ = allow_for_body(replace(problem.claimed(), lines=lines), asked)
    return judged.center_off is not None or judged.inertia_off is not None


def beside_lines(problem: Problem, harmonics: Collection[str] = ()) -> Problem:
    """The problem solved with the lines of its loads, again and again until it shows no further ones.

    At harmonics of the spin, in the loads of these names alone.
    """
    while True:
        more = beside_more_lines(problem, harmonics)
        if more.lines is problem.lines:
            return more
        if shows_body(problem, more.lines):
            return problem
        try:
            found = with_frames_that_agree(more)
        except EstimationError:  # what does not settle beside lines leaves them in its innovations
            return problem
        if problem.wild is not None and not largest_innovations(found.state).max() < WILD:
            return problem  # an impact holds every line, and stays
        problem = found
