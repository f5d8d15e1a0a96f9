"""The filter and the smoother: priors tuned on the record, then force and moment along the whole flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.deformation import Deformation, smooth_deformation
from forceid.estimation.kinematics import Kinematics, kinematics, scaled
from forceid.estimation.verdict import colored
from forceid.kalman.engines import Engine
from forceid.kalman.flight import Flight, FlightState, LoadPrior, smooth_flight, smooth_translation
from forceid.kalman.tuning import Tuned, load_axes, start_of, tune_loads
from forceid.motion.first_moment import angular_channel
from forceid.records import Array, Body, Flags, Motion

STATED = (1.0, 4.0)  # factors on a stated noise: it is a floor
UNSTATED = (0.02, 3.0)  # factors on the noise that high-order differences show: nearly a ceiling
SMALL, CORRELATED = 0.6, 0.5  # innovations: mean square, and correlation from frame to frame
SHARED = (
    "the tracks are smoother than independent errors of the stated size allow: half of their variance is "
    "taken as common to all markers, and slow errors pass for force; the claimed errors are too small where "
    "markers slide or were smoothed"
)
WILD = 5.0  # innovation in standard deviations
MOST_WILD = 0.02  # part of the frames that may be dropped for it
ENOUGH = 1.02  # a noise factor this near to one changes nothing


@dataclass(frozen=True)
class Solution:
    """A solved flight: what was seen, how it deformed, its state, and how the numbers were come by.

    tuned: numbers that tuning chose, by name; noise_at_limit: by variable, whether the likelihood wanted
    less noise than it was allowed; reasons: sentences for the verdict.
    """

    kinematics: Kinematics
    deformation: Deformation
    state: FlightState
    engine: str
    tuned: dict[str, float]
    noise_at_limit: dict[str, bool]
    reasons: tuple[str, ...] = ()


def estimate_flight(
    body: Body, motion: Motion, settings: Settings, engine: Engine, reasons: tuple[str, ...] = ()
) -> Solution:
    """Wrench and motion by the Kalman smoother, or by the filter if settings.method says so.

    reasons: sentences from a first pass that rejected frames.
    """
    kin = kinematics(body, motion, settings)
    source = "position" if motion.position is not None else "center"
    force = tune_force(kin, motion.gravity, STATED if kin.stated[source] else UNSTATED)
    at_limit = {source: force.tuned.noise_at_limit}
    if not 1 / ENOUGH < force.tuned.noise < ENOUGH:
        kin = kinematics(body, motion, settings, scaled(kin, {source: force.tuned.noise}))
    if kin.stated[source] and errors_shared(kin, force, motion.gravity, engine):
        reasons = (*reasons, SHARED)
        kin = with_shared_error(kin)
        force = tune_force(kin, motion.gravity, (1.0, 1.0))
    causal = settings.method == "filter"
    deformation = smooth_deformation(kin, engine, causal)
    tuned = {"force": force.tuned}
    if kin.attitude:
        limits = (1.0, 1.0)
        if "orientation" in kin.noise:
            limits = STATED if kin.stated["orientation"] else UNSTATED
        moment = tune_moment(kin, deformation, limits)
        tuned["moment"] = moment.tuned
        if "orientation" in kin.noise:
            at_limit["orientation"] = moment.tuned.noise_at_limit
            kin = kinematics(body, motion, settings, scaled(kin, {"orientation": moment.tuned.noise}))

    def solve(flight: Flight) -> FlightState:
        if not kin.attitude:
            return smooth_translation(flight, force, engine.smooth, causal)
        return smooth_flight(flight, force, moment, engine.smooth, causal)

    flight = flight_of(kin, deformation, motion.gravity)
    state = solve(flight)
    dropped, sentence = wild_frames(flight, state, solve)
    if dropped.any():
        return estimate_flight(body, without_frames(motion, dropped), settings, engine, (*reasons, sentence))
    reasons = (*reasons, sentence) if sentence else reasons
    return Solution(kin, deformation, state, engine.name, named(kin, tuned), at_limit, reasons)


def wild_frames(
    flight: Flight, first: FlightState, solve: Callable[[Flight], FlightState]
) -> tuple[Flags, str]:
    """Frames (time,) that nothing else agrees with, and a sentence on them.

    A frame is dropped if its innovation is wild and, without such frames, no other one is. Where the
    wildness stays, it is not the frames but the motion: then none is dropped.
    """
    state, dropped = first, np.zeros(len(flight.time), bool)
    size = float(np.nanmax(np.abs(first.innovation)))
    while (wild := np.any(np.abs(state.innovation) > WILD, axis=1)).any():
        # the first of each run: the ones behind it suffer from what it did to the state
        dropped |= wild & ~np.concatenate([[False], wild[:-1]])
        when = flight.time[dropped][0]
        if dropped.sum() > max(2, MOST_WILD * len(dropped)):
            return np.zeros_like(dropped), (
                f"innovations reach {size:.0f} sigma, first past {WILD:.0f} at {when:.4g} s: an impact "
                "faster than the prior follows, or markers that changed places; force and moment are blurred "
                "around such times"
            )
        kept = np.where(dropped, np.nan, 1.0)[:, None]
        center, rotation = flight.center * kept, flight.rotation * kept[..., None]
        state = solve(replace(flight, center=center, rotation=rotation))
    if not dropped.any():
        return dropped, ""
    return dropped, (
        f"frames rejected as outliers: {dropped.sum()}, the first at {flight.time[dropped][0]:.4g} s, up to "
        f"{size:.0f} sigma off; look at the markers there"
    )


def without_frames(motion: Motion, dropped: Flags) -> Motion:
    """The motion with nothing seen in some frames."""
    kept = np.where(dropped, np.nan, 1.0)
    gone = {
        name: value * kept.reshape(-1, *[1] * (value.ndim - 1))
        for name in ("position", "center", "orientation")
        if (value := getattr(motion, name)) is not None
    }
    return replace(motion, **gone)


def errors_shared(kin: Kinematics, force: LoadPrior, gravity: Array, engine: Engine) -> bool:
    """Whether the mass center moves far more smoothly than independent errors of its markers would let it.

    Tracks that were smoothed at the source, or a skin or segment model, have errors that are common to the
    markers and slow: innovations small and correlated. Averaging over the markers then helps nobody.
    """
    still = np.zeros((len(kin.time), 3))
    flight = flight_of(kin, Deformation(still, still, kin.pose.rotation, still), gravity)
    path = smooth_translation(flight, force, engine.smooth)
    return slow_and_small(path.innovation, path.nis)


def slow_and_small(innovation: Array, nis: Array) -> bool:
    """Whether innovations (time, channel) are far smaller than predicted and follow each other."""
    return bool(np.nanmean(nis) < SMALL and colored(innovation)[0] > CORRELATED)


def with_shared_error(kin: Kinematics) -> Kinematics:
    """The same with half the variance of the stated error common to all markers: it does not average out.

    How much of it is shared nobody states; a half is the middle of what is possible.
    """
    cov = kin.pose.cov.copy()
    cov[:, :3, :3] += 0.5 * max(kin.noise.values()) ** 2 * np.eye(3)
    return replace(kin, pose=replace(kin.pose, cov=cov))


def named(kin: Kinematics, priors: dict[str, Tuned]) -> dict[str, float]:
    """What tuning chose, as numbers with names; std in N or N m, rate in 1/s, along the axes it found."""
    found = {f"noise_std_{name}": level for name, level in kin.noise.items()}
    for load, tuned in priors.items():
        found[f"{load}_order"] = tuned.order
        for i in range(3):
            found[f"{load}_std_{i + 1}"] = float(tuned.std[i])
            found[f"{load}_rate_{i + 1}"] = float(tuned.rate[i])
    return found


def flight_of(kin: Kinematics, deformation: Deformation, gravity: Array) -> Flight:
    """The poses and the inertia that the flight smoother works on."""
    cov = np.where(np.isfinite(kin.pose.cov), kin.pose.cov, np.eye(6))
    inertia, h = deformation.inertia, deformation.h
    return Flight(kin.time, kin.pose.center, kin.pose.rotation, cov, kin.inertia.mass, inertia, h, gravity)


def tune_force(kin: Kinematics, gravity: Array, limits: tuple[float, float]) -> LoadPrior:
    """Prior of the force and factor on the marker noise, from the mass center with the fall removed."""
    center, time = kin.pose.center, kin.time - kin.time[0]
    seen = np.isfinite(center).all(1)
    if seen.sum() < 5:
        raise EstimationError(
            f"shows the mass center in {seen.sum()} frames, fewer than the 5 that a force needs",
            "the recording",
            "restore the markers, or give the center of a longer record",
        )
    z = center - 0.5 * time[:, None] ** 2 * gravity
    axes = load_axes(time[seen], z[seen])
    cov = np.where(np.isfinite(kin.pose.cov[:, :3, :3]), kin.pose.cov[:, :3, :3], np.eye(3))
    var = np.einsum("ai,tab,bi->ti", axes, cov, axes)
    gain = 1 / kin.inertia.mass
    tuned = tune_loads(time, z @ axes, gain, var, np.zeros(3), limits)
    return LoadPrior(tuned, axes, start_of(time, (z - z[seen][0]) @ axes, gain))


def tune_moment(kin: Kinematics, deformation: Deformation, limits: tuple[float, float]) -> LoadPrior:
    """Prior of the moment, from the integrated angular momentum of the measured rotations."""
    pose = kin.pose
    ch = angular_channel(kin.time, pose.rotation, pose.cov[:, 3:, 3:], deformation.inertia, deformation.h)
    axes = load_axes(ch.time, ch.Y)
    var = np.einsum("ai,tab,bi->ti", axes, ch.noise_cov, axes)
    drift = np.einsum("ai,ab,bi->i", axes, ch.drift, axes)
    tuned = tune_loads(ch.time, ch.Y @ axes, 1.0, var, drift, limits)
    return LoadPrior(tuned, axes, start_of(ch.time, ch.Y @ axes, 1.0))
