"""A mass center or an inertia told a little wrong, which passes for a load that turns with the body.

A center told d beside its place, body axes, is seen at c + R d, and m (R d)'' passes for force. An inertia
told dJ too large makes R dJ omega of angular momentum, and the rate of that passes for moment. Where the body
deforms by a map F, both do with it. These are patterns that the motion fixes, and the record is more or less
likely with them: beforehand as likely as none, of the size that usual measurements leave. The prior of the
load has grown to what such a pattern passed for, so that smaller loads are tried beside it. Of a mass no
motion tells. Who is seen to have told one of the three wrong is believed in none; who states how well the
body is known (body_std) is believed.
Source: principal equations 2.4, 2.6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from forceid.estimation.body.inertia import Inertia, second_moment
from forceid.estimation.body.kinematics import Kinematics, mapped, shape_at
from forceid.estimation.loads.hidden.inner_wheel import STRONG
from forceid.estimation.loads.hidden.order_uncertainty import claimed_along, grown
from forceid.estimation.loads.hidden.patterns import patterns_held
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.verdict.body_errors import SYMMETRIC
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding
from forceid.significance import SIGMAS, TENTH

BALANCED = 0.01  # of the length of a body: as near its mass center is found by balancing it on an edge
OWN = {"force": slice(0, 3), "moment": slice(3, 6)}
SAID = {"force": ("center-told", "N", 1e3), "moment": ("inertia-told", "N m", 100.0)}  # in mm, in percent
SWUNG = 0.02  # of moments of inertia, and the mass in them: as well they are known by swings on wires


def balanced(inertia: Inertia) -> float:
    """How far off, m, the mass center of a body may well be told: of the length of a rod of its gyration."""
    return BALANCED * float(np.sqrt(12 * 0.5 * np.trace(inertia.tensor) / inertia.mass))


def deforming_map(kin: Kinematics, amplitude: Array) -> Array:
    """What a body carries along with its axes (time, 3, 3): its map from the mean shape where that is affine.

    amplitude (time, mode): of its shapes. Of others the identity.
    """
    if kin.model != "affine":
        return np.tile(np.eye(3), (len(kin.time), 1, 1))
    return mapped(kin.shape, shape_at(kin, amplitude))


def by_inertia(time: Array, F: Array, rate: Array, inertia: Array) -> Array:
    """What the channel of a moment (time, 3, 6) sees of entries of J told too large, over its diagonal.

    F, rate (time, 3, 3): of what the body carries, world axes, and its rate; inertia (3, 3) kg m2, body axes.
    The angular momentum of a second moment E is the axial part of F E F'^T.
    """
    scale, H = np.sqrt(np.diagonal(inertia)), []
    for i, j in SYMMETRIC:
        wrong = np.zeros((3, 3))
        wrong[i, j] = wrong[j, i] = scale[i] * scale[j]
        each = F @ second_moment(wrong) @ rate.mT
        H.append(np.stack([each[:, a, b] - each[:, b, a] for a, b in ((1, 2), (2, 0), (0, 1))], 1))
    return np.asarray(cumulative_trapezoid(np.stack(H, -1), time, axis=0, initial=0))


@dataclass(frozen=True)
class Wrong:
    """A mass center, or an inertia, that may be told wrong, and the load that it makes.

    gained: log-likelihood that the record gains by it; amounts (column,) of what is wrong; off (3,): rms of
    what is then wrong with the load, along `axes` ([time,] 3, 3) of its prior, and claimed (3,) without it.
    """

    load: str
    gained: float
    amounts: Array
    off: Array
    claimed: Array
    axes: Array


def wrongs(told: Mapping[str, tuple[Whitened, float]], state: FlightState, growth: Array) -> Iterator[Wrong]:
    """What may be told wrong and would matter, of each load.

    told: by load, its channel beside what a wrong body makes, and the size of that before the record is seen.
    """
    for load, (look, std) in told.items():
        own, edge = OWN[load], len(look.loads) // 8
        axes, made = look.prior.axes_along(state.rotation), look.loads[edge : len(look.loads) - edge]
        claimed = np.sqrt(claimed_along(axes, grown(state, growth).wrench_cov[:, own, own]))
        if not SIGMAS * std * np.sqrt(np.mean((made**2).sum(2), axis=0) / claimed**2).max() > TENTH:
            continue
        (held,) = patterns_held(look, [(slice(None), std)], found_of(state, load))
        square = (made @ held.amounts) ** 2 + np.einsum("tah,hk,tak->ta", made, held.cov, made, optimize=True)
        yield Wrong(load, held.gained, held.amounts, np.sqrt(np.mean(square, axis=0)), claimed, axes)


def allow_for_told(
    told: Mapping[str, tuple[Whitened, float]], state: FlightState, growth: Array
) -> tuple[Array, float, tuple[Finding, ...]]:
    """Growth ([time,] 6, 6) of claimed errors that allows for a body told wrong; findings where that matters.

    And the part of itself by which the mass may be told wrong. told: as of `wrongs`. Who is seen to have
    measured the one badly did the others, as far as that is open.
    """
    each, said = list(wrongs(told, state, growth)), []
    best = max((one.gained for one in each), default=0.0)
    badly = best > np.log(STRONG)
    for one in each:
        odds = np.exp(best if badly else one.gained)
        ratio = odds / (1 + odds) * (one.off / one.claimed) ** 2
        further = np.tile(np.eye(6), (*one.axes.shape[:-2], 1, 1))
        further[..., OWN[one.load], OWN[one.load]] = one.axes * np.sqrt(1 + ratio) @ one.axes.mT
        growth = np.asarray(further @ growth)
        if ratio.max() > SIGMAS**2:
            code, unit, scale = SAID[one.load]
            amount, made = scale * float(np.linalg.norm(one.amounts)), float(np.linalg.norm(one.off))
            said.append(note(code, amount=amount, made=made, found=found_of(state, one.load), unit=unit))
    return growth, SWUNG if badly else 0.0, tuple(said)


def found_of(state: FlightState, load: str) -> float:
    """The rms length of a load that was found."""
    return length(state.force if load == "force" else state.moment)
