"""A wheel inside the body that passes for a moment: angular momentum that no marker shows.

Markers show R J omega. With a momentum h inside, in body axes, that changes by -R (omega x h + h') more than
any moment from outside does. A constant h, or one that grows evenly, leaves a pattern that the motion fixes;
where it explains most of the moment found, and the record is likelier by far with it, it is said. What such a
pattern cannot be told from is said with it: a load that turns with the body, or a wrong inertia, and, along
one fixed axis of a body that keeps its spin, any slow moment. Source: principal equations 2.4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.deformation import Deformation
from forceid.estimation.likely_priors import likeliest
from forceid.estimation.sensitivity import length
from forceid.kalman.channels import Channel
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState
from forceid.kalman.lines import PATIENCE
from forceid.kalman.prior import LoadPrior
from forceid.records import Array, Flags, deviation

SHOWN = 3.0  # times its claim, that a moment is larger than which shows
MOST, ALL = 0.5, 0.97  # part of the square of the moment that is most of it, and all but noise
WHEEL = (
    "{share:.0%} of the moment found is what an angular momentum inside the body would make, ({h}) kg m2/s "
    "in body axes: a wheel, a rotor or a liquid turns in it, or else a load turns with it; state it as "
    "internal_momentum, or [0, 0, 0] where nothing turns inside"
)


def inner_wheel(channel: Channel, prior: LoadPrior, state: FlightState, seen: Flags, engine: Engine) -> str:
    """A sentence on a momentum inside the body, where the record tells of one; else nothing.

    channel: that the moment drives, with its prior, at the samples seen (time,) of the state.
    """
    rotation, moment = state.rotation[seen], state.moment[seen]
    std = deviation(state.wrench_cov)[seen, 3:]
    if length(moment) < SHOWN * length(std) and not prior.lines:
        return ""
    t = (channel.time - channel.time[0]) / np.ptp(channel.time)
    before, told, most = likeliest(channel, prior, engine), "", PATIENCE
    for grows in (False, True):
        path = rotation if not grows else np.concatenate([rotation, rotation * t[:, None, None]], 2)
        h, share = explained(moment, -np.gradient(path, channel.time, axis=0))
        step = np.diff(channel.time)[:, None, None]
        turned = np.cumsum(0.5 * step * (path[1:] + path[:-1]), 0)
        inside = -np.concatenate([np.zeros((1, *path.shape[1:])), turned])
        gained = likeliest(channel, replace(prior, lines=()), engine, inside) - before
        if gained > most and share > (ALL if grows else MOST):
            told = WHEEL.format(share=share, h=", ".join(f"{v:.2g}" for v in (h[:3] + h[3:] if grows else h)))
        most = max(gained, 0.0) + PATIENCE
    return told


def with_momentum(deformation: Deformation, h: Array | None) -> Deformation:
    """The same with a momentum of something that turns inside at a constant rate, body axes."""
    return deformation if h is None else replace(deformation, h=deformation.h + h)


def explained(moment: Array, made: Array) -> tuple[Array, float]:
    """The amounts (column,) of made (time, 3, column) that are most of a moment (time, 3), and their part."""
    edge = len(moment) // 16
    y, A = moment[edge : len(moment) - edge].ravel(), made[edge : len(made) - edge].reshape(-1, made.shape[2])
    h = np.asarray(np.linalg.lstsq(A, y, rcond=None)[0], float)
    return h, 1 - float(np.sum((y - A @ h) ** 2) / max(np.sum(y**2), 1e-300))
