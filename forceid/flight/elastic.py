"""The prior of elastic modes: oscillators of known frequency under loads of which all modes get a like share.

A load on a mode of unit modal mass is the work of the same forces that push the body as a whole, so its size
is alike for all of them, but for where it acts. Size and smoothness are found from the spectra of what the
frames show of the modes together, so modes that no marker tells apart, or none shows, have a prior all the
same. Source: theory of one model; likelihood by Whittle (1953).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from scipy.optimize import minimize

from forceid.compiled import engine as compiled
from forceid.flight.channels import CHANNEL_SAMPLES, FLIGHT_SAMPLES, middle
from forceid.flight.modes import chains
from forceid.flight.vibration import Vibration
from forceid.kalman.building.process import matern_density
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array, Indices
from forceid.rounding import SINGLE, SOLVED
from forceid.significance import HANN, PATIENCE, SIGMAS, TENTH

LOAD_ORDERS = (1, 2)  # of the loads tried: each costs a state a mode
AIR = 0.1  # of a logarithm: about how far a load that answers a mode moves its frequency, where one does
UNEVEN = 0.48  # of a logarithm, one standard deviation: of what a load at one node does to modes, chi of 3
DAMPINGS = (0.0005, 0.002, 0.007, 0.02, 0.05)  # of the critical one, tried where unknown: those of structures
DAMPING = 0.02  # of the critical one, while spectra are looked at
FIRST_SIZES = (0.01, 0.1, 1.0)  # of loads, over those that would move the modes as far as steady ones
FIRST_RATES = (0.02, 0.2, 1.0)  # at which loads forget, over the lowest frequency
WIDEST = 12.0  # of a logarithm: how far the size of loads may be from where its search begins
OWN_BINS = 128  # lowest frequencies looked at one by one; beyond, as many together as keeps the octaves alike


@dataclass(frozen=True)
class Elastic:
    """Elastic modes of unit shapes: frequency (mode,) rad/s, damping (mode,) over critical, None if unknown.

    size (mode,) 1/sqrt(kg): norm of the shape of unit modal mass, so mass = 1 / size^2; told (mode,): norm of
    the shape that forces are told on; detuned (mode,): about how far the logarithm of a frequency is off, as
    the pull of a spin tightens the body.
    """

    frequency: Array
    damping: Array | None
    size: Array
    told: Array
    detuned: Array


@dataclass(frozen=True)
class ElasticPrior:
    """How elastic modes swing with the air around them, and what of it is the air: a load that answers them.

    spring, brake (mode,) 1/s2, 1/s: such a load is -(spring q + brake q'), None where none is found.
    """

    vibration: Vibration
    spring: Array | None = None
    brake: Array | None = None


@dataclass(frozen=True)
class Spectra:
    """Cross spectra (band, channel, channel) of channels = rows q + noise of unit variance.

    count (band,): frequencies in each; frequency (bin,) rad/s, band (bin,) of each; step s of the clock;
    span s of the record.
    """

    power: Array
    count: Array
    frequency: Array
    band: Indices
    rows: Array
    step: float
    span: float

    def over_bands(self, density: Array) -> Array:
        """Means (band, ...) of a density (bin, ...) over the frequencies of each band."""
        first = np.flatnonzero(np.diff(self.band, prepend=-1))
        return np.asarray(np.add.reduceat(density, first, axis=0) / self.count[:, None])

    def misfit(self, p: Array) -> tuple[Array, Array]:
        """Minus the log-likelihood (band,) of an ordinate whose modes have densities p (band, mode), and its
        slopes (band, mode).
        """
        if compiled is not None:
            found: tuple[Array, Array] = compiled.misfit(self.rows, self.power, p)
            return found
        D = self.rows
        S = np.eye(len(D)) + (D * p[:, None]) @ D.T
        inverse = np.linalg.inv(S)
        left = inverse @ (self.power @ inverse)
        value = np.linalg.slogdet(S)[1] + np.einsum("bij,bji->b", inverse, self.power)
        return np.asarray(value), np.asarray((D * ((inverse - left) @ D)).sum(1))


def spectra_of(time: Array, observed: Array, rows: Array) -> Spectra | None:
    """Spectra of observed (time, mode) = rows q + unit noise, rows (time, mode, mode), from tapered samples.

    None where too few frames do. Frames that show less than the best are left out: an uneven clock and gaps
    cost accuracy, and no interpolation.
    """
    part = middle(len(time), CHANNEL_SAMPLES)
    time, observed, rows = time[part], observed[part], rows[part]
    seen = np.isfinite(observed).any(1)
    observed = np.nan_to_num(observed)  # where a frame has no further number its row is zero
    if seen.sum() < 8:
        return None
    best = rows[seen][np.einsum("tij,tij->t", rows[seen], rows[seen]).argmax()]
    seen &= np.linalg.norm(rows - best, axis=(1, 2)) < TENTH * np.linalg.norm(best)
    shown = np.linalg.norm(best, axis=1) > SOLVED * np.linalg.norm(best)
    best, t, y = best[shown], time[seen], observed[seen][:, shown]
    span, step = float(np.ptp(time)), float(np.median(np.diff(time)))
    taper = np.sin(np.pi * (t - time[0] + 0.5 * step) / (span + step)) ** 2
    taper /= np.sqrt((taper**2).sum())
    y = y - (taper @ y) / taper.sum()
    # below, the mean that was taken out
    w = np.arange(1, int(0.5 * span / step)) * (2 * np.pi / span)
    if not len(w) or not len(best):
        return None
    Y = np.exp(-1j * np.outer(w, t - time[0])) @ (taper[:, None] * y)
    octave = OWN_BINS * (1 + np.log(np.maximum(np.arange(len(w)) / OWN_BINS, 1.0)))
    together = np.minimum(np.arange(len(w)), octave.astype(int))
    band: Indices = np.unique(together, return_inverse=True)[1].astype(np.intp)
    power = np.zeros((band[-1] + 1, len(best), len(best)))
    np.add.at(power, band, np.einsum("fi,fj->fij", Y, Y.conj()).real)
    count = np.bincount(band).astype(float)
    return Spectra(power / count[:, None, None], count, np.asarray(w, float), band, best, step, span)


def seen_modes(time: Array, rows: Array, prior: Vibration) -> StateSpace:
    """Linear model of what frames say of modes beside their poses: rows q + noise of unit variance."""
    F, Q, P0 = chains(prior, np.diff(time))
    H = np.zeros((*rows.shape[:2], len(P0)))
    H[:, :, :: prior.states] = rows
    steady = not np.ptp(rows, axis=0).any()
    return StateSpace(F, Q, H[0] if steady else H, np.eye(rows.shape[1]), np.zeros(len(P0)), P0)


def tune_elastic(
    time: Array, observed: Array, rows: Array, elastic: Elastic, engine: Engine
) -> ElasticPrior | None:
    """The most likely prior of elastic modes, of which frames show observed (time, mode) = rows q + noise.

    None where too few frames show them, or they show a motion so large that no spectrum has a likelihood in
    doubles, 1e15 times the noise. Damping is narrower than spectra show: the exact likelihood tells it,
    and whether loads answer the motion: e^PATIENCE times as likely for every mode as that they do not.
    """
    spectra = spectra_of(time, observed, rows)
    if spectra is None:
        return None
    part = middle(len(time), FLIGHT_SAMPLES)

    def best(at: Array, order: int, modes: Elastic, ratios: list[Array]) -> tuple[float, Vibration]:
        def value(k: int) -> tuple[float, Vibration]:
            prior = prior_at(at, replace(modes, damping=ratios[k]), order)
            model = seen_modes(time[part], rows[part], prior)
            return float(engine.log_likelihood(model, observed[part])), prior

        return uphill_along(value, len(ratios))

    one = np.ones_like(elastic.frequency)
    told = [elastic.damping] if elastic.damping is not None else [ratio * one for ratio in DAMPINGS]
    if (found := likeliest_modes(spectra, elastic)) is None:
        return None
    at, order = found
    value, alone = best(at, order, elastic, told)
    braked = told if elastic.damping is None else [elastic.damping, *(elastic.damping + d for d in DAMPINGS)]
    loose = replace(elastic, detuned=np.hypot(elastic.detuned, AIR))
    at[-len(one) :] *= elastic.detuned / loose.detuned
    more, answering = best(searched(spectra, loose, order, at)[1], order, loose, braked)
    if more < value + PATIENCE * len(one):
        return ElasticPrior(alone)
    brakes = answering.damping - alone.damping if elastic.damping is not None else 0.0 * one
    return ElasticPrior(answering, answering.frequency**2 - elastic.frequency**2, 2 * brakes)


def uphill_along(value: Callable[[int], tuple[float, Vibration]], count: int) -> tuple[float, Vibration]:
    """The largest value along a damping, on which a likelihood has one peak: uphill from the middle one."""
    k = count // 2
    found = value(k)
    for side in (-1, 1):
        moved = False
        while 0 <= k + side < count and (other := value(k + side))[0] > found[0]:
            k, found, moved = k + side, other, True
        if moved:
            break
    return found


def likeliest_modes(spectra: Spectra, elastic: Elastic) -> tuple[Array, int] | None:
    """The point of the search where modes and loads are likeliest, and the order of the loads."""
    every = {order: searched(spectra, elastic, order) for order in LOAD_ORDERS}
    found = {order: (value, at) for order, (value, at) in every.items() if np.isfinite(value)}
    if not found:
        return None
    best = min(value for value, _ in found.values())
    order = max(order for order, (value, _) in found.items() if value < best + PATIENCE)
    return found[order][1], order


def searched(
    spectra: Spectra, elastic: Elastic, order: int, near: Array | None = None
) -> tuple[float, Array]:
    """The least value of `unlikeliness` at an order, and where; near: a point not far from it, if known."""
    modes, lowest = len(elastic.frequency), float(elastic.frequency.min())
    value = partial(unlikeliness, spectra, elastic, order)
    seen = np.linalg.norm(spectra.rows, axis=0) * elastic.size / elastic.frequency**2
    power = float(np.einsum("bii,b->", spectra.power, spectra.count))
    still = float(np.sqrt(2 * power * spectra.step / spectra.span))
    size = still / max(float(np.linalg.norm(seen)), np.finfo(float).tiny)
    fastest, slowest = 0.5 * np.pi / spectra.step, 1 / spectra.span
    starts = [
        np.log([size * s, np.clip(rate * lowest, slowest, fastest)])
        for s, rate in product(FIRST_SIZES, FIRST_RATES)
    ]
    starts = [np.concatenate([at, np.zeros(2 * modes)]) for at in starts]
    first = min(starts, key=lambda at: value(at)[0]) if near is None else near
    bounds = [
        (first[0] - WIDEST, first[0] + WIDEST),
        (np.log(slowest), np.log(fastest)),
        *[(-SIGMAS, SIGMAS)] * (2 * modes),
    ]
    # of thousands of logarithms of likelihood, a step that gains a thousandth is the last
    done = minimize(
        value, first, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": TENTH * SINGLE}
    )
    return float(done.fun), done.x


def unlikeliness(spectra: Spectra, elastic: Elastic, order: int, at: Array) -> tuple[float, Array]:
    """Minus the logarithm of Whittle's likelihood and of the prior of the shares, and its slope.

    at (2 + 2 mode,): logarithms of the size of the loads on unit modal mass and of their rate; of the share
    of each mode, and of what its frequency is off by, in standard deviations.
    """
    size, rate = np.exp(at[:2])
    shares, off = at[2:].reshape(2, -1)
    w, own = spectra.frequency[:, None], elastic.frequency * np.exp(elastic.detuned * off)
    # no mode is sharper than the record shows: its width is added to what damping makes
    width = own * (DAMPING if elastic.damping is None else elastic.damping) + np.pi / spectra.span
    gain = 1 / ((own**2 - w**2) ** 2 + (2 * width * w) ** 2)
    load = (size * elastic.size * np.exp(UNEVEN * shares)) ** 2
    density = load * gain * matern_density(order, 1.0, rate, w) / spectra.step
    by_rate = (2 * order - 1) - 2 * order * rate**2 / (rate**2 + w**2)
    by_own = (
        -4 * own * gain * (own * (own**2 - w**2) + 2 * (width - np.pi / spectra.span) * width * w**2 / own)
    )
    means = spectra.over_bands(np.concatenate([density, density * by_rate, density * by_own], 1))
    p, p_by_rate, p_by_own = np.split(means, 3, axis=1)
    each, slope = spectra.misfit(np.ascontiguousarray(p))
    count = HANN * spectra.count
    value, slope = count @ each, count[:, None] * slope
    by_share = 2 * (slope * p).sum(0)
    slopes = np.concatenate(
        [
            [by_share.sum(), (slope * p_by_rate).sum()],
            UNEVEN * by_share + shares,
            elastic.detuned * (slope * p_by_own).sum(0) + off,
        ]
    )
    return float(value + 0.5 * at[2:] @ at[2:]), slopes


def prior_at(at: Array, elastic: Elastic, order: int) -> Vibration:
    """The prior of modes at a point of the search."""
    size, rate = np.exp(at[:2])
    shares, off = at[2:].reshape(2, -1)
    w, one = elastic.frequency * np.exp(elastic.detuned * off), np.ones(len(off))
    damping = w * (DAMPING if elastic.damping is None else np.maximum(elastic.damping, DAMPINGS[0]))
    unit = Vibration(w, damping, one, rate * one, order)
    return replace(unit, std=size * elastic.size * np.exp(UNEVEN * shares) / unit.load)
