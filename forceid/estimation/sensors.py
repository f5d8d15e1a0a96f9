"""Gyros and accelerometers of a recording: onto the flight, and into the priors of its loads.

Markers show a load through two integrals, sensors almost directly: what the markers leave of its prior to
guess, the likelihood of all channels together settles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.errors import DataError, EstimationError
from forceid.estimation.kinematics import ROUNDOFF, Kinematics
from forceid.kalman.engines import Engine
from forceid.kalman.flight import Flight, FlightState, Reference, linear_flight, smooth_flight
from forceid.kalman.flight_sensors import Sensors
from forceid.kalman.prior import LoadPrior
from forceid.motion.window import ORDER as DIFFERENCES
from forceid.motion.window import noise_variance
from forceid.records import Array, Body, Motion

FAMILIES = ("angular_velocity", "specific_force")
LONGEST = 400  # samples that tuning looks at: the middle of a longer record
STEP = 0.7  # of a logarithm: first step of the search
LEAK = 0.02  # of the load on its strongest axis, as little as a quiet one is ever taken to have
LEAST = 0.5  # of a log-likelihood: less is no gain
SWEEPS = 3
AMISS = 1.3  # mean squared innovation of a family of sensors, over its covariance


def with_sensors(flight: Flight, kin: Kinematics, body: Body, motion: Motion, settings: Settings) -> Flight:
    """The flight with the gyros and accelerometers of its recording; as it is where there are none.

    Noise is as stated, by the file or as noise_std.angular_velocity and noise_std.specific_force; else as
    high-order differences show it. Biases stay constant from a start as good as unknown, or with a standard
    deviation of noise_std.angular_velocity_bias (rad/s) and noise_std.specific_force_bias (m/s2).
    Raises DataError where nobody says where the sensors stand.
    """
    sensors = sensors_of(body, motion, settings, kin.inertia.center)
    return flight if sensors is None else replace(flight, sensors=sensors)


def fused(
    flight: Flight,
    priors: dict[str, LoadPrior],
    kin: Kinematics,
    body: Body,
    motion: Motion,
    settings: Settings,
    engine: Engine,
) -> tuple[Flight, dict[str, LoadPrior]]:
    """A flight with the sensors of its recording, and the priors of "force" and "moment" that both call for.

    As they were where there are no sensors, or where markers do not show the rotation.
    """
    flight = with_sensors(flight, kin, body, motion, settings) if kin.attitude else flight
    if flight.sensors is None:
        return flight, priors
    known = motion.noise_std | settings.noise_std
    stated = {name: name in known for name in FAMILIES}
    flight, force, moment = tune_together(flight, priors["force"], priors["moment"], engine, stated)
    return flight, priors | {"force": force, "moment": moment}


def sensor_reasons(flight: Flight, state: FlightState) -> tuple[str, ...]:
    """A sentence on the family of sensors that reads most of what the flight does not explain, if any."""
    if flight.sensors is None:
        return ()
    gyro = np.repeat([True, False], flight.sensors.readings.shape[1] // 2)[flight.sensors.used]
    level = {}
    for name, family in (("gyros", gyro), ("accelerometers", ~gyro)):
        white = state.sensor_innovation[:, family]
        level[name] = float(np.nanmean(white**2)) if np.isfinite(white).any() else 0.0
    worst = max(level, key=level.__getitem__)
    if level[worst] < AMISS:
        return ()
    return (
        f"the innovations of the {worst} are {np.sqrt(level[worst]):.2f} times as large as predicted: they "
        "stand or point elsewhere than stated, their clock is off, or the body bends under them; "
        "claimed errors are too small",
    )


def sensors_of(body: Body, motion: Motion, settings: Settings, center: Array) -> Sensors | None:
    """Sensors of a recording about the mass center (3,) in reference axes; None where nothing is read."""
    read = {name: value for name in FAMILIES if (value := getattr(motion, name)) is not None}
    read = {name: value for name, value in read.items() if np.isfinite(value).any()}
    if not read:
        return None
    shape = next(iter(read.values())).shape
    gone = np.full(shape, np.nan)
    if "specific_force" in read and body.sensor_position is None:
        raise DataError("is missing", "/body/sensor_position", "add where each accelerometer stands")
    position = np.zeros(shape[1:]) if body.sensor_position is None else body.sensor_position - center
    rotation = np.tile(np.eye(3), (shape[1], 1, 1))
    if body.sensor_rotation is not None:
        rotation = Rotation.from_quat(body.sensor_rotation).as_matrix()
    stated = motion.noise_std | settings.noise_std
    noise, bias = np.ones((2, shape[1])), np.ones((2, shape[1]))
    for i, name in enumerate(FAMILIES):
        if name not in read:
            continue
        largest = float(np.nanmax(np.abs(read[name])))
        bias[i] = stated.get(f"{name}_bias", max(largest, ROUNDOFF))
        for s in range(shape[1]):
            level = stated.get(name) or sensor_noise(motion.time, read[name][:, s])
            noise[i, s] = max(level, ROUNDOFF * largest)
    gyro, accelerometer = (read.get(name, gone) for name in FAMILIES)
    return Sensors(gyro, accelerometer, position, rotation, noise, bias)


def sensor_noise(time: Array, z: Array) -> float:
    """Standard deviation that high-order differences of a sensor z (time, 3) show, over the axes it has.

    Of one that reads too little to tell, its own spread: next to nothing of it is believed.
    """
    z = z[:, np.isfinite(z).any(0)]
    if np.isfinite(z).all(1).sum() < 2 * DIFFERENCES:
        return float(np.nanstd(z)) if np.isfinite(z).any() else 1.0
    return float(np.sqrt(noise_variance(time, z)))


def tune_together(
    flight: Flight, force: LoadPrior, moment: LoadPrior, engine: Engine, stated: dict[str, bool] | None = None
) -> tuple[Flight, LoadPrior, LoadPrior]:
    """Priors of force and moment by the likelihood of markers and sensors together, and the sensors' noise.

    force, moment: as the markers alone have them, which misses axes by more than sensors forgive: first each
    load is taken to be the same along every axis, then along the axes of what was found, if the evidence is
    for it; its size and its rate move. Of a family of sensors whose noise is not `stated` (by name) its size
    moves. The likelihood is that of the flight linearized about its smoothed path, which is laid anew in
    between. Returns what it was given where the flight has no sensors.
    """
    if flight.sensors is None:
        return flight, force, moment
    free = [i for i, name in enumerate(FAMILIES) if not (stated or {}).get(name, False)]
    free = [i for i in free if np.isfinite(getattr(flight.sensors, FAMILIES[i])).any()]

    def searched(
        flight: Flight, force: LoadPrior, moment: LoadPrior, state: FlightState
    ) -> tuple[Flight, LoadPrior, LoadPrior]:
        assert state.reference is not None
        middle = max((len(flight.time) - LONGEST) // 2, 0)
        stretch = slice(middle, middle + LONGEST)
        about = stretched_reference(state.reference, stretch)
        value = partial(evidence, stretched(flight, stretch), force, moment, about, engine, free)
        best = climb(value, np.zeros(4 + len(free)))
        return louder(flight, free, best[4:]), moved(force, best[:2]), moved(moment, best[2:4])

    force, moment = round_prior(force), round_prior(moment)
    state = smooth_flight(flight, force, moment, engine)
    flight, force, moment = searched(flight, force, moment, state)
    state = smooth_flight(flight, force, moment, engine)
    for load in ("force", "moment"):  # one after the other: one may be uneven, and the other not
        tried = {"force": force, "moment": moment}
        tried[load] = along_own_axes(tried[load], getattr(state, load))
        uneven = smooth_flight(flight, tried["force"], tried["moment"], engine)
        if uneven.log_likelihood > state.log_likelihood:
            state, force, moment = uneven, tried["force"], tried["moment"]
    return searched(flight, force, moment, state)


def evidence(
    flight: Flight,
    force: LoadPrior,
    moment: LoadPrior,
    about: Reference,
    engine: Engine,
    free: list[int],
    by: Array,
) -> float:
    """Log-likelihood of a flight linearized about a reference, its priors and the noise of sensors moved."""
    priors = moved(force, by[:2]), moved(moment, by[2:4])
    model, z = linear_flight(louder(flight, free, by[4:]), *priors, about)
    try:
        return float(engine.log_likelihood(model, z))
    except EstimationError:  # numbers so far off that a covariance loses its sign
        return -np.inf


def round_prior(prior: LoadPrior) -> LoadPrior:
    """A prior that is along every axis what it is along its strongest."""
    tuned = prior.tuned
    strongest = int(tuned.std.argmax())
    std, rate = (np.full(3, a[strongest]) for a in (tuned.std, tuned.rate))
    return replace(prior, tuned=replace(tuned, std=std, rate=rate))


def along_own_axes(prior: LoadPrior, load: Array) -> LoadPrior:
    """A prior that is the same along every axis, along those of a load (time, 3) and in their proportions."""
    square, axes = np.linalg.eigh(np.cov(load.T))
    share = np.sqrt(np.maximum(square / square[-1], LEAK**2))
    axes = axes * np.sign(np.linalg.det(axes))
    return replace(prior, axes=axes, tuned=replace(prior.tuned, std=prior.tuned.std * share))


def moved(prior: LoadPrior, by: Array) -> LoadPrior:
    """A prior whose level at high frequency is e^by[0] times itself, and its rate e^by[1]."""
    tuned = prior.tuned
    std = tuned.std * np.exp(by[0] - (tuned.order - 0.5) * by[1])
    return replace(prior, tuned=replace(tuned, std=std, rate=tuned.rate * np.exp(by[1])))


def louder(flight: Flight, family: list[int], by: Array) -> Flight:
    """A flight whose families of sensors have e^by times the noise."""
    assert flight.sensors is not None
    noise = flight.sensors.noise_std.copy()
    for i, b in zip(family, by, strict=True):
        noise[i] *= np.exp(b)
    return replace(flight, sensors=replace(flight.sensors, noise_std=noise))


def stretched(flight: Flight, s: slice) -> Flight:
    """A stretch of a flight."""
    assert flight.sensors is not None
    parts = {
        name: getattr(flight, name)[s]
        for name in ("time", "center", "rotation", "pose_cov", "inertia", "h")
    }  # fmt: skip
    read = {name: getattr(flight.sensors, name)[s] for name in FAMILIES}
    # a family that does not read in the stretch reads nothing there, and its bias has no state
    return replace(flight, **parts, sensors=replace(flight.sensors, **read))


def stretched_reference(reference: Reference, s: slice) -> Reference:
    """The part of a reference in a stretch of the flight."""
    force = None if reference.force is None else reference.force[s]
    return replace(reference, rotation=reference.rotation[s], chain=reference.chain[s], force=force)


def climb(value: Callable[[Array], float], p: Array) -> Array:
    """A maximum of value(p) near p (k,): along each coordinate to the top of a parabola, and again.

    >>> climb(lambda p: -float((p[0] - 0.5) ** 2 + (p[1] + 0.2) ** 2), np.zeros(2)).round(3)
    array([ 0.5, -0.2])
    """
    best, step = value(p), np.full(len(p), STEP)
    for _ in range(SWEEPS):
        began = best
        for i in range(len(p)):
            at = [p + s * step[i] * np.eye(len(p))[i] for s in (-1, 1)]
            low, high = (value(q) for q in at)
            bend, slope = low + high - 2 * best, 0.5 * (high - low)
            to = -slope / bend if bend < 0 else np.sign(slope) * 2.0
            to = float(np.clip(to, -2.0, 2.0)) if np.isfinite(to) else 0.0
            trial = p + to * step[i] * np.eye(len(p))[i]
            tried = [(best, p), (low, at[0]), (high, at[1]), (value(trial), trial)]
            best, p = max(tried, key=lambda pair: pair[0])
            step[i] = np.clip(abs(to) * step[i], 0.1, 2 * STEP)
        if best - began < LEAST:
            break
    return p
