"""The plain route as a witness beside an estimate: where both differ by more than their errors, it is said.

What a channel has beside the load integrated twice is by how much they differ, before any low-pass: both
are compared in bands from zero up, so the bias of a cut-off is none of it. Of two estimates of one record,
where one makes the best of it, the difference has the variance of the worse less that of the better (Hausman,
Econometrica 46 (1978) 1251): the larger of the two is a bound, whichever is better.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import fdtri

from forceid.estimation.body.cleaning import without_frames
from forceid.estimation.loads.plain_cut import (
    STRETCH,
    Cut,
    MotionSpectrum,
    apiece,
    plain_cuts,
    second_difference_spectrum,
    spectrum_of,
    tapered,
)
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import FEW
from forceid.estimation.witness.plain_route import PlainChannel, plain_route
from forceid.flight.color import Colored, LowPassed
from forceid.flight.smoother import FlightState
from forceid.motion import SmoothingSpline
from forceid.records import Array, Body, Finding, Flags, Indices, Motion, Witness, deviation
from forceid.significance import DENIED
from forceid.timing import stage

LOWEST = 3  # bin up to which the lowest band goes: the taper spreads a constant so far
CENTRAL = 0.75  # part of the record compared: ends say little
BIASED = 2.0  # variance over that of the noise: at the best cut the squared bias is 5/12 to 5/3 of it
ADDED = 1.5  # times the variance that white noise leaves of a second derivative: a walk's, corner at the cut
COMPARED = ("band", "apart", "difference", "limit")
UNITS = {"force": "N", "moment": "N m"}


@stage("witness")
def witness_of(
    body: Body,
    motion: Motion,
    state: FlightState,
    color: Colored | None = None,
    deforms: bool = False,
    of_center: Colored | None = None,
) -> Witness | None:
    """The plain route of a motion beside a state; None where it shows neither mass center nor turn.

    color: of the errors of markers, None for white ones; deforms: whether the body is known to, which markers
    may hardly show; of_center: the color of the errors of the mass center, where it is another one.
    """
    time, shown = motion.time, motion
    if isinstance(color, LowPassed):
        shown, color = without_frames(shown, np.arange(len(time)) % color.every != 0), None
    route = plain_route(body, shown, deforms)
    std = deviation(state.wrench_cov)
    if route.force is None and route.moment is None:
        return None
    found: dict[str, Array] = {}
    given = np.full((len(time), 6), np.nan) if state.given is None else state.given
    for name, channel, load, claim, momentum, own in (
        ("force", route.force, state.force, std[:, :3], given[:, :3], of_center or color),
        ("moment", route.moment, state.moment, std[:, 3:], given[:, 3:], color),
    ):
        values = deviations = np.full((len(time), 3), np.nan)
        numbers = {key: np.full(3, np.nan) for key in ("cutoff", *COMPARED)}
        if channel is not None:
            spectrum, cuts = spectrum_and_cuts(channel)
            values, deviations = low_passed(time, channel, cuts, own)
            numbers = {"cutoff": np.array([cut.frequency for cut in cuts])}
            path = integrated(time, momentum) if np.isfinite(momentum).all() else None
            numbers |= apart_in_bands(channel, spectrum, cuts, time, load, claim, own, path)
        found |= {name: values, f"{name}_std": deviations}
        found |= {f"{key}_{name}": value for key, value in numbers.items()}
    return Witness(**found)


def spectrum_and_cuts(channel: PlainChannel) -> tuple[MotionSpectrum, list[Cut]]:
    """The spectrum of a channel over the shape of its noise, and its cut on every axis."""
    spectrum = spectrum_of(channel.time, channel.z, channel.corner)
    return spectrum, plain_cuts(spectrum)


def louder(color: Colored | None, cut: Cut, frequency: Array) -> Array:
    """Errors at frequencies (bin,) Hz over those in the octave above a cut, which show them; one if white."""
    if color is None:
        return np.ones(len(frequency))
    above = color.density(2 * np.pi * np.array([2 * cut.frequency]))
    return np.asarray(np.maximum(color.density(2 * np.pi * frequency) / above, 1.0))


def low_passed(
    time: Array, channel: PlainChannel, cuts: list[Cut], color: Colored | None = None
) -> tuple[Array, Array]:
    """The load that a channel shows below its cuts, and its standard deviation, (time, 3) each."""
    at, values, std = channel.frame, np.full((len(time), 3), np.nan), np.full((len(time), 3), np.nan)
    for cutoff in {cut.frequency for cut in cuts}:
        spline = SmoothingSpline(channel.time, cutoff)
        axes = np.flatnonzero([cut.frequency == cutoff for cut in cuts])
        loud = [float(louder(color, cuts[a], np.array([cutoff]))[0]) for a in axes]
        noise = (
            np.array([cuts[a].noise for a in axes])
            * np.array(loud)
            * (1 + ADDED * (channel.corner[axes] / cutoff) ** 2)
        )
        left = spline.second(channel.residual)[central(channel.time)] if channel.lever else np.zeros(1)
        values[np.ix_(at, axes)] = spline.second(channel.z[:, axes])
        var = BIASED * np.outer(spline.gain(), noise) + off_by_fit(channel, np.full(1, np.mean(left**2)))
        std[np.ix_(at, axes)] = np.sqrt(var)
    return values, std


def apart_in_bands(
    channel: PlainChannel,
    found: MotionSpectrum,
    cuts: list[Cut],
    time: Array,
    load: Array,
    claim: Array,
    color: Colored | None = None,
    path: Array | None = None,
) -> dict[str, Array]:
    """How far a load is apart from a channel, by axis, in the band from zero in which it is farthest.

    path (time, 3): the load integrated twice, where its samples do not tell it. Half an octave from band to
    band, each with the noise of the channel in it.
    """
    numbers = {name: np.full(3, np.nan) for name in COMPARED}
    seen = np.isfinite(load) & np.isfinite(claim)
    beside = channel.z - (integrated(time, load, 2) if path is None else path)[channel.frame]
    missing, shown = np.cumsum(~seen, 0)[channel.frame], seen[channel.frame] & channel.whole[:, None]
    for column, known, lost in zip(beside.T, shown.T, missing.T + channel.lost, strict=True):
        if known.sum() < FEW:
            column[:] = 0.0
            continue
        column[known] = apiece(channel.time[known], column[known], lost[known])
        column[~known] = np.interp(channel.time[~known], channel.time[known], column[known])
    f, apart, dof, step = second_difference_spectrum(channel.time, beside)
    count = max(int(2 * np.log2(STRETCH / step / f[LOWEST])) + 1, 1)
    ends = np.searchsorted(f, STRETCH / step * 2 ** (-0.5 * np.arange(count)))
    weight = np.interp(time, channel.time[1:-1], tapered(len(channel.time) - 2)) ** 2
    whole = np.concatenate([[1.0], np.full(len(f) - 1, 2.0)]) / (len(channel.time) - 2)  # to mean squares
    inexact = (2 * np.pi * f * step) ** 4 / 144  # of sums in place of integrals, in variance
    fits = (
        second_difference_spectrum(channel.time, channel.residual)[1].mean(1)
        if channel.lever
        else np.zeros(len(f))
    )
    for a, cut in enumerate(cuts):
        if not beside[:, a].any():
            continue
        known = seen[:, a]
        claimed = float(weight[known] @ claim[known, a] ** 2 / weight[known].sum())
        noise = cut.noise * louder(color, cut, found.frequency) * found.moved[:, a]
        noise = np.concatenate([[0.0], noise])
        carried = np.concatenate([[0.0], found.power[:, a] * found.moved[:, a]]) * inexact
        own, carried, bent, size = (
            np.cumsum(whole * v)[ends - 1] for v in (noise, carried, fits, apart[:, a])
        )
        joint = np.maximum(own + off_by_fit(channel, bent), claimed) + carried + np.finfo(float).tiny
        limit = allowed(found.moved[:, a], ends - 1, dof, cut.dof)
        k = int(np.argmax(size / joint / limit))
        if size[k] > 0:
            worst = f[ends[k] - 1], np.sqrt(size[k]), np.sqrt(size[k] / joint[k]), np.sqrt(limit[k])
            for name, value in zip(numbers, worst, strict=True):
                numbers[name][a] = value
    return numbers


def off_by_fit(channel: PlainChannel, bent: Array) -> Array:
    """Variance of the load that what a fit leaves of a marker gives it, of mean square `bent` when bent."""
    return channel.lever**2 / channel.free * bent if channel.free > 0 else 0.0 * bent


def allowed(moved: Array, ends: Indices, dof: float, known_by: float) -> Array:
    """Variances over variance (band,) that chance passes by DENIED, of six components in all bands together.

    moved (bin,): weights of the bins that a mean square sums, each of `dof`, in bands of the first `ends`
    (band,); known_by: those of its level.
    """
    total, squares = np.cumsum(moved), np.cumsum(moved**2)
    samples = np.maximum(dof * total[ends - 1] ** 2 / squares[ends - 1], 1.0)
    return np.asarray(fdtri(samples, known_by, 1 - DENIED / (6 * len(ends))))


def integrated(time: Array, load: Array, times: int = 1) -> Array:
    """A load or momentum (time, 3) integrated so many times, straight across what is not known of it."""
    filled = np.zeros_like(load)
    for column, out in zip(load.T, filled.T, strict=True):
        seen = np.isfinite(column)
        if seen.any():
            out[:] = np.interp(time, time[seen], column[seen])
    return np.asarray(CubicSpline(time, filled).antiderivative(times)(time))


def central(time: Array) -> Flags:
    """Samples (time,) of the central part of the record."""
    middle, span = (time[0] + time[-1]) / 2, time[-1] - time[0]
    return np.asarray(np.abs(time - middle) <= CENTRAL * span / 2)


def judge_witness(witness: Witness | None, state: FlightState) -> list[Finding]:
    """Force and moment, where witness and estimate differ by more than both allow."""
    if witness is None:
        return []
    said = []
    for (name, unit), load in zip(UNITS.items(), (state.force, state.moment), strict=True):
        off = np.flatnonzero(differs(witness, name))
        if not len(off):
            continue
        band, apart, errors = (getattr(witness, f"{key}_{name}") for key in COMPARED[:3])
        a = off[np.argmax(errors[off])]
        own, plain = (central_rms(v[:, a]) for v in (load, getattr(witness, name)))
        others = "".join(f", and so along {'xyz'[k]}" for k in off if k != a)
        said.append(
            note(
                "off-plain-route", load=name, axis="xyz"[a], own=own, unit=unit, plain=plain,
                band_hz=band[a], apart=apart[a], errors=errors[a], others=others,
            )
        )  # fmt: skip
    return said


def central_rms(values: Array) -> float:
    """Root mean square of values (time,) in the central part of a record, of what is known."""
    cut = int(len(values) * (1 - CENTRAL) / 2)
    kept = values[cut : len(values) - cut]
    return float(np.sqrt(np.nanmean(kept**2))) if np.isfinite(kept).any() else float("nan")


def differs(witness: Witness, name: str) -> Flags:
    """Axes (3,) along which the `force` or the `moment` differs by more than chance allows."""
    return np.asarray(getattr(witness, f"difference_{name}") > getattr(witness, f"limit_{name}"))


def yielding(state: FlightState, witness: Witness | None) -> FlightState:
    """The state with a covariance that is wider, where the two differ, by what they are apart."""
    if witness is None:
        return state
    apart = np.concatenate([witness.apart_force, witness.apart_moment])
    off = np.concatenate([differs(witness, name) for name in UNITS])
    return replace(state, wrench_cov=state.wrench_cov + np.diag(np.where(off, apart, 0.0) ** 2))
