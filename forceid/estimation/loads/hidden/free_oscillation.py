"""Free oscillations that one load shows and noise may hide in the others: claims that allow for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.verdict.catalogue import note
from forceid.flight.model import Flight, seen_part
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.building.lines import Line, excite, near, whiten
from forceid.kalman.engines import Engine
from forceid.records import Array, Finding
from forceid.significance import WORSE

DECAYED = 4.0  # e-folds over a record by which an oscillation has rung down


def widened_by_ringing(
    state: FlightState, flight: Flight, priors: dict[str, LoadPrior], engine: Engine
) -> tuple[FlightState, tuple[Finding, ...]]:
    """The same state, with claims that allow for ringing where none was found; said if that matters.

    A body that nutates turns every load that depends on its attitude: an oscillation that rings down in
    one component is in the others too. Where the record does not show it, its two amplitudes are as unknown
    there as the noise leaves them. A driven line has a direction of its own, and says nothing of others.
    """
    lines = [line for prior in priors.values() for line in prior.lines]
    cov, span = state.wrench_cov.copy(), float(np.ptp(flight.time))
    rings: tuple[Finding, ...] = ()
    for frequency in sorted({line.frequency for line in lines}):
        same = [line for line in lines if near(frequency, [line.frequency], flight.time)]
        if any(line.driven or line.bandwidth * span < DECAYED for line in same):
            continue  # what goes on in any component is driven
        line = same[0]
        for name, prior in priors.items():
            first = 0 if name == "force" else 3
            for axis, var in hidden_variance(flight, state, prior, first, line, engine).items():
                cov[:, first + axis, first + axis] += var
        held = {name: [line.frequency for line in prior.lines] for name, prior in priors.items()}
        shown = " and ".join(name for name, lines in held.items() if near(frequency, lines, flight.time))
        before, after = (np.trace(np.nanmean(a, 0)[:3, :3]) for a in (state.wrench_cov, cov))
        if not rings and after > WORSE**2 * before:
            rings = (note("free-oscillation", frequency_hz=frequency, load=shown),)
    return replace(state, wrench_cov=cov), rings


def hidden_variance(
    flight: Flight, state: FlightState, prior: LoadPrior, first: int, line: Line, engine: Engine
) -> dict[int, Array]:
    """Variance (time,) along each world axis that an unseen oscillation leaves to a load without it."""
    holds = np.zeros(3, bool)
    for own in prior.lines:
        if near(line.frequency, [own.frequency], flight.time):
            holds |= np.abs(own.direction) > 0
    if holds.all():
        return {}
    about = state.reference
    carrier = None if about is None else about.rotation
    model, z = seen_part(flight, prior, about if first else None, carrier)
    root = np.array([2j * np.pi * line.frequency - line.bandwidth])
    signal = excite(model, flight.time, prior.axes, root)[:, :, :, 0]
    filtered = engine.filter(model, z)
    white = whiten(model, filtered, signal.reshape(*signal.shape[:2], -1)).reshape(signal.shape)
    phase = np.exp(root[0] * (flight.time - flight.time[0]))
    load = np.stack([phase.real, -phase.imag], 1)
    found = {}
    for axis in np.flatnonzero(~holds):
        information = np.einsum("tci,tcj->ij", white[:, :, axis], white[:, :, axis])
        found[int(axis)] = np.einsum("ti,ij,tj->t", load, np.linalg.pinv(information), load)
    return found
