"""What a recording holds and what can be identified from it, before anything is estimated."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from forceid.config import Settings, load_settings
from forceid.errors import EstimationError
from forceid.estimation.applied import check_points
from forceid.estimation.blocks import blocks_of, said_of
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.instruments.accelerometer_array import Field, field_of
from forceid.estimation.joints.inspection import inspect_linkage
from forceid.estimation.joints.prospects import JointProspects
from forceid.estimation.loads.rough_look import RESOLVED, bandwidths, sensed_bandwidths
from forceid.estimation.methods.accelerometers import judge_field, kinematics_of
from forceid.estimation.methods.classic import estimate_classic
from forceid.estimation.methods.imu_only import (
    is_unmarked,
    judge_unmarked,
    reads_turn,
    unmarked_flight,
    unmarked_kinematics,
)
from forceid.estimation.stated import check_stiffness, with_stated, without_mechanism
from forceid.estimation.verdict.finding import judge_leakage, judge_recording, refusing
from forceid.estimation.verdict.leakage import Leakage, leakage
from forceid.estimation.verdict.sensitivity import Budget, body_sensitivity
from forceid.estimation.verdict.shape import judge_shape, judge_size
from forceid.flight.instruments import ACCELEROMETER, INSTRUMENTS
from forceid.flight.instruments.dead_reckoning import gyro_rate
from forceid.kalman.engines import engine
from forceid.motion import largest_turn, pose_rank
from forceid.principal import summation_operator
from forceid.records import Body, Finding, Flags, Motion, Recording, Verdict
from forceid.rounding import SOLVED, solvable

if TYPE_CHECKING:
    import xarray

UNITS = {"orientation": "rad"} | {one.name: one.unit for one in INSTRUMENTS}


@dataclass(frozen=True)
class Inspection:
    """Contents and prospects of a recording.

    force, moment: whether they can be identified; force_bandwidth_hz, moment_bandwidth_hz: up to which a
    load of the size seen in a rough look is followed to a tenth, None where nothing of it is seen; shapes:
    that stand out of the noise; leakage: between rigid motion and deformation, on the markers and by the
    fit, None where no marker is seen; sensitivity: to errors of the body, from a rough estimate, None where
    no force is; linkage: of a body in parts; findings: that the verdict will hold.
    """

    title: str
    frames: int
    duration_s: float
    rate_hz: float
    regular: bool
    nodes: int
    seen_nodes: int
    missing_percent: float
    mass_kg: float
    gravity: tuple[float, ...]
    noise_std: dict[str, float]
    noise_stated: dict[str, bool]
    rank: int
    turn_deg_per_frame: float
    shapes: int
    force: bool
    moment: bool
    force_bandwidth_hz: float | None
    moment_bandwidth_hz: float | None
    has_truth: bool
    leakage: Leakage | None
    sensitivity: Budget | None
    linkage: JointProspects | None
    findings: tuple[Finding, ...]

    def __str__(self) -> str:
        return "\n".join(self.summary)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(finding.text for finding in self.findings)

    @property
    def summary(self) -> list[str]:
        """The same for people, a line each."""
        clock = "" if self.regular else ", irregular clock"
        noise = ", ".join(
            f"{name} {level:.2g} {UNITS.get(name, 'm')} "
            f"({'stated' if self.noise_stated[name] else 'from the data'})"
            for name, level in self.noise_std.items()
        )
        lines = [
            f"holds    {self.title or 'untitled'}: {self.frames} frames over {self.duration_s:.4g} s, "
            f"{self.rate_hz:.4g} Hz{clock}",
            f"body     {self.mass_kg:.4g} kg, {self.nodes} nodes, {self.seen_nodes} with markers, "
            f"{self.missing_percent:.2g} % of their samples missing",
            f"noise    {noise}",
            f"turn     {self.turn_deg_per_frame:.3g} degrees a frame at most",
            f"shapes   {self.shapes} stand out of the noise beside the rigid motion",
            f"force    {wording(self.force, self.force_bandwidth_hz)}",
            f"moment   {wording(self.moment, self.moment_bandwidth_hz)}",
        ]
        costs = [] if self.sensitivity is None else [f"costs    {line}" for line in self.sensitivity.summary]
        joints = [] if self.linkage is None else self.linkage.summary
        return lines + leaking(self.leakage) + costs + [f"note     {w}" for w in self.warnings] + joints

    def as_dict(self) -> dict[str, Any]:
        """The same for machines: plain numbers and lists."""
        found = asdict(self) | {"warnings": list(self.warnings)} | Verdict(findings=self.findings).coded
        if (linkage := self.linkage) is not None:
            found["linkage"] |= {"warnings": list(linkage.warnings)}
            found["linkage"] |= Verdict(findings=linkage.findings).coded
            del found["linkage"]["findings"]
        del found["findings"]
        if self.leakage is not None:
            found["leakage"] = {
                k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in found["leakage"].items()
            } | {"worst": self.leakage.numbers()}
        found["sensitivity"] = {} if self.sensitivity is None else self.sensitivity.numbers()
        return found


def leaking(found: Leakage | None) -> list[str]:
    """How well the markers fix a turn, and what passes between rigid motion and deformation, a line each."""
    if found is None:
        return []
    lines = ["markers  lie on a line: a turn about it leaves no trace"]
    if np.isfinite(found.condition):
        lines = [
            f"markers  condition {found.condition:.3g}; 1 mm of noise turns the body by "
            f"{', '.join(f'{s:.2g}' for s in found.rotation_sigma)} degrees about x, y, z in one frame"
        ]
    for k, name in enumerate(found.name):
        mean, worst = percent(found.to_rigid[k]), percent(found.to_rigid_worst[k])
        beside = "" if worst == mean else f", {worst} in the worst frame"
        lines.append(
            f"leakage  {name}: {mean} of it is taken for rigid motion{beside}; sine of its angle with rigid "
            f"motion {found.sine[k]:.3g}"
        )
    if found.name:
        lines.append(f"leakage  {percent(found.to_shape)} of a rigid motion is taken for deformation")
    return lines


def percent(value: float) -> str:
    """A part in percent, without what rounding leaves of nothing."""
    return f"{value if value > SOLVED else 0.0:.2g} %"


def wording(identifiable: bool, bandwidth: float | None) -> str:
    """How far a component can be followed, in words."""
    if not identifiable:
        return "cannot be identified"
    if bandwidth is None:
        return "identifiable; none stands out of the noise"
    return f"identifiable, all three axes; followed to a tenth of its size up to about {bandwidth:.2g} Hz"


def inspect(tree: xarray.DataTree, config: Any = None, **settings: Any) -> Inspection:
    """What a motion holds and what can be identified from it, before anything runs; `print` shows it.

    tree: from `open_motion`, `motion` or `import_`; config: a TOML file; settings: single keys that override
    it. Frequencies are in Hz. DataError, ConfigError: see `estimate`.
    """
    from forceid.files import recording_from_tree

    merged = load_settings(config, **settings)
    return inspect_recording(recording_from_tree(tree, merged.gravity), merged)


@solvable()
def inspect_recording(recording: Recording, settings: Settings) -> Inspection:
    """What the recording holds, which wrench components it determines, and up to which frequency."""
    recording = with_stated(recording, settings)
    if settings.part and is_unmarked(recording.motion):
        return inspect_blocks(recording, settings)
    linkage = inspect_linkage(recording, settings) if settings.part or settings.joint else None
    recording = without_mechanism(recording, settings)
    body, motion = recording.body, recording.motion
    check_stiffness(body)
    check_points(settings, body)
    if is_unmarked(motion):
        return inspect_unmarked(recording, settings)
    kin = kinematics(body, motion, settings)
    findings = judge_recording(kin, motion)
    leaks = leakage(body, kin)
    findings += [*judge_size(kin), *judge_leakage(leaks), *judge_shape(kin, body)]
    x = motion.position[:, kin.seen] if motion.position is not None else motion.center
    assert x is not None
    force = np.isfinite(kin.pose.center).any() and not refusing(findings)
    reach = bandwidths(kin, motion.gravity, bool(force))
    rank = pose_rank(summation_operator(kin.shape[kin.seen])) if kin.seen.any() else 6 * kin.attitude
    return Inspection(
        **contents(recording, kin), seen_nodes=int(kin.seen.sum()),
        missing_percent=float(100 * np.isnan(x).mean()), rank=int(rank),
        turn_deg_per_frame=float(np.degrees(largest_turn(kin.time, kin.pose.rotation))),
        shapes=len(kin.shapes),
        force=bool(force), moment=kin.attitude or kin.inertia.point,
        force_bandwidth_hz=reach[0], moment_bandwidth_hz=reach[1],
        leakage=leaks,
        sensitivity=rough_sensitivity(body, motion, settings) if force else None, linkage=linkage,
        findings=tuple(findings),
    )  # fmt: skip


def inspect_blocks(recording: Recording, settings: Settings) -> Inspection:
    """The same of bodies with accelerometers of their own: what they tell of each, and so of all."""
    blocks, _, alone = blocks_of(recording, settings)
    each = [inspect_recording(block.recording, alone) for block in blocks]
    said = said_of(blocks, [one.findings for one in each])
    return replace(
        each[0], title=recording.title, mass_kg=sum(b.mass for b in blocks), moment=False,
        force=all(one.force for one in each), has_truth="force" in recording.truth, findings=tuple(said),
    )  # fmt: skip


def contents(recording: Recording, kin: Kinematics) -> dict[str, Any]:
    """What an inspection says of any recording: clock, nodes, mass, gravity, noise, truth."""
    time, step = recording.motion.time, np.diff(recording.motion.time)
    return {
        "title": recording.title, "frames": len(time), "duration_s": float(np.ptp(time)),
        "rate_hz": float(1 / np.median(step)), "regular": bool(np.ptp(step) < 1e-3 * np.median(step)),
        "nodes": len(recording.body.node), "mass_kg": kin.inertia.mass,
        "gravity": tuple(recording.motion.gravity.tolist()), "noise_std": kin.noise,
        "noise_stated": kin.stated, "has_truth": "force" in recording.truth,
    }  # fmt: skip


def inspect_unmarked(recording: Recording, settings: Settings) -> Inspection:
    """The same of a recording of sensors alone."""
    body, motion = recording.body, recording.motion
    if not reads_turn(motion) and (field := field_of(body, motion, settings)) is not None:
        return inspect_field(recording, field)
    kin, findings = unmarked_kinematics(body, motion, settings), judge_unmarked(body, motion, settings)
    flight = unmarked_flight(body, motion, settings, kin)
    moment = not refusing(findings)
    force = moment and flight.sensors is not None and flight.sensors.of(ACCELEROMETER) is not None
    read = [motion.readings[one.name] for one in INSTRUMENTS if one.name in motion.readings]
    missing = float(100 * np.mean([np.isnan(a).mean() for a in read]))
    bands = sensed_bandwidths(flight, RESOLVED) if moment else (None, None)
    rate, step = gyro_rate(motion.time, flight.sensors), np.diff(motion.time)
    turn = 0.0 if rate is None else float(np.linalg.norm(rate, axis=1).max() * np.median(step))
    return Inspection(
        **contents(recording, kin), seen_nodes=0, missing_percent=missing, rank=0,
        turn_deg_per_frame=float(np.degrees(turn)), shapes=0, force=force, moment=moment,
        force_bandwidth_hz=bands[0] if force else None, moment_bandwidth_hz=bands[1],
        leakage=None, sensitivity=None, linkage=None, findings=tuple(findings),
    )  # fmt: skip


def inspect_field(recording: Recording, field: Field) -> Inspection:
    """The same of a recording of accelerometers alone: what they tell is told at every sample."""
    kin = kinematics_of(field, recording.body, recording.motion.time)
    findings = judge_field(field, recording.motion.gravity)
    told: Flags = np.asarray(field.told.any(0))
    rate = 0.5 / float(np.median(np.diff(kin.time)))
    return Inspection(
        **contents(recording, kin), seen_nodes=0, missing_percent=float(100 * np.isnan(field.y).mean()),
        rank=int(told.sum()), turn_deg_per_frame=0.0, shapes=len(field.sites.shape),
        force=bool(told[:3].all()), moment=bool(told[3:].all()), force_bandwidth_hz=rate,
        moment_bandwidth_hz=rate, leakage=None, sensitivity=None, linkage=None, findings=tuple(findings),
    )  # fmt: skip


def rough_sensitivity(body: Body, motion: Motion, settings: Settings) -> Budget | None:
    """Sensitivity by the quickest estimate, about the mass center; None where the record is too short."""
    quick = settings.model_copy(update={"method": "savgol"})
    try:
        found = estimate_classic(body, motion, quick, engine(settings.engine))
    except EstimationError:
        return None
    return body_sensitivity(found.kinematics, found.deformation, found.state, body.node, motion.gravity)
