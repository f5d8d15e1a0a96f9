"""Frozen records that pass between the stages: plain arrays inside, SI units, right-handed frames.

Shapes are written with the dimension names of the motion file. A wrench is ordered force, then moment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Annotated, Any, Literal, NamedTuple, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Level = Literal["ok", "degraded", "refused"]


def deviation(cov: Array) -> Array:
    """Standard deviations (..., n) of covariances (..., n, n)."""
    return np.asarray(np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1)))


class Claims:
    """A record with a covariance wrench_cov (..., 6, 6) of force, then moment."""

    wrench_cov: Array

    @property
    def force_std(self) -> Array:
        """Standard deviation of the force (..., 3) N."""
        return deviation(self.wrench_cov)[..., :3]

    @property
    def moment_std(self) -> Array:
        """Standard deviation of the moment (..., 3) N m."""
        return deviation(self.wrench_cov)[..., 3:]


@dataclass(frozen=True)
class Variable:
    """What a variable of the contract is: dimensions in order, SI units, meaning."""

    dims: tuple[str, ...]
    units: str
    long_name: str


AXES = ("x", "y", "z")
SENSOR = ("time", "sensor", "axis")  # dimensions of what a sensor of three axes reads
Reading = Array | None  # of sensors, where there are any


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
        return np.where(np.nan_to_num(self.bridged)[..., None] > 0, np.nan, self.position)

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


@dataclass(frozen=True)
class Loads:
    """Applied loads p of f = B p. load (time, load) N, load_cov (time, load, load_2) N2.

    null_space (load, null): directions of p the motion cannot see. estimable (functional, load): rows
    whose combination of loads is determined. chi_square (time,): misfit of resultants and
    forces on modes, with `dof` degrees of freedom.
    """

    name: tuple[str, ...]
    load: Array
    load_cov: Array
    null_space: Array
    estimable: Array
    chi_square: Array
    dof: int


@dataclass(frozen=True)
class ModalForces:
    """Forces g = shape^T f of the applied loads f, body axes, on modes of a body: force (time, mode) N.

    shape (mode, node, 3): of the modes, of unit norm, body axes; cov (time, mode, mode) N2; with_wrench
    (time, 6, mode): covariance with force and moment, world axes, None where their errors share nothing.
    """

    shape: Array
    force: Array
    cov: Array
    with_wrench: Array | None = None


@dataclass(frozen=True)
class Interface(Claims):
    """What passes through the joints of a body in parts, as the first part named does to the second.

    name (joint,), parts: the pair of each; force (time, joint, 3) N and moment (time, joint, 3) N m about
    point (time, joint, 3) m, world axes; wrench_cov (time, joint, 6, 6). determined (joint,): whether the
    motion tells a joint's wrench; where not, it is NaN, and null_space (joint, 6, null) holds the wrenches
    about the mass center of all parts that leave no trace. gap (time, joint, 3) m: by which the second part
    is off the first at the joint. chi_square (time,): misfit of the balances that repeat each other, with
    `dof` degrees of freedom; consistency: its mean per degree of freedom. verdict: of the joints alone.
    """

    name: tuple[str, ...]
    parts: tuple[tuple[str, str], ...]
    force: Array
    moment: Array
    wrench_cov: Array
    point: Array
    determined: Flags
    null_space: Array
    gap: Array
    chi_square: Array
    dof: int
    verdict: Verdict

    @property
    def consistency(self) -> float:
        """Mean misfit per degree of freedom: one or less where the balances agree; NaN without any."""
        seen = np.isfinite(self.chi_square)
        return float(self.chi_square[seen].mean() / self.dof) if self.dof and seen.any() else float("nan")


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or to be known, and the verdict that it leads to by itself.

    code: of the catalogue; values: the numbers and names in the sentence, by name, None for what is not
    finite; text: the sentence, with a next step.
    """

    code: str
    level: Level
    values: Mapping[str, str | float | None]
    text: str

    @property
    def cause(self) -> tuple[str, ...]:
        """What findings of one cause have in common: the code, and what it is about, without numbers."""
        return (self.code, *(str(self.values[name]) for name in ABOUT if name in self.values))


ABOUT = ("part", "joint", "load", "variable", "sensors")  # values that say what a finding is about


@dataclass(frozen=True)
class Verdict:
    """Accurate (`ok`), degraded or refused, and why: each reason is one sentence with a next step."""

    level: Level = "ok"
    findings: tuple[Finding, ...] = ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(finding.text for finding in self.findings)

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the findings, in the order of the reasons."""
        return tuple(finding.code for finding in self.findings)

    def _repr_html_(self) -> str:
        reasons = "".join(f"<li>{escape(text)}</li>" for text in self.reasons)
        return f"<p>verdict <b>{self.level}</b></p>" + (f"<ul>{reasons}</ul>" if reasons else "")

    @property
    def coded(self) -> dict[str, list[Any]]:
        """The findings as lists of plain values in one order, by the names of result files."""
        return {
            "reason_codes": list(self.codes),
            "reason_levels": [finding.level for finding in self.findings],
            "reason_values": [dict(finding.values) for finding in self.findings],
        }


@dataclass(frozen=True)
class HiddenLoad:
    """What an estimate leaves out.

    band (wrench,) Hz: up to which each load was followed, 0 where none was found; amplitude (frequency,
    wrench) N, N m: of an oscillating load at `frequency` (frequency,) Hz that would have gone unseen with
    probability one half, along each world axis. NaN where nothing is known.
    """

    frequency: Array
    amplitude: Array
    band: Array


@dataclass(frozen=True)
class Impulses:
    """What the loads give in each piece of a record in which they are of one character.

    start, stop (piece,) s; impulse (piece, 6) N s and N m s, about the mass center, world axes, from the last
    sample before the start to the first behind the stop; cov (piece, 6, 6).
    """

    start: Array
    stop: Array
    impulse: Array
    cov: Array


@dataclass(frozen=True)
class Witness:
    """The plain route beside an estimate: low-passed second derivatives of the mass center and of the turn.

    force (time, 3) N and moment (time, 3) N m about the mass center, world axes, weight excluded, with the
    standard deviation of each below its cut-off; NaN where they are not seen. By axis (3,): the cut-off, Hz;
    band, Hz: up to where both differ most for their errors; how far they are apart there, rms in the middle
    of the record, in N or N m; difference, the same in joint standard errors, and limit, what chance allows.
    """

    force: Array
    moment: Array
    force_std: Array
    moment_std: Array
    cutoff_force: Array
    cutoff_moment: Array
    band_force: Array
    band_moment: Array
    apart_force: Array
    apart_moment: Array
    difference_force: Array
    difference_moment: Array
    limit_force: Array
    limit_moment: Array


@dataclass(frozen=True)
class Flown:
    """What a flight can be flown again from: poses as they were measured, frame by frame, and what they move.

    center (time, 3) m, NaN where not seen; orientation (time, 4) [x y z w], NaN where not known; pose_cov
    (time, 6, 6) of center and rotation (left error, rad), world axes; inertia (time, 3, 3) kg m2 about the
    mass center and internal_momentum (time, 3) kg m2/s of the deformation and of what turns inside, body
    axes; wind (time, 3) m/s, world axes, where it was measured; current_mass (time,) kg where it changes:
    then the inertia is that of the body as stated.
    """

    center: Array
    orientation: Array
    pose_cov: Array
    inertia: Array
    internal_momentum: Array
    wind: Array | None = None
    current_mass: Array | None = None


@dataclass(frozen=True)
class Aero:
    """What the air does to a body, over the time of its estimate, and how sure that is.

    value and std (time, quantity), by `name`: speed m/s against the air, alpha and beta rad, pressure Pa,
    lift, drag and side_force N, CL, CD, CY, Cl, Cm, Cn, advance_ratio and spin_parameter 1. force and moment
    with _std (time, 3) N and N m in wind, stability and body axes, x forward, y to the right, z down.
    coefficient_cov (time, 6, 6) of CL, CD, CY, Cl, Cm, Cn; counts: what the deviations count.
    """

    name: tuple[str, ...]
    value: Array
    std: Array
    force_wind: Array
    moment_wind: Array
    force_stability: Array
    moment_stability: Array
    force_body: Array
    moment_body: Array
    force_wind_std: Array
    moment_wind_std: Array
    force_stability_std: Array
    moment_stability_std: Array
    force_body_std: Array
    moment_body_std: Array
    coefficient_cov: Array
    counts: str

    def __getitem__(self, name: str) -> Array:
        """The values of one quantity (time,)."""
        return np.asarray(self.value[:, self.name.index(name)])


@dataclass(frozen=True)
class Feet:
    """The force of the ground on each of two feet, world axes.

    name (foot,); force (time, foot, 3) N with force_cov (time, foot, 3, 3); contact (time, foot): 1 where it
    touches; share (time, foot) of the whole, and share_std (time,): zero where one stands alone.
    """

    name: tuple[str, ...]
    force: Array
    force_cov: Array
    contact: Array
    share: Array
    share_std: Array


@dataclass(frozen=True)
class Estimate(Claims):
    """The result: applied wrench (weight excluded) with covariance, mean motion and deformation.

    time (time,) s; force (time, 3) N and moment (time, 3) N m, world axes, about `moment_about`;
    wrench_cov (time, 6, 6); known_force (time, 3) N and known_moment (time, 3) N m, about the mass center, of
    the loads that were known beforehand, which act beside these, None without any; center (time, 3) m;
    velocity (time, 3) m/s; orientation (time, 4) [x y z w]; angular_velocity (time, 3) rad/s and
    angular_momentum (time, 3) kg m2/s, world axes; deformation (time, node, 3) m, body axes, about
    mean_shape (node, 3) m; nis (time,) normalized
    innovation squared per degree of freedom, NaN where the method has no innovations; innovation
    (time, channel) whitened innovations, unit variance if the model is right; mass kg and gravity (3,) m/s2
    that the force was computed with. modal: forces on the modes of a body,
    None where those are not known. Of an affine body, stretch (time, 3, 3) and first_moment (time, 3, 3)
    N m, f r^T of all forces on it, those in it too, about the mass center, world axes, row: of the force,
    column: of its arm; first_moment_cov (time, 9, 9) row by row; the applied ones alike, where the material
    is known; F (time, 3, 3) from the reference, F_rate 1/s; spin (time, 3) rad/s of its polar rotation, world
    axes; circulation (time, 3) kg m2/s, reference axes. What cannot be identified is NaN.
    model_choice: a sentence on why this model, ladder: what every level looked at said, as numbers with
    names. hidden: what the estimate leaves out, None where the method does not tell; impulses: of loads that
    come in pieces; witness: what the plain
    route gives beside it; flown: what a flight again begins with; feet: what the ground gives
    each; aero: what the air does, where that was
    asked for. settings: the merged configuration as TOML text; runtime_s: s by
    the clock; timing: s of CPU by stage.
    """

    time: Array
    force: Array
    moment: Array
    wrench_cov: Array
    center: Array
    velocity: Array
    orientation: Array
    angular_velocity: Array
    angular_momentum: Array
    deformation: Array
    mean_shape: Array
    nis: Array
    innovation: Array
    mass: float
    gravity: Array
    node: tuple[str, ...]
    method: str
    model: str
    engine: str
    log_likelihood: float
    moment_about: str
    verdict: Verdict
    mode_amplitude: Array | None = None
    modal: ModalForces | None = None
    stretch: Array | None = None
    first_moment: Array | None = None
    first_moment_cov: Array | None = None
    known_force: Array | None = None
    known_moment: Array | None = None
    applied_first_moment: Array | None = None
    applied_first_moment_cov: Array | None = None
    F: Array | None = None
    F_cov: Array | None = None
    F_rate: Array | None = None
    spin: Array | None = None
    circulation: Array | None = None
    loads: Loads | None = None
    interface: Interface | None = None
    witness: Witness | None = None
    flown: Flown | None = None
    feet: Feet | None = None
    aero: Aero | None = None
    runtime_s: float = 0.0
    timing: dict[str, float] = field(default_factory=dict)
    settings: str = ""
    input_sha256: str = ""
    tuned: dict[str, float] = field(default_factory=dict)
    leakage: dict[str, float] = field(default_factory=dict)
    sensitivity: dict[str, float] = field(default_factory=dict)
    model_choice: str = ""
    ladder: dict[str, float] = field(default_factory=dict)
    hidden: HiddenLoad | None = None
    impulses: Impulses | None = None


class Frame(NamedTuple):
    """A frame of markers: time s and position (node, 3) m, world axes, NaN where not seen."""

    time: float
    position: Array


@dataclass(frozen=True)
class LiveWrench:
    """The wrench at one frame, told a lag later: world axes, weight excluded, moment about the mass center.

    time s; force (3,) N and moment (3,) N m with force_std and moment_std (3,), NaN where the markers do not
    show it; reasons: why it is less sure than the frames around it, none where nothing is wrong.
    """

    time: float
    force: Array
    moment: Array
    force_std: Array
    moment_std: Array
    reasons: tuple[str, ...] = ()

    @property
    def flag(self) -> Level:
        """`ok`, or `degraded` where there are reasons."""
        return "degraded" if self.reasons else "ok"
