"""A rigid body that carries gyros and accelerometers through a free flight under a swinging force and moment.

The loads are sums of sines of time, world axes, so that both are known in closed form at any instant. The
sensors read by the laws of Newton and Euler in body axes, and then what makes them sensors is added: white
noise, a bias that stays or wanders, a clock that is late, and their own rate on the clock of the recording,
NaN between their samples.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.mechanics import KnownFlight
from forceid.scenes.rigid import RigidState, fly_rigid, rigid_positions
from forceid.sections import Section


class Sine(Section):
    """amplitude N or N m along world axes, frequency Hz, phase rad of one sine."""

    amplitude: Vector
    frequency: float = Field(gt=0.0)
    phase: float = 0.0


class Parameters(Section):
    """position m: markers, reference axes, about the mass center. total_mass kg, inertia kg m2 (3 rows).
    force N and moment N m: sums of sines. At t = 0: center m, velocity m/s, turn rad (rotation vector body to
    world), spin rad/s in body axes. gravity m/s2.

    Sensors: sensor_position m and sensor_turn rad (rotation vector sensor to body), one each. gyro_noise
    rad/s and accelerometer_noise m/s2: white, per component; gyro_bias and accelerometer_bias: of every
    sensor, sensor axes; gyro_walk rad/s and accelerometer_walk m/s2 per root of a second: by which they
    wander; gyro_clock and accelerometer_clock s: what is stamped t was read so much later, and nothing before
    the flight; sensor_every, marker_every: read at each so many samples of the clock; markers: whether there
    are any.
    """

    position: tuple[Vector, ...] = (
        (0.12, 0.0, 0.0),
        (-0.10, 0.03, 0.01),
        (0.0, 0.09, -0.02),
        (0.02, -0.08, 0.02),
        (0.01, 0.0, 0.06),
    )
    total_mass: float = Field(default=0.3, gt=0.0)
    inertia: tuple[Vector, Vector, Vector] = ((6e-4, 2e-5, 0.0), (2e-5, 1.1e-3, -3e-5), (0.0, -3e-5, 1.5e-3))
    force: tuple[Sine, ...] = (
        Sine(amplitude=(1.0, 0.4, -0.6), frequency=1.3),
        Sine(amplitude=(-0.3, 0.5, 0.4), frequency=2.3, phase=1.0),
    )
    moment: tuple[Sine, ...] = (
        Sine(amplitude=(0.03, -0.02, 0.015), frequency=1.7, phase=0.4),
        Sine(amplitude=(-0.01, 0.02, 0.02), frequency=5.3),
    )
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.0)
    velocity: Vector = (1.0, 0.3, 4.0)
    turn: Vector = (0.3, -0.2, 0.5)
    spin: Vector = (1.0, 2.0, 25.0)
    sensor_position: tuple[Vector, ...] = ((0.04, 0.01, 0.01), (-0.03, 0.02, -0.02))
    sensor_turn: tuple[Vector, ...] = ((0.0, 0.0, 0.0), (0.2, 1.4, -0.3))
    gyro_noise: float = Field(default=0.02, ge=0.0)
    accelerometer_noise: float = Field(default=0.1, ge=0.0)
    gyro_bias: tuple[Vector, ...] = ((0.05, -0.03, 0.02), (-0.02, 0.06, 0.01))
    accelerometer_bias: tuple[Vector, ...] = ((0.3, -0.2, 0.1), (-0.1, 0.25, 0.2))
    gyro_walk: float = Field(default=0.0, ge=0.0)
    accelerometer_walk: float = Field(default=0.0, ge=0.0)
    gyro_clock: float = 0.0
    accelerometer_clock: float = 0.0
    sensor_every: int = Field(default=1, ge=1)
    marker_every: int = Field(default=1, ge=1)
    markers: bool = True

    @model_validator(mode="after")
    def _one_of_each_a_sensor(self) -> Parameters:
        for name in ("sensor_turn", "gyro_bias", "accelerometer_bias"):
            if len(getattr(self, name)) != len(self.sensor_position):
                raise ValueError(f"{len(getattr(self, name))} {name} for {len(self.sensor_position)} sensors")
        return self


def instrumented_body(parameters: Parameters) -> Body:
    """The body as a motion file describes it: known as a whole, markers without mass, sensors mounted."""
    p = parameters
    return Body(
        node=tuple(f"marker_{i + 1}" for i in range(len(p.position))),
        position=np.array(p.position),
        total_mass=p.total_mass,
        mass_center=np.zeros(3),
        inertia=np.array(p.inertia),
        sensor_position=np.array(p.sensor_position),
        sensor_rotation=Rotation.from_rotvec(p.sensor_turn).as_quat(canonical=True),
    )


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The flight at `time` (time,) s."""
    p = parameters
    R0 = Rotation.from_rotvec(p.turn).as_matrix()
    start = RigidState(np.array(p.center), np.array(p.velocity), R0, R0 @ p.spin)

    def wrench(t: float, now: RigidState) -> tuple[Array, Array]:
        return swung(p.force, t), swung(p.moment, t)

    truth = fly_rigid(p.total_mass, np.array(p.inertia), wrench, start, np.array(p.gravity), time)
    return KnownFlight(
        instrumented_body(p), rigid_positions(truth, np.array(p.position)), np.array(p.gravity), truth
    )


def swung(swings: tuple[Sine, ...], t: float) -> Array:
    """Sum of sines (3,) at time t."""
    total = np.zeros(3)
    for s in swings:
        total += np.array(s.amplitude) * np.sin(2 * np.pi * s.frequency * t + s.phase)
    return total


def readings(parameters: Parameters, truth: dict[str, Array]) -> tuple[Array, Array]:
    """Angular velocity rad/s and specific force m/s2 (time, sensor, 3), sensor axes, without any error."""
    p, J = parameters, np.array(parameters.inertia)
    to_body = Rotation.from_quat(truth["orientation"]).inv()
    w, T, f = (to_body.apply(truth[name]) for name in ("angular_velocity", "moment", "force"))
    w_dot = np.linalg.solve(J, (T - np.cross(w, w @ J))[..., None])[..., 0]
    gyro, accelerometer = [], []
    for r, turn in zip(np.array(p.sensor_position), p.sensor_turn, strict=True):
        into_sensor = Rotation.from_rotvec(turn).inv()
        gyro.append(into_sensor.apply(w))
        at = f / p.total_mass + np.cross(w_dot, r) + np.cross(w, np.cross(w, r))
        accelerometer.append(into_sensor.apply(at))
    return np.stack(gyro, 1), np.stack(accelerometer, 1)


def sensor_channels(
    parameters: Parameters, seen: dict[str, Array], truth: dict[str, Array], rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, float]]:
    """The channels of the motion file: those already seen, thinned or taken away, and those of the sensors.

    Also the standard deviations of the sensors' noise, by variable. truth: with its `time`.
    """
    p, sample = parameters, np.arange(len(truth["time"]))
    if not p.markers:
        seen = {}
    for name, values in seen.items():
        rare = (sample % p.marker_every > 0).reshape(-1, *[1] * (values.ndim - 1))
        seen = seen | {name: np.where(rare, np.nan, values)}
    std = {"angular_velocity": p.gyro_noise, "specific_force": p.accelerometer_noise}
    errors = (
        (p.gyro_bias, p.gyro_walk, p.gyro_clock),
        (p.accelerometer_bias, p.accelerometer_walk, p.accelerometer_clock),
    )
    for i, (name, (bias, walk, clock)) in enumerate(zip(std, errors, strict=True)):
        exact = late_readings(p, truth, clock)[i]
        read = exact + np.array(bias) + std[name] * rng.standard_normal(exact.shape)
        if walk > 0:
            step = np.sqrt(np.diff(truth["time"], prepend=truth["time"][0]))
            read += walk * np.cumsum(step[:, None, None] * rng.standard_normal(exact.shape), 0)
        read[sample % p.sensor_every > 0] = np.nan
        seen = seen | {name: read}
    return seen, std


def late_readings(parameters: Parameters, truth: dict[str, Array], clock: float) -> tuple[Array, Array]:
    """Readings as `readings` gives them, but taken `clock` s after the times of `truth`; NaN before t = 0."""
    if clock == 0.0:
        return readings(parameters, truth)
    taken = truth["time"] + clock
    flown = taken > 0
    then = fly(parameters, np.concatenate([[0.0], taken[flown]])).truth
    gyro, accelerometer = (np.full((len(taken), *a.shape[1:]), np.nan) for a in readings(parameters, then))
    gyro[flown], accelerometer[flown] = (a[1:] for a in readings(parameters, then))
    return gyro, accelerometer
