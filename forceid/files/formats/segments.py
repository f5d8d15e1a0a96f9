"""Bodies of markers: mass points at fixed combinations of them, mass, shape, and which stay on which segment.

A mass point needs a marker or two; all others are kept beside it, since they show how far a segment is off.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.import_settings import ImportSettings
from forceid.records import Array, Body

_MASS_LOST = 5e-3  # of the total mass: published tables are rounded, forgotten segments are not that small
FEWEST = 3  # markers that fix how a segment stands


@dataclass(frozen=True)
class Points:
    """Tracked points: name, position (time, node, 3) m, mass (node,) kg where the settings give it."""

    name: tuple[str, ...]
    position: Array
    mass: Array | None


def mass_points(name: tuple[str, ...], position: Array, settings: ImportSettings, where: str) -> Points:
    """The nodes of the body: the mass points of the segments, or the markers themselves where there are none.

    A mass point is NaN in a frame where one of its markers is. A marker that [import.body] mass does not
    name carries none. ConfigError: an unknown marker, or masses that do not add up to total_mass.
    """
    body = settings.body
    if not settings.segment:
        for marker in body.mass:
            known_name(marker, name, "[import.body] mass")
        return Points(name, position, np.array([body.mass.get(n, 0.0) for n in name]) if body.mass else None)
    nodes = point_weights(name, settings, where)
    mass = np.zeros(len(nodes))
    for segment in settings.segment:
        if segment.mass_fraction is not None and body.total_mass is None:
            what = f"segment {segment.name} has a mass_fraction, expected total_mass beside it"
            raise ConfigError(what, "[import.body]:", "add total_mass (kg)")
        own = (segment.mass_fraction or 0.0) * (body.total_mass or 0.0) + (segment.mass or 0.0)
        for point in segment.points:
            mass[list(nodes).index(point)] = own / len(segment.points)
    if body.total_mass is not None and abs(mass.sum() / body.total_mass - 1) > _MASS_LOST:
        what = f"segments add up to {mass.sum():.5g} kg, expected total_mass {body.total_mass:.5g} kg"
        raise ConfigError(what, "[import.segment]:", "complete the segment table, or correct total_mass")
    # one product a segment: in a common one, 0 times NaN would spread the gaps of the others
    points = np.stack([np.einsum("n,tni->ti", w[w != 0], position[:, w != 0]) for w in nodes.values()], 1)
    return Points(tuple(nodes), points, mass)


def point_weights(name: tuple[str, ...], settings: ImportSettings, where: str) -> dict[str, Array]:
    """Weights (marker,) of the mass points of all segments, by name. ConfigError: an unknown marker."""
    nodes = {}
    for segment in settings.segment:
        for point, markers in segment.points.items():
            nodes[point] = np.zeros(len(name))
            for marker, share in markers.items():
                nodes[point][known_name(marker, name, f"{where}: segment {segment.name}:")] = share
    return nodes


def build_body(settings: ImportSettings, points: Points | None, sensors: Iterable[str], where: str) -> Body:
    """The body of the settings; its shape is theirs, or else the first frame that shows all nodes."""
    given = settings.body
    rigid = points is None or points.mass is None
    node = tuple(given.position) if points is None else points.name
    position = rows(given.position, node, "position")
    if points is not None:
        if rigid and not given.position:
            what = "has no position of the markers, expected one in the axes of mass_center and inertia"
            raise ConfigError(what, "[import.body]:", "add position, or the mass of every marker")
        position = first_complete(points.position, where) if position is None else position
    inertia = None if given.inertia is None else np.array(given.inertia, float)
    names = tuple(sensors)
    return Body(
        node=node,
        position=position,
        mass=None if points is None else points.mass,
        total_mass=given.total_mass if rigid else None,
        mass_center=np.array(given.mass_center) if rigid and given.total_mass else None,
        inertia=inertia if rigid else None,
        mass_rate=given.mass_rate,
        sensor_position=rows(given.sensor_position, names, "sensor_position"),
        sensor_rotation=rows(given.sensor_rotation, names, "sensor_rotation"),
    )


def first_complete(position: Array, where: str) -> Array:
    """The first frame (node, 3) in which every node is seen. DataError: there is none."""
    complete = np.isfinite(position).all((1, 2))
    if not complete.any():
        what = "has no frame that shows every node, expected one for the reference shape"
        raise DataError(what, where, "give [import.body] position, or leave the lost node out")
    first: Array = position[np.argmax(complete)]
    return first


def rows(table: Mapping[str, tuple[float, ...]], names: tuple[str, ...], key: str) -> Array | None:
    """The rows of a table in the order of `names`; None when the table is empty."""
    if not table:
        return None
    if lacking := [name for name in names if name not in table]:
        raise ConfigError(
            f"lacks {lacking[0]!r}", f"[import.body] {key}:", "give every node and sensor its own"
        )
    return np.array([table[name] for name in names], float)


def known_name(name: str, known: tuple[str, ...], where: str) -> int:
    """The index of a name. ConfigError: it is unknown; names the nearest known one."""
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
        raise ConfigError(f"unknown name {name!r}", where, f"did you mean {near[0]!r}?" if near else "")
    return known.index(name)


def marker_clusters(
    name: tuple[str, ...], position: Array, settings: ImportSettings, where: str, still: Array | None = None
) -> dict[str, Any]:
    """The fields of a Body that say what its markers show of segments and joints; none without clusters.

    name (marker,), position (time, marker, 3) m; still (marker, 3) m: where markers are in a static capture,
    NaN where it does not show them. ConfigError: unknown names, too few markers on a segment.
    """
    clustered = [segment for segment in settings.segment if segment.cluster]
    if not clustered:
        if settings.joint:
            what = "joins segments that have no cluster, expected the markers on each"
            raise ConfigError(what, "[import.joint]:", "add cluster to the segments")
        return {}
    points = point_weights(name, settings, where)
    nodes, owner = tuple(points), np.full(len(name), -1.0)
    for segment in clustered:
        if len(segment.cluster) < FEWEST:
            what = f"segment {segment.name} has {len(segment.cluster)} markers in its cluster"
            raise ConfigError(what, "[import.segment]:", f"a segment that turns needs {FEWEST}")
        for marker in segment.cluster:
            k = known_name(marker, name, f"{where}: cluster of {segment.name}:")
            if owner[k] >= 0:
                what = f"marker {marker} is in the clusters of {nodes[int(owner[k])]} and {segment.name}"
                raise ConfigError(what, "[import.segment]:", "leave it where it moves least")
            owner[k] = nodes.index(segment.name)
    shape = reference_pose(position, still, where)
    with_cluster = tuple(segment.name for segment in clustered)
    sides, places = [], []
    for joint, setting in settings.joint.items():
        sides.append([nodes.index(with_cluster[known_name(side, with_cluster, f"[import.joint.{joint}]")])
                      for side in setting.segments])  # fmt: skip
        at = [known_name(marker, name, f"[import.joint.{joint}]") for marker in setting.markers]
        places.append(np.array(list(setting.markers.values())) @ shape[at])
    if not sides:  # segments that meet nowhere tell nothing of each other
        return {}
    return {
        "marker": name, "marker_weight": np.stack(list(points.values())),
        "marker_segment": owner, "marker_shape": shape,
        "joint": tuple(settings.joint), "joint_segment": np.array(sides, float).reshape(-1, 2),
        "joint_shape": np.array(places, float).reshape(-1, 3),
    }  # fmt: skip


def reference_pose(position: Array, still: Array | None, where: str) -> Array:
    """Markers (marker, 3) m in one pose: of the static capture, else of the first frame that shows all."""
    whole = np.isfinite(position).all((1, 2))
    if still is not None and np.isfinite(still).all():
        return still
    if still is None and whole.any():
        return np.asarray(position[np.argmax(whole)])
    what = "shows no pose of all markers" if still is None else "is shown at rest without some markers"
    raise DataError(what, where, "give a static capture ([import] static) that shows all of them")


def resting_markers(name: tuple[str, ...], shown: tuple[str, ...], position: Array) -> Array:
    """Medians (marker, 3) m of the markers of a static capture, in the order of `name`; NaN for others."""
    middle = np.full((len(name), 3), np.nan)
    for k, marker in enumerate(name):
        if marker in shown:
            track = position[:, shown.index(marker)]
            seen = np.isfinite(track).all(1)
            middle[k] = np.median(track[seen], axis=0) if seen.any() else np.nan
    return middle
