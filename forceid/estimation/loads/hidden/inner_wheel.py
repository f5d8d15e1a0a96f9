"""A wheel inside the body that passes for a moment: angular momentum that no marker shows.

Markers show R J omega. With a momentum h inside, in body axes, that changes by -R (omega x h + h') more than
any moment from outside does. The torque h' of what spins a wheel up is a moment like any other; a constant h
leaves a pattern that the motion fixes, and the record is more or less likely with it. A wheel that would take
the moment beyond its claim is said, unless the record excludes it, and degrades the verdict where it is more
likely than none; its moment is no part of the claim, which would say nothing of the rest then. A smaller one
is in the claim. Source: principal equations 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.loads.hidden.order_uncertainty import claimed_along, grown
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding
from forceid.significance import SIGMAS, TENTH

SPACING = 0.5 * np.log(10)  # of sizes of wheels, in logarithm: two a decade
STRONG = 10.0  # odds against it by which a record excludes a wheel (Jeffreys, Theory of Probability, app. B)


@dataclass(frozen=True)
class Wheel:
    """Constant momenta inside of one size, kg m2/s rms along an axis, as a record leaves them.

    odds: that such a one turns inside, over that none does; off (3,) N m: rms of what is then wrong with the
    moment found, along the axes of its prior; h (3,) kg m2/s: what it most likely is, body axes.
    """

    size: float
    odds: float
    off: Array
    h: Array


def signals(time: Array, rotation: Array) -> Array:
    """What a constant momentum inside takes from the channel of a moment (time, 3, body axis)."""
    turned = np.cumsum(0.5 * np.diff(time)[:, None, None] * (rotation[1:] + rotation[:-1]), 0)
    return -np.concatenate([np.zeros((1, 3, 3)), turned])


def allow_for_wheels(look: Whitened, state: FlightState, growth: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Growth ([time,] 6, 6) of claimed errors that allows for wheels as well; a finding on those beyond it.

    By the law of total variance: unlike a load, a wheel has a largest size that the variance may rest on.
    look: at the channel of the moment, beside `signals`.
    """
    edge, axes = len(state.wrench_cov) // 8, look.prior.axes_along(state.rotation)
    inner = slice(edge, len(state.wrench_cov) - edge)
    claimed = np.sqrt(claimed_along(axes, grown(state, growth).wrench_cov[:, 3:, 3:]))
    found = wheels(look, length(state.H) / np.sqrt(3), TENTH * float(np.linalg.norm(claimed)))
    total = 1 + sum(wheel.odds for wheel in found)
    beyond = [wheel for wheel in found if (wheel.off > SIGMAS * claimed).any()]
    within = [wheel for wheel in found if (wheel.off <= SIGMAS * claimed).all()]
    own = np.tile(np.eye(6), (*axes.shape[:-2], 1, 1))
    more = np.sqrt(1 + sum(w.odds / total * (w.off / claimed) ** 2 for w in within))
    own[..., 3:, 3:] = axes * more @ axes.mT
    growth = np.asarray(own @ growth)
    odds = sum(wheel.odds for wheel in beyond)
    if STRONG * odds <= total - odds:
        return growth, ()
    first = max(beyond, key=lambda wheel: wheel.odds)
    wheel = note(
        "inner-wheel" if odds > total - odds else "inner-wheel-possible",
        h_x=first.h[0],
        h_y=first.h[1],
        h_z=first.h[2],
        made=float(np.linalg.norm(first.off)),
        moment=length(state.moment[inner]),
    )
    return growth, (wheel,)


def wheels(look: Whitened, most: float, least: float) -> list[Wheel]:
    """Wheels of all sizes, uniform in the logarithm, from `most` down to where they make moments of `least`.

    Beforehand one wheel is as likely as none: nothing is known of it. A body without momentum holds none.
    """
    if most == 0.0:
        return []
    edge = len(look.loads) // 8
    made = look.loads[edge : len(look.loads) - edge]
    scale = float(np.sqrt(np.einsum("tah,tah->", made, made) / len(made)))
    count = 1 + max(int(np.log(max(most * scale / least, 1.0)) / SPACING), 0)
    A, none, found = look.signals.reshape(-1, 3), look.evidence(), []
    for size in most * np.exp(-SPACING * np.arange(count)):
        h, cov = look.amounts(size)
        gained = look.evidence(h) - none - 0.5 * h @ h / size**2
        gained -= 0.5 * np.linalg.slogdet(np.eye(3) + size**2 * A.T @ A)[1]
        off = np.mean((made @ h) ** 2 + np.einsum("tah,hk,tak->ta", made, cov, made, optimize=True), axis=0)
        found.append(Wheel(float(size), float(np.exp(min(gained, 500.0))) / count, np.sqrt(off), h))
    return found
