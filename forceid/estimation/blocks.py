"""Bodies that push or crush each other, each with accelerometers of its own: the force on each, and between.

None turns by much, so that the axes of all stay those of the reference shape. The force on a body is its mass
times what its accelerometers read of its center; that of all bodies is what pushes them from outside.
Source: principal equations 2.11 A.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from forceid.config import PartSetting, Settings
from forceid.errors import ConfigError
from forceid.estimation.assembly import refused_estimate
from forceid.estimation.instruments.accelerometer_array import READ
from forceid.estimation.joints.forces import empty_interface
from forceid.estimation.joints.parts import Joint, Part, check_names, joint_of
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge
from forceid.partition import link_resultants
from forceid.partition.coupling.resultants import GROUND
from forceid.records import Array, Body, Estimate, Finding, Interface, Motion, Recording

AXES, OPEN = "body-axes", "array-open"  # findings on all accelerometers alike, and on components not told
ROUND = 0.1  # m: radius of gyration of a block that has none stated
Solve = Callable[[Recording, Settings], tuple[Estimate, Solution | None]]


def estimate_blocks(recording: Recording, settings: Settings, solve: Solve) -> Estimate:
    """The force on all parts from outside, and what passes their joints; moments are NaN.

    solve: estimates a part as a body of its own. Raises ConfigError for parts that do not fit the recording.
    """
    blocks, joints, alone = blocks_of(recording, settings)
    each = [solve(block.recording, alone)[0] for block in blocks]
    said = said_of(blocks, [e.verdict.findings for e in each])
    F, cov = np.stack([e.force for e in each], 1), np.stack([e.wrench_cov[:, :3, :3] for e in each], 1)
    whole = refused_estimate(recording, settings, said)
    wrench_cov = whole.wrench_cov.copy()
    wrench_cov[:, :3, :3] = cov.sum(1)
    return replace(
        whole, force=F.sum(1), wrench_cov=wrench_cov, mass=sum(block.mass for block in blocks),
        nis=np.mean([e.nis for e in each], axis=0), engine=each[0].engine,
        interface=through_joints(blocks, joints, F, cov) if joints else None,
    )  # fmt: skip


def blocks_of(
    recording: Recording, settings: Settings
) -> tuple[tuple[Part, ...], tuple[Joint, ...], Settings]:
    """Parts and joints of the settings, and what is asked of each part by itself."""
    blocks = tuple(block_of(setting, recording) for setting in settings.part)
    check_blocks(settings, recording)
    names = [block.name for block in blocks]
    joints = tuple(joint_of(joint, names, recording.body) for joint in settings.joint)
    return (
        blocks,
        joints,
        settings.model_copy(update={"part": (), "joint": (), "moment_about": "mass_center"}),
    )


def through_joints(blocks: tuple[Part, ...], joints: tuple[Joint, ...], F: Array, cov: Array) -> Interface:
    """What passes the joints, axis by axis, where forces F (time, part, 3) with cov act on the parts."""
    links = [(j.before, j.behind) for j in joints] + [(GROUND, k) for k, b in enumerate(blocks) if b.external]
    count, still = len(joints), np.zeros((len(F), len(joints), 3))
    g, covs, misfit, dof = still.copy(), np.full((*still.shape[:2], 6, 6), np.nan), np.zeros(len(F)), 0
    determined, null = np.ones(count, bool), np.zeros((count, 0))
    for a in range(3):
        found = link_resultants(links, -F[..., a : a + 1], cov[..., a : a + 1, a : a + 1])
        assert found.cov is not None
        determined, null = found.determined[:count], found.null_space[:count]
        g[..., a] = np.where(determined, found.wrench[:, :count, 0], np.nan)
        covs[..., a, a] = np.where(determined, found.cov[:, :count, 0, 0], np.nan)
        misfit, dof = misfit + found.chi_square, dof + found.dof
    at = still + [joint.at for joint in joints]
    findings = []
    if not determined.all():
        names = ", ".join(j.name for j, known in zip(joints, determined, strict=True) if not known)
        findings.append(note("joint-undetermined", None if determined.any() else "refused", names=names))
    null_space = np.zeros((count, 6, 3 * null.shape[1]))
    for a in range(3):
        null_space[:, a, a::3] = null
    return replace(
        empty_interface(joints, blocks, at, still, determined, judge(findings)),
        force=g, wrench_cov=covs, null_space=null_space, chi_square=misfit, dof=dof,
    )  # fmt: skip


def block_of(setting: PartSetting, recording: Recording) -> Part:
    """A part on the accelerometers that it names."""
    body, motion, where = recording.body, recording.motion, f"part {setting.name}"
    if not setting.sensors:
        raise ConfigError("has no markers here", where, "give sensors, the accelerometers on it, from 0")
    if setting.mass is None:
        raise ConfigError("has no mass", where, "give its mass in kg")
    if body.sensor_position is None or motion.specific_force is None:
        raise ConfigError(
            "names accelerometers, and the motion file holds none", where, "add them, or markers"
        )
    if (last := max(setting.sensors)) >= (count := len(body.sensor_position)):
        raise ConfigError(f"names accelerometer {last}, of {count}", where, "count them from 0")
    own = list(setting.sensors)
    at = body.sensor_position[own]
    center = at.mean(0) if setting.center is None else np.array(setting.center)
    round_one = setting.mass * ROUND**2 * np.eye(3)  # of the moment, which is not asked for
    own_body = Body(
        total_mass=setting.mass, mass_center=center,
        inertia=round_one if setting.inertia is None else np.array(setting.inertia), sensor_position=at,
        sensor_rotation=None if body.sensor_rotation is None else body.sensor_rotation[own],
    )  # fmt: skip
    noise = {name: std for name, std in motion.noise_std.items() if name.startswith(READ)}
    read = motion.specific_force[:, own]
    shown = Motion(motion.time, specific_force=read, gravity=motion.gravity, noise_std=noise)
    part = Recording(own_body, shown, title=setting.name, sha256=recording.sha256)
    return Part(setting.name, part, setting.mass, center, setting.external, setting.rigid)


def check_blocks(settings: Settings, recording: Recording) -> None:
    """No name twice, no accelerometer on two parts, and nothing asked that needs places."""
    check_names("part", ["ground", *(p.name for p in settings.part)])
    check_names("joint", [j.name for j in settings.joint])
    named = [k for part in settings.part for k in part.sensors]
    if twice := [k for k in named if named.count(k) > 1]:
        raise ConfigError(f"name accelerometer {twice[0]} more than once", "part", "give each to one part")
    if settings.known_load or settings.foot or recording.known_loads is not None:
        what = "stand beside parts that accelerometers alone show"
        raise ConfigError(what, "known_load and foot", "add markers, or leave them out")
    if others := sorted(set(recording.motion.readings) - {READ}):
        what = "stands beside accelerometers that are of parts, and is of none"
        raise ConfigError(what, f"/motion/{others[0]}", "leave it out, or estimate its part by itself")


def said_of(blocks: Sequence[Part], findings: Sequence[Sequence[Finding]]) -> list[Finding]:
    """Findings on the parts by name, once what holds for all; none on moments, which are not asked for."""
    found: dict[str, Finding] = {}
    for block, own in zip(blocks, findings, strict=True):
        for one in own:
            if one.code == AXES:
                found[AXES] = one
            elif one.code != OPEN or "force" in str(one.values["names"]):
                text = f"part {block.name}: {one.text}"
                found[text] = replace(one, values={**one.values, "part": block.name}, text=text)
    return list(found.values())
