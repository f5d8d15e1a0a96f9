"""A mass center or an inertia told a little wrong, which passes for a load that turns with the body.

A center told d beside its place, body axes, is seen at c + R d, and m (R d)'' passes for force. An inertia
told dJ too large makes R dJ omega of angular momentum, and the rate of that passes for moment. Where the body
deforms by a map F, both do with it. These are patterns that the motion fixes, and the record is more or less
likely with them: beforehand as likely as none, of the size that is stated (body_std), or that usual
measurements leave. The prior of the load has grown to what such a pattern passed for, so that smaller loads
are tried beside it. So are their rivals, a force that keeps to the body, of a spring or a dashpot at a point
of it, of a blow beside the center, of air, or of a shaker that turns the body as well, those of a wheel, and
an inertia of another size: what they explain as well tells of nothing wrong. Of a mass no motion tells, nor
of the size of an inertia. Who is seen to have told one of the three wrong is believed in none: the mass is as
likely wrong as the likelier of the other two, where either would matter; by itself a mass is weighed. A mass
center or an inertia that a record shows beside its rivals, at odds that chance reaches once in a hundred, is
taken there: if every part of the record shows it, which a blow does not, and the same, which air does not.
Source: principal equations 2.4, 2.6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from forceid.config import BodyStdSetting
from forceid.estimation.body.inertia import Inertia
from forceid.estimation.loads.hidden.inner_wheel import LEVERS, STRONG, TOLD, TURNING, WHEEL
from forceid.estimation.loads.hidden.order_uncertainty import claimed_along, grown
from forceid.estimation.loads.hidden.patterns import MOST_GAINED, Smaller, likeliest_amounts, patterns_held
from forceid.estimation.loads.hidden.signatures import balanced
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding
from forceid.significance import CHANCE, SIGMAS, TENTH

OWN = {"force": slice(0, 3), "moment": slice(3, 6)}
SAID = {"force": ("center-told", "N", 1e3), "moment": ("inertia-told", "N m", 100.0)}  # in mm, in percent
SWUNG = 0.02  # of moments of inertia, and the mass in them: as well they are known by swings on wires
CENTER, SPRING, DASHPOT = slice(3), slice(3, 6), slice(6, 9)  # columns of `by_center`
WITH_MOMENT, WITH_AIR = [*range(9, 18)], [*range(18, 27)]  # columns of `by_center`
SHAKEN, SWINGING = 27, 18  # columns of `swung_at` from there on: of `by_center`, and behind `by_inertia`
OF_SIZE, NONE = slice(17, 18), slice(0)  # columns that no motion tells: the last of `by_inertia`, or none


@dataclass(frozen=True)
class Suspect:
    """What of a body may be told wrong, beside its rivals, in the channel of the load that it makes.

    look: the channel beside all of these, under: smaller loads; columns: of what may be wrong by std each,
    beforehand, `size`: of what no motion tells; rivals: columns, and std of their amounts; stated: whether
    how well it is known was.
    """

    look: Whitened
    under: Smaller
    columns: slice
    size: slice
    std: float
    rivals: tuple[tuple[slice | list[int], float], ...]
    stated: bool

    @property
    def made(self) -> Array:
        """The loads (time, 3, column) that units of all columns make, away from the edges of the record."""
        edge = len(self.look.loads) // 8
        return self.look.loads[edge : len(self.look.loads) - edge]

    def held(self, about: Array) -> Array:
        """The amounts that are likeliest where it is wrong, and by about so much."""
        return likeliest_amounts(self.look, self.columns, self.std, about)


@dataclass(frozen=True)
class Wrong:
    """A mass center, or an inertia, that may be told wrong, and the load that it makes.

    gained: log-likelihood that the record gains by it, beside its rivals; steady: whether every part of it
    shows that, and the same; amounts (column,) of what is wrong; off (3,): rms of what is then wrong with the
    load, along `axes` ([time,] 3, 3) of its prior, and claimed (3,) without it.
    """

    load: str
    gained: float
    steady: bool
    amounts: Array
    off: Array
    claimed: Array
    axes: Array


class Allowance(NamedTuple):
    """Growth ([time,] 6, 6) of claimed errors that allows for a body told wrong, and what is said of it.

    wrong_mass: part of the mass by which it may be wrong (rms); center_off (3,) m, body axes, inertia_off
    (column,) of TOLD: by what each is told wrong, where the record shows it.
    """

    growth: Array
    wrong_mass: float = 0.0
    said: tuple[Finding, ...] = ()
    center_off: Array | None = None
    inertia_off: Array | None = None


def told_in(
    load: str,
    look: Whitened,
    under: Smaller,
    state: FlightState,
    inertia: Inertia,
    doubt: BodyStdSetting,
    lever: float,
    inside: bool,
    shown: bool,
) -> Suspect:
    """What of a body may be told wrong in the channel of a load: look, beside `by_center`, or beside
    `inner_wheel.signals` and `by_inertia` behind them, under smaller loads.

    doubt: as stated; lever m: of a force that turns the body, 0 for none; inside: whether a wheel may be;
    shown: whether it is where the motion showed it, and of what was stated the size of an inertia is left.
    """
    size = found_of(state, load)
    if load == "force":
        each: list[slice | list[int]] = [SPRING, DASHPOT, WITH_MOMENT, WITH_AIR]
        each += shaken(look.also.shape[2])
        rivals, said = [(one, size) for one in each], doubt.mass_center
        columns, unseen, std = CENTER, NONE, said or balanced(inertia)
    else:
        wheel = length(state.H) / np.sqrt(3) if inside else 0.0
        rivals = [(TURNING, size), *((columns, lever) for columns in LEVERS), (WHEEL, wheel)]
        rivals += [(own, size) for own in at_frequencies(SWINGING, look.also.shape[2])]
        rivals, said = [*rivals, (OF_SIZE, doubt.inertia or SWUNG)], doubt.inertia
        columns, unseen, std = TOLD, NONE if said else OF_SIZE, said or SWUNG
    known = bool(said) and not shown
    return Suspect(look, under, columns, unseen, std, tuple(one for one in rivals if one[1]), known)


def shaken(columns: int) -> list[slice | list[int]]:
    """Of so many columns of `by_center`, those of a shaker: all, of one frequency, along one axis alone."""
    each = at_frequencies(SHAKEN, columns)
    alone = [[at + axis, at + axis + 3] for at in range(SHAKEN, columns, 6) for axis in range(3)]
    return [*each, *alone]


def at_frequencies(first: int, columns: int) -> list[slice]:
    """Of so many columns, `swung_at` from a first one on: those of all frequencies, and those of each."""
    of_one = [slice(at, at + 6) for at in range(first, columns, 6)]
    return [*([slice(first, columns)] if len(of_one) > 1 else []), *of_one]


def wrongs(told: Mapping[str, Suspect], state: FlightState, growth: Array) -> Iterator[Wrong]:
    """What may be told wrong and would matter, of each load; growth: of claims, without it."""
    for load, one in told.items():
        axes, own = one.look.prior.axes_along(state.rotation), OWN[load]
        made, unseen = one.made[..., one.columns], one.made[..., one.size]
        claimed = np.sqrt(claimed_along(axes, grown(state, growth).wrench_cov[:, own, own]))
        if not SIGMAS * one.std * np.sqrt(np.mean((made**2).sum(2), axis=0) / claimed**2).max() > TENTH:
            continue
        gained, steady, amounts, cov = beside_rivals(one)
        square = (made @ amounts) ** 2 + np.einsum("tah,hk,tak->ta", made, cov, made, optimize=True)
        off = np.sqrt(np.mean(square + one.std**2 * (unseen**2).sum(2), axis=0))
        yield Wrong(load, gained, steady, amounts, off, claimed, axes)


def beside_rivals(told: Suspect) -> tuple[float, bool, Array, Array]:
    """Log-likelihood that a record gains by what is told wrong, whether that is steady (it gains by that
    alone, in all quarters, but no more by amounts of their own), its amounts (column,), and their covariance.

    With it and without it each rival is as likely there as none.
    """
    every = np.arange(told.look.also.shape[2])
    of = [(told.columns, told.std), *told.rivals]
    wrong, *rivals = [(every[own], np.full(len(every[own]), std)) for own, std in of]
    both = [(np.append(wrong[0], own), np.append(wrong[1], std)) for own, std in rivals]
    held = patterns_held(told.look, told.under, [wrong, *both, *rivals])
    with_it, without = held[: len(both) + 1], [0.0, *(one.gained for one in held[len(both) + 1 :])]
    each, own = np.array([one.gained for one in with_it]), slice(len(wrong[0]))
    total = np.logaddexp.reduce(each)
    weight, amounts = np.exp(each - total), np.array([one.amounts[own] for one in with_it])
    mean = weight @ amounts
    spread = np.einsum("r,ri,rj->ij", weight, amounts - mean, amounts - mean)
    cov = np.einsum("r,rij->ij", weight, [one.cov[own, own] for one in with_it]) + spread
    alone, least = held[0], max(-np.log(CHANCE), min(max(held[0].apart), MOST_GAINED))
    steady = alone.throughout and alone.gained >= least
    return float(total - np.logaddexp.reduce(without)), steady, mean, cov


def allow_for_told(
    told: Mapping[str, Suspect], state: FlightState, growth: Array, taken: Set[str] = frozenset()
) -> Allowance:
    """What claims must allow for a body told wrong; findings where that matters.

    taken: loads of what was seen to be told wrong, and is where the motion showed it. Who is seen to have
    measured one badly did the others, as far as that is open; who said how well he knows it has claimed that
    already.
    """
    each, said = list(wrongs(told, state, growth)), list[Finding]()
    best = max((one.gained for one in each), default=-np.inf) if not taken else np.inf
    badly = best > np.log(STRONG)
    for one in (one for one in each if not told[one.load].stated):
        ratio = (one.off / one.claimed) ** 2 * expit(best if badly else one.gained)
        further = np.tile(np.eye(6), (*one.axes.shape[:-2], 1, 1))
        further[..., OWN[one.load], OWN[one.load]] = one.axes * np.sqrt(1 + ratio) @ one.axes.mT
        growth = np.asarray(further @ growth)
        if ratio.max() > SIGMAS**2:
            code, unit, scale = SAID[one.load]
            amount, made = scale * float(np.linalg.norm(one.amounts)), float(np.linalg.norm(one.off))
            said.append(note(code, amount=amount, made=made, found=found_of(state, one.load), unit=unit))
    off = {one.load: put_right(told[one.load], one, one.load in taken) for one in each}
    mass = SWUNG * float(np.sqrt(expit(best))) if told else 0.0
    return Allowance(growth, mass, tuple(said), off.get("force"), off.get("moment"))


def put_right(told: Suspect, wrong: Wrong, taken: bool) -> Array | None:
    """By how much (column,) of each it is told wrong where the record shows that; None where it does not.

    What was taken where the record showed it moves on too for as long as that makes more than is claimed.
    """
    seen = wrong.steady and wrong.gained > -np.log(CHANCE)
    if not (seen or taken):
        return None
    off = told.held(wrong.amounts)
    made = np.sqrt(np.mean((told.made[..., told.columns] @ off) ** 2, axis=0))
    return off if seen or (made > wrong.claimed).any() else None


def found_of(state: FlightState, load: str) -> float:
    """The rms length of a load that was found."""
    return length(state.force if load == "force" else state.moment)
