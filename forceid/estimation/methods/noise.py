"""The noise of tracks as they show it, against what was stated of it, and errors that follow each other.

Where those mislead the likelihood of white noise, the noise is what the spectrum of the mass center shows
where the motion ends, and no less than was stated; and errors of that size may be slow and common to all
markers: the claims are widened by them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.deformation_residual import KNOWN, errors_beyond
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.body.tracks.marker_errors import MarkerErrors
from forceid.estimation.body.tracks.noise_axes import noisy
from forceid.estimation.loads.channels import flight_of, tune_channel
from forceid.estimation.loads.plain_cut import plain_cuts, spectrum_of
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.innovations import NIS_BAND, lag_one_correlation
from forceid.flight.channels import FLIGHT_SAMPLES, Channel, middle
from forceid.flight.color import LowPassed
from forceid.flight.model import Flight
from forceid.flight.path.linear import seen_part
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState, smooth_translation
from forceid.kalman.building.lines import Line
from forceid.kalman.engines import Engine
from forceid.kalman.tuning.calibration import slow_noise_cov
from forceid.records import Array, Finding, Level, Motion
from forceid.significance import PATIENCE, TENTH, WHOLE

CORRELATED = 0.5  # innovations, from frame to frame
HEAVY = 5.0  # kurtosis: 3 of normal errors, 4.1 where half of the markers are twice as noisy
SAID = 1.5  # times, or one over it: less is no news to who stated a noise


def errors_shared(kin: Kinematics, force: LoadPrior, gravity: Array, engine: Engine) -> bool:
    """Whether the mass center moves far more smoothly than independent errors of its markers would let it.

    Tracks that were smoothed at the source, or a skin or segment model, have errors that are common to the
    markers and slow: innovations small and correlated. Averaging over the markers then helps nobody.
    """
    still = np.zeros((len(kin.time), 3))
    flight = flight_of(kin, Deformation(still, still, kin.pose.rotation, still), gravity)
    found = engine.filter(*seen_part(flight, force))
    return slow_and_small(found.innovation, found.nis)


def slow_and_small(innovation: Array, nis: Array) -> bool:
    """Whether innovations (time, channel) are far smaller than predicted and follow each other."""
    return bool(np.nanmean(nis) < NIS_BAND[0] and lag_one_correlation(innovation)[0] > CORRELATED)


def noise_beyond_motion(channel: Channel, stated: bool = False) -> float:
    """Factor on a noise that follows itself: to what the spectrum of a channel shows where the motion ends.

    Of a `stated` noise at least one: what smoothed the tracks took errors out beyond the motion, not within.
    Errors of tracks are alike along all axes: the mean of what the axes show, but for those that show none,
    as in a planar video. Source: the plain cut.
    """
    seen = np.isfinite(channel.z).all(1)
    z = straight(channel.time, channel.time[seen], channel.z[seen])
    shown = np.array([cut.noise for cut in plain_cuts(spectrum_of(channel.time, z))])
    some = noisy(shown)
    # the factor is one on the noise of markers, and what bridges add to it is none: frames with the least
    taken = np.diagonal(channel.noise_cov[seen], axis1=1, axis2=2)[:, some].mean(1).min()
    found = float(np.sqrt(max(shown[some].mean(), np.finfo(float).tiny) / taken))
    return max(found, 1.0) if stated else found


def widened_by_slow_errors(
    state: FlightState, flight: Flight, force: LoadPrior, channel: Channel, noise: float, engine: Engine
) -> FlightState:
    """The same state, with a force claimed no better than slow errors and the roughest likely prior allow.

    Errors of the stated size may be slow and common to all markers. Under so much noise orders of the prior
    that are e^PATIENCE as likely as the best claim different errors: the roughest one's is taken, and what
    its force differs by.
    """
    rival = force
    for order in range(1, force.kernel.order):
        other = tune_channel(channel, (1.0, 1.0), force.lines, (order,), engine)
        if other.tuned.log_likelihood > force.tuned.log_likelihood - PATIENCE:
            rival = other
            break
    run = middle(len(flight.time), FLIGHT_SAMPLES)
    center = np.where(np.isfinite(flight.center[run]), flight.center[run], 0.0)
    part = replace(flight, time=flight.time[run], center=center, pose_cov=flight.pose_cov[run])
    model, _ = seen_part(part, rival)
    cov = state.wrench_cov.copy()
    if rival is not force:
        path = smooth_translation(flight, rival, engine)
        off = path.force - state.force
        cov[:, :3, :3] = path.wrench_cov[:, :3, :3] + off[:, :, None] * off[:, None, :]
        cov[:, :3, 3:] = cov[:, 3:, :3] = 0.0
    cov[:, :3, :3] += slow_noise_cov(model, rival.rows, part.time, noise, engine.smooth)
    return replace(state, wrench_cov=cov)


def judge_filter(kin: Kinematics, lines: Iterable[Line] = ()) -> list[Finding]:
    """Tracks that were low-passed: they show loads up to the cut, and a claim is of no faster ones.

    lines: of the loads: degraded where the filter may have taken from one, or it may be another's mirror
    image.
    """
    color = kin.color
    if not isinstance(color, LowPassed):
        return []
    missed = any(line.turns or may_be_another(color, line.frequency) for line in lines)
    return [note("smoothed-at-source", "degraded" if missed else "ok", cut_hz=color.cut)]


def may_be_another(color: LowPassed, frequency: float) -> bool:
    """Whether a filter takes from a load that swings at a frequency Hz, or lets pass what looks the same.

    A load beyond half the rate of the frames that tell anything new shows as its mirror image below.
    """
    mirrored = 1 / (color.every * color.step) - frequency
    own, other = color.power(np.array([frequency, mirrored]))
    return bool(own < WHOLE or other > TENTH**2)


def measured_errors(
    kin: Kinematics, motion: Motion
) -> tuple[MarkerErrors | None, Array | None, tuple[Finding, ...]]:
    """Errors of markers where they show them, with deviations (3,) m along world axes, and what to say of it.

    None where they do not show them, or show what was stated.
    """
    source = "position"
    seen = errors_beyond(kin, motion) if motion.position is not None else None
    if seen is None:
        return None, None, ()
    errors, std = seen
    # the size of heavy errors is known as well as their fourth moment lets it be
    size = errors.relative * float(np.sqrt(max(errors.kurtosis - 1, 0.0) / 2))
    level: Level = "degraded" if size > KNOWN else "ok"
    heavy = (note("noise-heavy", level, kurtosis=errors.kurtosis),) if errors.kurtosis > HEAVY else ()
    # what is smaller than the noise stated is no motion beside it
    smaller = kin.stated[source] and errors.std * SAID < kin.noise[source]
    color = errors.color if std is not None or smaller else None
    if std is None or (kin.stated[source] and errors.as_stated(kin.noise[source])):
        return None, None, heavy
    ratio = errors.std / kin.noise[source]
    if not kin.stated[source] or 1 / SAID < ratio < SAID or isinstance(color, LowPassed):
        return errors, std, heavy
    told = note("noise-measured", variable=source, stated=kin.noise[source], noise=errors.std)
    return errors, std, (told, *heavy)
