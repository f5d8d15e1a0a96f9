"""Loads that turn with the body or stay in fixed axes: every alternative, tuned on a record of sensors alone.

What a load is slow in, sensors do not say beforehand: each of force and moment is taken to be slow in the
axes of the body, and in fixed ones, and what the record says of the four is weighed by their likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.loads.ascent import NO_GAIN, bfgs_maximum
from forceid.estimation.loads.fused_tuning import (
    flight_likelihood,
    louder,
    tune_together,
)
from forceid.flight.channels import middle
from forceid.flight.instruments.protocol import Instrument
from forceid.flight.model import Flight
from forceid.flight.path.reference import Reference
from forceid.flight.path.settling import settled
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState, smooth_flight, smoothed_once_more
from forceid.kalman.engines import Engine
from forceid.motion import log
from forceid.records import Array
from forceid.significance import TENTH, WILD

# of a logarithm: what differences show as noise is a ceiling, to which motion adds
QUIETER = (-0.5, -2.5, -4.5)
LONGEST = 120  # samples that a start is chosen by
LOADS = ("force", "moment")
Kind = tuple[bool, bool]
PriorPair = tuple[LoadPrior, LoadPrior]


@dataclass(frozen=True)
class Alternative:
    """A flight smoothed with force and moment slow in body axes where `turning` says so, else in fixed.

    left: what its path still moves by, over its claimed error.
    """

    turning: tuple[bool, bool]
    flight: Flight
    force: LoadPrior
    moment: LoadPrior
    state: FlightState
    left: float

    @property
    def restless(self) -> bool:
        """Whether its path moves on by so much that its likelihood says nothing."""
        return self.left > WILD


@dataclass(frozen=True)
class Search:
    """What tuning an alternative takes: a flight with noise as differences show it, priors of force and
    moment of about the right size, the passes, and what is stated.
    """

    flight: Flight
    rough: PriorPair
    settings: Settings
    engine: Engine
    stated: frozenset[str]


def alternatives(first: Reference, search: Search) -> list[Alternative]:
    """Every alternative that the record bears: each load slow in body axes, or in fixed ones where those are
    not ruled out by load_axes. EstimationError: it bears none.

    The first begins with a reference; the others from what was found.
    """
    found: dict[Kind, Alternative] = {}
    failed: Exception | None = None
    for kind in ((True, True), (True, False), (False, True), (False, False)):
        asked = search.settings.load_axes
        if (asked == "body" and not all(kind)) or (asked == "world" and any(kind)):
            continue
        near = max(found.values(), key=likelihood, default=None)
        try:
            if near is None:
                tried = from_scratch(kind, first, search)
            else:
                tried = from_near(kind, near, near, near, search)
        except (EstimationError, np.linalg.LinAlgError) as error:
            failed = error
            continue
        if np.isfinite(tried.state.log_likelihood):
            found[kind] = tried
        if sum(one.restless for one in found.values()) > 1:
            break  # a third would come to rest no more
    if not found:
        what = f"bears no estimate ({failed})"
        raise EstimationError(what, "the record of the sensors", "raise the sample rate, or record longer")
    return list(crossed_alternatives(found, search).values())


def likelihood(alternative: Alternative) -> float:
    """Of an alternative, to compare it by."""
    return alternative.state.log_likelihood


def crossed_alternatives(found: dict[Kind, Alternative], search: Search) -> dict[Kind, Alternative]:
    """Alternatives, each tuned again from the best that share force or moment, where it is likelier."""
    better = dict(found)
    for kind, own in found.items():
        force, moment = (
            max((a for a in found.values() if a.turning[i] == kind[i]), key=likelihood) for i in (0, 1)
        )
        if (force is own and moment is own) or own.restless:
            continue
        try:
            if promising(kind, own, force, moment, search):
                tried = from_near(kind, own, force, moment, search)
                better[kind] = max(own, tried, key=likelihood)
        except (EstimationError, np.linalg.LinAlgError):
            continue
    return better


def promising(kind: Kind, own: Alternative, force: Alternative, moment: Alternative, search: Search) -> bool:
    """Whether an alternative is likelier, about its own path, with the priors and the noise of others."""
    about = own.state.reference
    assert about is not None
    pair = turning_as(kind, force.force, moment.moment)
    flight = with_noise_of(with_noise_of(own.flight, moment.flight, "moment"), force.flight, "force")
    value = flight_likelihood(flight, *pair, about, search.engine)
    return value > likelihood(own) + NO_GAIN


def turning_as(kind: Kind, force: LoadPrior, moment: LoadPrior) -> PriorPair:
    """Priors alike along all axes, of loads that turn with the body or do not."""
    was = zip((force, moment), kind, strict=True)
    a, b = (replace(prior, body_axes=np.eye(3) if turns else None, axes=np.eye(3)) for prior, turns in was)
    return a, b


def from_scratch(kind: Kind, first: Reference, search: Search) -> Alternative:
    """An alternative from priors of about the right size."""
    rough, flight = turning_as(kind, *search.rough), search.flight
    _, _, _, about = settled(flight, *rough, search.engine, first)
    for i in (0, 1):
        flight, rough = begun(flight, rough, i, about, search)
    return tuned_and_smoothed(flight, kind, *rough, about, search)


def from_near(
    kind: Kind, near: Alternative, force: Alternative, moment: Alternative, search: Search
) -> Alternative:
    """An alternative from the flight and the path of one that is near, and priors of others; a load that none
    of them has so begins anew.
    """
    pair, about = turning_as(kind, force.force, moment.moment), near.state.reference
    assert about is not None
    flight = near.flight
    for i, other in enumerate((force, moment)):
        if other.turning[i] != kind[i]:
            flight, pair = begun(flight, pair, i, about, search)
    return tuned_and_smoothed(flight, kind, *pair, about, search)


def begun(
    flight: Flight, pair: PriorPair, i: int, about: Reference, search: Search
) -> tuple[Flight, PriorPair]:
    """A flight and priors to begin a search with, of a load (0 force, 1 moment) of which nothing is known.

    A fast load explains a record without any noise, and one that does not fit leaves it all to noise: a
    search stays where it begins. So it begins slow, and with several noises where none is stated.
    """
    part = middle(len(flight.time), LONGEST)
    path, kinds = about.part(part), observing_instruments(search.flight, LOADS[i])
    free = [kind for kind in kinds if instruments_of(search.flight)[kind].name not in search.stated]
    rough = turning_as((pair[0].body_axes is not None, pair[1].body_axes is not None), *search.rough)[i]
    flight = with_noise_of(flight, search.flight, LOADS[i])

    def by(p: Array) -> tuple[Flight, PriorPair]:
        prior = rough.moved(p[:2])
        return louder(flight, free, p[2:]), (prior, pair[1]) if i == 0 else (pair[0], prior)

    def value(p: Array) -> float:
        noisy, priors = by(p)
        return flight_likelihood(noisy.part(part), *priors, path, search.engine)

    starts = QUIETER if free else (0.0,)
    tops = [bfgs_maximum(value, np.array([0.0, 0.0, *[quieter] * len(free)])) for quieter in starts]
    return by(max(tops, key=value))


def instruments_of(flight: Flight) -> tuple[Instrument, ...]:
    """The instruments on a flight."""
    return () if flight.sensors is None else flight.sensors.instruments


def observing_instruments(flight: Flight, load: str) -> list[int]:
    """Places among the instruments on a flight of those that tell of a load."""
    return [i for i, one in enumerate(instruments_of(flight)) if one.tells == load]


def with_noise_of(flight: Flight, other: Flight, load: str) -> Flight:
    """A flight with the noise of another, of the sensors that tell of a load."""
    assert flight.sensors is not None
    assert other.sensors is not None
    noise = flight.sensors.noise_std.copy()
    kinds = observing_instruments(flight, load)
    noise[kinds] = other.sensors.noise_std[kinds]
    return replace(flight, sensors=replace(flight.sensors, noise_std=noise))


def tuned_and_smoothed(
    flight: Flight, kind: Kind, force: LoadPrior, moment: LoadPrior, first: Reference, search: Search
) -> Alternative:
    """One alternative, tuned from near. No bias is taken to wander unasked: it would pass for a load that
    does.
    """
    stated = search.stated | {f"{one.name}_walk" for one in instruments_of(flight)}
    flight, tuned, moment = tune_together(flight, force, moment, search.engine, stated, first, even=True)
    force = tuned or force
    causal = search.settings.method == "filter"
    state = smooth_flight(flight, force, moment, search.engine, causal, first)
    state, left = with_left_over(flight, force, moment, search.engine, state)
    return Alternative(kind, flight, force, moment, state, left)


def with_left_over(
    flight: Flight, force: LoadPrior, moment: LoadPrior, engine: Engine, state: FlightState
) -> tuple[FlightState, float]:
    """A state that claims what its path still moves by as well, and that over its claim before, at most.

    The loads turn with the path; of one that is not at rest, they move on with it, and that is claimed too.
    """
    assert state.reference is not None
    step = log(state.rotation @ state.reference.rotation.swapaxes(1, 2))
    before = np.sqrt(np.diagonal(state.pose_cov, axis1=1, axis2=2)[:, 3:])
    left = float((np.abs(step) / before).max())
    pose = np.concatenate([np.zeros_like(step), step], 1)
    offs = [np.concatenate([np.cross(step, state.force), np.cross(step, state.moment)], 1)]
    if left > TENTH:
        on = smoothed_once_more(flight, force, moment, engine, state.reference)
        offs.append(np.concatenate([on.force - state.force, on.moment - state.moment], 1))
    wrench_cov = state.wrench_cov + sum(off[:, :, None] * off[:, None] for off in offs)
    pose_cov = state.pose_cov + pose[:, :, None] * pose[:, None]
    return replace(state, pose_cov=pose_cov, wrench_cov=wrench_cov), left
