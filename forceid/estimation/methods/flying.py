"""Stages that solve the flight: instruments beside the poses, priors by the flight, wild frames, lines."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

from forceid.estimation.body.cleaning import wild_frames
from forceid.estimation.instruments.on_flight import fused
from forceid.estimation.instruments.strain_gauges import with_strain_gauges
from forceid.estimation.loads.channels import flight_of
from forceid.estimation.loads.fused_tuning import by_the_flight
from forceid.estimation.loads.lines import Lines, more_lines
from forceid.estimation.methods.problem import Problem
from forceid.kalman.building.line_search import AT_ONCE
from forceid.timing import stage


@stage("instruments")
def add_instruments(problem: Problem) -> Problem:
    """The flight with its sensors and gauges, and priors that suit all of its channels."""
    body, motion, kin, settings = problem.body, problem.motion, problem.kin, problem.settings
    flight = flight_of(kin, problem.deformation, motion.gravity, bool(motion.readings))
    flight = with_strain_gauges(flight, kin, body, motion, settings)
    apiece = problem.priors
    flight, priors = fused(flight, apiece, kin, body, motion, settings, problem.engine)
    return replace(problem, apiece=apiece, flight=flight, priors=priors)


@stage("flight")
def solve(problem: Problem) -> Problem:
    """The state of the flight."""
    return replace(problem, state=problem.smoothed(problem.flight))


@stage("flight_tuning")
def tune_on_flight(problem: Problem) -> Problem:
    """The flight under priors by its own likelihood, where its rotations contradict those of the channels.

    Not where a deformation hides what loads do: the likeliest ones are then too weak.
    """
    kin, flight = problem.kin, problem.flight
    alone = kin.apart or flight.sensors is not None or kin.inertia.line is not None
    if problem.hides or not kin.attitude or alone:
        return problem
    priors = by_the_flight(flight, problem.priors, problem.state, problem.engine)
    if priors["moment"] is problem.priors["moment"]:
        return problem
    return solve(replace(problem, priors=priors))


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
    if settings.lines == "none":
        return problem
    # a moment of deformation that no marker shows turns with the body, and would pass for lines
    searched = {"force": priors["force"]} if len(kin.shapes) and kin.unfollowed.any() else priors
    asked = () if isinstance(settings.lines, str) else settings.lines
    more: Lines = more_lines(problem.flight, problem.state, searched, problem.engine, asked, harmonics)
    if not len(problem.lines) < len(more) <= 6 * AT_ONCE:  # as many as one look may find of each component
        return problem
    return replace(problem, lines=more, near=problem.apiece)
