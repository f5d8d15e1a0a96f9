"""Claims of a body that deforms: how its modes move, and its moment, as far as the record does not tell.

A mode is smoothed under the likeliest oscillator and load. As of a force, loads of other order, rate and size
explain its record about as well. And the shapes of a level are axes that nobody chose for the body: what
swings along one is in the others too, by a share that noise may hide, as a narrow line that their own prior
takes for noise and does not follow. Before the record is seen, shares are uniform in the logarithm, from next
to none to all; the error is that under each, weighed by its likelihood. Source: as of `order_uncertainty`.

Forces act on points that deform with the body. However slowly a force f on a node varies, a part dx of its
place that is faster than the smooth moment is followed shakes the moment by dx x f. Of the forces the record
tells the moment T alone. Forces alike on all masses make it, and shake it:

    cov(dT) = k (tr(M) I - M),   M = <sum w dx dx^T>,   k = <T.T> / (2 sum w x.x).

Of an affine body M = <dG E dG^T>, of the fast part dG of its map, with first moments K of the forces whose
entries K E^-1/2 are alike.
Source: pseudo-rigid bodies, section 1; theory of one model, section 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.hidden.order_uncertainty import BEYOND, grown_deviation, shares_lost
from forceid.estimation.loads.hidden.whitened import FAINTEST, STEP, candidates, groups_of, summed_powers
from forceid.flight.channels import middle
from forceid.flight.smoother import FlightState
from forceid.flight.vibration import ModeState, Vibration, vibrating
from forceid.kalman.engines import Engine
from forceid.records import Array, Indices
from forceid.significance import OUTLIER

IN_LINE = 2  # frequencies to one over the record, which is as narrow as it shows a line
FASTER = 32  # frequencies beyond those that samples show


@dataclass(frozen=True)
class SeenModes:
    """Modes as a record shows them: prior, no sharper than that, and density (mode,) of the noise, white."""

    prior: Vibration
    white: Array

    def spectra(self, frequency: Array) -> tuple[Array, Array, Array]:
        """Of noise and modes (frequency, mode), as accelerations, and what these make of their loads."""
        w = 2 * np.pi * frequency[:, None]
        return self.white * w**4, self.prior.density(w), self.prior.answer(w)


def motion_growth(
    time: Array, q: Array, noise_var: Array, prior: Vibration, motion_cov: Array, engine: Engine
) -> Array:
    """Factors (mode, 3), one at least, on the claimed deviations of amplitude, rate and acceleration.

    time (time,) s; q (time, mode) m, NaN = missing, seen with noise_var (time, mode); motion_cov (time, 3
    mode, 3 mode): of their motion, as claimed under the prior.
    """
    edge = len(time) // 8
    inner = np.diagonal(motion_cov, axis1=1, axis2=2)[edge : len(time) - edge]
    claimed = np.nanmean(inner, axis=0).reshape(q.shape[1], len(ModeState))
    run = middle(len(time))
    time, q, var = time[run], q[run], noise_var[run]
    innovation, span = engine.innovations(vibrating(prior, var, np.diff(time)), q), float(np.ptp(time))
    seen = np.isfinite(innovation)
    frequency, first, count = groups_of(time)
    held = np.where(seen, np.clip(innovation, -OUTLIER, OUTLIER), 0.0)
    powers = summed_powers(held, seen.sum(0), first)
    white = np.where(seen, var, 0.0).sum(0) / seen.sum(0) ** 2 * span
    modes = SeenModes(replace(prior, damping=prior.damping + np.pi / span), white)
    neighbors = shares_of_others(modes, frequency[0], first, count, powers)
    noise, own, answer = modes.spectra(frequency)
    loads = [
        candidates(frequency, count, *each) for each in zip((noise / answer).T, (own / answer).T, strict=True)
    ]
    slow = np.arange(1, IN_LINE * len(time) // 2) / (IN_LINE * span)
    wide = np.concatenate([slow, np.geomspace(slow[-1], BEYOND * frequency[-1], FASTER + 1)[1:]])
    noise, own, answer = modes.spectra(wide)
    growth = np.ones_like(claimed)
    for derivative in range(len(ModeState)):
        per = (2 * np.pi * wide[:, None]) ** (2.0 * derivative - 4)
        lost = shares_lost(wide, frequency[-1], noise * per, own * per, claimed[:, derivative])
        counted = 2 * np.gradient(wide)[:, None] * lost**2 * per
        power = counted.T @ own  # of each mode (mode, other), that another one would miss if it had all of it
        for j, load in enumerate(loads):
            more = load.density(wide, counted[:, j] * answer[:, j]) - power[j, j]
            tried = [(load.log_likelihood(powers[:, j]), more)]
            tried += [(likelihood, share * power[j, k]) for k, share, likelihood in neighbors[j]]
            alone = [grown_deviation(*each, claimed[j, derivative]) ** 2 - 1 for each in tried]
            growth[j, derivative] = np.sqrt(1 + sum(alone))
    return np.asarray(growth)


def shares_of_others(
    modes: SeenModes, step: float, first: Indices, count: Array, powers: Array
) -> list[list[tuple[int, Array, Array]]]:
    """For each mode, each other one with shares (candidate,) of its power, and the logarithms of how likely
    they make its record.

    step: frequency of the first ordinate; first, count (group,): ordinates of the groups; powers (group,
    mode): of innovations, as of `summed_powers`.
    """
    ordinate: Array = step * np.arange(1.0, count.sum() + 1)
    noise, own, _ = modes.spectra(ordinate)
    found: list[list[tuple[int, Array, Array]]] = [[] for _ in range(own.shape[1])]
    for j, k in permutations(range(len(found)), 2):
        line = np.add.reduceat(own[:, k] / (noise[:, j] + own[:, j]), first) / count
        least = np.log(FAINTEST / max(1.0, float(line.max())))
        share = np.exp(np.arange(0.0, least, -np.log(STEP)))
        ratio = 1 + share[:, None] * line
        found[j].append((k, share, (1 - 1 / ratio) @ powers[:, j] - np.log(ratio) @ count))
    return found


def widened_by_arms(state: FlightState, kin: Kinematics, amplitude: Array, band: float) -> FlightState:
    """The state with a moment that may shake with its arms.

    amplitude (time, mode) m: of the shapes of kin; band Hz: up to which the moment is followed.
    """
    if kin.markers is None or not len(kin.shapes):
        return state
    told = kin.seen | (kin.elastic is not None)  # nodes that show their shape
    weight, shapes = kin.inertia.weight[told], kin.shapes[:, told]
    weight = weight if weight.any() else np.ones(len(weight))
    M = np.einsum(
        "kl,n,kna,lnb->ab",
        fast_square(kin.time, amplitude, band), weight, shapes, shapes,
        optimize=True,
    )  # fmt: skip
    shaken = state.rotation @ (np.trace(M) * np.eye(3) - M) @ state.rotation.mT
    spread, cov = 2 * float(weight @ (kin.shape[told] ** 2).sum(1)), state.wrench_cov.copy()
    cov[:, 3:, 3:] += np.nanmean((state.moment**2).sum(1)) / spread * shaken
    return replace(state, wrench_cov=cov)


def fast_square(time: Array, q: Array, band: float) -> Array:
    """Mean of dq dq^T (mode, mode), of the part dq of amplitudes q (time, mode) above band Hz."""
    taper = np.sin(np.pi * (np.arange(len(time)) + 0.5) / len(time)) ** 2
    taper /= np.sqrt((taper**2).mean())
    waves = np.fft.rfft(taper[:, None] * (q - q.mean(0)), axis=0)
    fast = waves[np.fft.rfftfreq(len(time), float(np.median(np.diff(time)))) > band]
    return np.asarray(2 * (fast.T @ fast.conj()).real / len(time) ** 2)
