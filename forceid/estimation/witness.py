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

from forceid.estimation.flight_smoother import Solution
from forceid.estimation.plain_route import FEWEST, Channel, plain_route
from forceid.estimation.verdict import Finding
from forceid.kalman.flight import FlightState
from forceid.motion.plain_cut import STRETCH, Cut, Spectrum, bending, plain_cuts, spectrum_of, tapered
from forceid.motion.smoothing_spline import SmoothingSpline
from forceid.records import Array, Flags, Motion, Recording, Witness

CHANCE = 1e-4  # of saying of an honest recording that both differ: one in ten thousand loses its `ok`
LOWEST = 3  # bin up to which the lowest band goes: the taper spreads a constant so far
CENTRAL = 0.75  # part of the record compared: ends say little
BIASED = 2.0  # variance over that of the noise: at the best cut the squared bias is 5/12 to 5/3 of it
ADDED = 1.5  # times the variance that white noise leaves of a second derivative: a walk's, corner at the cut
COMPARED = ("band", "apart", "difference", "limit")
UNITS = {"force": "N", "moment": "N m"}


def witness_of(recording: Recording, solution: Solution) -> Witness | None:
    """The plain route of a recording beside its solution; None where it shows neither center nor turn."""
    state, motion = solution.state, as_used(recording.motion, solution)
    route = plain_route(recording.body, motion)
    std = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
    sides = [
        compared(motion.time, one, load, claim)
        for one, load, claim in (
            (route.force, state.force, std[:, :3]),
            (route.moment, state.moment, std[:, 3:]),
        )
    ]
    if all(side is None for side in sides):
        return None
    nothing, none = np.full((len(motion.time), 3), np.nan), np.full(3, np.nan)
    found: dict[str, Array] = {}
    for name, side in zip(UNITS, sides, strict=True):
        series = side[0] if side else (nothing, nothing)
        found |= {name: series[0], f"{name}_std": series[1]}
        found |= {f"{k}_{name}": side[1][k] if side else none for k in ("cutoff", *COMPARED)}
    return Witness(**found)


def as_used(motion: Motion, solution: Solution) -> Motion:
    """The motion without the readings that the solution found to be wrong: these count as gaps."""
    left = solution.kinematics.pose.residual
    if motion.position is None or left.shape != motion.position.shape or not np.isfinite(left).any():
        return motion
    frames = np.asarray(np.isfinite(left).all(2))
    taken = frames | ~frames.any(1, keepdims=True)  # a frame without a pose says nothing of its readings
    return replace(motion, position=np.where(taken[..., None], motion.position, np.nan))


def compared(
    time: Array, channel: Channel | None, load: Array, claim: Array
) -> tuple[tuple[Array, Array], dict[str, Array]] | None:
    """What a channel says of its load, beside an estimate of it (time, 3) with its claimed deviation.

    The load and its deviation (time, 3), and by name the numbers of `Witness` by axis.
    """
    if channel is None:
        return None
    at, found = channel.frame, spectrum_of(channel.time, channel.z, channel.corner)
    cuts = plain_cuts(found)
    values, std = np.full((len(time), 3), np.nan), np.full((len(time), 3), np.nan)
    maps: dict[float, tuple[SmoothingSpline, Array]] = {}
    for a, cut in enumerate(cuts):
        if cut.frequency not in maps:
            spline = SmoothingSpline(channel.time, cut.frequency)
            maps[cut.frequency] = spline, spline.gain()
        spline, gain = maps[cut.frequency]
        noise = cut.noise * gain * (1 + ADDED * (channel.corner[a] / cut.frequency) ** 2)
        left = spline.second(channel.residual)[central(channel.time)] if channel.lever else np.zeros(1)
        values[at, a] = spline.second(channel.z[:, a : a + 1])[:, 0]
        std[at, a] = np.sqrt(BIASED * noise + off_by_fit(channel, float(np.mean(left**2))))
    cutoff = {"cutoff": np.array([cut.frequency for cut in cuts])}
    return (values, std), cutoff | apart_in_bands(channel, found, cuts, time, load, claim)


def apart_in_bands(
    channel: Channel, found: Spectrum, cuts: list[Cut], time: Array, load: Array, claim: Array
) -> dict[str, Array]:
    """How far a load is apart from a channel, by axis, in the band from zero in which it is farthest.

    Half an octave from band to band, each with the noise of the channel in it.
    """
    numbers = {name: np.full(3, np.nan) for name in COMPARED}
    path = integrated_twice(time, load)[channel.frame]
    seen = np.isfinite(load) & np.isfinite(claim)
    beside = channel.z - path
    for column, known in zip(beside.T, (seen[channel.frame] & channel.whole[:, None]).T, strict=True):
        if known.sum() >= FEWEST:
            column[~known] = np.interp(channel.time[~known], channel.time[known], column[known])
        else:
            column[:] = 0.0
    f, apart, dof, step = bending(channel.time, beside)
    samples = len(channel.time) - 2
    count = max(int(2 * np.log2(STRETCH / step / f[LOWEST])) + 1, 1)
    ends = np.searchsorted(f, STRETCH / step * 2 ** (-0.5 * np.arange(count)))
    weight = np.interp(time, channel.time[1:-1], tapered(samples)) ** 2
    whole = np.concatenate([[1.0], np.full(len(f) - 1, 2.0)]) / samples  # bins to mean squares
    inexact = (2 * np.pi * f * step) ** 4 / 144  # of sums in place of integrals, in variance
    fits = bending(channel.time, channel.residual)[1].mean(1) if channel.lever else np.zeros(len(f))
    for a, cut in enumerate(cuts):
        if not beside[:, a].any():
            continue
        told = seen[:, a]
        claimed = float(weight[told] @ claim[told, a] ** 2 / weight[told].sum())
        noise = np.concatenate([[0.0], cut.noise * found.moved[:, a]])
        carried = np.concatenate([[0.0], found.power[:, a] * found.moved[:, a]]) * inexact
        worst = 0.0
        for end in ends:
            own = float(whole[:end] @ noise[:end])
            joint = max(own + off_by_fit(channel, float(whole[:end] @ fits[:end])), claimed)
            joint += float(whole[:end] @ carried[:end]) + np.finfo(float).tiny
            size = float(whole[:end] @ apart[:end, a])
            limit = allowed(found.moved[: end - 1, a], dof, cut.dof, count)
            if (ratio := size / joint / limit) > worst:
                worst = ratio
                for name, value in zip(numbers, (f[end - 1], size, size / joint, limit), strict=True):
                    numbers[name][a] = value if name == "band" else np.sqrt(value)
    return numbers


def off_by_fit(channel: Channel, bent: float) -> float:
    """Variance of the load that what a fit leaves of a marker gives it, of mean square `bent` when bent."""
    return channel.lever**2 * bent / channel.free if channel.free > 0 else 0.0


def allowed(moved: Array, dof: float, known_by: float, bands: int) -> float:
    """Variance over variance that chance passes by CHANCE, of six components in all bands together.

    moved (bin,): weights of the bins that a mean square sums, each of `dof`; known_by: those of its level.
    """
    samples = max(dof * float(moved.sum() ** 2 / (moved**2).sum()), 1.0)
    return float(fdtri(samples, known_by, 1 - CHANCE / (6 * bands)))


def integrated_twice(time: Array, load: Array) -> Array:
    """A load (time, 3) integrated twice from its start, straight across what is not known of it."""
    out = np.zeros_like(load)
    for a, column in enumerate(load.T):
        seen = np.isfinite(column)
        if seen.sum() > 1:
            filled = np.interp(time, time[seen], column[seen])
            out[:, a] = CubicSpline(time, filled).antiderivative(2)(time)
    return out


def central(time: Array) -> Flags:
    """Samples (time,) of the central part of the record."""
    middle, span = (time[0] + time[-1]) / 2, time[-1] - time[0]
    return np.asarray(np.abs(time - middle) <= CENTRAL * span / 2)


def judge_witness(witness: Witness | None, state: FlightState) -> list[Finding]:
    """A sentence on force and on moment, where witness and estimate differ by more than both allow."""
    if witness is None:
        return []
    texts = []
    for (name, unit), load in zip(UNITS.items(), (state.force, state.moment), strict=True):
        off = np.flatnonzero(differs(witness, name))
        if not len(off):
            continue
        band, apart, errors = (getattr(witness, f"{key}_{name}") for key in COMPARED[:3])
        a = off[np.argmax(errors[off])]
        own, plain = (rms(v[:, a]) for v in (load, getattr(witness, name)))
        others = "".join(f", and so along {'xyz'[k]}" for k in off if k != a)
        texts.append(
            f"the {name} along {'xyz'[a]} is {own:.2g} {unit} rms, {plain:.2g} {unit} by the plain route, "
            f"the low-passed second derivative: up to {band[a]:.2g} Hz they are {apart[a]:.2g} {unit} apart, "
            f"{errors[a]:.1f} joint errors{others}; the claim is widened by what they are apart; compare "
            "both (/witness), and look at the body, the model and the tracks"
        )
    return [Finding(text) for text in texts]


def rms(values: Array) -> float:
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
