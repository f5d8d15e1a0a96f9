"""Loads that turn with the body: their priors along axes of the body, tuned on a flight already solved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import Bounds, minimize

from forceid.estimation.loads.ascent import NO_GAIN
from forceid.flight.channels import Channel
from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine, for_tuning
from forceid.records import Array

SPAN = np.log([1e-3, 1e3, 1e-2, 1e2])  # factors on the first guess of every std, and of the rate


def body_fixed_prior(
    channel: Channel, prior: LoadPrior, rotation: Array, load: Array, engine: Engine
) -> LoadPrior:
    """The prior of a load along axes of the body, by maximum likelihood of what it drives.

    prior: of the same load along world axes; rotation (time, 3, 3) of the body and the load (time, 3) found
    under that prior, world axes, both at the channel's times. The axes are those along which the load varies
    independently in the body; its lines stay as they are.
    """
    in_body = np.einsum("tba,tb->ta", rotation, load)
    about = in_body - in_body.mean(0)
    size, axes = np.linalg.eigh(about.T @ about / len(about))
    axes = axes * np.sign(np.linalg.det(axes))
    rough = np.sqrt(np.mean(np.gradient(about, channel.time, axis=0) ** 2) / max(np.mean(about**2), 1e-300))
    rate = np.clip(rough, 1 / np.ptp(channel.time), 0.5 / np.median(np.diff(channel.time)))
    std = np.sqrt(np.maximum(size, 1e-6 * max(size[-1], 1e-300)))
    first = np.log([*std, rate])
    z, likelihood = channel.moved, for_tuning(engine).log_likelihood

    def at(x: Array) -> LoadPrior:
        # a load that turns with the body leaves little to tell kernels apart
        kernel = prior.kernel.unknown(np.exp(x[:3]), float(np.exp(x[3])))
        return replace(prior.with_kernel(kernel), axes=np.eye(3), body_axes=axes)

    def misfit(x: Array) -> float:
        return -float(likelihood(channel_model(channel, at(x), rotation), z))

    low, high = (first + SPAN[[k, k, k, k + 2]] for k in (0, 1))
    found = minimize(
        misfit, first, method="Nelder-Mead", bounds=Bounds(low, high),
        options={"fatol": NO_GAIN, "xatol": 0.02, "initial_simplex": first + np.eye(5, 4, k=-1)},
    )  # fmt: skip
    best = at(found.x)
    return replace(best, tuned=replace(best.tuned, log_likelihood=-float(found.fun)))


def body_fixed_priors(
    priors: dict[str, LoadPrior],
    channels: dict[str, Channel],
    flight: Flight,
    state: FlightState,
    engine: Engine,
) -> tuple[dict[str, LoadPrior], dict[str, float]]:
    """Priors of force and moment along axes of the body, and how much more likely they make the record.

    As numbers with names, logarithms: below zero, world axes explain it better.
    """
    found, gained = {}, {}
    for (name, prior), load in zip(priors.items(), (state.force, state.moment), strict=True):
        channel = channels[name]
        seen = (
            np.isfinite(flight.rotation).all((1, 2))
            if len(channel.time) < len(load)
            else np.full(len(load), True)
        )
        R = state.rotation[seen]
        found[name] = body_fixed_prior(channel, prior, R, load[seen], engine)
        gained[f"{name}_body_axes_evidence"] = channel_likelihood(
            channel, found[name], R, engine
        ) - channel_likelihood(channel, prior, R, engine)
    return found, gained


def channel_likelihood(channel: Channel, prior: LoadPrior, rotation: Array, engine: Engine) -> float:
    """Log-likelihood of a channel under a prior, whichever axes that holds along."""
    model = channel_model(channel, prior, rotation)
    return float(for_tuning(engine).log_likelihood(model, channel.moved))
