"""An estimate beside known loads: along the motion as measured first, then along the one that it finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.config import Settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.known.loads import KnownLoad
from forceid.estimation.known.removal import KnownWrench, Path, along, interpolated
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.records import Array, Body, Estimate, Finding, Recording, deviation
from forceid.significance import TENTH

LOOKS = 4  # at where loads act, at most: each leaves what a pose is off, times the load, over its lever


@dataclass(frozen=True)
class Beside:
    """Known loads, what they do along a path, and the shares of force and moment taken out beforehand."""

    loads: tuple[KnownLoad, ...]
    known: KnownWrench
    shares: tuple[float, float]

    @property
    def taken(self) -> KnownWrench:
        """What is taken out of the motion beforehand."""
        return self.known.times(*self.shares)

    def restored(self, state: FlightState, body: Body, time: Array) -> tuple[FlightState, KnownWrench]:
        """The state beside all known loads, of the motion as it was, and these along its path."""
        taken = self.taken
        state = replace(state, center=state.center + taken.shift, velocity=state.velocity + taken.rate)
        # a low-passed rotation lags in a fast turn, as a measured one does not
        known = self.known if state.reference is None else self.along(state, body, time)
        state = known.added(taken.added(state), -1.0)
        cov = known.cov + known.by_pose @ np.nan_to_num(state.pose_cov) @ known.by_pose.mT
        return replace(state, wrench_cov=state.wrench_cov + cov), known

    def judged(self, known: KnownWrench) -> Finding:
        """What the estimate is of, for the verdict."""
        names = ", ".join(load.name for load in self.loads)
        return note(
            "beside-known", names=names, force=length(known.part.force), moment=length(known.part.moment)
        )

    def along(self, state: FlightState, body: Body, time: Array) -> KnownWrench:
        """The loads along the path of a state."""
        return along(self.loads, path_through(time, state.center, state.rotation), body)


Found = tuple[Estimate, Solution | None]


def beside_known(
    loads: tuple[KnownLoad, ...],
    recording: Recording,
    settings: Settings,
    estimate: Callable[[Recording, Settings, Beside], Found],
) -> Found:
    """The estimate of what acts beside the loads that are known.

    estimate: of a recording under settings, beside known loads. Force and moment are those of the way that
    claims less: with the known part taken out beforehand, or taken off in the end.
    """
    kin = kinematics(recording.body, recording.motion, settings)
    path = path_through(kin.time, kin.pose.center, kin.pose.rotation)
    first = along(loads, path, recording.body)

    def found(force: float, moment: float) -> Found:
        return settled_beside(recording, settings, Beside(loads, first, (force, moment)), estimate)

    before = found(1.0, 1.0)
    if settings.method not in ("smoother", "filter"):  # a window answers to the smoothness of what is found
        return before
    after = found(0.0, 0.0)
    if before[1] is None or after[1] is None:
        return after if before[1] is None else before
    less = claimed(before[0]) <= claimed(after[0])  # false where either is not known
    if less.all() or not less.any():
        return before if less.all() else after
    return found(float(less[0]), float(less[1]))


def settled_beside(
    recording: Recording,
    settings: Settings,
    beside: Beside,
    estimate: Callable[[Recording, Settings, Beside], Found],
) -> Found:
    """An estimate beside known loads, again until the path that it finds moves none by a tenth of a claim."""
    follows = any(beside.shares) and any(load.follows for load in beside.loads)
    for _ in range(LOOKS):
        result, solution = estimate(recording, settings, beside)
        if solution is None or solution.state.reference is None or not follows:
            break
        known = beside.along(solution.state, recording.body, recording.motion.time)
        if settled(beside.known, known, solution.state):
            break
        beside = replace(beside, known=known)
    return result, solution


def claimed(estimate: Estimate) -> Array:
    """Rms claim (2,) of force, N, and moment, N m."""
    return np.array([np.sqrt(np.nanmean(a**2)) for a in (estimate.force_std, estimate.moment_std)])


def path_through(time: Array, center: Array, rotation: Array) -> Path:
    """A path from what is seen of it: straight, and at a constant turn, across what is not."""
    seen, turned = np.isfinite(center).all(1), np.isfinite(rotation).all((1, 2))
    center = interpolated(time, time[seen], center[seen])
    if turned.sum() < 2:
        return Path(time, center, np.tile(np.eye(3), (len(time), 1, 1)))
    known = Slerp(time[turned], Rotation.from_matrix(rotation[turned]))
    return Path(time, center, known(np.clip(time, *time[turned][[0, -1]])).as_matrix())


def settled(before: KnownWrench, after: KnownWrench, state: FlightState) -> bool:
    """Whether known loads along a path and a better one differ by no more than a tenth of a claim."""
    claimed = deviation(state.wrench_cov)
    moved = [after.part.force - before.part.force, after.part.moment - before.part.moment]
    rms = np.sqrt(np.mean(np.concatenate(moved, 1) ** 2, axis=0))
    return bool((rms <= TENTH * np.sqrt(np.nanmean(claimed**2, axis=0))).all())
