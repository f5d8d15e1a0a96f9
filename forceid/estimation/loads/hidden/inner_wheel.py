"""A wheel inside the body that passes for a moment: angular momentum that no marker shows.

Markers show R J omega. With a momentum h inside, in body axes, that changes by -R (omega x h + h') more than
any moment from outside does. The torque h' of what spins a wheel up is a moment like any other; a constant h
leaves a pattern that the motion fixes, and the record is more or less likely with it. So does a force that
acts at a point which stands still, in the body or beside it: the foot of a top turns it as a wheel would that
takes its momentum away. So does a moment that keeps to the body, of fins or a thrust, where the spin is
steady, and an inertia told wrong. Beforehand a wheel is as likely as none, and any share of the momentum that
it holds as likely as any other; where there is none, each of these is as likely as none of them.

Wheels are in the claim, weighed by their odds. One that takes the moment beyond its claim is said, unless the
record excludes every such one, and they are in the claim as if one of them were there. The verdict is
degraded where a record shows it, by odds that one in a hundred without a wheel may reach at most. What flies
without weight touches nothing: there no force at a point is a rival.
Source: principal equations 2.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from forceid.estimation.loads.hidden.order_uncertainty import claimed_along, grown
from forceid.estimation.loads.hidden.patterns import Held, Smaller, patterns_held
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding
from forceid.significance import CHANCE, SIGMAS, TENTH

SPACING = 0.5 * np.log(10)  # of sizes of wheels, in logarithm: two a decade
# columns of `signals`, behind which are those of an inertia told wrong
WHEEL, TURNING, LEVERS, TOLD = slice(3), slice(3, 6), (slice(6, 9), slice(9, 12)), slice(12, 17)
STRONG = 10.0  # odds by which a record excludes a wheel (Jeffreys, Theory of Probability, B)


@dataclass(frozen=True)
class Wheel:
    """Constant momenta inside of one size, kg m2/s rms along an axis, as a record leaves them.

    likely: how many times as likely as none they make it; odds: that such a one turns inside, over that none
    does; off (3,) N m: rms of what is then wrong with the moment found, along the axes of its prior; h (3,)
    kg m2/s: what it most likely is, body axes.
    """

    size: float
    likely: float
    odds: float
    off: Array
    h: Array


def signals(time: Array, rotation: Array, force: Array) -> Array:
    """What the channel of a moment (time, 3, 12) sees of a momentum inside, and of its rivals.

    Of each unit: a momentum along the axes of the body; a moment along these; a lever of the force along
    these, and along those of the world. force (time, 3) N, world axes.
    """
    levers = np.concatenate([rotation, np.tile(np.eye(3), (len(time), 1, 1))], 2)
    moment = np.concatenate([rotation, np.cross(levers, force[:, :, None], axis=1)], 2)
    pushed = cumulative_trapezoid(moment, time, axis=0, initial=0)
    moved = -cumulative_trapezoid(rotation, time, axis=0, initial=0)
    return np.concatenate([moved, cumulative_trapezoid(pushed, time, axis=0, initial=0)], 2)


def allow_for_wheels(
    look: Whitened,
    under: Smaller,
    state: FlightState,
    growth: Array,
    lever: float,
    told: float = 0.0,
) -> tuple[Array, tuple[Finding, ...]]:
    """Growth ([time,] 6, 6) of claimed errors that allows for wheels as well; a finding on those beyond it.

    By the law of total variance: unlike a load, a wheel has a largest size that the variance may rest on.
    look: at the channel of the moment, beside `signals` and, where told is not zero, what an inertia told
    wrong makes, which is that far off; under: smaller loads; lever m: of a force, the radius of gyration, 0
    for none.
    """
    edge, axes = len(state.wrench_cov) // 8, look.prior.axes_along(state.rotation)
    inner = slice(edge, len(state.wrench_cov) - edge)
    claimed = np.sqrt(claimed_along(axes, grown(state, growth).wrench_cov[:, 3:, 3:]))
    size = length(state.moment)
    rivals = [(TURNING, size), *((columns, lever) for columns in LEVERS), (TOLD, told)]
    rivals = [(columns, std) for columns, std in rivals if std]
    sizes = sizes_of_wheels(look, length(state.H) / np.sqrt(3), TENTH * float(np.linalg.norm(claimed)))
    held = patterns_held(look, under, [*rivals, *((WHEEL, one) for one in sizes)])
    without = float(np.mean([1.0, *(np.exp(one.gained) for one in held[: len(rivals)])]))
    found = wheels(look, sizes, held[len(rivals) :])
    total = without + sum(wheel.odds for wheel in found)
    beyond = [wheel for wheel in found if (wheel.off > SIGMAS * claimed).any()]
    odds = sum(wheel.odds for wheel in beyond)
    excluded = STRONG * max((w.likely for w in beyond), default=0.0) <= without
    weights = [(w, w.odds / (total if excluded else odds)) for w in beyond]
    weights += [(w, w.odds / total) for w in found if w not in beyond]
    own = np.tile(np.eye(6), (*axes.shape[:-2], 1, 1))
    more = np.sqrt(1 + sum(weight * (w.off / claimed) ** 2 for w, weight in weights))
    own[..., 3:, 3:] = axes * more @ axes.mT
    growth = np.asarray(own @ growth)
    if excluded:
        return growth, ()
    first = max(beyond, key=lambda wheel: wheel.odds)
    said = note(
        "inner-wheel",
        "degraded" if CHANCE * odds > total - odds else "ok",
        h_x=first.h[0],
        h_y=first.h[1],
        h_z=first.h[2],
        made=float(np.linalg.norm(first.off)),
        moment=length(state.moment[inner]),
    )
    return growth, (said,)


def sizes_of_wheels(look: Whitened, most: float, least: float) -> list[float]:
    """Sizes uniform in the logarithm, from `most` down to where wheels make moments of `least`.

    A body without momentum holds none.
    """
    if most == 0.0:
        return []
    made = judged_loads(look)
    scale = float(np.sqrt(np.einsum("tah,tah->", made, made) / len(made)))
    count = 1 + max(int(np.log(max(most * scale / least, 1.0)) / SPACING), 0)
    return [float(size) for size in most * np.exp(-SPACING * np.arange(count))]


def wheels(look: Whitened, sizes: Sequence[float], held: Sequence[Held]) -> list[Wheel]:
    """Wheels of sizes, of which a record holds so much; beforehand one is as likely as none, of any share of
    the momentum: a size has the odds of the shares about it.
    """
    made, found = judged_loads(look), []
    for size, one in zip(sizes, held, strict=True):
        square = (made @ one.amounts) ** 2
        off = np.mean(square + np.einsum("tah,hk,tak->ta", made, one.cov, made, optimize=True), axis=0)
        likely = float(np.exp(one.gained))
        found.append(Wheel(size, likely, likely * size / sum(sizes), np.sqrt(off), one.amounts))
    return found


def judged_loads(look: Whitened) -> Array:
    """What the prior of the moment takes unit wheels for (time, 3, 3), over the central three quarters."""
    edge = len(look.loads) // 8
    return look.loads[edge : len(look.loads) - edge, :, WHEEL]
