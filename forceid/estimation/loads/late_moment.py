"""A moment that the flight shows better than its channel, which a fast spin blinds."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.loads.fused_tuning import of_half, tune_together
from forceid.flight.model import Flight
from forceid.flight.path.reference import Reference
from forceid.flight.path.settling import first_reference, settled
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.significance import OUTLIER, PATIENCE, SIGMAS

LARGER_BY = np.exp(np.arange(13.0))  # of a moment over that which a channel took for none: up to five decades


def contradicted(state: FlightState) -> bool:
    """Whether rotations are off what their prior expects by more than chance, at all frequencies or at some.

    A moment that its channel took for none leaves slow innovations, of which their mean square tells little:
    another prior promises that of each octave of their spectrum, n ordinates of mean power r > 1, the
    log-likelihood n (r - 1 - log r). Chance makes a quarter of it an octave. Wild ones do not count: no prior
    explains them.
    """
    white = np.clip(state.innovation[:, 3:6], -OUTLIER, OUTLIER)
    white = white[np.isfinite(white).all(1)]
    if len(white) < 3:
        return False
    power = np.abs(np.fft.rfft(white, axis=0)[1:]) ** 2 / len(white)
    first = 2 ** np.arange(int(np.log2(len(power))) + 1) - 1
    count = np.diff(first, append=len(power))[:, None]
    r = np.maximum(np.add.reduceat(power, first) / count, 1.0)
    promise = float((count * (r - 1 - np.log(r))).sum())
    known = white.size
    return bool((white**2).mean() > 1 + SIGMAS * np.sqrt(2 / known) or promise > PATIENCE + 0.25 * r.size)


def by_the_flight(
    flight: Flight, priors: dict[str, LoadPrior], about: Reference | None, engine: Engine
) -> dict[str, LoadPrior]:
    """The priors of a flight, that of its moment by its own likelihood about a reference; as they are where
    no moment along all axes alike is e^PATIENCE times as likely.

    Errors of a rotation turn the momentum of a fast spin, so that its channel shows little of the moment, or
    of it along some axes; the flight itself shows it, whenever it comes. A moment that the channel took for
    none is so small that no step from it changes the likelihood: the search begins at its likeliest size.
    Where no path came to rest under it (None), about that under the smallest larger one which lets one.
    """
    moment, rests = priors["moment"], about is not None
    first = first_reference(flight, moment) if about is None else about
    for size in () if rests else LARGER_BY[1:]:
        larger = moment.with_kernel(moment.kernel.scaled(size))
        with suppress(EstimationError):
            about = settled(flight, None, larger, engine, replace(first, moment=larger))[2]
            break
    if about is None:
        return priors
    known, alike = (partial(of_half, flight, one, about, engine) for one in (moment, moment.alike()))
    try:
        each = {float(one): alike(np.array([np.log(one), 0.0])) for one in LARGER_BY}
        size = max(each, key=lambda one: each[one])
        if rests and not each[size] > known(np.zeros(2)) + PATIENCE:
            return priors
        moment = moment.with_kernel(moment.kernel.scaled(size))
        moment = tune_together(flight, None, moment, engine, first=about)[2]
    except EstimationError:
        return priors
    return priors | {"moment": moment}
