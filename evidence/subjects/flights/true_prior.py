"""The bound of a case: the smoother that is told the prior of the true load, and the noise.

A Matern prior is fitted to the true load itself, by likelihood along its own axes, and the posterior
deviation of the flight smoother under it is the bound. Averaged over loads drawn from that prior no estimator
does better; on one smooth record one may, and where a load holds a line the Matern prior is a rough likeness.
Source: principal equations 4e, 4f.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evidence.subject import Answer, Contestant
from evidence.subjects.flights.cases import LOADS, Case
from evidence.subjects.flights.methods import halves
from forceid import kalman
from forceid.config import load_settings
from forceid.errors import ForceIdError
from forceid.estimation.body.deformation import undeformed
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.instruments.on_flight import with_sensors
from forceid.estimation.loads.channels import flight_of, force_channel, moment_channel
from forceid.flight.channels import Channel, start_of
from forceid.flight.model import Flight
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import FlightState, smooth_flight, smooth_translation
from forceid.flight.tuning import ORDERS
from forceid.kalman.engines import engine
from forceid.records import Array

GOOD_TO = 1e-3  # of a load: how well a prior has to follow the truth itself
QUIET = 1e-9  # of the largest axis, or N and N m: a load that is not there
ENOUGH = 200  # samples of a load show its prior
PATIENCE = 2.0  # log-likelihood by which a rougher order must be likelier
AS_TOLD = "told the prior"


@dataclass(frozen=True)
class TruePriorProblem:
    """A flight as the smoother meets it, and the priors that the true loads call for."""

    flight: Flight
    priors: dict[str, LoadPrior]
    channels: dict[str, Channel]

    def smoothed(self) -> FlightState:
        """The flight under those priors."""
        if "moment" not in self.priors:
            return smooth_translation(self.flight, self.priors["force"], engine())
        return smooth_flight(self.flight, self.priors["force"], self.priors["moment"], engine())


def problem_of(case: Case) -> TruePriorProblem:
    """The case as a flight with stated noise, under priors fitted to its truth."""
    recording, settings = case.blind, load_settings()
    kin = kinematics(recording.body, recording.motion, settings)
    kin, deformation = undeformed(kin, engine())
    flight = flight_of(kin, deformation, recording.motion.gravity)
    flight = with_sensors(flight, kin, recording.body, recording.motion, settings)
    channels = {"force": force_channel(kin, recording.motion.gravity)}
    if kin.attitude:
        channels["moment"] = moment_channel(kin, deformation)
    priors = {load: true_prior_of(case, load, channel) for load, channel in channels.items()}
    return TruePriorProblem(flight, priors, channels)


def true_prior_of(case: Case, load: str, channel: Channel) -> LoadPrior:
    """The prior of a load that is known, with the start that its channel calls for."""
    truth = case.wrench[:, LOADS[load]]
    known = np.isfinite(truth).all(1)
    tuned, axes = fitted_prior(case.blind.motion.time[known], truth[known])
    return LoadPrior(tuned, axes, start_of(channel.time, channel.moved @ axes, channel.gain))


def fitted_prior(time: Array, load: Array, orders: Sequence[int] = ORDERS) -> tuple[Tuned, Array]:
    """Matern prior of a load (time, 3) about its mean, by likelihood along its own axes, and those axes.

    One order for all three; of the orders, the smoothest within PATIENCE of the likeliest.

    >>> t = np.arange(200) / 100
    >>> tuned, _ = fitted_prior(t, np.outer(np.sin(6 * t), [0.0, 0.0, 2.0]))
    >>> bool(tuned.kernel.std.max() > 0.5), bool(tuned.kernel.std.min() < 1e-6)
    (True, True)
    """
    thin = max(len(time) // ENOUGH, 1)
    time, load = time[::thin], load[::thin]
    varying = load - load.mean(0)
    axes = np.linalg.eigh(varying.T @ varying)[1]
    axes = axes * np.sign(np.linalg.det(axes))
    along = varying @ axes
    size = np.sqrt(np.mean(along**2, axis=0))
    moving = size > QUIET * max(float(size.max()), 1.0)
    step, span = float(np.median(np.diff(time))), float(np.ptp(time))
    best: tuple[float, int, Array] | None = None
    for order in sorted(orders, reverse=True) if moving.any() else orders[:1]:
        theta = np.zeros((3, 2))
        theta[:, 1] = np.log(1 / span)
        value = 0.0
        for axis in np.flatnonzero(moving):
            theta[axis], found = likeliest_matern(order, along[:, axis] / size[axis], step, span)
            value += found
        if best is not None and value <= best[0] + PATIENCE:
            break
        best = value, order, theta
    assert best is not None
    std = np.where(moving, size * np.exp(best[2][:, 0]), QUIET)
    kernel = Matern(best[1], std, np.exp(best[2][:, 1]))
    return Tuned(kernel, log_likelihood=best[0]), np.asarray(axes)


def likeliest_matern(order: int, z: Array, step: float, span: float) -> tuple[Array, float]:
    """Log std and log rate (2,) of the likeliest Matern process for a load z (time,); how likely."""

    def build(theta: Array) -> kalman.StateSpace:
        load = kalman.matern(order, np.exp(theta[0]), np.exp(theta[1]))
        F, Q = kalman.discretize(load, step)
        R = np.array([[GOOD_TO**2]])
        return kalman.StateSpace(F, Q, load.output[None], R, np.zeros(order), load.P0)

    rates = float(np.log(1 / span)), float(np.log(0.5 / step))
    starts = [np.array([0.0, r]) for r in np.linspace(rates[0], rates[1], 4)[1:-1]]
    try:
        fit = kalman.tune(build, starts[0], z, bounds=[(-3.0, 5.0), rates], starts=starts[1:])
    except ForceIdError:
        return starts[0], -np.inf
    return np.asarray(fit.theta), float(fit.log_likelihood)


def bound_of(case: Case, state: FlightState) -> Array:
    """Rms posterior deviation of force and moment, per axis, over the judged part (2,); NaN where unknown."""
    var = np.diagonal(state.wrench_cov, axis1=1, axis2=2)[case.judged]
    known = np.isfinite(case.wrench[case.judged])
    found = []
    for part in LOADS.values():
        seen = known[:, part] & np.isfinite(var[:, part])
        found.append(float(np.sqrt(var[:, part][seen].mean())) if seen.any() else np.nan)
    return np.array(found)


def told_the_prior() -> Contestant:
    """The smoother under the prior of the true load; its preparation is the fit of that prior."""

    def prepare(case: Case) -> Callable[[], Answer]:
        problem = problem_of(case)

        def job() -> Answer:
            state = problem.smoothed()
            std = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
            order = ", ".join(f"{load} order {prior.kernel.order}" for load, prior in problem.priors.items())
            return Answer((state.force, state.moment), halves(std), chosen=order)

        return job

    about = "smoother under the prior of the true load, from poses on"
    return Contestant(AS_TOLD, prepare, about=about, key=f"Matern {ORDERS} {GOOD_TO} {PATIENCE}", told=True)
