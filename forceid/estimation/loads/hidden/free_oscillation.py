"""Oscillations that noise may hide in a load whose own are not found: how large they may be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.loads.hidden.whitened import FAINTEST, STEP
from forceid.estimation.verdict.catalogue import note
from forceid.flight.model import Flight
from forceid.flight.path.linear import seen_part
from forceid.flight.priors.protocol import CONSTANT, LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.building.line_search import missed_lines
from forceid.kalman.building.lines import Line, axes_left, near
from forceid.kalman.engines import Engine
from forceid.kalman.model import expand
from forceid.records import Array, Finding
from forceid.significance import WORSE

DECAYED = 4.0  # e-folds over a record by which an oscillation has rung down


def widened_by_ringing(
    state: FlightState, flight: Flight, priors: dict[str, LoadPrior], engine: Engine
) -> tuple[FlightState, tuple[Finding, ...]]:
    """The same state, with claims that allow for ringing where none was found; said if that matters.

    A body that nutates turns every load that depends on its attitude: an oscillation that rings down in
    one component is in the others too. Where the record does not show it, its size there is open, uniform in
    the logarithm from next to none up, and weighed by its likelihood. So is that of a load that keeps its
    phase along the axes on which its line is too weak to be found: its direction is free. One whose phase
    drifts has a direction of its own, and says nothing of others.
    """
    lines = [line for prior in priors.values() for line in prior.lines]
    cov, span = state.wrench_cov.copy(), float(np.ptp(flight.time))
    rings: tuple[Finding, ...] = ()
    seen: list[float] = []
    for frequency in sorted({line.frequency for line in lines}):
        if near(frequency, seen, flight.time):
            continue
        seen.append(frequency)
        same = [line for line in lines if near(frequency, [line.frequency], flight.time)]
        if any(line.driven for line in same):
            continue
        line = same[0]
        steady = any(line.bandwidth * span < DECAYED for line in same)  # what goes on is driven
        held = {name: [line.frequency for line in prior.lines] for name, prior in priors.items()}
        holding = [name for name, lines in held.items() if near(frequency, lines, flight.time)]
        for name, prior in priors.items():
            if steady and name not in holding:
                continue
            first = 0 if name == "force" else 3
            for axis, var in hidden_variance(flight, state, prior, first, line, engine).items():
                cov[:, first + axis, first + axis] += var
        before, after = (np.trace(np.nanmean(a[:, :3, :3], 0)) for a in (state.wrench_cov, cov))
        if not (rings or steady) and after > WORSE**2 * before:
            rings = (note("free-oscillation", frequency_hz=frequency, load=" and ".join(holding)),)
    return replace(state, wrench_cov=cov), rings


def hidden_variance(
    flight: Flight, state: FlightState, prior: LoadPrior, first: int, line: Line, engine: Engine
) -> dict[int, Array]:
    """Variance (time,) along each world axis that an unseen oscillation leaves to a load without it.

    Of what the smoother misses of it: the prior by itself follows what is slow.
    """
    if not (left := axes_left(line.frequency, prior.lines, flight.time)):
        return {}
    about = state.reference
    carrier = None if about is None else about.rotation
    model, z = seen_part(flight, prior, about if first else None, carrier)
    root, states = (
        np.array([2j * np.pi * line.frequency - line.bandwidth]),
        slice(CONSTANT.start, prior.states),
    )
    filtered = engine.filter(model, z)
    as_it_is = np.broadcast_to(np.eye(z.shape[1]), (len(z), z.shape[1], z.shape[1]))
    missed = missed_lines(model, filtered, flight.time, prior.axes, root, as_it_is)[:, :, :, 0]
    signals = np.where(np.isfinite(z)[:, None], np.moveaxis(missed, 1, -1).reshape(len(z), 6, -1), np.nan)
    x = engine.followed(filtered, signals, states.start)[..., : states.stop - states.start]
    followed = (x @ prior.rows_along(carrier)[..., states].mT).reshape(len(z), 3, 2, 3)
    g = filtered.gains
    white = np.einsum("tij,tjaq->tiaq", expand(g.W, g.start, g.time), missed)
    phase = np.exp(root[0] * (flight.time - flight.time[0]))
    own, found = np.nan_to_num(filtered.innovation), {}
    for axis in left:
        load = np.stack([phase.real, -phase.imag], 1) - followed[:, axis, :, axis]
        told = np.einsum("tci,tcj->ij", white[:, :, axis], white[:, :, axis])
        shown = np.einsum("tci,tc->i", white[:, :, axis], own)
        found[axis] = of_open_size(load, told, shown)
    return found


def of_open_size(load: Array, told: Array, shown: Array) -> Array:
    """Variance (time,) of an oscillation of two amplitudes of open size.

    load (time, 2): of unit amplitudes; told (2, 2): information of a record on them, shown (2,): its vector.
    They have the covariance g / told before the record is seen, and g / (1 + g) / told with it, about as
    large a share of the likeliest. Sizes g are uniform in the logarithm, up to what no record would fail to
    show, and weighed by their likelihood. Source: the prior of Zellner (1986).
    """
    g = np.exp(np.arange(np.log(FAINTEST), -np.log(FAINTEST), np.log(STEP)))
    kept, cov = g / (1 + g), np.linalg.pinv(told)
    likeliest = cov @ shown
    gained = 0.5 * kept * (shown @ likeliest) - np.log1p(g)
    weight = np.exp(gained - gained.max())
    spread = np.einsum("ti,ij,tj->t", load, cov, load)
    weight /= weight.sum()
    return np.asarray(spread * (kept @ weight) + (load @ likeliest) ** 2 * (kept**2 @ weight))
