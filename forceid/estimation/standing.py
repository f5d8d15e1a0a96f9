"""What the ground gives each foot of a person: as plates say it, or by a rule where motion alone tells it."""

from __future__ import annotations

import numpy as np

from forceid.config import FootSetting, Settings
from forceid.errors import ConfigError
from forceid.estimation.body.kinematics import rotations
from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.feet import LEVEL, feet_of, split_by_foot
from forceid.estimation.joints.parts import Part, part_of_foot
from forceid.estimation.joints.segments import FootWrench
from forceid.estimation.known.loads import KnownLoad, known_loads, loads_on_part
from forceid.estimation.known.removal import path_through, wrench_of
from forceid.estimation.methods.problem import Solution
from forceid.principal import transport, transport_cov
from forceid.records import Array, Estimate, Indices, Recording

UNDER = 0.3  # m: a foot is no longer, so that what is farther from it is not under it


def ground_on_feet(recording: Recording, settings: Settings, whole: Solution) -> tuple[FootWrench, ...]:
    """The wrench on every foot, about the mass center; whole: the solution, beside loads that are known.

    ConfigError: the body names no feet, or a known load is under none of them.
    """
    body, motion = recording.body, recording.motion
    feet = feet_of(settings.foot, body.node)
    nodes = [np.array([body.node.index(n) for n in one.nodes]) for one in feet]
    loads = known_loads(recording, settings)
    if not feet:
        what = "asks what passes the joints of a body whose feet are not known"
        raise ConfigError(what, "joint_loads", "give a [[foot]] for each of two feet")
    if not loads:
        state = whole.state
        W = np.concatenate([state.force, state.moment], 1)
        split = split_by_foot(feet, body.node, motion, state.center, W, state.wrench_cov)
        if split is None:
            what = "asks what passes the joints of a person without gravity, or whose feet are never seen"
            raise ConfigError(what, "joint_loads", "give gravity, and markers on both feet")
        return tuple(FootWrench(own, split.wrench[:, k], split.cov[:, k]) for k, own in enumerate(nodes))
    return on_plates(recording, feet, nodes, loads, whole)


def on_plates(
    recording: Recording,
    feet: tuple[FootSetting, ...],
    nodes: list[Indices],
    loads: tuple[KnownLoad, ...],
    whole: Solution,
) -> tuple[FootWrench, ...]:
    """Feet with the loads that are known under them; one without any has what else acts on the body.

    NaN where one stands beside its plate: what else acts is not on the other foot alone.
    """
    time, state, body = recording.motion.time, whole.state, recording.body
    path = path_through(time, state.center, state.rotation)
    W = np.concatenate([state.force, state.moment], 1)
    split = split_by_foot(feet, body.node, recording.motion, state.center, W, state.wrench_cov)
    if split is None:
        what = "asks what passes the joints of a person without gravity, or whose feet are never seen"
        raise ConfigError(what, "joint_loads", "give gravity, and markers on both feet")
    wrench, cov = np.zeros((len(feet), len(time), 6)), np.zeros((len(feet), len(time), 6, 6))
    under = [foot_over(load, time, split.middle) for load in loads]
    for load, k in zip(loads, under, strict=True):
        own, error, _ = wrench_of(load, time, path)
        wrench[k] += own
        cov[k] += error
    held = np.linalg.norm(wrench[..., :3], axis=2)
    held = held > LEVEL * held.max(1, keepdims=True)
    beside = (split.feet.contact.T == 1) & ~held & split.pushed
    for k in range(len(feet)):
        if k not in under:
            wrench[k], cov[k] = W, state.wrench_cov
        lost = beside[k] if k in under else beside[sorted(set(under))].any(0)
        wrench[k][lost], cov[k][lost] = np.nan, np.nan
    return tuple(FootWrench(own, wrench[k], cov[k]) for k, own in enumerate(nodes))


def foot_over(load: KnownLoad, time: Array, middle: Array) -> int:
    """Which foot, middle (time, foot, 3) m, is over a known load. ConfigError: none is, or both are."""
    if load.point is None or load.body:
        what = f"acts on the body at no place on the ground: joint_loads cannot tell what {load.name} passes"
        raise ConfigError(what, "known_load", "give its point, or leave out joint_loads")
    point = load.point if load.point.ndim == 1 else straight(time, load.time, load.point)
    size = np.linalg.norm(straight(time, load.time, load.wrench[:, :3]), axis=1)
    size = size / max(float(size.sum()), np.finfo(float).tiny)
    away = np.linalg.norm(middle - np.broadcast_to(point, middle[:, 0].shape)[:, None], axis=2)
    part = [float(size[(away.argmin(1) == k) & (away[:, k] < UNDER)].sum()) for k in range(middle.shape[1])]
    if max(part) < 1 - LEVEL:
        what = f"{load.name} is under no foot, or not under one alone"
        raise ConfigError(what, "known_load", "part it by foot, or leave out joint_loads")
    return int(np.argmax(part))


def told_on_parts(
    recording: Recording, settings: Settings, parts: tuple[Part, ...], estimates: list[Estimate]
) -> tuple[Array, Array] | None:
    """Wrenches (time, part, 6) about the centers of parts, of loads that are known and of the ground on feet
    by the rule, and their covariances (time, part, 6, 6); None where nothing is told of any.
    """
    if not settings.foot and not settings.known_load and recording.known_loads is None:
        return None
    time = recording.motion.time
    wrench, cov = np.zeros((len(time), len(parts), 6)), np.zeros((len(time), len(parts), 6, 6))
    for k, (part, found) in enumerate(zip(parts, estimates, strict=True)):
        path = path_through(time, found.center, rotations(found.orientation))
        for load in loads_on_part(recording, part.recording, settings, part.name):
            own, error, _ = wrench_of(load, time, path)
            wrench[:, k] += own
            cov[:, k] += error
    feet = feet_of(settings.foot, recording.body.node) if settings.foot else ()
    over = [part_of_foot(foot, parts) for foot in feet]
    if feet:
        mass = np.array([part.mass for part in parts])
        each = np.stack([found.center for found in estimates], 1)
        center = np.einsum("p,tpa->ta", mass / mass.sum(), each)
        arm = each - center[:, None]
        moved = np.stack([np.concatenate([e.force, e.moment], 1) for e in estimates], 1) - wrench
        errors = np.stack([e.wrench_cov for e in estimates], 1) + cov
        W, C = transport(moved, arm).sum(1), transport_cov(errors, arm).sum(1)
        split = split_by_foot(feet, recording.body.node, recording.motion, center, W, C)
        if split is None:
            what = "stand on no ground: gravity is zero, or they are never seen"
            raise ConfigError(what, "foot", "give gravity, and markers on both feet")
        for k, one in enumerate(over):
            wrench[:, one] += transport(split.wrench[:, k], -arm[:, one])
            cov[:, one] += transport_cov(split.cov[:, k], -arm[:, one])
    return wrench, cov
