"""Loads that are known: taken out of the motion beforehand, so that what is found is what else acts.

With p' = F + F_known + m g and H' = T + T_known, what known loads bring is known too: the path that their
force makes, s'' = F_known / m, and the momentum L' = T_known. Markers moved back by s move as if the other
forces acted alone, and H - L is what the other moments make; every method then finds those. What of s is a
free fall goes to the gravity: the rest stays small, however long the record. Loads that answer each other, as
two feet that share a weight, are another case: their sum may be smoother than either. Then the known part is
taken off what was found. Source: principal equations 2.4, 4a.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.config import Settings
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.known.loads import KnownLoad
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.principal import cross_matrix, summation_operator, transport_cov
from forceid.records import Array, Body, Estimate, Finding, KnownPart, Motion, Recording, deviation
from forceid.significance import TENTH

LOOKS = 4  # at where loads act, at most: each leaves what a pose is off, times the load, over its lever


@dataclass(frozen=True)
class Path:
    """Where a body is: center (time, 3) m and rotation (time, 3, 3), body to world, known at every time."""

    time: Array
    center: Array
    rotation: Array

    def at(self, time: Array) -> tuple[Array, Array]:
        """Center and rotation at other times of the record."""
        center = straight(time, self.time, self.center)
        turned = Slerp(self.time, Rotation.from_matrix(self.rotation))
        return center, np.asarray(turned(np.clip(time, *self.time[[0, -1]])).as_matrix())


@dataclass(frozen=True)
class KnownWrench:
    """All known loads along a path: what they do there, and what is not known of them.

    part: force and moment about the mass center, world axes, and the momentum that they bring; cov (time, 6,
    6) of force, then moment; by_pose (time, 6, 6): their slope by an error of the pose, center then left
    error of the rotation. The path that their force makes is shift (time, 3) m, with its rate (time, 3) m/s,
    and a free fall (3,) m/s2.
    """

    part: KnownPart
    cov: Array
    by_pose: Array
    shift: Array
    rate: Array
    fall: Array

    def times(self, force: float, moment: float) -> KnownWrench:
        """The same with these shares of what its force and its moment do."""
        own, F, T = self.part, force, moment
        part = KnownPart(F * own.force, T * own.moment, T * own.momentum, T * own.turned)
        shift, rate, fall = F * self.shift, F * self.rate, F * self.fall
        return replace(self, part=part, shift=shift, rate=rate, fall=fall)

    def removed(self, motion: Motion) -> Motion:
        """The motion as it would be without what these forces do to the mass center."""
        moved = {
            name: value - self.shift.reshape(len(value), *(1,) * (value.ndim - 2), 3)
            for name in ("position", "center")
            if (value := getattr(motion, name)) is not None
        }
        return replace(motion, **moved, gravity=motion.gravity + self.fall, known=self.part)

    def added(self, state: FlightState, times: float = 1.0) -> FlightState:
        """The state with this wrench added to its own, times a factor."""
        force, moment = state.force + times * self.part.force, state.moment + times * self.part.moment
        return replace(state, force=force, moment=moment)


def wrench_of(load: KnownLoad, time: Array, path: Path) -> tuple[Array, Array, Array]:
    """Wrench (time, 6) of one load about the mass center, its covariance, and its slope by the pose."""
    center, R = path.at(time)
    W, cov = straight(time, load.time, load.wrench), straight(time, load.time, load.cov)
    if load.nodal is not None:
        f = straight(time, load.time, load.nodal)
        at = np.einsum("tab,nb->tna", R, load.arms)
        W = W + np.einsum("tiw,ti->tw", summation_operator(at), f.reshape(len(f), -1))
        by_pose = np.zeros((len(time), 6, 6))
        by_pose[:, 3:, 3:] = (cross_matrix(f) @ cross_matrix(at)).sum(1)
        return W, cov, by_pose
    if load.turns:
        W = np.einsum("tab,tkb->tka", R, W.reshape(-1, 2, 3)).reshape(-1, 6)
        both = np.zeros((len(time), 6, 6))
        both[:, :3, :3] = both[:, 3:, 3:] = R
        cov = both @ cov @ both.mT
    arm = np.zeros_like(center)
    if load.point is not None and load.body:
        arm = np.einsum("tab,b->ta", R, load.point)
    elif load.point is not None:
        point = load.point if load.point.ndim == 1 else straight(time, load.time, load.point)
        arm = point - center
    W = np.concatenate([W[:, :3], W[:, 3:] + np.cross(arm, W[:, :3])], 1)
    F, by_pose = cross_matrix(W[:, :3]), np.zeros((len(time), 6, 6))
    if load.turns:
        by_pose[:, :3, 3:], by_pose[:, 3:, 3:] = -F, -cross_matrix(W[:, 3:])
    elif load.body:
        by_pose[:, 3:, 3:] = F @ cross_matrix(arm)
    if load.point is not None and not load.body:
        by_pose[:, 3:, :3] = F
    return W, transport_cov(cov, arm), by_pose


def along(loads: tuple[KnownLoad, ...], path: Path, body: Body) -> KnownWrench:
    """All known loads along a path: straight between the samples of either clock."""
    start, end = path.time[[0, -1]]
    clocks = [load.time[(load.time > start) & (load.time < end)] for load in loads]
    fine = np.unique(np.concatenate([path.time, *clocks]))
    total = np.zeros((len(fine), 6))
    for load in loads:
        total += wrench_of(load, fine, path)[0]
    at = np.searchsorted(fine, path.time)
    each = [wrench_of(load, path.time, path) for load in loads]
    once, twice = integrals(fine, total)
    since, mass = path.time - start, inertia_of(body).mass
    shift, rate = twice[at, :3] / mass, once[at, :3] / mass
    fit = np.polynomial.polynomial.polyfit(since, shift, 2)  # a free fall, which goes to the gravity
    shift = shift - np.polynomial.polynomial.polyval(since, fit).T
    rate = rate - fit[1] - 2 * fit[2] * since[:, None]
    part = KnownPart(total[at, :3], total[at, 3:], once[at, 3:], twice[at, 3:])
    cov, by_pose = (np.sum([wrench[k] for wrench in each], axis=0) for k in (1, 2))
    return KnownWrench(part, cov, by_pose, shift, rate, 2 * fit[2])


def integrals(time: Array, values: Array) -> tuple[Array, Array]:
    """Values (time, column), straight between the samples, integrated from the first on once and twice."""
    step, none = np.diff(time)[:, None], np.zeros((1, values.shape[1]))
    once = np.concatenate([none, np.cumsum(0.5 * step * (values[1:] + values[:-1]), 0)])
    grown = once[:-1] * step + step**2 * (2 * values[:-1] + values[1:]) / 6
    return once, np.concatenate([none, np.cumsum(grown, 0)])


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
    each = [[np.nanmean(a**2) for a in (e.force_std, e.moment_std)] for e, _ in (before, after)]
    less = np.sqrt(each[0]) <= np.sqrt(each[1])  # false where either is not known
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
        before, after, claim = beside.known.part, known.part, deviation(solution.state.wrench_cov)
        moved = np.concatenate([after.force - before.force, after.moment - before.moment], 1)
        if (np.sqrt(np.mean(moved**2, axis=0)) <= TENTH * np.sqrt(np.nanmean(claim**2, axis=0))).all():
            break
        beside = replace(beside, known=known)
    return result, solution


def path_through(time: Array, center: Array, rotation: Array) -> Path:
    """A path from what is seen of it: straight, and at a constant turn, across what is not."""
    seen, turned = np.isfinite(center).all(1), np.isfinite(rotation).all((1, 2))
    center = straight(time, time[seen], center[seen])
    if turned.sum() < 2:
        return Path(time, center, np.tile(np.eye(3), (len(time), 1, 1)))
    known = Slerp(time[turned], Rotation.from_matrix(rotation[turned]))
    return Path(time, center, known(np.clip(time, *time[turned][[0, -1]])).as_matrix())
