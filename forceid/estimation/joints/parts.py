"""A body in parts: which nodes move as one, and what holds the parts together, as the settings say it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.config import FootSetting, JointSetting, PartSetting, Settings
from forceid.errors import ConfigError
from forceid.estimation.body.inertia import inertia_of
from forceid.motion import pose_rank
from forceid.partition.coupling.resultants import GROUND
from forceid.principal import summation_operator
from forceid.records import Array, Body, Indices, Motion, Recording, all_finite
from forceid.rounding import SOLVED


@dataclass(frozen=True)
class Part:
    """A body of its own: its recording, mass kg, mass center (3,) m in the reference shape; external: whether
    loads other than weight and joints act on it; rigid: whether it is stated not to bend.
    """

    name: str
    recording: Recording
    mass: float
    center: Array
    external: bool
    rigid: bool


@dataclass(frozen=True)
class Joint:
    """A link from one part to another (by number, GROUND for the ground) at a place (3,) m of the reference
    shape; axis (3,).

    kind: weld, hinge or ball; free: axes about which it passes no moment, "none", "one" (that axis) or "all".
    """

    name: str
    before: int
    behind: int
    at: Array
    axis: Array | None
    kind: str
    free: str

    @property
    def moving(self) -> tuple[int, ...]:
        """The parts that it holds, without the ground."""
        return tuple(k for k in (self.before, self.behind) if k != GROUND)

    def names(self, parts: Sequence[Part]) -> tuple[str, str]:
        """What it holds together, by name."""
        before, behind = ("ground" if k == GROUND else parts[k].name for k in (self.before, self.behind))
        return before, behind


def parts_of(recording: Recording, settings: Settings) -> tuple[tuple[Part, ...], tuple[Joint, ...]]:
    """Parts and joints of the settings on this recording; ConfigError for what does not fit it."""
    body, motion = recording.body, recording.motion
    if motion.position is None or body.position is None:
        raise ConfigError("need markers: the motion file holds no positions", "part", "leave out [[part]]")
    if not settings.part:
        raise ConfigError("is given without parts", "joint", "add [[part]] for what it holds together")
    if settings.rotor or body.rotor_axis is not None:
        what = "turns inside a body in parts, expected none there"
        raise ConfigError(what, "rotor", "leave it out, or estimate its part as a body of its own")
    if not settings.joint:
        raise ConfigError("stands without a joint", "part", "add [[joint]] for what holds them together")
    check_names("part", ["ground", *(p.name for p in settings.part)])
    check_names("joint", [j.name for j in settings.joint])
    chosen = [nodes_of(part, body) for part in settings.part]
    told = [p.model_copy(update={"rigid": p.rigid or settings.model == "rigid"}) for p in settings.part]
    check_shared(settings, chosen, body)
    parts = tuple(part_of(setting, nodes, recording) for setting, nodes in zip(told, chosen, strict=True))
    names = [part.name for part in parts]
    joints = tuple(joint_of(joint, names, body) for joint in settings.joint)
    held = {k for joint in joints for k in (joint.before, joint.behind)}
    if loose := [name for k, name in enumerate(names) if k not in held]:
        what, next_step = "is held by no joint", "name it in a [[joint]], or leave it out"
        raise ConfigError(what, f"part {loose[0]}", next_step)
    check_known(recording, settings, names)
    for foot in settings.foot:
        part_of_foot(foot, parts)
    return parts, joints


def check_known(recording: Recording, settings: Settings, parts: list[str]) -> None:
    """Every known load is of one of these parts."""
    stored, asked = recording.known_loads, {load.name: load.part for load in settings.known_load}
    for name in (*asked, *(() if stored is None else stored.name)):
        if asked.get(name) not in parts:
            what, every = f"{name}: does not say which part it acts on", ", ".join(parts)
            raise ConfigError(what, "known_load", f"add part, one of {every}, to its [[known_load]]")
    if stored is not None and stored.nodal_force is not None:
        what = "holds forces on all nodes, expected loads by name beside parts"
        raise ConfigError(what, "/load_known", "sum them by part, or estimate the body as a whole")


def part_of_foot(foot: FootSetting, parts: Sequence[Part]) -> int:
    """The part that holds all nodes of a foot."""
    own = [k for k, part in enumerate(parts) if set(foot.nodes) <= set(part.recording.body.node)]
    if not own or parts[own[0]].external:
        what = f"{foot.name}: its nodes are not of one part, or that has loads from outside to be found"
        raise ConfigError(what, "foot", "name nodes of one part, without external = true")
    return own[0]


def part_of(setting: PartSetting, nodes: Indices, recording: Recording) -> Part:
    """The part on the markers of its nodes."""
    body, motion, where = recording.body, recording.motion, f"part {setting.name}"
    assert motion.position is not None
    assert body.position is not None
    x, X = motion.position[:, nodes], body.position[nodes]
    seen = all_finite(x).any(0)
    if seen.sum() < 3 or pose_rank(summation_operator(X[seen])) < 6:
        how = "on a line" if seen.sum() > 2 else "seen"
        raise ConfigError(
            f"has {seen.sum()} markers {how}, expected three off a line at least", where, "add nodes to it"
        )
    own = Body(node=tuple(body.node[k] for k in nodes) if body.node else (), position=X)
    own = with_mass(own, setting, nodes, body, where)
    own = with_shapes(own, nodes, body)
    if body.internal_momentum is not None and not body.internal_momentum.any():
        own = replace(own, internal_momentum=body.internal_momentum)  # nothing turns inside any part
    inertia = inertia_of(own)
    noise = {name: std for name, std in motion.noise_std.items() if name == "position"}
    tracks = Motion(motion.time, x, gravity=motion.gravity, noise_std=noise)
    part = Recording(own, tracks, title=setting.name, sha256=recording.sha256)
    return Part(setting.name, part, inertia.mass, inertia.center, setting.external, setting.rigid)


def with_mass(own: Body, setting: PartSetting, nodes: Indices, body: Body, where: str) -> Body:
    """The part with its mass: that of the settings, or of its nodes."""
    given = {"mass": setting.mass, "center": setting.center, "inertia": setting.inertia}
    if lacking := [name for name, value in given.items() if value is None]:
        if len(lacking) < 3:
            raise ConfigError(f"has no {lacking[0]}", where, "give mass, center and inertia, or none of them")
    else:
        J = np.array(setting.inertia)
        if not np.allclose(J, J.T) or np.linalg.eigvalsh(J)[0] <= 0:
            raise ConfigError("has an inertia that no body has", where, "give the symmetric tensor in kg m2")
        return replace(own, total_mass=setting.mass, mass_center=np.array(setting.center), inertia=J)
    if body.mass is not None:
        mass = body.mass[nodes]
        if not mass.sum() > 0:
            raise ConfigError("has nodes without mass", where, "give its mass, center and inertia")
        return replace(own, mass=mass)
    if body.mass_matrix is not None:
        dof = (3 * nodes[:, None] + np.arange(3)).ravel()
        beside = np.delete(body.mass_matrix[dof], dof, axis=1)
        if np.abs(beside).max(initial=0.0) > SOLVED * np.abs(body.mass_matrix).max():
            what = "is coupled by the mass matrix to nodes of other parts"
            raise ConfigError(what, where, "give its mass, center and inertia")
        return replace(own, mass_matrix=body.mass_matrix[np.ix_(dof, dof)])
    raise ConfigError("is of a body known only as a whole", where, "give its mass, center and inertia")


def with_shapes(own: Body, nodes: Indices, body: Body) -> Body:
    """The part with the stiffness and the modes that are its alone, and none that others share."""
    dof = (3 * nodes[:, None] + np.arange(3)).ravel()
    if (K := body.stiffness) is not None and len(K) == 3 * len(body.node or ()):
        between = np.delete(K[dof], dof, axis=1)
        if np.abs(between).max(initial=0.0) <= SOLVED * np.abs(K).max() and K[np.ix_(dof, dof)].any():
            own = replace(own, stiffness=K[np.ix_(dof, dof)])
    if (shape := body.mode_shape) is not None:
        alone = ~np.delete(shape, nodes, axis=1).any((1, 2)) & shape[:, nodes].any((1, 2))
        if alone.any():
            frequency, damping = (
                None if each is None else each[alone] for each in (body.mode_frequency, body.mode_damping)
            )
            shape = shape[alone][:, nodes]
            own = replace(own, mode_shape=shape, mode_frequency=frequency, mode_damping=damping)
    return own


def joint_of(setting: JointSetting, names: list[str], body: Body) -> Joint:
    """The joint between numbered parts."""
    where = f"joint {setting.name}"
    before, behind = (
        GROUND if name == "ground" else index_of(name, names, where, "part") for name in setting.parts
    )
    if before == behind:
        raise ConfigError(f"holds '{setting.parts[0]}' to itself", where, "name two parts")
    if isinstance(setting.at, str):
        if body.position is None:
            raise ConfigError(f"is at node '{setting.at}', which has no place", where, "give at in m")
        at = body.position[index_of(setting.at, body.node, where, "node")]
    else:
        at = np.array(setting.at)
    axis = None if setting.axis is None else np.array(setting.axis)
    if setting.kind == "hinge" and (axis is None or not axis.any()):
        raise ConfigError(
            "is a hinge without an axis", where, "give axis, a direction in the reference shape"
        )
    free = "none" if setting.driven else {"weld": "none", "hinge": "one", "ball": "all"}[setting.kind]
    axis = None if axis is None else axis / np.linalg.norm(axis)
    return Joint(setting.name, before, behind, at, axis, setting.kind, free)


def nodes_of(part: PartSetting, body: Body) -> Indices:
    """The nodes of a part, by number."""
    assert body.position is not None
    where, count, found = f"part {part.name}", len(body.position), []
    for node in part.nodes:
        if isinstance(node, str):
            found.append(index_of(node, body.node, where, "node"))
        elif 0 <= node < count:
            found.append(node)
        else:
            raise ConfigError(f"names node {node}, of {count}", where, "count nodes from 0, or name them")
    return np.array(found, np.intp)


def check_shared(settings: Settings, chosen: list[Indices], body: Body) -> None:
    """No node is in two parts, and none with mass in no part."""
    named = np.concatenate(chosen) if chosen else np.zeros(0, np.intp)
    label = body.node or tuple(str(k) for k in range(len(body.position if body.position is not None else ())))
    node, times = np.unique(named, return_counts=True)
    if (times > 1).any():
        twice = label[node[int(np.argmax(times > 1))]]
        raise ConfigError(f"name node '{twice}' more than once", "part", "give every node to one part")
    own = [part.mass is not None for part in settings.part]
    if body.mass is None or any(own):
        return
    left = np.setdiff1d(np.flatnonzero(body.mass > 0), named)
    if len(left):
        what = f"leave out node '{label[left[0]]}', which carries {body.mass[left[0]]:g} kg"
        raise ConfigError(what, "part", "give every node with mass to a part")


def check_names(what: str, names: Iterable[str]) -> None:
    """Every name is its own."""
    found = list(names)
    if twice := [name for name in found if found.count(name) > 1]:
        raise ConfigError("is named twice", f"{what} {twice[0]}", "give each a name of its own")


def index_of(name: str, known: Iterable[str], where: str, what: str) -> int:
    """The number of a name, or a ConfigError with the nearest one."""
    names = list(known)
    if name in names:
        return names.index(name)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
    hint = f"did you mean '{near[0]}'?" if near else ""
    raise ConfigError(f"names the unknown {what} '{name}'", where, hint)
