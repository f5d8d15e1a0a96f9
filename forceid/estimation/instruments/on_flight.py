"""Sensors of a recording: onto the flight, and into the priors of its loads.

Markers show a load through two integrals, sensors almost directly: what the markers leave of its prior to
guess, the likelihood of all channels together settles.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.errors import DataError, EstimationError
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.markers import ROUNDOFF
from forceid.estimation.instruments.clocks import align_clocks
from forceid.estimation.loads.fused_tuning import tune_together
from forceid.estimation.loads.rough_look import rough_priors
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import FAST
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.flight.instruments import ACCELEROMETER, INSTRUMENTS
from forceid.flight.instruments.dead_reckoning import rate_read
from forceid.flight.instruments.sensors import Sensors
from forceid.flight.model import Flight
from forceid.flight.path.reference import COARSE
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.memory import memory_limit
from forceid.motion import ORDER as DIFFERENCES
from forceid.motion import exp, largest_turn, noise_variance
from forceid.principal import summation_operator
from forceid.records import Array, Body, Finding, Motion
from forceid.significance import SIGMAS, TENTH

AT_NODE = 1e-3  # of the size of the body: nearer than that, a point stands on its node
CHANNELS = 120  # twenty sensors of six axes: sixty frames take a quarter of a minute, by the cube of these
FADING = 2  # the say of a node falls with its distance to the power of four


def with_sensors(flight: Flight, kin: Kinematics, body: Body, motion: Motion, settings: Settings) -> Flight:
    """The flight with the sensors of its recording; as it is where there are none.

    Of an instrument that reads /motion/NAME, noise is as stated, by the file or as noise_std.NAME; else as
    high-order differences show it. Biases stay constant from a start as good as unknown, or with a standard
    deviation of noise_std.NAME_bias; they wander by noise_std.NAME_walk (per root of a second) where stated.
    Its clock is off by about noise_std.NAME_clock (s), zero for clocks that agree; by a frame where nothing
    is stated. Raises DataError where nobody says where an accelerometer stands.
    """
    sensors = sensors_of(body, motion, settings, kin.inertia.center)
    if sensors is None:
        return flight
    if body.sensor_position is None or body.position is None:
        return replace(flight, sensors=sensors)
    return on_shape(replace(flight, sensors=sensors), kin, body.position - kin.inertia.center)


def on_shape(flight: Flight, kin: Kinematics, position: Array) -> Flight:
    """The flight with its sensors where the mean shape takes them from the reference shape, and its modes on.

    position (node, 3) m about the mass center: the reference shape.
    """
    sensors, modes = flight.sensors, flight.modes
    assert sensors is not None
    if not len(position) or not (kin.shapes.size or (kin.shape != position).any()):
        return flight
    shapes = np.concatenate([(kin.shape - position)[None], kin.shapes])
    moved, tilt = mounted(position, shapes, sensors.position)
    rotation = exp(tilt[:, 0]) @ sensors.rotation
    sensors = replace(sensors, position=sensors.position + moved[:, 0], rotation=rotation)
    if modes is not None:
        own = moved[:, 1:], tilt[:, 1:]
        if kin.hidden is not None:
            more = kin.hidden.carried(sensors.position)
            own = np.concatenate([own[0], more[0]], 1), np.concatenate([own[1], more[1]], 1)
        modes = replace(modes, mounting=own)
    return replace(flight, sensors=sensors, modes=modes)


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

    As they were where markers do not show the rotation, or where there are no sensors and the body turns by
    less between frames than makes the first moment a poor channel.
    """
    if kin.attitude and kin.inertia.line is None:
        flight = with_sensors(flight, kin, body, motion, settings)
    turn = turn_a_frame(flight)
    if not kin.attitude or (flight.sensors is None and turn < 2 * COARSE):
        return flight, priors
    force, moment = priors["force"], priors["moment"]
    if turn < FAST:
        flight = align_clocks(flight, force, moment, engine)
    elif rate_read(flight.time, flight.rotation, flight.sensors) is not None:
        moment = rough_priors(flight)[1]  # frames alone may have the wrong sense
    known, alone = set(motion.noise_std | settings.noise_std), kin.apart and flight.sensors is None
    try:
        flight, tuned, moment = tune_together(flight, None if alone else force, moment, engine, known)
    except EstimationError:
        if flight.sensors is not None:
            raise
        return flight, priors  # read in the wrong sense, perhaps: what the first moment says has to do
    return flight, priors | {"force": tuned or force, "moment": moment}


def turn_a_frame(flight: Flight) -> float:
    """Largest turn (rad) from one frame seen to the next: as sensors read it, or as both frames show."""
    rate = rate_read(flight.time, flight.rotation, flight.sensors)
    seen = np.isfinite(flight.rotation).all((1, 2))
    if rate is None or seen.sum() < 2:
        return largest_turn(flight.time, flight.rotation)
    return float(np.linalg.norm(rate, axis=1).max() * np.median(np.diff(flight.time[seen])))


def judge_sensors(flight: Flight, state: FlightState, stated: Set[str] = frozenset()) -> tuple[Finding, ...]:
    """Clocks that are off, biases that wander though none is `stated` to (by the name of its noise_std), and
    the instrument that reads most of what nothing explains.
    """
    if flight.sensors is None:
        return ()
    found, level, sensors = [], {}, flight.sensors
    step = float(np.median(np.diff(flight.time)))
    late, late_std = sensors.clock(state.steady), sensors.clock(state.steady_std)
    for i, one in enumerate(sensors.instruments):
        white, name = state.sensor_innovation[:, sensors.kind == i], one.plural
        level[name] = float(np.nanmean(white**2)) if np.isfinite(white).any() else 0.0
        off, error = float(sensors.shifted[i] + late[i]), float(late_std[i])
        if i in sensors.clocked and abs(off) > max(SIGMAS * error, TENTH * step):
            sense = "later" if off > 0 else "earlier"
            ms, error_ms = 1e3 * abs(off), 1e3 * error
            found.append(note("clock-off", sensors=name, offset_ms=ms, sense=sense, error_ms=error_ms))
        if sensors.bias_walk[i] and f"{one.name}_walk" not in stated:
            walk, unit = sensors.bias_walk[i], one.unit
            found.append(note("bias-wanders", sensors=name, walk=walk, unit=unit, variable=one.name))
        bias, doubt = (a[sensors.kind == i] for a in (state.bias, state.bias_std))
        most = float(np.max(np.abs(bias) - SIGMAS * doubt, initial=0.0))
        if one.tells and most > one.offset and f"{one.name}_bias" not in stated:
            unit, variable = one.unit, one.name
            found.append(
                note("bias-beyond", sensors=name, bias=most, most=one.offset, unit=unit, variable=variable)
            )
    worst = max(level, key=level.__getitem__)
    if level[worst] > NIS_BAND[1]:
        found.append(note("sensor-innovations", sensors=worst, times=np.sqrt(level[worst])))
    return tuple(found)


def named_sensors(flight: Flight, state: FlightState) -> dict[str, float]:
    """What was found of the clocks (s) and of biases that wander, as numbers with names."""
    found = {}
    if (sensors := flight.sensors) is None:
        return {}
    for i in sensors.clocked:
        name = f"clock_offset_{sensors.instruments[i].singular}"
        found[name] = float(sensors.shifted[i] + sensors.clock(state.steady)[i])
        found[f"{name}_std"] = float(sensors.clock(state.steady_std)[i])
    for i in np.flatnonzero(sensors.bias_walk):
        found[f"bias_walk_{sensors.instruments[i].singular}"] = float(sensors.bias_walk[i])
    for k, name in enumerate(name for one in sensors.instruments for name in one.steady):
        found |= {name: float(state.steady[k]), f"{name}_std": float(state.steady_std[k])}
    return found


def sensors_of(body: Body, motion: Motion, settings: Settings, center: Array) -> Sensors | None:
    """Sensors of a recording about the mass center (3,) in reference axes; None where nothing is read."""
    kinds = tuple(one for one in INSTRUMENTS if np.isfinite(motion.readings.get(one.name, np.nan)).any())
    if not kinds:
        return None
    read = np.stack([motion.readings[one.name] for one in kinds], 1)
    check_work(read[0].size, len(read), kinds[0].name)
    if ACCELEROMETER in kinds and body.sensor_position is None:
        raise DataError("is missing", "/body/sensor_position", "add where each accelerometer stands")
    count = read.shape[2]
    position = np.zeros((count, 3)) if body.sensor_position is None else body.sensor_position - center
    rotation = np.tile(np.eye(3), (count, 1, 1))
    if body.sensor_rotation is not None:
        rotation = Rotation.from_quat(body.sensor_rotation).as_matrix()
    stated, frame = motion.noise_std | settings.noise_std, marker_step(motion)
    noise, bias, largest = np.ones((len(kinds), count)), np.ones((len(kinds), count)), np.ones(len(kinds))
    for i, one in enumerate(kinds):
        largest[i] = float(np.nanmax(np.abs(read[:, i])))
        bias[i] = stated.get(f"{one.name}_bias", max(largest[i], ROUNDOFF))
        for s in range(count):
            level = stated.get(one.name) or sensor_noise(motion.time, read[:, i, s])
            noise[i, s] = max(level, ROUNDOFF * largest[i])
    walk = np.array([stated.get(f"{one.name}_walk", 0.0) for one in kinds])
    clock = np.array([stated.get(f"{one.name}_clock", frame) for one in kinds])
    return Sensors(kinds, read, position, rotation, noise, bias, walk, clock, number_std=largest)


def check_work(channels: int, frames: int, name: str) -> None:
    """A DataError where so many channels would take more time, or memory, than there is."""
    need, room = 8.0 * frames * channels**2, float(memory_limit())
    if channels <= CHANNELS and need <= room:
        return
    what = f"is read by {channels} channels of sensors in {frames} frames, which need {need / 1e9:.3g} GB"
    limit = f"limit {room / 1e9:.3g} GB and {CHANNELS} channels"
    step = "average sensors that stand together, or leave out frames"
    raise DataError(f"{what}, {limit}", f"/motion/{name}", step)


def marker_step(motion: Motion) -> float:
    """Usual time s between frames in which a marker or a mean motion is seen; of the clock where none is."""
    seen = motion.position if motion.position is not None else motion.center
    time = motion.time
    if seen is not None:
        time = time[np.isfinite(seen).reshape(len(time), -1).any(1)]
    return float(np.median(np.diff(time))) if len(time) > 1 else float(np.ptp(motion.time))


def sensor_noise(time: Array, z: Array) -> float:
    """Standard deviation that high-order differences of a sensor z (time, axis) show, over the axes it has.

    Of one that reads too little to tell, its own spread: next to nothing of it is believed.
    """
    z = z[:, np.isfinite(z).any(0)]
    if np.isfinite(z).all(1).sum() < 2 * DIFFERENCES:
        return float(np.nanstd(z)) if np.isfinite(z).any() else 1.0
    return float(np.sqrt(noise_variance(time, z)))


def mounted(position: Array, shapes: Array, points: Array) -> tuple[Array, Array]:
    """Displacement and tilt (point, mode, 3) of points for a unit of each of the shapes (mode, node, 3).

    position (node, 3) and points (point, 3) m, reference axes; tilt in rad per unit of amplitude. Those of
    the rigid motion that fits the nodes about a point best, the near ones weighed most: what is screwed on
    there moves so. A point on a node moves as the node does. Source: principal equations 4d.
    """
    size = float(np.linalg.norm(position - position.mean(0), axis=1).max())
    flat = shapes.reshape(len(shapes), -1).T
    found = []
    for point in points:
        distance = ((position - point) ** 2).sum(1) + (AT_NODE * size) ** 2
        root = np.repeat((distance.min() / distance) ** (FADING / 2), 3)[:, None]
        found.append(
            np.linalg.lstsq(root * summation_operator(position, point), root * flat, rcond=1e-9)[0].T
        )
    both = np.array(found).reshape(len(points), len(shapes), 6)
    return both[..., :3], both[..., 3:]
