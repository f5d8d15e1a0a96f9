"""Loads that turn with the body or stay in fixed axes: every alternative, tuned on a record of sensors alone.

What a load is slow in, sensors do not say beforehand: each of force and moment is taken to be slow in the
axes of the body, and in fixed ones, and what the record says of the four is weighed by their likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.joint_tuning import FAMILIES, evidence, louder, tune_together
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState, smooth_flight, smoothed_once_more
from forceid.kalman.flight_model import Flight, Reference
from forceid.kalman.prior import LoadPrior
from forceid.motion.pose import log
from forceid.records import Array

ROUNDS = 2  # in which alternatives learn from each other
GAIN = 0.5  # of a log-likelihood: less is no gain
LEFT = 0.1  # of a standard deviation: a path that moves by less is at rest
# A fast load may explain a record without any noise, and a search that begins there stays there: it begins
# with the slowest that a record shows, and with noise below what differences show, to which motion adds.
SLOW = 3.0  # over the length of a record: rate of a load that changes once in it
QUIET = -1.0  # of a logarithm
Kind = tuple[bool, bool]


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


@dataclass(frozen=True)
class Search:
    """What tuning an alternative takes: the passes, what is stated, and whether it filters or smooths."""

    settings: Settings
    engine: Engine
    stated: frozenset[str]

    @property
    def loud(self) -> list[int]:
        """Families of sensors whose noise is not stated."""
        return [i for i, name in enumerate(FAMILIES) if name not in self.stated]


def alternatives(
    flight: Flight, force: LoadPrior, moment: LoadPrior, first: Reference, search: Search
) -> list[Alternative]:
    """Every alternative that the record bears: each load slow in body axes, or in fixed ones where those are
    not ruled out by load_axes. EstimationError: it bears none.

    The first begins from priors of about the right size and a reference; the others from what was found.
    """
    found: dict[Kind, Alternative] = {}
    failed: Exception | None = None
    for kind in ((True, True), (True, False), (False, True), (False, False)):
        if search.settings.load_axes == "body" and not all(kind):
            continue
        near = max(found.values(), key=likelihood, default=None)
        try:
            if near is None:
                tried = from_scratch(flight, kind, force, moment, first, search)
            else:
                tried = from_near(kind, near, near, near, search)
        except (EstimationError, np.linalg.LinAlgError) as error:
            failed = error
            continue
        if np.isfinite(tried.state.log_likelihood):
            found[kind] = tried
    if not found:
        what = f"bears no estimate ({failed})"
        raise EstimationError(what, "the record of the sensors", "raise the sample rate, or record longer")
    return list(crossed(found, search).values())


def likelihood(alternative: Alternative) -> float:
    """Of an alternative, to compare it by."""
    return alternative.state.log_likelihood


def crossed(found: dict[Kind, Alternative], search: Search) -> dict[Kind, Alternative]:
    """Alternatives, each tuned again from the best of the others that share its force or its moment, where
    that is likelier.
    """
    found = dict(found)
    for _ in range(ROUNDS):
        better = False
        for kind, own in list(found.items()):
            force, moment = (
                max((a for a in found.values() if a.turning[i] == kind[i]), key=likelihood) for i in (0, 1)
            )
            if force is own and moment is own:
                continue
            try:
                if not promising(kind, own, force, moment, search):
                    continue
                tried = from_near(kind, own, force, moment, search)
            except (EstimationError, np.linalg.LinAlgError):
                continue
            if likelihood(tried) > likelihood(own) + GAIN:
                found[kind], better = tried, True
        if not better:
            break
    return found


def promising(kind: Kind, own: Alternative, force: Alternative, moment: Alternative, search: Search) -> bool:
    """Whether an alternative is likelier, about its own path, with the priors and the noise of others."""
    about = own.state.reference
    assert about is not None
    pair = turning_as(kind, force.force, moment.moment)
    sensors = own.flight.sensors
    assert sensors is not None
    noise = sensors.noise_std.copy()
    for i, other in enumerate((moment, force)):  # gyros tell of moments, accelerometers of forces
        assert other.flight.sensors is not None
        noise[i] = other.flight.sensors.noise_std[i]
    flight = replace(own.flight, sensors=replace(sensors, noise_std=noise))
    value = evidence(flight, *pair, about, search.engine, [], np.zeros(4))
    return value > likelihood(own) + GAIN


def turning_as(kind: Kind, force: LoadPrior, moment: LoadPrior) -> tuple[LoadPrior, LoadPrior]:
    """Priors alike along all axes, of loads that turn with the body or do not."""
    was = zip((force, moment), kind, strict=True)
    a, b = (replace(prior, carried=np.eye(3) if turns else None, axes=np.eye(3)) for prior, turns in was)
    return a, b


def from_scratch(
    flight: Flight, kind: Kind, force: LoadPrior, moment: LoadPrior, first: Reference, search: Search
) -> Alternative:
    """An alternative from priors of about the right size."""
    force, moment = (
        replace(prior, tuned=replace(prior.tuned, rate=np.full(3, SLOW / np.ptp(flight.time))))
        for prior in turning_as(kind, force, moment)
    )
    flight = louder(flight, search.loud, np.full(len(search.loud), QUIET))
    return tuned_and_smoothed(flight, kind, force, moment, first, search)


def from_near(
    kind: Kind, near: Alternative, force: Alternative, moment: Alternative, search: Search
) -> Alternative:
    """An alternative from the flight and the path of one that is near, and priors of others."""
    force_prior, moment_prior = turning_as(kind, force.force, moment.moment)
    about = near.state.reference
    assert about is not None
    return tuned_and_smoothed(near.flight, kind, force_prior, moment_prior, about, search)


def tuned_and_smoothed(
    flight: Flight, kind: Kind, force: LoadPrior, moment: LoadPrior, first: Reference, search: Search
) -> Alternative:
    """One alternative, tuned from near. No bias is taken to wander unasked: it would pass for a load that
    does.
    """
    stated = search.stated | {f"{family}_walk" for family in FAMILIES}
    flight, force, moment = tune_together(flight, force, moment, search.engine, stated, first, even=True)
    causal = search.settings.method == "filter"
    state = smooth_flight(flight, force, moment, search.engine, causal, first)
    state, left = with_left_over(flight, force, moment, search.engine, state)
    return Alternative(kind, flight, force, moment, state, left)


def mixed(states: list[FlightState], share: Array) -> FlightState:
    """The likeliest state with the mean wrench of all, and a covariance that holds what they differ by."""
    wrench = np.stack([np.hstack([state.force, state.moment]) for state in states])
    mean = np.einsum("s,sta->ta", share, wrench)
    off = wrench - mean
    cov = np.einsum("s,stab->tab", share, np.stack([state.wrench_cov for state in states]))
    cov += np.einsum("s,sta,stb->tab", share, off, off)
    return replace(
        states[int(share.argmax())], force=mean[:, :3], moment=mean[:, 3:], wrench_cov=cov
    )  # fmt: skip


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
    if left > LEFT:
        on = smoothed_once_more(flight, force, moment, engine, state.reference)
        offs.append(np.concatenate([on.force - state.force, on.moment - state.moment], 1))
    wrench_cov = state.wrench_cov + sum(off[:, :, None] * off[:, None] for off in offs)
    pose_cov = state.pose_cov + pose[:, :, None] * pose[:, None]
    return replace(state, pose_cov=pose_cov, wrench_cov=wrench_cov), left
