"""A wheel inside the body that passes for a moment: angular momentum that no marker shows.

Markers show R J omega. With a momentum h inside, in body axes, that changes by -R (omega x h + h') more than
any moment from outside does. The torque h' of what spins a wheel up is a moment like any other; a constant h,
or one that grows evenly, leaves a pattern that the motion fixes. Where it explains most of the moment found,
and the record is likelier by far with it, it is said; as well where the record tells neither from the other.
A wheel that is not said, and not excluded, is in the claim. Source: principal equations 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.loads.whitened import Whitened, whitened
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.channels import Channel
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.kalman.lines import PATIENCE
from forceid.records import Array, Flags, deviation

SPACING = 0.5 * np.log(10)  # of sizes of wheels, in logarithm: two a decade
LEAST = 0.1  # times the claim, of the moment of a wheel: a smaller one widens it by half a percent
SHOWN = 3.0  # times its claim, that a moment is larger than which shows
MOST, ALL = 0.5, 0.97  # part of the square of the moment that is most of it, and all but noise
WHEEL = (
    "{share:.0%} of the moment found is what an angular momentum inside the body would make, ({h}) kg m2/s "
    "in body axes: {whether}; state it as internal_momentum, or [0, 0, 0] where nothing turns inside"
)
LIKELY = "a wheel, a rotor or a liquid turns in it, or else a load turns with it"
OPEN = "the record does not tell a moment from a wheel, a rotor or a liquid that turns in it"


@dataclass(frozen=True)
class Wheel:
    """Constant momenta inside of one size, kg m2/s rms along an axis, as a record leaves them.

    odds: that such a one turns inside, over that none does; off (3,) N m: rms of what is then wrong with the
    moment found, along the axes of its prior.
    """

    size: float
    odds: float
    off: Array


def signals(time: Array, rotation: Array) -> Array:
    """What momenta inside take from the channel of a moment (time, 3, column): constant, and growing."""
    path = paths(time, rotation)
    turned = np.cumsum(0.5 * np.diff(time)[:, None, None] * (path[1:] + path[:-1]), 0)
    return -np.concatenate([np.zeros((1, *path.shape[1:])), turned])


def paths(time: Array, rotation: Array) -> Array:
    """Momenta in world axes (time, 3, column) of unit ones in body axes: constant, and growing from zero."""
    t = (time - time[0]) / np.ptp(time)
    return np.concatenate([rotation, rotation * t[:, None, None]], 2)


def allowing(look: Whitened, state: FlightState, growth: Array) -> Array:
    """Growth (6, 6) of claimed errors that allows as well for wheels that the record does not exclude.

    By the law of total variance: unlike a load, a wheel has a largest size that the variance may rest on.
    look: at the channel of the moment, beside `signals`.
    """
    edge, axes = len(state.wrench_cov) // 8, look.prior.axes
    inner = state.wrench_cov[edge : len(state.wrench_cov) - edge]
    cov = np.nanmean(growth @ inner @ growth.T, axis=0)[3:, 3:]
    claimed = np.sqrt(np.einsum("ai,ab,bi->i", axes, cov, axes))
    found = wheels(look, largest(state), LEAST * float(np.linalg.norm(claimed)))
    odds, off = np.array([wheel.odds for wheel in found]), np.array([wheel.off for wheel in found])
    own = np.eye(6)
    own[3:, 3:] = axes * np.sqrt(1 + odds @ (off / claimed) ** 2 / (1 + odds.sum())) @ axes.T
    return np.asarray(own @ growth)


def largest(state: FlightState) -> float:
    """Size of the largest wheel, kg m2/s along an axis: its momentum is that of the body."""
    return float(length(state.H) / np.sqrt(3))


def wheels(look: Whitened, most: float, least: float) -> list[Wheel]:
    """Wheels of all sizes, uniform in the logarithm, from `most` down to where they make moments of `least`.

    Beforehand one wheel is as likely as none: nothing is known of it.
    """
    made = look.loads[:, :, :3]
    edge = len(made) // 8
    made = made[edge : len(made) - edge]
    scale = float(np.sqrt(np.einsum("tah,tah->", made, made) / len(made)))
    count = 1 + max(int(np.log(max(most * scale / least, 1.0)) / SPACING), 0)
    A, none, found = look.signals[:, :, :3].reshape(-1, 3), look.evidence(), []
    for size in most * np.exp(-SPACING * np.arange(count)):
        h, cov = look.amounts(3, size)
        gained = look.evidence(h) - none - 0.5 * h @ h / size**2
        gained -= 0.5 * np.linalg.slogdet(np.eye(3) + size**2 * A.T @ A)[1]
        off = np.mean((made @ h) ** 2 + np.einsum("tah,hk,tak->ta", made, cov, made, optimize=True), axis=0)
        found.append(Wheel(float(size), float(np.exp(min(gained, 500.0))) / count, np.sqrt(off)))
    return found


def inner_wheel(channel: Channel, look: Whitened, state: FlightState, seen: Flags, engine: Engine) -> str:
    """A sentence on a momentum inside the body, where the record tells of one, or not from a moment.

    channel: that the moment drives, at the samples seen (time,) of the state; look: at it, beside `signals`.
    """
    time, rotation, moment = channel.time, state.rotation[seen], state.moment[seen]
    claim = length(deviation(state.wrench_cov)[seen, 3:])
    if length(moment) < SHOWN * claim and not look.prior.lines:
        return ""
    made, free = -np.gradient(paths(time, rotation), time, axis=0), look
    if look.prior.lines:
        free = whitened(channel, replace(look.prior, lines=()), engine, signals(time, rotation))
    told, most, before = "", 0.0, look.evidence()
    for columns, part in ((3, MOST), (6, ALL)):
        h, share = explained(moment / claim, made[:, :, :columns] / claim, largest(state))
        gained = free.evidence(free.amounts(columns, largest(state))[0]) - before
        if gained > most and share > part:
            inside = ", ".join(f"{v:.2g}" for v in h.reshape(-1, 3).sum(0))
            told = WHEEL.format(share=share, h=inside, whether=LIKELY if gained > PATIENCE else OPEN)
        most = max(gained, 0.0) + PATIENCE
    return told


def with_momentum(deformation: Deformation, h: Array | None) -> Deformation:
    """The same with a momentum of something that turns inside at a constant rate, body axes."""
    return deformation if h is None else replace(deformation, h=deformation.h + h)


def explained(moment: Array, made: Array, size: float) -> tuple[Array, float]:
    """Amounts (column,) of made (time, 3, column) that are most of a moment (time, 3), and their part of it.

    size: of the amounts, at most, about; moment and made: over the error of the moment.
    """
    edge = len(moment) // 16
    y, A = moment[edge : len(moment) - edge].ravel(), made[edge : len(made) - edge].reshape(-1, made.shape[2])
    h = np.asarray(np.linalg.solve(A.T @ A + np.eye(len(A.T)) / size**2, A.T @ y), float)
    return h, 1 - float(np.sum((y - A @ h) ** 2) / max(np.sum(y**2), 1e-300))
