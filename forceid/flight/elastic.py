"""The prior of elastic modes: oscillators of known frequency under loads of which all modes get a like share.

A load on a mode of unit modal mass is the work of the same forces that push the body as a whole, so its size
is alike for all of them, but for where it acts. Size and smoothness are found from the spectra of what the
frames show of the modes together, so modes that no marker tells apart, or none shows, have a prior all the
same. Source: theory of one model; likelihood by Whittle (1953).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.flight.elastic_spectra import DAMPING, UNEVEN, Elastic, Spectra, searched, spectra_of
from forceid.flight.modes import chains
from forceid.flight.vibration import Vibration
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.significance import PATIENCE

LOAD_ORDERS = (1, 2)  # of the loads tried: each costs a state a mode
AIR = 0.1  # of a logarithm: about how far a load that answers a mode moves its frequency, where one does
DAMPINGS = (0.0005, 0.002, 0.007, 0.02, 0.05)  # of the critical one, tried where unknown: those of structures


@dataclass(frozen=True)
class ElasticPrior:
    """How elastic modes swing with the air around them, and what of it is the air: a load that answers them.

    spring, brake (mode,) 1/s2, 1/s: such a load is -(spring q + brake q'), None where none is found.
    """

    vibration: Vibration
    spring: Array | None = None
    brake: Array | None = None


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


def prior_at(at: Array, elastic: Elastic, order: int) -> Vibration:
    """The prior of modes at a point of the search."""
    size, rate = np.exp(at[:2])
    shares, off = at[2:].reshape(2, -1)
    w, one = elastic.frequency * np.exp(elastic.detuned * off), np.ones(len(off))
    damping = w * (DAMPING if elastic.damping is None else np.maximum(elastic.damping, DAMPINGS[0]))
    unit = Vibration(w, damping, one, rate * one, order)
    return replace(unit, std=size * elastic.size * np.exp(UNEVEN * shares) / unit.load)
