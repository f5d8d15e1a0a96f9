"""What was measured, of what body: shapes with the dimension names of the motion file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, get_origin, get_type_hints

import numpy as np

from forceid.records.arrays import Array

SENSOR = ("time", "sensor", "axis")  # dimensions of what a sensor of three axes reads
Reading = Array | None  # of sensors, where there are any


@dataclass(frozen=True)
class Variable:
    """What a variable of the contract is: dimensions in order, SI units, meaning."""

    dims: tuple[str, ...]
    units: str
    long_name: str


@dataclass(frozen=True)
class Body:
    """What moves: reference shape and mass, known node by node, as a matrix, or as a rigid whole.

    position (node, 3) m, reference axes; mass (node,) kg or mass_matrix (dof, dof) kg, node-major, or
    total_mass kg with mass_center (3,) m and inertia (3, 3) kg m2 about it. stiffness (dof, dof) N/m.
    mass_rate kg/s: by which all of these change alike from the first sample on.
    mode_shape (mode, node, 3) 1, mode_frequency (mode,) Hz, mode_damping (mode,) 1.
    internal_momentum (3,) kg m2/s, reference axes, of what turns inside the body and no marker shows; beside
    it rotors by name: rotor_axis (rotor, 3), reference axes, rotor_inertia (rotor,) kg m2 about these.
    sensor_position (sensor, 3) m, sensor_rotation (sensor, 4) quaternion, sensor to body.
    strain_shape (gauge, node, 3) 1/m: strain per nodal displacement, none for a rigid motion.
    material: its name and constants, by name, of a body that deforms affinely.
    Of a body of segments, whose nodes are mass points at fixed combinations of tracked markers: marker_weight
    (node, marker) of these, which add up to one; marker_segment (marker,): the node on whose segment a marker
    stays, -1 for none; marker_shape (marker, 3) m: where markers are in one pose of the body; joint_segment
    (joint, 2): the nodes of the segments that meet at a joint, which is at joint_shape (joint, 3) m in that
    pose; marker and joint: their names.
    center_off: how far, m, mass_center was told beside where its own motion showed it, and it is;
    inertia_off: the same of inertia, as part of it; 0 where that was tried, None where it was not.
    """

    node: tuple[str, ...] = ()
    position: Array | None = None
    mass: Array | None = None
    mass_matrix: Array | None = None
    total_mass: float | None = None
    mass_center: Array | None = None
    inertia: Array | None = None
    internal_momentum: Array | None = None
    rotor: tuple[str, ...] = ()
    rotor_axis: Array | None = None
    rotor_inertia: Array | None = None
    mass_rate: float | None = None
    stiffness: Array | None = None
    mode_shape: Array | None = None
    mode_frequency: Array | None = None
    mode_damping: Array | None = None
    sensor_position: Array | None = None
    sensor_rotation: Array | None = None
    strain_shape: Array | None = None
    material: Mapping[str, str | float | tuple[float, ...]] | None = None
    marker: tuple[str, ...] = ()
    marker_weight: Array | None = None
    marker_segment: Array | None = None
    marker_shape: Array | None = None
    joint: tuple[str, ...] = ()
    joint_segment: Array | None = None
    joint_shape: Array | None = None
    center_off: float | None = None
    inertia_off: float | None = None

    @property
    def shown(self) -> frozenset[str]:
        """Loads of what is not as it was told, but as the motion shows it: force of the center, moment of the
        inertia.
        """
        off = {"force": self.center_off, "moment": self.inertia_off}
        return frozenset(load for load, by in off.items() if by)

    @property
    def inside_stated(self) -> bool:
        """Whether it is stated what turns inside, be it nothing."""
        return self.internal_momentum is not None or self.rotor_axis is not None


@dataclass(frozen=True)
class KnownPart:
    """What known loads do along a motion, world axes: force (time, 3) N and moment (time, 3) N m.

    momentum (time, 3) kg m2/s: the integral of the moment from the first sample on; turned (time, 3) kg m2:
    that of the momentum.
    """

    force: Array
    moment: Array
    momentum: Array
    turned: Array

    def part(self, s: slice) -> KnownPart:
        """The same over some samples."""
        return KnownPart(self.force[s], self.moment[s], self.momentum[s], self.turned[s])

    def over_steps(self, step: Array) -> tuple[Array, Array]:
        """A moment b + c s (sample, 3) each that brings as much over every step; none at the last sample."""
        s = step[:, None]
        H = np.diff(self.momentum, axis=0)
        Y = np.diff(self.turned, axis=0) - s * self.momentum[:-1]
        b, c = 6 * Y / s**2 - 2 * H / s, 6 * H / s**2 - 12 * Y / s**3
        return np.concatenate([b, b[-1:]]), np.concatenate([c, c[-1:]])


@dataclass(frozen=True)
class Motion:
    """What was measured, NaN where it was not. World axes.

    time (time,) s; position (time, node, 3) m, with marker_position (time, marker, 3) m of the markers that
    nodes are combinations of, if any; or center (time, 3) m with orientation (time, 4)
    quaternion [x y z w] body to world; specific_force m/s2, angular_velocity rad/s and magnetic_field T
    (time, sensor, 3); strain (time, gauge) 1; wind (time, 3) m/s where the body is; rotor_speed
    (time, rotor) rad/s of the rotors of the body, against it; current_mass (time,) kg where it
    changes. gravity (3,) m/s2.
    noise_std: standard deviation of one
    component of one sample by variable name, where the file states it (rad for the orientation).
    bridged (time, node) m2: error variance of positions that were filled in, zero where they were measured,
    NaN where there is none; None for a motion as it was measured. known: what known loads do besides moving
    the mass center, which was taken out of the positions; None for none.
    """

    time: Array
    position: Array | None = None
    marker_position: Array | None = None
    center: Array | None = None
    orientation: Array | None = None
    specific_force: Annotated[Reading, Variable(SENSOR, "m s-2", "specific force, sensor axes")] = None
    angular_velocity: Annotated[Reading, Variable(SENSOR, "rad s-1", "angular velocity, sensor axes")] = None
    magnetic_field: Annotated[Reading, Variable(SENSOR, "T", "magnetic field, sensor axes")] = None
    strain: Annotated[Reading, Variable(("time", "gauge"), "1", "strain")] = None
    wind: Array | None = None
    rotor_speed: Array | None = None
    current_mass: Array | None = None
    gravity: Array = field(default_factory=lambda: np.zeros(3))
    noise_std: dict[str, float] = field(default_factory=dict)
    bridged: Array | None = None
    known: KnownPart | None = None

    @property
    def measured(self) -> Array | None:
        """Positions (time, node, 3) as they were measured, without those that were filled in."""
        if self.position is None or self.bridged is None:
            return self.position
        return np.where(self.bridged[..., None] > 0, np.nan, self.position)

    @property
    def readings(self) -> dict[str, Array]:
        """What sensors on the body read, by the variables that are there."""
        return {name: value for name in SENSED if (value := getattr(self, name)) is not None}


SENSED: dict[str, Variable] = {  # of the fields of Motion that sensors on the body fill
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(Motion, include_extras=True).items()
    if get_origin(hint) is Annotated
}


@dataclass(frozen=True)
class KnownLoads:
    """Loads that were measured, as /load_known of a motion file holds them, on a clock of their own.

    time (sample,) s; name (known_load,); force (sample, known_load, 3) N and moment (sample, known_load, 3)
    N m about `point` (sample, known_load, 3) m, world axes, with wrench_cov (sample, known_load, 6, 6). No
    force or no moment is zero; no point is left to the settings, the mass center where they name none.
    nodal_force (sample, node, 3) N, world axes: on every node of the body.
    """

    time: Array
    name: tuple[str, ...] = ()
    force: Array | None = None
    moment: Array | None = None
    wrench_cov: Array | None = None
    point: Array | None = None
    nodal_force: Array | None = None


@dataclass(frozen=True)
class Recording:
    """One motion file: body, motion, what is known of the truth, and where it came from.

    known_loads: loads that were measured beside the motion. truth: variables named as in Estimate (force,
    moment, center, ...), possibly on their own `time`. sha256: hash of the file's bytes, or of the arrays
    when there is no file. import_settings: the TOML text by which it was imported, and source_sha256 the
    hashes of the files that it came from, where it was.
    """

    body: Body
    motion: Motion
    truth: dict[str, Array] = field(default_factory=dict)
    title: str = ""
    source: str = ""
    history: str = ""
    sha256: str = ""
    known_loads: KnownLoads | None = None
    import_settings: str = ""
    source_sha256: str = ""
