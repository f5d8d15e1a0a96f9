"""From named channels to the variables of /motion, as the import settings say: names, units, clock."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.files.formats.captures.capture import listed
from forceid.files.formats.channels import Channels, base_of, nearest_names, raw, shape_of
from forceid.files.formats.clocks import agree, joined, spread
from forceid.files.schema import MOTION
from forceid.files.units import si_factor
from forceid.import_settings import ON_SENSORS, ChannelSetting
from forceid.records import Array

Spec = str | tuple[str, ...]
_UNITS = {name: variable.units for name, variable in MOTION.items()} | {"displacement": "m"}


@dataclass(frozen=True)
class Signals:
    """Variables of /motion in SI, the names of their nodes and sensors, and places (3,) m of nodes.

    left_out: what else the file holds, in words.
    """

    variables: dict[str, Array]
    node: tuple[str, ...] = ()
    sensor: tuple[str, ...] = ()
    geometry: dict[str, Array] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def motion_signals(
    channels: Channels, setting: ChannelSetting, reference: Mapping[str, Sequence[float]]
) -> Signals:
    """The variables of /motion that the settings name, in SI, and the nodes and sensors they belong to.

    reference: places (3,) m of nodes, before those of the file, to which displacements are added. DataError:
    a channel is missing, has no unit, no clock or another length. ConfigError: settings that clash.
    """
    where = f"[{channels.table}]"
    if not channels.values:
        raise DataError(f"holds no {channels.noun} of numbers", channels.where, "export it again, with data")
    look = Reader(channels, setting, looking=True)
    look.all()
    read = replace(look, used={}, looking=False, common=look.common_clock())
    found, names = read.all()
    if not found:
        what = f"names no {channels.noun}, expected position, center and orientation, or sensors"
        raise ConfigError(what, where, f"{channels.where} has {', '.join(list(channels.values)[:6])}")
    found["time"] = read.clock()
    sensor = same_sensors(found, names, where)
    geometry = node_places(channels, setting) | {
        k: np.asarray(place, float) for k, place in reference.items()
    }
    if "displacement" in found:
        if "position" in found:
            raise ConfigError("has position and displacement, expected one of them", where, "drop the other")
        node = names["position"] = names["displacement"]
        found["position"] = found.pop("displacement") + start_positions(node, geometry, channels)
    used = {setting.time, setting.rate, getattr(setting, "group", None), *read.used, *map(base_of, read.used)}
    rest = [name for name in channels.values if name not in used]
    left_out = (f"{channels.noun}s {listed(rest)}",) if rest else ()
    return Signals(found, names.get("position", ()), sensor, geometry, left_out)


@dataclass(frozen=True)
class Reader:
    """Channels as settings name them, in SI; used: how many samples each of those that were read has.

    looking: whether this only notes what is read, and together: the name of what has one clock of its own,
    with its channels. common: the clock (time,) s of all, on which what is not read then is NaN; None where
    all are read at once.
    """

    channels: Channels
    setting: ChannelSetting
    used: dict[str, int] = field(default_factory=dict)
    looking: bool = False
    together: dict[str, list[str]] = field(default_factory=dict)
    common: Array | None = None

    def all(self) -> tuple[dict[str, Array], dict[str, tuple[str, ...]]]:
        """The variables that the settings name, and the names of the nodes or sensors of each."""
        found, names = dict[str, Array](), dict[str, tuple[str, ...]]()
        for variable in ("position", "displacement", *ON_SENSORS):
            if spec := getattr(self.setting, variable):
                names[variable], found[variable] = self.points(variable, spec)
        for variable, width in (
            ("center", 3),
            ("orientation", 4),
            ("strain", len(self.setting.strain)),
            ("rotor_speed", len(self.setting.rotor_speed)),
        ):
            if spec := getattr(self.setting, variable):
                found[variable] = self.vector(variable, variable, spec, width)
        if (name := self.setting.current_mass) is not None:
            found["current_mass"] = self.counted(name, self.si("current_mass", name), "current_mass")
        return found, names

    def points(self, variable: str, spec: Mapping[str, Spec] | str) -> tuple[tuple[str, ...], Array]:
        """Vectors of nodes or sensors: their names, and (time, name, 3)."""
        if isinstance(spec, str) and "{name}" not in spec:
            return self.whole(variable, spec)
        table = matches(self.channels, spec) if isinstance(spec, str) else spec
        own = variable in ON_SENSORS
        vectors = [
            self.vector(variable, f"{variable} {name}" if own else variable, entry, 3)
            for name, entry in table.items()
        ]
        return tuple(table), np.stack(vectors, 1)

    def vector(self, variable: str, together: str, spec: Spec, width: int) -> Array:
        """One vector (time, width): each column a channel, or all of them in one channel, either way up.

        together: the name of what has one clock with it.
        """
        if isinstance(spec, str):
            values = self.si(variable, spec)
            self.require(spec, values.ndim == 2 and width in values.shape, values, f"{width} columns")
            values = values if values.shape[1] == width else values.T
            return self.counted(spec, values, together)
        columns = []
        for name in spec:
            column = self.si(variable, name)
            self.require(name, column.ndim == 1, column, "one number a sample")
            columns.append(self.counted(name, column, together))
        return np.stack(columns, -1)

    def whole(self, variable: str, name: str) -> tuple[tuple[str, ...], Array]:
        """All nodes in one array, its axes in the order of `dims`: three coordinates, or a fourth as well."""
        values, dims, channels = self.si(variable, name), self.setting.dims, self.channels
        self.require(name, values.ndim == 3, values, f"{' x '.join(dims)}, or a pattern with {{name}}")
        values = values.transpose([dims.index(d) for d in ("time", "node", "axis")])
        self.require(
            name, values.shape[2] in (3, 4), values, f"3 coordinates in {' x '.join(dims)}: set dims"
        )
        node = self.setting.nodes
        if isinstance(node, str):
            if node not in channels.label:
                hint = nearest_names(node, channels.label)
                raise DataError(f"has no list of names {node!r}", channels.where, hint)
            node = channels.label[node]
        node = node or tuple(str(k + 1) for k in range(values.shape[1]))
        if len(node) != values.shape[1]:
            what = f"holds {values.shape[1]} nodes, expected {len(node)} as `nodes` names"
            raise DataError(what, f"{channels.where}:{name}", "correct nodes, or the order in dims")
        return node, self.counted(name, values, variable)[..., :3]

    def si(self, variable: str, name: str) -> Array:
        """A channel in SI: by the unit of the settings, else of the file; as it is where that has none."""
        channels, given = self.channels, self.setting.units.get(variable)
        values, wanted, where = raw(channels, name), _UNITS[variable], f"{channels.where}:{name}"
        if given is not None or channels.unit is None:
            return np.asarray(si_factor(wanted if given is None else given, wanted, where) * values)
        stated = channels.unit.get(base_of(name), "").strip()
        next_step = f'say which: {channels.table}.units.{variable} = "{wanted}"'
        if not stated and wanted not in ("1", "s"):
            raise DataError(f"states no unit, expected one that converts to {wanted!r}", where, next_step)
        try:
            return np.asarray(si_factor(stated or wanted, wanted, where) * values)
        except DataError as e:
            raise DataError(e.what, where, f"correct it, or {next_step}") from e

    def clock(self) -> Array:
        """The times (time,) s: of a channel, by a rate, or of the clocks that the channels used have."""
        channels, setting, (first, count) = self.channels, self.setting, next(iter(self.used.items()))
        if setting.time is not None:
            time = self.si("time", setting.time)
            self.require(setting.time, time.ndim == 1, time, "one time a sample")
            return self.counted(setting.time, time)
        if setting.rate is not None:
            return np.asarray(np.arange(count) / stated_rate(channels, setting.rate))
        return self.own_clock(first) if self.common is None else self.common

    def own_clock(self, name: str) -> Array:
        """The times (time,) s of a channel. DataError: the file says none."""
        clock = self.channels.time.get(base_of(name))
        if clock is None:
            next_step = f'add {self.channels.table}.time = "NAME", or rate = HZ'
            raise DataError("says no times of the samples", f"{self.channels.where}:{name}", next_step)
        return clock

    def common_clock(self) -> Array | None:
        """One clock for all that was looked at, None where the settings state it or all have the same.

        DataError: the channels of one sensor, or of all nodes, have different ones.
        """
        if self.setting.time is not None or self.setting.rate is not None or not self.used:
            return None
        clocks: list[Array] = []
        for first, *others in self.together.values():
            clock = self.own_clock(first)
            for name in others:
                self.require_count(name, first)
                if not agree(clock, self.channels.time.get(base_of(name))):
                    what = f"has another clock than {first!r}, expected one for all"
                    next_step = "resample them to one clock, or leave it out"
                    raise DataError(what, f"{self.channels.where}:{name}", next_step)
            if not any(agree(known, clock) for known in clocks):
                clocks.append(clock)
        return joined(clocks) if len(clocks) > 1 else None

    def counted(self, name: str, values: Array, together: str = "") -> Array:
        """The values (time, ...) of a channel on the common clock. DataError: not as many as before."""
        self.used[name] = len(values)
        if self.looking:
            self.together.setdefault(together, []).append(name)
            return values[:0]
        if self.common is not None:
            return spread(values, self.own_clock(name), self.common)
        self.require_count(name, next(iter(self.used)))
        return values

    def require_count(self, name: str, first: str) -> None:
        """DataError unless a channel has as many samples as another."""
        if self.used[name] != self.used[first]:
            what = f"has {self.used[name]} samples, expected {self.used[first]} as {first!r} has"
            raise DataError(what, f"{self.channels.where}:{name}", "export both on one clock")

    def require(self, name: str, fits: bool, values: Array, expected: str) -> None:
        """DataError unless the shape of a channel fits."""
        if not fits:
            what = f"is {shape_of(values)}, expected {expected}"
            raise DataError(what, f"{self.channels.where}:{name}", f"correct [{self.channels.table}]")


def matches(channels: Channels, pattern: str) -> dict[str, Spec]:
    """The channels of each name that a pattern finds: {name} is anything, {axis} one of x y z or X Y Z.

    >>> zeros = dict.fromkeys(("tip x", "tip y", "tip z", "load"), np.zeros(3))
    >>> matches(Channels("a.csv", "column", zeros), "{name} {axis}")
    {'tip': ('tip x', 'tip y', 'tip z')}
    """
    text = (
        re.escape(pattern)
        .replace(r"\{name\}", "(?P<name>.+)", 1)
        .replace(r"\{axis\}", "(?P<axis>[xyzXYZ])", 1)
    )
    text = text.replace(r"\{name\}", "(?P=name)").replace(r"\{axis\}", "(?P=axis)")
    found: dict[str, dict[str, str]] = {}
    for channel in channels.values:
        if match := re.fullmatch(text, channel):
            axis = match["axis"].lower() if "{axis}" in pattern else ""
            found.setdefault(match["name"], {})[axis] = channel
    if not found:
        hint = nearest_names(pattern, channels.values)
        raise DataError(f"has no {channels.noun} like {pattern!r}", channels.where, hint)
    if "{axis}" not in pattern:
        return {name: axes[""] for name, axes in found.items()}
    for name, axes in found.items():
        if lacking := [axis for axis in "xyz" if axis not in axes]:
            what = f"has no axis {lacking[0]} of {name!r}, found {', '.join(axes.values())}"
            raise DataError(
                what, channels.where, "name the channels of each node, without the incomplete ones"
            )
    return {name: tuple(axes[axis] for axis in "xyz") for name, axes in found.items()}


def stated_rate(channels: Channels, rate: float | str) -> float:
    """A rate in Hz, stated or held by a channel of one number."""
    if not isinstance(rate, str):
        return rate
    values = raw(channels, rate)
    if values.size != 1 or not 0 < values.item() < np.inf:
        found = f"{values.item():g}" if values.size == 1 else f"{values.size} numbers"
        what = f"holds {found}, expected one positive rate in Hz"
        raise DataError(what, f"{channels.where}:{rate}", "give the number itself as rate")
    return float(values.item())


def node_places(channels: Channels, setting: ChannelSetting) -> dict[str, Array]:
    """The places (3,) m of nodes in the file; none where nobody says their unit."""
    unit = setting.units.get("geometry", channels.geometry_unit)
    if not unit:
        return {}
    factor = si_factor(unit, "m", f"{channels.where}:geometry")
    return {name: factor * place for name, place in channels.geometry.items()}


def start_positions(node: tuple[str, ...], geometry: Mapping[str, Array], channels: Channels) -> Array:
    """The places (node, 3) m that displacements start from."""
    for name in node:
        if name not in geometry:
            next_step = "give it in [import.body] position"
            if name in channels.geometry:
                next_step = f'say the unit of the places in the file: {channels.table}.units.geometry = "m"'
            what = f"has no place of node {name!r} in m, expected one that its displacement starts from"
            raise DataError(what, channels.where, next_step)
    return np.stack([geometry[name] for name in node])


def same_sensors(
    found: dict[str, Array], names: Mapping[str, tuple[str, ...]], where: str
) -> tuple[str, ...]:
    """The sensors of all their variables; puts those of every other in the order of the first."""
    first, *others = [variable for variable in ON_SENSORS if variable in names] or [""]
    order = names.get(first, ())
    for other in others:
        own = names[other]
        if set(order) != set(own):
            what = f"has sensors {', '.join(order)} of {first} but {', '.join(own)} of {other}"
            raise ConfigError(what, where, "name the same sensors in both")
        found[other] = found[other][:, [own.index(name) for name in order]]
    return order
