"""Priors of force and moment, and the noise of sensors, by the likelihood of a whole flight.

Markers show a load through two integrals, sensors almost directly: what the markers leave of its prior to
guess, the likelihood of all channels together settles. The likelihood is that of the flight linearized about
its smoothed path. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from scipy.linalg import block_diag

from forceid.errors import EstimationError
from forceid.estimation.loads.ascent import ascended, spread_about
from forceid.estimation.loads.lines import ROUNDS
from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.flight.model import Flight
from forceid.flight.path.linear import Read, flexed, linear_flight, read_of, seen_part
from forceid.flight.path.reference import Reference, rotation_model, translation
from forceid.flight.path.settling import settled
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.tuning import LEAK
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.significance import NUMBER, PATIENCE

MODELS_HELD = 3  # of each load, at hand: that of a point, and of steps from it along level and rate
WANDER = 3.0 * 2.0 ** np.arange(12)  # over a record, in units of the noise of its mean


def tune_together(
    flight: Flight,
    force: LoadPrior | None,
    moment: LoadPrior,
    engine: Engine,
    stated: Set[str] = frozenset(),
    first: Reference | None = None,
    even: bool = False,
) -> tuple[Flight, LoadPrior | None, LoadPrior]:
    """Priors of force and moment by the likelihood of markers and sensors together, and the sensors' noise.

    force, moment: as the markers alone have them, which misses axes by more than sensors forgive: first each
    load is taken to be the same along every axis, then along the axes of what was found, if the evidence is
    for it; its size and its rate move. Of a kind of sensor whose noise is not `stated` (by name) its size
    moves; whose biases are not, they wander where that is far likelier. The path is laid anew in between,
    from a `first` one along the axes of both loads, if one is known. even: loads stay alike along all axes;
    force: None for the rotation by itself.
    """
    kinds = () if flight.sensors is None else flight.sensors.instruments
    free = [] if flight.sensors is None else [int(i) for i in np.unique(flight.sensors.kind)]
    loud = [i for i in free if kinds[i].name not in stated]

    spread: Array | None = None

    def searched(about: Reference) -> tuple[Flight, LoadPrior | None, LoadPrior]:
        nonlocal spread
        if force is None:
            half = partial(of_half, flight, moment, about, engine)
            by, spread = ascended(half, np.zeros(2), spread_about(half, 2) if spread is None else spread)
            return flight, force, moment.moved(by)
        part = middle(len(flight.time), FLIGHT_SAMPLES)
        cut, near = flight.part(part), about.part(part)
        push, bent = force, flexed(cut, near)  # a step along one load leaves the model of the other as it was
        read = None if cut.sensors is None else read_of(cut, push, moment, near)

        @lru_cache(MODELS_HELD)
        def moving(*by: float) -> StateSpace:
            return translation(bent, push.moved(np.array(by)), near.rotation)

        @lru_cache(MODELS_HELD)
        def turning(*by: float) -> StateSpace:
            return rotation_model(bent, moment.moved(np.array(by)), near)

        over: StateSpace | None = None

        def value(by: Array) -> float:
            nonlocal over
            halves = moving(*by[:2].tolist()), turning(*by[2:4].tolist())
            priors, tried = (push.moved(by[:2]), moment.moved(by[2:4])), louder(cut, loud, by[4:])
            over, z = linear_flight(tried, *priors, near, halves, read, over)
            return likelihood_of(over, z, engine)

        start = np.zeros(4 + len(loud))
        apiece = [partial(of_half, cut, push, None, engine), partial(of_half, cut, moment, near, engine)]
        if spread is None:  # that of each load by itself costs little; a reading tells of its noise
            each = (spread_about(half, 2) for half in apiece)
            spread = block_diag(*each, np.eye(len(loud)) / len(cut.time))
        if flight.sensors is not None or flight.modes is not None:
            best, spread = ascended(value, start, spread)
        else:  # the likelihood of all is nearly that of each
            known = spread[:2, :2], spread[2:4, 2:4]
            tops = [ascended(half, start[:2], own) for half, own in zip(apiece, known, strict=True)]
            start = np.concatenate([top for top, _ in tops])
            best, spread = ascended(value, start, block_diag(*(own for _, own in tops)), sure=True)
        return louder(flight, loud, best[4:]), push.moved(best[:2]), moment.moved(best[2:4])

    force, moment = None if force is None else force.alike(), moment.alike()
    laid = partial(settled, engine=engine)
    _, _, _, about = laid(flight, force, moment, first=first)
    flight, force, moment = searched(about)
    if force is not None:
        wander = [i for i in free if f"{kinds[i].name}_walk" not in stated]
        flight = wandering(wander, flight, force, moment, about, engine)
    path, _, _, about = laid(flight, force, moment, first=about)
    level = path.log_likelihood
    # one after the other: one may be uneven, and the other not
    for load in () if even else ("moment",) if force is None else ("force", "moment"):
        pair, turned = with_own_axes(load, force, moment, about)
        path, _, _, reached = laid(flight, *pair, first=turned)
        if (likely := path.log_likelihood) > level + 5 * NUMBER:  # axes and proportions
            level, about, (force, moment) = likely, reached, pair
    for _ in range(ROUNDS):
        flight, force, moment = searched(about)
        path, _, _, about = laid(flight, force, moment, first=about)
        before, level = level, path.log_likelihood
        if not level > before + 5 * NUMBER:
            break
    return flight, force, moment


def wandering(
    kinds: list[int], flight: Flight, force: LoadPrior, moment: LoadPrior, about: Reference, engine: Engine
) -> Flight:
    """A flight whose sensors of these kinds have biases that wander, where it is far likelier than not."""
    if not kinds:
        return flight
    bent = flexed(flight, about)
    halves = translation(bent, force, about.rotation), rotation_model(bent, moment, about)
    read = read_of(flight, force, moment, about)

    def level(flight: Flight) -> float:
        return flight_likelihood(flight, force, moment, about, engine, halves, read)

    stays = level(flight)
    for i in kinds:
        sensors = flight.sensors
        assert sensors is not None
        unit = float(sensors.noise_std[i].min()) / np.sqrt(len(flight.time) * np.ptp(flight.time))
        best, likely = (stays + PATIENCE, flight), stays
        for size in WANDER:
            walk = sensors.bias_walk.copy()
            walk[i] = size * unit
            tried = replace(flight, sensors=replace(sensors, bias_walk=walk))
            likely, last = level(tried), likely
            if likely < last:
                break
            if likely > best[0]:
                best = (likely, tried)
        if best[1] is not flight:
            stays, flight = best
    return flight


def with_own_axes(
    load: str, force: LoadPrior | None, moment: LoadPrior, about: Reference
) -> tuple[tuple[LoadPrior | None, LoadPrior], Reference]:
    """Both priors, that of one load along the axes of what a reference holds of it; the reference on them."""
    prior, chain = (force, about.force) if load == "force" else (moment, about.chain)
    assert prior is not None
    assert chain is not None
    found = prior.read(chain)[1]
    if prior.body_axes is not None:  # its axes turn with the body, its states do not
        along = along_own_axes(prior, np.einsum("tba,tb->ta", about.rotation, found))
        along = replace(along, axes=prior.axes, body_axes=along.axes)
        return ((along, moment) if load == "force" else (force, along)), about
    along = along_own_axes(prior, found)
    if load == "force":
        return (along, moment), replace(about, force=along.restated(chain, prior))
    return (force, along), replace(about, chain=along.restated(about.chain, moment), moment=along)


def flight_likelihood(
    flight: Flight,
    force: LoadPrior,
    moment: LoadPrior,
    about: Reference,
    engine: Engine,
    halves: tuple[StateSpace, StateSpace] | None = None,
    read: Read | None = None,
) -> float:
    """Log-likelihood of a flight linearized about a reference; halves, read: as of `linear_flight`."""
    return likelihood_of(*linear_flight(flight, force, moment, about, halves, read), engine)


def likelihood_of(model: StateSpace, z: Array, engine: Engine) -> float:
    """Log-likelihood of a model, none where numbers are so far off that a covariance loses its sign."""
    try:
        return float(engine.log_likelihood(model, z))
    except EstimationError:
        return -np.inf


def of_half(flight: Flight, prior: LoadPrior, about: Reference | None, engine: Engine, by: Array) -> float:
    """Log-likelihood of the rotation by itself, linearized about a reference, its prior moved; None: of the
    mass center.
    """
    return likelihood_of(*seen_part(flight, prior.moved(by), about), engine)


def along_own_axes(prior: LoadPrior, load: Array) -> LoadPrior:
    """A prior that is the same along every axis, along those of a load (time, 3) and in their proportions."""
    square, axes = np.linalg.eigh(np.cov(load.T))
    share = np.sqrt(np.maximum(square / square[-1], (2 * LEAK) ** 2))
    axes = axes * np.sign(np.linalg.det(axes))
    return replace(prior.with_kernel(prior.kernel.scaled(share)), axes=axes)


def louder(flight: Flight, kinds: list[int], by: Array) -> Flight:
    """A flight whose kinds of sensors have e^by times the noise."""
    if flight.sensors is None:
        return flight
    noise = flight.sensors.noise_std.copy()
    for i, b in zip(kinds, by, strict=True):
        noise[i] *= np.exp(b)
    return replace(flight, sensors=replace(flight.sensors, noise_std=noise))
