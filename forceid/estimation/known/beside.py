"""An estimate beside known loads: along the motion as measured first, then along the one that it finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.config import Settings
from forceid.estimation.body.deformation import Deformation, inertia_along
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.known.loads import KnownLoad, known_loads
from forceid.estimation.known.removal import KnownWrench, Path, along
from forceid.estimation.loads.channels import force_channel, moment_channel, tune_channel
from forceid.estimation.methods.solution import Solution
from forceid.estimation.methods.tuning import range_of
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine, engine
from forceid.records import Array, Body, Estimate, Motion, Recording
from forceid.significance import TENTH

LOOKS = 4  # at where loads act, at most: each leaves what a pose is off, times the load, over its lever


@dataclass(frozen=True)
class Beside:
    """Known loads, and the part of them that is taken out of the motion beforehand."""

    loads: tuple[KnownLoad, ...]
    taken: KnownWrench

    def removed(self, motion: Motion) -> Motion:
        """The motion without that part."""
        return self.taken.removed(motion)

    def restored(self, state: FlightState, body: Body, time: Array) -> tuple[FlightState, KnownWrench]:
        """The state beside all known loads, of the motion as it was, and these along its path."""
        state = self.taken.with_path(state)
        # a low-passed rotation lags in a fast turn, as a measured one does not
        known = self.taken if state.reference is None else self.along(state, body, time)
        state = known.added(self.taken.added(state), -1.0)
        return known.with_errors(state), known

    def along(self, state: FlightState, body: Body, time: Array) -> KnownWrench:
        """The loads along the path of a state."""
        return along(self.loads, path_through(time, state.center, state.rotation), body)


Found = tuple[Estimate, Solution | None]


def beside_known(
    recording: Recording, settings: Settings, estimate: Callable[[Recording, Settings, Beside | None], Found]
) -> Found:
    """The estimate of what acts beside the loads that are known; of all that acts where none are.

    estimate: of a recording under settings, beside known loads. It runs again where a load depends on the
    path, until the path that it finds moves no load by a tenth of a claim.
    """
    loads = known_loads(recording, settings)
    if not loads:
        return estimate(recording, settings, None)
    body, motion = recording.body, recording.motion
    kin = kinematics(body, motion, settings)
    known = along(loads, path_through(kin.time, kin.pose.center, kin.pose.rotation), body)
    shares = 1.0, 1.0
    if settings.method in ("smoother", "filter"):
        shares = taken_beforehand(kin, known, body, motion, settings)
    for _ in range(LOOKS):
        result, solution = estimate(recording, settings, Beside(loads, known.times(*shares)))
        if solution is None or solution.state.reference is None or not any(load.follows for load in loads):
            break
        before, known = known, Beside(loads, known).along(solution.state, body, motion.time)
        if settled(before, known, solution.state):
            break
    return result, solution


def taken_beforehand(
    kin: Kinematics, known: KnownWrench, body: Body, motion: Motion, settings: Settings
) -> tuple[float, float]:
    """Shares, 1 or 0, of the known force and moment that leave the likelier motion when they are taken out."""
    without = known.removed(motion)
    moved = kinematics(body, without, settings)
    chosen = engine(settings.engine)
    force = [log_likelihood(k, g, chosen) for k, g in ((kin, motion.gravity), (moved, without.gravity))]
    moment = [log_likelihood(k, None, chosen) for k in (kin, moved)] if kin.attitude else [0.0, 0.0]
    return float(force[1] >= force[0]), float(moment[1] >= moment[0])


def log_likelihood(kin: Kinematics, gravity: Array | None, chosen: Engine) -> float:
    """That of the channel of the force under gravity, or of the moment where none is given, tuned."""
    still = np.zeros_like(kin.amplitude)
    deformation = Deformation(still, still, *inertia_along(kin, still, still))
    channel = moment_channel(kin, deformation) if gravity is None else force_channel(kin, gravity)
    limits = range_of(kin, next(iter(kin.noise)))
    return tune_channel(channel, limits, (), engine=chosen).tuned.log_likelihood


def path_through(time: Array, center: Array, rotation: Array) -> Path:
    """A path from what is seen of it: straight, and at a constant turn, across what is not."""
    seen, turned = np.isfinite(center).all(1), np.isfinite(rotation).all((1, 2))
    center = np.stack([np.interp(time, time[seen], c) for c in center[seen].T], 1)
    if turned.sum() < 2:
        return Path(time, center, np.tile(np.eye(3), (len(time), 1, 1)))
    known = Slerp(time[turned], Rotation.from_matrix(rotation[turned]))
    return Path(time, center, known(np.clip(time, *time[turned][[0, -1]])).as_matrix())


def settled(before: KnownWrench, after: KnownWrench, state: FlightState) -> bool:
    """Whether known loads along a path and a better one differ by no more than a tenth of a claim."""
    claimed = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
    moved = [after.part.force - before.part.force, after.part.moment - before.part.moment]
    rms = np.sqrt(np.mean(np.concatenate(moved, 1) ** 2, axis=0))
    return bool((rms <= TENTH * np.sqrt(np.nanmean(claimed**2, axis=0))).all())
