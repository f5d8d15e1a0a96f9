"""The filter and the smoother: priors tuned on the record, then force and moment along the whole flight."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.cleaning import (
    NONE_DROPPED,
    Dropped,
    kinematics_without,
    prepared,
    wild_frames,
    wildest,
)
from forceid.estimation.body.deformation import Deformation, as_smoothed, undeformed
from forceid.estimation.body.deformation_residual import noise_beyond
from forceid.estimation.body.kinematics import Kinematics, scaled
from forceid.estimation.body.spin import turning
from forceid.estimation.instruments.on_flight import fused, judge_sensors, named_sensors
from forceid.estimation.instruments.strain_gauges import judge_gauges, with_gauges
from forceid.estimation.loads.body_axes import on_body
from forceid.estimation.loads.channels import flight_of, force_channel, moment_channel, tune_channel
from forceid.estimation.loads.free_oscillation import allow_for_ringing
from forceid.estimation.loads.fused_tuning import by_the_flight
from forceid.estimation.loads.hidden import hidden_load, lines_at_spin
from forceid.estimation.loads.inner_wheel import allow_for_wheels, signals, with_momentum
from forceid.estimation.loads.lines import MOST_LINES, NO_LINES, Lines, mass_hidden, more_lines
from forceid.estimation.loads.noise import errors_shared, lever, noise_beyond_motion, widened
from forceid.estimation.loads.order_uncertainty import growth_along_world
from forceid.estimation.loads.whitened import whitened
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import GROWTH
from forceid.estimation.verdict.tracks import judge_mending, judge_wild
from forceid.flight.model import Flight, Reference, translation
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState, smooth_flight, smooth_translation, with_translation
from forceid.kalman.engines import Engine
from forceid.kalman.robust import WILD
from forceid.motion.window import noise_growth
from forceid.records import Array, Body, Finding, Flags, HiddenLoad, Motion

STATED = (1.0, 4.0)  # factors on a stated noise: it is a floor
UNSTATED = (0.02, 3.0)  # factors on the noise that high-order differences show: nearly a ceiling
ENOUGH = 1.02  # a noise factor this near to one changes nothing


@dataclass(frozen=True)
class Smoothing:
    """What a smoothed wrench rests on: the flight, the priors of its loads, and allowance (time, 6, 6), what
    its covariance claims beyond what follows from these.
    """

    flight: Flight
    priors: dict[str, LoadPrior]
    allowance: Array


@dataclass(frozen=True)
class Solution:
    """A solved flight: what was seen, how it deformed, its state, and how the numbers were come by.

    tuned: numbers that tuning chose, by name; noise_at_limit: by variable, whether the likelihood wanted
    less noise than it was allowed; findings: for the verdict; priors: of the loads, by name; smoothing: of a
    smoother's wrench;
    hidden: what that leaves out; growth (6, 6): of the errors that the wrench claims, for what the record
    does not tell of its priors, None for none. Levels are compared without it: it is alike at all of them.
    """

    kinematics: Kinematics
    deformation: Deformation
    state: FlightState
    engine: str
    tuned: dict[str, float]
    noise_at_limit: dict[str, bool]
    findings: tuple[Finding, ...] = ()
    priors: Mapping[str, LoadPrior] = field(default_factory=dict)
    smoothing: Smoothing | None = None
    hidden: HiddenLoad | None = None
    growth: Array | None = None


def estimate_flight(
    body: Body,
    motion: Motion,
    settings: Settings,
    engine: Engine,
    findings: tuple[Finding, ...] = (),
    lines: Lines = NO_LINES,
    dropped: Dropped = NONE_DROPPED,
    slow: dict[str, Array] | None = None,
    near: Mapping[str, LoadPrior] = MappingProxyType({}),
) -> Solution:
    """Wrench and motion by the Kalman smoother, or by the filter if settings.method says so.

    findings: of a first pass that rejected frames, dropped: those frames; lines: of the loads,
    that a pass without them found; slow: noise of tracks whose errors follow each other, that it found; near:
    priors of a pass before, which those of the same lines are near to.
    """
    motion, mended = prepared(body, motion)
    findings = (*findings, *judge_mending(mended))
    look = partial(kinematics_without, dropped, body, motion, settings)
    kin = look(slow)
    source = "position" if motion.position is not None else "center"
    gravity = motion.gravity
    limits = (1.0, 1.0) if slow else STATED if kin.stated[source] else UNSTATED
    # where a pose is as uncertain as the body deforms, how smooth it is says nothing of the noise of markers
    followed = kin.apart or not kin.deforms
    if not followed and not slow and not kin.stated[source]:
        kin, limits = look(scaled(kin, {source: min(noise_beyond(kin, motion), 1.0) * np.eye(3)})), (1.0, 1.0)
    causal = settings.method == "filter"

    def at_rest(kin: Kinematics) -> tuple[Kinematics, Deformation]:
        kin, deformation = undeformed(kin, engine, causal)
        return kin, with_momentum(deformation, body.internal_momentum)

    kin, deformation = at_rest(kin)
    channel, before = force_channel(kin, gravity), near.get("force")
    tune = partial(tune_channel, engine=engine, kind=settings.load_prior)
    force = tune(channel, limits, lines.force, near=before)
    at_limit = {source: force.tuned.noise_at_limit}
    if np.abs(np.log(force.tuned.noise)).max() > np.log(ENOUGH):
        kin = look(scaled(kin, {source: force.noise}))
        kin, deformation = at_rest(kin)
    notes: tuple[Finding, ...] = ()
    stated = kin.stated[source]
    if (
        not slow
        and followed
        and (
            errors_shared(kin, force, gravity, engine)
            if stated
            else force.tuned.noise_at_limit or noise_growth(kin.time, kin.pose.center) > GROWTH
        )
    ):
        beyond = noise_beyond_motion(force_channel(kin, gravity), stated)
        slow = scaled(kin, {source: beyond * np.eye(3)})
        kin = look(slow)
        kin, deformation = at_rest(kin)
        force = tune(force_channel(kin, gravity), (1.0, 1.0), lines.force)
    if slow:
        code = "slow-errors-allowed" if stated else "noise-hidden"
        notes = (note(code, variable=source, noise=kin.noise[source]),)
        at_limit = {}  # said in the note
    priors = {"force": force}
    if kin.attitude:
        limits = (1.0, 1.0)
        if "orientation" in kin.noise:
            limits = STATED if kin.stated["orientation"] else UNSTATED
        channel, before = moment_channel(kin, deformation), near.get("moment")
        moment = tune(channel, limits, lines.moment, near=before)
        priors["moment"] = moment
        if "orientation" in kin.noise:
            at_limit["orientation"] = moment.tuned.noise_at_limit
            kin = look(scaled(kin, {"orientation": moment.noise}))

    def solve(flight: Flight, first: Reference | None = None) -> FlightState:
        if not kin.attitude:
            return smooth_translation(flight, force, engine, causal)
        if not kin.apart or flight.sensors is not None:
            state = smooth_flight(flight, force, moment, engine, causal, first)
            return turning(state, kin.spin, kin.inertia.line)
        free = smooth_translation(flight, force, engine, causal)
        turns: Flags = np.asarray(np.isfinite(flight.rotation).all((1, 2)))
        center = np.where(np.isfinite(flight.center), flight.center, free.center)
        beside = replace(flight, center=np.where(turns[:, None], center, np.nan))
        state = smooth_flight(beside, force.plain(), moment, engine, causal, first)
        beyond = engine.log_likelihood(translation(beside, force.plain()), beside.center)
        state = replace(state, log_likelihood=state.log_likelihood - float(beyond) + free.log_likelihood)
        return turning(with_translation(state, free), kin.spin, kin.inertia.line)

    flight = flight_of(kin, deformation, gravity, bool(motion.readings))
    flight = with_gauges(flight, kin, body, motion, settings)
    apiece = priors
    flight, priors = fused(flight, priors, kin, body, motion, settings, engine)
    force, moment = priors["force"], priors.get("moment", force)
    state = solve(flight)
    if kin.attitude and not kin.apart and flight.sensors is None and kin.inertia.line is None:
        priors = by_the_flight(flight, priors, state, engine)
        if priors["moment"] is not moment:
            force, moment = priors["force"], priors["moment"]
            state = solve(flight)
    again, parts = partial(solve, first=state.reference), kin.apart and flight.sensors is None
    more_dropped, wild = wild_frames(flight, state, again, parts, dropped)
    if more_dropped.any:
        both, findings = dropped.beside(more_dropped), (*findings, *judge_wild(wild))
        return estimate_flight(body, motion, settings, engine, findings, lines, both, slow, apiece)
    # a moment of deformation that no marker shows turns with the body, and would pass for lines
    searched = {"force": force} if mass_hidden(kin) else priors
    more = lines
    if settings.lines != "none":
        asked = () if isinstance(settings.lines, str) else settings.lines
        more = more_lines(flight, state, searched, engine, asked)
    if len(lines) < len(more) <= MOST_LINES:
        with suppress(EstimationError):  # what does not settle beside lines leaves them in its innovations
            found = estimate_flight(body, motion, settings, engine, findings, more, dropped, slow, apiece)
            if wild is None or wildest(found.state).max() < WILD:  # an impact holds every line, and stays
                return found
    told = judge_sensors(flight, state, set(motion.noise_std | settings.noise_std))
    told = (*told, *judge_gauges(flight, state, body, motion))
    findings = (*findings, *notes, *told, *judge_wild(wild))
    plain = state.wrench_cov
    state, rings = allow_for_ringing(state, flight, priors, engine)
    findings = (*findings, *rings)
    if slow:
        state = widened(state, flight, force, force_channel(kin, gravity), kin.noise[source], engine)
    told_by = {"force": force_channel(kin, gravity)}
    if kin.attitude:
        told_by["moment"] = moment_channel(kin, deformation)
    tuned = named(kin, priors) | named_sensors(flight, state)
    if settings.load_axes == "body" and kin.attitude:
        priors, gained = on_body(priors, told_by, flight, state, engine)
        state = smooth_flight(flight, priors["force"], priors["moment"], engine, causal)
        plain = state.wrench_cov
        tuned = named(kin, priors) | named_sensors(flight, state) | gained
    elif state.reference is not None and flight.sensors is None:  # these would show what poses do not
        findings = (*findings, *lines_at_spin(told_by, priors, state, kin.inertia.mass, gravity))
    if slow and kin.attitude:
        findings = (*findings, lever(state))
    smoothing = None if causal else Smoothing(flight, priors, state.wrench_cov - plain)
    if kin.inertia.line is not None:  # mass on a line or a point shows not every moment
        told_by.pop("moment", None)
    growth = None
    if settings.load_axes != "body":
        seen = np.asarray(np.isfinite(kin.pose.rotation).all((1, 2)))
        open_to = [name for name in told_by if priors[name].kernel.rivals]
        inside = "moment" in open_to and body.internal_momentum is None and not len(kin.shapes)
        beside = {"moment": signals(told_by["moment"].time, state.rotation[seen])} if inside else {}
        looks = {name: whitened(told_by[name], priors[name], engine, beside.get(name)) for name in open_to}
        growth = growth_along_world(state, looks)
        if inside:
            growth, wheel = allow_for_wheels(looks["moment"], state, growth)
            findings = (*findings, *wheel)
    deformation = as_smoothed(kin, deformation, state)
    hides = None
    if flight.sensors is None and not causal:  # these would show what poses do not
        turned = state.rotation[np.isfinite(kin.pose.rotation).all((1, 2))]
        hides = hidden_load(told_by, priors, turned)
    return Solution(
        kin, deformation, state, engine.name, tuned, at_limit, findings, priors, smoothing, hides, growth
    )  # fmt: skip


def named(kin: Kinematics, priors: dict[str, LoadPrior]) -> dict[str, float]:
    """What tuning chose of noise and loads, as numbers with names."""
    found = {f"noise_std_{name}": level for name, level in kin.noise.items()}
    for load, prior in priors.items():
        found |= prior.numbers(load)
    return found
