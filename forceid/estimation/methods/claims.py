"""Stages after a flight is solved: what its claims must allow for, and what is to say of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.body.deformation import as_smoothed
from forceid.estimation.instruments.on_flight import judge_sensors, named_sensors
from forceid.estimation.instruments.strain_gauges import judge_strain_gauges
from forceid.estimation.loads.hidden.deforming_body import motion_growth, widened_by_arms
from forceid.estimation.loads.hidden.free_oscillation import widened_by_ringing
from forceid.estimation.loads.hidden.left_out import hidden_load, least_band, lines_at_spin
from forceid.estimation.loads.hidden.loads_on_modes import as_fast_as_on_modes, loads_shown
from forceid.estimation.loads.hidden.misfit import shown_misfit, typical_variance
from forceid.estimation.loads.pieces.edges import spread_of, with_edges_known
from forceid.estimation.loads.pieces.impulses import edges_of, impulses
from forceid.estimation.methods.noise import judge_filter, widened_by_slow_errors
from forceid.estimation.methods.problem import Problem, Smoothing, Solution, named
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import Unit, length
from forceid.estimation.verdict.tracks import judge_rejected, judge_wild
from forceid.flight.vibration import ModeState


def judge_channels(problem: Problem) -> Problem:
    """What sensors and gauges say against the flight, and frames that nothing explains."""
    motion, flight, state = problem.motion, problem.flight, problem.state
    stated = set(motion.noise_std | problem.settings.noise_std)
    said = (*judge_sensors(flight, state, stated), *judge_strain_gauges(flight, state, problem.body, motion))
    frames = (*judge_rejected(problem.dropped), *judge_wild(problem.wild))
    return replace(problem.noting(*said, *frames), plain=state.wrench_cov)


def allow_for_ringing(problem: Problem) -> Problem:
    """Free oscillations of the loads that the record does not show."""
    state, said = widened_by_ringing(problem.state, problem.flight, problem.priors, problem.engine)
    return replace(problem, state=state).noting(*said)


def allow_for_slow_errors(problem: Problem) -> Problem:
    """Errors of the tracks that follow each other."""
    if problem.slow is None:
        return problem
    noise = problem.kin.noise[problem.source]
    state = widened_by_slow_errors(
        problem.state, problem.flight, problem.priors["force"], problem.driven.force, noise, problem.engine
    )
    return replace(problem, state=state)


def judge_spin(problem: Problem) -> Problem:
    """What a load that keeps to axes of the world may hide at the spin; one that turns with it hides none."""
    flight, priors = problem.flight, problem.priors
    if problem.state.reference is None or flight.sensors is not None:  # these would show what poses do not
        return problem
    still = {load: channel for load, channel in problem.channels.items() if priors[load].body_axes is None}
    mass, gravity = problem.kin.inertia.mass, problem.motion.gravity
    return problem.noting(*lines_at_spin(still, priors, problem.state, mass, gravity))


def allow_for_deforming_loads(problem: Problem) -> Problem:
    """What a body that deforms says of its loads: as fast as on its modes, and on arms that move."""
    kin, state, modes = problem.kin, problem.state, problem.deformation.prior
    if not kin.attitude or problem.causal or modes is None or problem.flight.sensors is not None:
        return problem
    turned = problem.turned_at("moment")
    band = least_band(problem.channels["moment"], problem.priors["moment"], turned)
    bent = as_smoothed(kin, problem.deformation, state)
    state = widened_by_arms(state, kin, bent.amplitude, band)
    if kin.elastic is None or kin.frames is None or problem.deformation.path is None:
        return replace(problem, state=state)
    # as smoothed by themselves: what a flight makes of them beside has a noise that is harder to tell
    on_modes = problem.deformation.path[:, ModeState.LOAD :: modes.states]
    rows = kin.frames.rows.reshape(-1, kin.frames.rows.shape[2])
    told = rows.T @ rows / len(kin.time)
    found = loads_shown(kin.time, on_modes, told, modes, kin.elastic.size)
    inertia = (state.rotation @ kin.inertia.tensor @ state.rotation.mT).mean(0)
    moved = {"force": kin.inertia.mass * np.eye(3), "moment": inertia}
    # a mass center that is known by itself tells of no mode, and no stiffness told may touch its force
    shown = {name: ch for name, ch in problem.channels.items() if name == "moment" or not kin.apart}
    state, said = as_fast_as_on_modes(shown, problem.priors, state, found, moved, turned)
    return replace(problem, state=state).noting(*said)


def allow_for_edges(problem: Problem) -> Problem:
    """Edges of the loads, whose places are open to a part of a step or to more."""
    channels, priors, flight, state = problem.channels, problem.priors, problem.flight, problem.state
    time = flight.time
    apart = {name: spread_of(ch, priors[name], time, problem.engine) for name, ch in channels.items()}
    spread = {name: one for name, one in apart.items() if one is not None}
    if not spread:
        return problem
    fall = (time - time[0])[:, None] * flight.gravity
    given = np.concatenate([flight.mass * (state.velocity - fall), state.H], 1)
    each = [
        (priors["force"], None),
        *((priors[name], state.reference) for name in ("moment",) if name in priors),
    ]
    said = [
        note("load-in-pieces", load=name, edges=len(at), first_s=float(at[0]), last_s=float(at[-1]))
        for name, at in ((name, edges_of(priors[name])) for name in spread)
    ]
    for name, own in (("force", slice(0, 3)), ("moment", slice(3, 6))):
        if name in spread:
            given[:, own] += spread[name].mean[:, :3]
    places = [spread.get(name) for name in ("force", "moment")]
    found = impulses(flight, each, given, places, problem.engine)
    return replace(problem, state=with_edges_known(state, spread, given), impulses=found).noting(*said)


def judge_lever(problem: Problem) -> Problem:
    """The moment of a force about a mass center that errs slowly."""
    if problem.slow is None or not problem.kin.attitude or problem.settings.body_std.mass_center:
        return problem
    state, off = problem.state, 10 * Unit.MILLIMETER
    claim = float(np.sqrt(np.nanmean(np.trace(state.wrench_cov[:, 3:, 3:], axis1=1, axis2=2))))
    return problem.noting(
        note("moment-lever", off_mm=1e3 * off, moment=off * length(state.force), claim=claim)
    )


def allow_for_modes(problem: Problem) -> Problem:
    """What the records of affine modes do not tell of how these move."""
    kin, found = problem.kin, as_smoothed(problem.kin, problem.deformation, problem.state)
    if found.motion_cov is None or found.prior is None:
        return problem
    seen = kin.time, kin.amplitude, np.nan_to_num(kin.amplitude_var, nan=1.0)
    return replace(problem, moving=motion_growth(*seen, found.prior, found.motion_cov, problem.engine))


def solution_of(problem: Problem) -> Solution:
    """The solution that a problem has come to."""
    kin, state, flight, priors = problem.kin, problem.state, problem.flight, problem.priors
    hidden = None
    if flight.sensors is None and not problem.causal:  # these would show what poses do not
        turned = problem.turned_at("moment") if kin.attitude else None
        hidden = hidden_load(problem.channels, priors, turned)
    alone = {name: problem.turned_at(name) if kin.attitude else None for name in problem.channels}
    misfit = shown_misfit(problem.channels, priors, flight.time, state.innovation, alone)
    filtered = judge_filter(kin, (line for prior in priors.values() for line in prior.lines))
    allowance = state.wrench_cov - problem.plain + problem.between
    return Solution(
        kin,
        as_smoothed(kin, problem.deformation, state),
        state,
        problem.engine.name,
        named(kin, priors) | named_sensors(flight, state) | problem.gained,
        problem.at_limit,
        (*problem.findings, *problem.notes, *filtered),
        priors,
        None if problem.causal else Smoothing(flight, priors, allowance),
        hidden,
        problem.growth,
        problem.moving,
        problem.impulses,
        misfit * typical_variance(problem.plain),
        problem.ringing,
        problem.looks,
        rivals=problem.rivals,
        between=problem.between,
        wrong_mass=problem.wrong_mass,
        center_off=problem.center_off,
        inertia_off=problem.inertia_off,
    )
