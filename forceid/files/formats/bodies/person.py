"""A person by name of a table: joint centers of the markers, and the segments and joints between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forceid.errors import ConfigError
from forceid.files.formats.bodies.joint_centers import joint_centers, on_line
from forceid.files.formats.bodies.marker_sets import known_sets, marker_set
from forceid.files.formats.bodies.tables import (
    SIDES,
    TableSegment,
    of_side,
    table_joints,
    table_segments,
)
from forceid.files.formats.segments import FEWEST, known_name
from forceid.import_settings import BodySetting, ImportSettings, JointSetting, SegmentSetting
from forceid.records import Array

Placed = Callable[[tuple[str, ...], Array], tuple[tuple[str, ...], Array]]
PREFIX = "point "  # of the names of points that are no markers
CARRIED = {  # points by what carries them, of sides or of the middle; shoulders glide
    "pelvis": ("left_hip", "right_hip", "mid_hip", "loin"), "thorax": ("neck", "cervicale"),
    "thigh": ("knee",), "shank": ("ankle",), "foot": ("heel", "toe_tip", "metatarsal"),
    "upper_arm": ("elbow",), "forearm": ("wrist", "knuckle"),
}  # fmt: skip


@dataclass(frozen=True)
class Person:
    """How markers become those and points beside them: the points that are placed, by name."""

    body: BodySetting
    point: tuple[str, ...]

    def placed(self, name: tuple[str, ...], position: Array) -> tuple[tuple[str, ...], Array]:
        """Markers (time, marker, 3) m with the points behind them, and all names."""
        shown = centers(self.body, name, position)
        lost = np.full((len(position), 3), np.nan)
        points = [shown.get(one, lost) for one in self.point]
        return (*name, *(PREFIX + one for one in self.point)), np.concatenate(
            [position, np.stack(points, 1)], 1
        )


def with_person(settings: ImportSettings, name: tuple[str, ...], where: str) -> tuple[ImportSettings, Placed]:
    """The settings with segments and joints of the table that they name, and what places their ends.

    name (marker,): of the capture. ConfigError: something of the person is not said, or no marker shows it.
    """
    body = settings.body
    if not body.table:
        return settings, lambda names, position: (names, position)
    if body.total_mass is None or body.height is None:
        lacking = "mass" if body.total_mass is None else "height"
        what = f"names the table {body.table} without {lacking}, expected mass (kg) and height (m)"
        raise ConfigError(what, "[import.body]:", f"add {lacking}")
    if settings.segment or body.mass:
        what = f"names the table {body.table} beside masses of its own, expected one of them"
        raise ConfigError(what, "[import.body]:", "leave out [[import.segment]] and the masses of markers")
    segments = table_segments(body.table, body.sex)
    shown = centers(body, name, np.zeros((1, len(name), 3)))
    ends = {end: on_line(end, shown) for segment in segments for end in segment.ends}
    if unseen := [end for end, parts in ends.items() if not parts]:
        raise ConfigError(*no_point(unseen, name), f"add [import.body.ends] {unseen[0]} = [MARKER, ...]")
    points = tuple(dict.fromkeys(point for parts in ends.values() for point in parts))
    on = clusters(body, segments, name, points)
    joints = {
        joint: JointSetting(segments=pair, markers={PREFIX + joint: 1.0})
        for joint, pair in table_joints(body.table).items()
        if all(on.get(one) for one in pair)
    }
    made = tuple(of_table(segment, ends, on.get(segment.name, ())) for segment in segments)
    settings = settings.model_copy(update={"segment": made, "joint": {**joints, **settings.joint}})
    return settings, Person(body, points).placed


def no_point(lacking: list[str], name: tuple[str, ...]) -> tuple[str, str]:
    """What is wrong, and where, for points that no marker shows."""
    known = marker_set(name)
    others = f"; nor {', '.join(lacking[1:4])}" if len(lacking) > 1 else ""
    sets = f"the marker set {known.name}" if known else f"no marker set of {', '.join(known_sets())}"
    return f"has no marker that shows {lacking[0]} ({sets}){others}", "[import.body]:"


def centers(body: BodySetting, name: tuple[str, ...], position: Array) -> dict[str, Array]:
    """All points (time, 3) m that the markers show, those that the settings name before those of a set."""
    known = marker_set(name)
    landmark: dict[str, tuple[str, ...]] = dict(known.landmark) if known else {}
    stated = {end: markers for end, markers in body.ends.items() if set(markers) <= set(name)}

    def middle(markers: tuple[str, ...]) -> Array:
        return np.asarray(np.mean([position[:, name.index(one)] for one in markers], axis=0))

    with np.errstate(invalid="ignore", divide="ignore"):  # of markers on one place no line is told
        return joint_centers(
            {one: middle(markers) for one, markers in (landmark | stated).items()}, body.height or 0.0
        )


def clusters(
    body: BodySetting, segments: tuple[TableSegment, ...], name: tuple[str, ...], points: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """Which markers stay on a segment: as the settings say, else those of the set where there are enough."""
    known = marker_set(name)
    ends = {end for segment in segments for end in segment.ends}
    for end, markers in body.ends.items():
        known_name(end, tuple(sorted(ends | LANDMARKS)), "[import.body.ends]")
        for marker in markers:
            known_name(marker, name, f"[import.body.ends] {end}:")
    found = {}
    for segment in segments:
        on = () if known is None else known.on.get(segment.on, ())
        if len(on) >= FEWEST:
            found[segment.name] = on
    for segment_name, markers in body.cluster.items():
        known_name(segment_name, tuple(s.name for s in segments), "[import.body.cluster]")
        found[segment_name] = markers
    for segment in segments:
        if segment.name in found:
            side = next((one for one in SIDES if segment.on.startswith(one)), "")
            kind = segment.on.removeprefix(f"{side}_")
            carried = [of_side(point, side) for point in CARRIED.get(kind, ())]
            found[segment.name] += tuple(PREFIX + point for point in carried if point in points)
    return found


LANDMARKS = {
    f"{side}{key}"
    for rows in known_sets().values()
    for key, names in rows.items()
    if key != "on"
    for side in ([f"{s}_" for s in SIDES] if any("{S}" in one for one in names) else [""])
}


def of_table(
    segment: TableSegment, ends: dict[str, dict[str, float]], cluster: tuple[str, ...]
) -> SegmentSetting:
    """The segment as the settings have it: two points on its line, at its radius of gyration across it.

    ends: its ends as combinations of points.
    """
    across = float(np.sqrt(np.mean(np.square(segment.gyration[:2]))))

    def combined(first: float, second: float) -> dict[str, float]:
        found: dict[str, float] = {}
        for end, share in zip(segment.ends, (first, second), strict=True):
            for point, part in ends[end].items():
                found[PREFIX + point] = found.get(PREFIX + point, 0.0) + share * part
        return found

    return SegmentSetting(
        name=segment.name, markers=combined(1 - segment.center, segment.center), cluster=cluster,
        gyration=combined(-across, across) if across else {}, mass_fraction=segment.mass,
    )  # fmt: skip
