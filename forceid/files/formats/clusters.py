"""Markers on the segments of a body: which stays on which, and where joints are among them.

A mass point needs a marker or two; all others are kept beside it, since they show how far a segment is off.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.files.formats.segments import known_name, point_weights
from forceid.import_settings import ImportSettings
from forceid.records import Array

FEWEST = 3  # markers that fix how a segment stands


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
