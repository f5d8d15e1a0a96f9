"""The loads of links, and the bending of joints, under which all parts and their constraints are likeliest.

Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq, minimize

from forceid.errors import EstimationError
from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.linked_flight import LinkedFlight
from forceid.estimation.joints.linked_model import linked_model
from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.flight.spectral_start import ENOUGH_SAMPLES
from forceid.kalman.engines import Engine
from forceid.records import Array

BEGINNING = 8  # samples that tell where parts begin
SIZE_OF_BENDING = 4  # among the numbers that are tuned: level and rate of forces, of moments, of bending
DOUBLED = 8  # times at most: joints of parts that bend by so much more hold next to nothing
ABOUT = 0.1  # of a logarithm: to which sizes, rates and a standard error are found
GUESSED_WITHIN = 0.5  # of a logarithm: about as far off as a first guess of sizes and rates may be
WITHIN = {"initial_tr_radius": GUESSED_WITHIN, "final_tr_radius": ABOUT}


def tuned_linked(
    flight: LinkedFlight, engine: Engine, near: Array
) -> tuple[LinkedFlight, Bending, float, Array]:
    """The loads and the bending of the joints under which all parts and their constraints are likeliest; how
    likely.

    The sizes and the rates of all forces move together, those of all moments, and those of all bending. How
    likely: the markers, given the constraints, and where the parts begin; that these hold is likelier the
    smaller the loads, and tells nothing of them. Bending is taken as large as the markers let it be by a
    standard error: what is believed too still holds the joints, and all that they pass, too well. near (6,):
    from where the search begins, as logarithms; last, where it ended.
    """
    start, tied = bending_of(flight), flight.constraints.gap.shape[1]
    run = middle(len(flight.constraints.gap), samples_looked_at(len(flight.parts)))
    whole = linked_model(flight, start, run)
    z, begun = whole.z, whole.z.copy()
    begun[BEGINNING:, : z.shape[1] - tied] = np.nan

    def likely(by: Array) -> float:
        model = whole.under(flight.moved(by).loads, start.moved(by[4:]))
        try:
            return float(engine.log_likelihood(model, z)) - float(engine.log_likelihood(model, begun))
        except EstimationError:  # numbers so far off that a covariance loses its sign
            return -np.inf

    bends = bool(start.std.any())
    tuned = [load for load in flight.loads if not load.keeps]
    moved = [[0, 1] * any(load.force for load in tuned), [2, 3] * any(not load.force for load in tuned)]
    free = np.array([*moved[0], *moved[1], *[4, 5] * bends], int)
    if not len(free):
        return flight, start, likely(np.zeros(6)), near
    spread = np.eye(6)[free]
    turned = turning(tuned[0].kernel.order)[np.ix_(free, free)]

    def of_free(by: Array) -> float:
        return likely(by @ spread)

    # bending that noise hides is as likely as any less: quadratic models would wander there
    found = bfgs_maximum(of_free, near[free]) if bends else likeliest(of_free, near[free], turned)
    best = found @ spread
    highest = likely(best)
    bending = start.moved(as_far(likely, best, highest)[4:]) if bends else start
    return flight.moved(best), bending, highest, best


def samples_looked_at(parts: int) -> int:
    """As many as tell sizes and rates that all parts share as well as a whole flight of one part does."""
    return max(FLIGHT_SAMPLES // parts, ENOUGH_SAMPLES)


def turning(order: int) -> Array:
    """Matrix (6, 6) to what is tuned, of loads of an order, from what trades places the least.

    The size of a load is its level at high frequency. A record tells the level at the rate of the load, and
    the rate far less.
    """
    load = np.array([[1.0, order / 2], [0.0, 1.0]])
    return block_diag(load, load, np.eye(2))  # bending as it is


def likeliest(value: Callable[[Array], float], near: Array, turned: Array) -> Array:
    """A maximum of value near a point (number,), by quadratic models of the values along columns of turned.

    Source: Ragonneau and Zhang, COBYQA.
    """
    start = np.linalg.solve(turned, near)
    least: Any = minimize  # whose types know no options of this method
    found = least(lambda q: -value(turned @ q), start, method="COBYQA", options=WITHIN)
    return np.asarray(turned @ found.x)


def bending_of(flight: LinkedFlight) -> Bending:
    """Bending as fast as the forces in the links, before its size and rate are tuned."""
    kernels = [load.kernel for load in flight.loads if load.force and not load.keeps]
    rate = np.exp(np.mean([np.log(k.rate[k.std.argmax()]) for k in kernels] or [0.0]))
    return Bending(flight.constraints.bends, float(rate))


def as_far(likely: Callable[[Array], float], best: Array, highest: float) -> Array:
    """The maximum at `best` (6,) with bending so large that it is half a unit less likely: a standard error.

    Where no bending is likelier than any, that is as far as noise hides it.
    """

    def lower(by: float) -> float:
        return likely(best + by * np.eye(6)[SIZE_OF_BENDING]) - highest + 0.5

    far = next((by for by in np.log(2.0) * np.arange(1, DOUBLED) if lower(by) < 0), None)
    by = np.log(2.0) * DOUBLED if far is None else brentq(lower, far - np.log(2.0), far, xtol=ABOUT)
    return np.asarray(best + by * np.eye(6)[SIZE_OF_BENDING])
