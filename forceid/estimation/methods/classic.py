"""Difference, Savitzky-Golay and spline: rigid fit first, then two derivatives, window from the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.deformation import Deformation, inertia_along
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.loads.channels import angular_channel, check_turns, force_channel
from forceid.estimation.methods.noise import SAID, judge_filter, measured_errors, slow_and_small
from forceid.estimation.methods.problem import Solution
from forceid.estimation.methods.window_bias import bias_of
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import FEW, GROWTH
from forceid.flight.channels import Channel
from forceid.flight.color import Colored, LowPassed
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.kalman.model import mean_square
from forceid.motion import (
    Derivatives,
    Window,
    WindowChoice,
    choose_window,
    derivatives,
    fit_rotation,
    noise_growth,
    noise_variance,
    windows,
)
from forceid.principal import axial
from forceid.records import Array, Body, Flags, Motion
from forceid.rounding import SOLVED
from forceid.timing import stage

ADDING = 252 / 924  # variance of the sixth difference of a walk, over that of its steps: C(10, 5) / C(12, 6)


@stage("flight")
def estimate_classic(
    body: Body, motion: Motion, settings: Settings, engine: Engine, kin: Kinematics | None = None
) -> Solution:
    """Wrench and motion by differentiating twice; the method is settings.method, and it needs no engine.

    Force and moment are second derivatives of m c and of the integrated angular momentum (principal
    equations 2.4), each under the window that it calls for. What the window leaves of a measured center, over
    what noise alone would leave, stands for innovations. kin: kinematics of the motion at the level of the
    settings, where they are known already.
    """
    kin = kinematics(body, motion, settings) if kin is None else kin
    errors, std, said = measured_errors(kin, motion)
    if std is not None and errors is not None:
        told = kin.stated
        kin = replace(kinematics(body, motion, settings, {"position": np.diag(std)}), color=errors.color)
        kin = replace(kin, stated=dict.fromkeys(told, True))
    kin = with_errors_in_common(kin, motion.gravity)
    time, candidates = kin.time, windows(settings.method, motion.time)  # type: ignore[arg-type]
    force = choose_force(kin, motion.gravity, candidates)
    path = derivatives(time, kin.pose.center, force.window)
    resolved = force.resolved
    tuned = {"force_window_s": force.window.seconds} | {f"noise_std_{k}": v for k, v in kin.noise.items()}
    var = np.diagonal(kin.pose.cov[:, :3, :3], axis1=1, axis2=2)
    left = (kin.pose.center - path.value) / np.sqrt(var * np.maximum(1 - path.gain[:, :, 0, 0], SOLVED))
    nis = mean_square(left)
    shared = errors is None and kin.stated[next(iter(kin.noise))] and slow_and_small(left, nis)
    if motion.position is not None:  # markers show by themselves what their noise is
        left, nis = np.zeros((len(time), 0)), np.full(len(time), np.nan)
    none = np.full((len(time), 3), np.nan)
    moment, H, omega, rotation = none, none, none, kin.pose.rotation
    cov = np.full((len(time), 6, 6), np.nan)
    seen: Flags = np.asarray(np.isfinite(kin.pose.center).all(1))
    cov[:, :3, :3] = with_bias(time, seen, force, force_cov(kin, path), kin.color)
    amplitude, rate = np.nan_to_num(kin.amplitude), np.zeros_like(kin.amplitude)
    if kin.attitude:
        channel = measured_angular_channel(kin)
        chosen = choose_moment(channel, candidates, kin.color)
        tuned["moment_window_s"] = chosen.window.seconds
        at = np.searchsorted(time, channel.time)
        turn = derivatives(channel.time, channel.z, chosen.window)
        resolved &= chosen.resolved
        moment, H = none.copy(), none.copy()
        moment[at], H[at] = turn.second, turn.first
        H += 0.0 if kin.known is None else kin.known.momentum
        shown: Flags = np.asarray(np.isfinite(channel.z).all(1))
        noise = moment_cov(channel, turn, kin.color)
        cov[at, 3:, 3:] = with_bias(channel.time, shown, chosen, noise, kin.color)
        cov[:, :3, 3:] = cov[:, 3:, :3] = 0.0
        omega, rotation = spin(kin, chosen.window)
        if amplitude.size:
            smooth = derivatives(time, kin.amplitude, chosen.window)
            amplitude, rate = np.nan_to_num(smooth.value), np.nan_to_num(smooth.first)
    state = FlightState(
        path.value, path.first, rotation, H, omega, force.target, moment, cov, kin.pose.cov,
        left, nis, np.nan,
    )  # fmt: skip
    deformation = Deformation(amplitude, rate, *inertia_along(kin, amplitude, rate))
    said = (*said, *judge_filter(kin))  # what was taken is in the claim
    found = (*said, note("slow-errors")) if shared else said
    if not resolved:
        found = (*found, note("load-within-window"))
    given = int(np.isfinite(state.force).all(1).sum())
    if seen.sum() < FEW < len(seen) or 2 * given < len(seen):
        found = (*found, note("gaps-in-windows", lost=(~seen).sum(), frames=len(seen), given=given))
    return Solution(kin, deformation, state, "scipy", tuned, dict.fromkeys(kin.noise, False), found)


def with_errors_in_common(kin: Kinematics, gravity: Array) -> Kinematics:
    """Kinematics with poses as noisy as their channels show, where that is more than their markers show.

    As of late frames, which move all markers alike. Not where a record does not resolve the motion.
    """
    times = np.ones(6)
    times[:3] = louder(force_channel(kin, gravity))
    if kin.attitude:
        times[3:] = louder(measured_angular_channel(kin))
    return replace(kin, pose=replace(kin.pose, cov=kin.pose.cov * np.outer(times, times)))


def louder(channel: Channel) -> float:
    """How many times as large as predicted the white errors of a channel are; one where it is no news."""
    seen = np.isfinite(channel.z).all(1)
    if seen.sum() < FEW or not noise_growth(channel.time, channel.z) < GROWTH:
        return 1.0
    white = float(np.trace(channel.noise_cov[seen], axis1=1, axis2=2).mean()) / 3
    adding = float(np.trace(channel.drift)) / 3 * float(np.median(np.diff(channel.time)))
    axes = np.linalg.svd(np.diff(channel.z[seen], 6, axis=0), full_matrices=False)[2]
    # axis by axis: late frames err along the motion alone
    shown = np.mean([noise_variance(channel.time, channel.z @ a[:, None]) for a in axes])
    times = float(np.sqrt(shown / (white + ADDING * adding)))
    return times if times > SAID else 1.0


def with_bias(time: Array, seen: Flags, choice: WindowChoice, noise: Array, color: Colored | None) -> Array:
    """Covariance (time, 3, 3) of a load: of its noise, and of what its window takes, along axes as that."""
    filtered = color if isinstance(color, LowPassed) else None
    bias = bias_of(time, seen, choice, np.trace(noise, axis1=1, axis2=2), filtered)
    mean = np.nanmean(noise, axis=0)
    return np.asarray(noise + bias[:, None, None] * mean / np.trace(mean))


def choose_force(kin: Kinematics, gravity: Array, candidates: list[Window]) -> WindowChoice:
    """Force on the mass center under the window that the force calls for."""

    def estimate(window: Window) -> tuple[Array, Array]:
        d = derivatives(kin.time, kin.pose.center, window)
        var = np.diagonal(force_cov(kin, d), axis1=1, axis2=2)
        return kin.inertia.mass * (d.second - gravity), var

    return choose_window(candidates, estimate)


def measured_angular_channel(kin: Kinematics) -> Channel:
    """Integrated angular momentum of the body with the deformation as it was measured."""
    check_turns(kin)
    amplitude = np.nan_to_num(kin.amplitude)
    inertia, h = inertia_along(kin, amplitude, np.gradient(amplitude, kin.time, axis=0))
    known = None if kin.known is None else kin.known.turned
    return angular_channel(kin.time, kin.pose.rotation, kin.pose.cov[:, 3:, 3:], inertia, h, known)


def choose_moment(channel: Channel, candidates: list[Window], color: Colored | None = None) -> WindowChoice:
    """Moment about the mass center under the window that the moment calls for."""

    def estimate(window: Window) -> tuple[Array, Array]:
        d = derivatives(channel.time, channel.z, window)
        return d.second, np.diagonal(moment_cov(channel, d, color), axis1=1, axis2=2)

    return choose_window(candidates, estimate)


def force_cov(kin: Kinematics, d: Derivatives) -> Array:
    """Covariance (time, 3, 3) that the noise of the poses gives the force."""
    cov = kin.pose.cov[:, :3, :3]
    cov = np.where(np.isfinite(cov), cov, np.nanmean(cov, axis=0))  # of a frame that is bridged
    gain = d.gain[:, :1, 2, 2]
    gain = gain if kin.color is None else gain * kin.color.passed(gain)
    return np.asarray(kin.inertia.mass**2 * cov * gain[:, :, None])


def moment_cov(channel: Channel, d: Derivatives, color: Colored | None) -> Array:
    """Covariance (sample, 3, 3) that the noise of the poses gives the moment."""
    rate_cov = channel.drift / np.median(np.diff(channel.time))  # what adds up in Y is white in its rate
    gain = d.gain[:, 0, :, :, None, None]
    second = gain[:, 2, 2]
    if color is not None:
        second, rate_cov = second * color.passed(second), color.slow * rate_cov
    return channel.noise_cov * second + rate_cov * gain[:, 1, 1]


def spin(kin: Kinematics, window: Window) -> tuple[Array, Array]:
    """Angular velocity (time, 3) and smoothed rotation (time, 3, 3), from the axes of the body."""
    T = len(kin.time)
    frame = derivatives(kin.time, kin.pose.rotation.reshape(T, -1), window)
    R, dR = frame.value.reshape(T, 3, 3), frame.first.reshape(T, 3, 3)
    omega = -0.5 * axial(dR @ R.swapaxes(1, 2))  # dR R^T = [omega]x
    seen = np.isfinite(R).all((1, 2))
    rotation = np.full_like(R, np.nan)
    rotation[seen] = fit_rotation(R[seen].swapaxes(1, 2), np.eye(3), np.ones(3))[1]
    return omega, rotation
