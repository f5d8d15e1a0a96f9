"""Known loads as a file and the settings state them: their wrenches, where they act, along which axes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from forceid.config import KnownLoadSetting, Settings, Vector
from forceid.errors import ConfigError, DataError
from forceid.estimation.body.inertia import inertia_of
from forceid.records import Array, Body, KnownLoads, Recording


@dataclass(frozen=True)
class KnownLoad:
    """One known load: wrench (sample, 6), force then moment about `point`, with cov (sample, 6, 6).

    point: (3,) or (sample, 3) m, None for the mass center; body: whether that is a place on the body, about
    its mass center; turns: whether the vectors turn with the body. nodal (sample, node, 3) N: forces on
    nodes, arms (node, 3) m of these about the mass center, body axes.
    """

    name: str
    time: Array
    wrench: Array
    cov: Array
    point: Array | None = None
    body: bool = False
    turns: bool = False
    nodal: Array | None = None
    arms: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def follows(self) -> bool:
        """Whether its wrench about the mass center depends on where the body is."""
        return self.turns or self.point is not None or self.nodal is not None


def known_loads(recording: Recording, settings: Settings) -> tuple[KnownLoad, ...]:
    """The known loads of a recording, of the file and of the settings. ConfigError, DataError: see there."""
    body, motion, stored = recording.body, recording.motion, recording.known_loads
    asked = {load.name: load for load in settings.known_load}
    if not asked and stored is None:
        return ()
    if motion.position is None and motion.center is None:
        what = "needs a motion that shows where the body is, expected markers or a mean motion"
        kind, where = (ConfigError, "known_load") if stored is None else (DataError, "/load_known")
        raise kind(what, where, "add /motion/position, or leave the known loads out")
    if not settings.part and (stray := [load for load in asked.values() if load.part is not None]):
        what = f"{stray[0].name}: acts on the part '{stray[0].part}' of a body that is whole"
        raise ConfigError(what, "known_load", "leave out its part, or add [[part]] and [[joint]]")
    if len(asked) < len(settings.known_load):
        raise ConfigError("gives one name to two loads", "known_load", "name every load once")
    center = inertia_of(body).center
    series = () if stored is None else stored.name
    found = [of_file(stored, k, asked, body, center) for k in range(len(series)) if stored is not None]
    found += [constant(load, motion.time, body, center) for name, load in asked.items() if name not in series]
    if stored is not None and stored.nodal_force is not None:
        found.append(on_nodes(stored.time, stored.nodal_force, body, center))
    return tuple(found)


def loads_on_part(
    recording: Recording, own: Recording, settings: Settings, part: str
) -> tuple[KnownLoad, ...]:
    """The known loads that act on one part of a body, whose recording is `own`."""
    stored = recording.known_loads
    own_loads = (load for load in settings.known_load if load.part == part)
    here = {load.name: load.model_copy(update={"part": None}) for load in own_loads}
    if stored is not None:
        series = [k for k, name in enumerate(stored.name) if name in here]
        fields = "force", "moment", "wrench_cov", "point"
        kept: dict[str, Any] = {
            f: None if (a := getattr(stored, f)) is None else a[:, series] for f in fields
        }
        stored = replace(stored, name=tuple(stored.name[k] for k in series), **kept) if series else None
    alone = settings.model_copy(update={"known_load": tuple(here.values()), "part": (), "joint": ()})
    return known_loads(replace(own, known_loads=stored), alone)


def of_file(
    stored: KnownLoads, k: int, asked: dict[str, KnownLoadSetting], body: Body, center: Array
) -> KnownLoad:
    """Load k of a file, whose place and axes the settings give where it has none."""
    setting = asked.get(stored.name[k], KnownLoadSetting(name=stored.name[k]))
    if setting.force is not None or setting.moment is not None:
        what = f"{setting.name}: states a load that /load_known holds as a series, expected one of the two"
        raise ConfigError(what, "known_load", "leave out force and moment, or give the load another name")
    none = np.zeros((len(stored.time), 3))
    parts = (none if a is None else a[:, k] for a in (stored.force, stored.moment))
    wrench = np.concatenate(list(parts), 1)
    cov = diagonal(setting) if stored.wrench_cov is None else stored.wrench_cov[:, k]
    if stored.point is not None:
        every = np.broadcast_to(cov, (len(wrench), 6, 6))
        return KnownLoad(setting.name, stored.time, wrench, every, stored.point[:, k])
    return placed(setting, stored.time, wrench, cov, body, center)


def constant(setting: KnownLoadSetting, time: Array, body: Body, center: Array) -> KnownLoad:
    """A constant load as the settings state it."""
    if setting.force is None and setting.moment is None:
        what = f"{setting.name}: has no force and no moment, and the file no series of that name"
        raise ConfigError(what, "known_load", "give force or moment, or a series in /load_known")
    wrench = np.concatenate([setting.force or (0.0, 0.0, 0.0), setting.moment or (0.0, 0.0, 0.0)])
    ends = time[[0, -1]]
    return placed(setting, ends, np.tile(wrench, (2, 1)), diagonal(setting), body, center)


def diagonal(setting: KnownLoadSetting) -> Array:
    """Covariance (6, 6) of the errors that the settings state."""
    return np.diag(np.repeat([setting.force_std, setting.moment_std], 3) ** 2)


def placed(
    setting: KnownLoadSetting, time: Array, wrench: Array, cov: Array, body: Body, center: Array
) -> KnownLoad:
    """A load where, and along the axes that, the settings say."""
    point, turns = place_of(setting.point, body, center), setting.axes == "body"
    on_body = point is not None and (turns or not is_vector(setting.point))
    if turns and point is not None and is_vector(setting.point):
        point = point - center
    cov = np.broadcast_to(cov, (len(time), 6, 6))
    return KnownLoad(setting.name, time, wrench, cov, point, on_body, turns)


def is_vector(point: str | Vector | tuple[str, ...]) -> bool:
    """Whether a point is given by coordinates."""
    return not isinstance(point, str) and not isinstance(point[0], str)


def place_of(point: str | Vector | tuple[str, ...], body: Body, center: Array) -> Array | None:
    """Coordinates (3,) m of a point, of nodes about the mass center; None for the mass center."""
    if point == "mass_center":
        return None
    if is_vector(point):
        return np.array(point, float)
    named = (point,) if isinstance(point, str) else point
    for name in named:
        if name not in body.node:
            what = f"names the point '{name}', expected mass_center, three coordinates or nodes"
            there = f"the nodes are {', '.join(body.node[:8])}" if body.node else "this body has no nodes"
            raise ConfigError(what, "known_load", there)
    if body.position is None:
        raise DataError("is missing, expected where nodes are", "/body/position", "add it")
    return np.asarray(body.position[[body.node.index(str(name)) for name in named]].mean(0) - center)


def on_nodes(time: Array, force: Array, body: Body, center: Array) -> KnownLoad:
    """Forces on the nodes, at the places that these have in the reference shape."""
    if body.position is None or len(body.position) != force.shape[1]:
        raise DataError("is missing, expected the place of every node", "/body/position", "add it")
    none = np.zeros((len(time), 6))
    cov = np.zeros((len(time), 6, 6))
    return KnownLoad("nodal_force", time, none, cov, nodal=force, arms=body.position - center)
