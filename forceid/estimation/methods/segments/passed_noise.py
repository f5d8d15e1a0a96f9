"""What errors of a known color make of a load that a smoother follows as if they were white.

How far a load can be followed, its own channel tells: up to where motion ends and noise begins. How much of
the errors is in it below that, the channel cannot tell, and what measures them elsewhere can. The smoother is
linear, so they pass through it by its answer to a single sample; what it leaves out of a load stays claimed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.methods.segments.misplaced_mass import passed
from forceid.flight.channels import Channel, middle
from forceid.flight.color import Color
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.records import Array

ANSWER = 512  # samples of a record that an answer is looked at in


@dataclass(frozen=True)
class Passing:
    """Variance of a load along its axes (axis,), over that of the channel: of errors white, and colored."""

    axes: Array
    white: Array
    colored: Array

    def along(self, factor: Array) -> Array:
        """The root (3, 3), world axes, of factors (axis,) on variances along the axes."""
        return np.asarray(self.axes * np.sqrt(factor) @ self.axes.T)


def passing(channel: Channel, prior: LoadPrior, color: Color, engine: Engine) -> Passing:
    """How errors pass the smoother of a channel in the middle of its record."""
    run = middle(len(channel.time), ANSWER)
    part = Channel(channel.time[run], np.zeros((run.stop - run.start, 3)), channel.gain,
                   channel.noise_cov[run], channel.drift)  # fmt: skip
    n = len(part.time)
    one = np.zeros((n, 3, 3))
    one[n // 2] = prior.axes.T / channel.gain
    answer = np.einsum("tka,ak->tk", passed(part, prior, one, engine), prior.axes)
    w: Array = np.asarray(2 * np.pi * np.fft.rfftfreq(4 * n, color.step))
    power = np.abs(np.fft.rfft(answer, 4 * n, axis=0)) ** 2
    white = (answer**2).sum(0)
    share = (power * color.density(w)[:, None]).sum(0) / power.sum(0)
    return Passing(prior.axes, white, white * share)


def claimed(passes: Passing, cov: Array, white: Array, errors: Array) -> Array:
    """Covariance (time, 3, 3) of a load: what its smoother claims beyond white errors, and errors.

    cov: as claimed; white, errors (time, 3, 3): covariances of the channel as assumed, and as measured.
    """
    own = np.einsum("ai,tab,bi->ti", passes.axes, white, passes.axes) * passes.white
    all_of_it = np.einsum("ai,tab,bi->ti", passes.axes, cov, passes.axes)
    left = passes.along(np.clip(1 - own.mean(0) / all_of_it.mean(0), 0.0, 1.0))
    through = passes.along(passes.colored)
    return np.asarray(left @ cov @ left.T + through @ errors @ through.T)


def with_passed_noise(
    state: FlightState,
    channels: dict[str, Channel],
    priors: dict[str, LoadPrior],
    color: Color,
    errors: dict[str, Array],
    engine: Engine,
) -> FlightState:
    """The state of channels smoothed under white noise, its wrench claimed under errors of a color.

    errors (time, 3, 3): covariances of the channels, by load.
    """
    cov = state.wrench_cov.copy()
    for own, (load, channel) in zip((slice(0, 3), slice(3, 6)), channels.items(), strict=True):
        passes = passing(channel, priors[load], color, engine)
        cov[:, own, own] = claimed(passes, cov[:, own, own], channel.noise_cov, errors[load])
    return replace(state, wrench_cov=cov)
