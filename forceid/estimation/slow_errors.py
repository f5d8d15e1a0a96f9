"""Tracks whose errors follow each other: where the likelihood of white noise misleads, and what is done then.

A stated noise is a floor, half of it taken as common to all markers; one that was not stated, and that the
record does not show, is chosen by blocks left out. Either way the claims are widened.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.deformation import Deformation
from forceid.estimation.innovations import colored
from forceid.estimation.kinematics import Kinematics
from forceid.estimation.load_channels import flight_of, tune_channel
from forceid.kalman.channels import Channel
from forceid.kalman.cross_validation import left_out_error
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState, smooth_translation
from forceid.kalman.flight_model import Flight, seen_part
from forceid.kalman.lines import PATIENCE, Line
from forceid.kalman.prior import LoadPrior, channel_model, load_rows
from forceid.kalman.slow_noise import LONGEST, slow_noise_cov
from forceid.records import Array

SMALL, CORRELATED = 0.6, 0.5  # innovations: mean square, and correlation from frame to frame
SHARED = (
    "the tracks are smoother than independent errors of the stated size allow: half of their variance is "
    "taken as common to all markers, and slow errors pass for force; the claimed errors are too small where "
    "markers slide or were smoothed"
)
HIDDEN = (
    "the noise of {0} was not stated, and the record does not show it: it was smoothed before, or its errors "
    "are not white; {1:.1e} was chosen, with which stretches of {2} frames left out are predicted best, and "
    "the claimed errors allow for slow errors of that size; state noise_std.{0}"
)
COARSER, FINER = 4.0 ** np.arange(8), 4.0 ** np.array([-0.5, 0.5])  # factors on a noise that does not show
MIDDLE, SHORTEST = 2, 4  # order of the prior that noises are compared under; frames a block


def errors_shared(kin: Kinematics, force: LoadPrior, gravity: Array, engine: Engine) -> bool:
    """Whether the mass center moves far more smoothly than independent errors of its markers would let it.

    Tracks that were smoothed at the source, or a skin or segment model, have errors that are common to the
    markers and slow: innovations small and correlated. Averaging over the markers then helps nobody.
    """
    still = np.zeros((len(kin.time), 3))
    flight = flight_of(kin, Deformation(still, still, kin.pose.rotation, still), gravity)
    path = smooth_translation(flight, force, engine)
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
    frames = kin.frames
    if frames is not None:
        frames = replace(frames, cov=frames.cov + cov - kin.pose.cov)
    return replace(kin, pose=replace(kin.pose, cov=cov), frames=frames)


def noise_by_prediction(channel: Channel, lines: tuple[Line, ...], engine: Engine) -> tuple[float, int]:
    """Factor on a noise that the record does not show, by blocked cross-validation, and frames a block.

    Each noise with the prior tuned for it. Blocks a few times as long as the slowest load is remembered.
    """
    step = float(np.median(np.diff(channel.time)))
    first = tune_channel(channel, (1.0, 1.0), lines, (MIDDLE,), engine).tuned
    length = int(np.clip(4 * MIDDLE / first.rate.min() / step, SHORTEST, len(channel.time) // 10))

    def error(factor: float) -> float:
        noisier = replace(channel, noise_cov=factor**2 * channel.noise_cov)
        model = channel_model(noisier, tune_channel(noisier, (1.0, 1.0), lines, (MIDDLE,), engine))
        return left_out_error(model, channel.moved, max(length, 1), engine.smooth)

    tried = {float(f): error(float(f)) for f in COARSER}
    best = min(tried, key=lambda f: tried[f])
    tried |= {float(best * f): error(float(best * f)) for f in FINER}
    return min(tried, key=lambda f: tried[f]), length


def widened(
    state: FlightState, flight: Flight, force: LoadPrior, channel: Channel, noise: float, engine: Engine
) -> FlightState:
    """The same state, with a force claimed no better than slow errors and the roughest likely prior allow.

    Errors of the stated size may be slow and common to all markers. Under so much noise orders of the prior
    that are e^PATIENCE as likely as the best claim different errors: the roughest one's is taken, and what
    its force differs by.
    """
    rival = force
    for order in range(1, force.tuned.order):
        other = tune_channel(channel, (1.0, 1.0), force.lines, (order,), engine)
        if other.tuned.log_likelihood > force.tuned.log_likelihood - PATIENCE:
            rival = other
            break
    first = max(0, (len(flight.time) - LONGEST) // 2)
    run = slice(first, first + LONGEST)
    center = np.where(np.isfinite(flight.center[run]), flight.center[run], 0.0)
    part = replace(flight, time=flight.time[run], center=center, pose_cov=flight.pose_cov[run])
    model, _ = seen_part(part, rival)
    rows = load_rows(len(model.x0), rival.axes, rival.lines)
    cov = state.wrench_cov.copy()
    if rival is not force:
        path = smooth_translation(flight, rival, engine)
        off = path.force - state.force
        cov[:, :3, :3] = path.wrench_cov[:, :3, :3] + off[:, :, None] * off[:, None, :]
        cov[:, :3, 3:] = cov[:, 3:, :3] = 0.0
    cov[:, :3, :3] += slow_noise_cov(model, rows, part.time, noise, engine.smooth)
    return replace(state, wrench_cov=cov)
