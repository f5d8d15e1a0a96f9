"""From the files of a laboratory to recordings, as the import settings describe them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forceid import __version__
from forceid.errors import ConfigError
from forceid.files.checks.numbers import check_quaternions
from forceid.files.formats.channels import Channels
from forceid.files.formats.csv import CsvTable, part, read_csv
from forceid.files.formats.mat import read_mat
from forceid.files.formats.mocap import Markers, Plates, read_c3d, read_mot, read_trc
from forceid.files.formats.segments import (
    Points,
    build_body,
    known_name,
    marker_clusters,
    mass_points,
    resting_markers,
)
from forceid.files.formats.signals import Signals, motion_signals
from forceid.files.formats.tdms import read_tdms
from forceid.files.formats.uff import read_uff
from forceid.files.parse import canonical
from forceid.files.schema import hash_arrays, motion_groups
from forceid.files.validate import check_recording
from forceid.import_settings import ImportSettings, PlateSetting, UntilSetting
from forceid.import_settings import load_import_settings as load_import_settings
from forceid.records import Array, Body, KnownLoads, Motion, Recording

CAPTURES: dict[str, Callable[[Path], Markers]] = {".trc": read_trc, ".c3d": read_c3d}
TABLES: dict[str, Callable[[Path], Channels]] = {
    ".mat": read_mat, ".uff": read_uff, ".unv": read_uff, ".tdms": read_tdms
}  # fmt: skip


def import_sources(paths: Sequence[str | Path], settings: ImportSettings) -> list[tuple[str, Recording]]:
    """Named recordings from the files of a laboratory; a mot file adds the truth to its capture.

    One recording a capture; one a group of a CSV file that is parted. ConfigError: settings that do not fit
    the files. DataError: files that do not hold what the settings or the contract ask for.
    """
    files = [Path(path) for path in paths]
    captures = [path for path in files if path.suffix.lower() != ".mot"]
    plates = pair_plates(captures, [path for path in files if path.suffix.lower() == ".mot"])
    return [pair for path in captures for pair in import_capture(path, plates.get(path), settings)]


def pair_plates(captures: Sequence[Path], plates: Sequence[Path]) -> dict[Path, Path]:
    """The plates of each capture: those whose name its own begins; a lone capture takes lone plates."""
    pairs: dict[Path, Path] = {}
    for mot in plates:
        alone = len(captures) == len(plates) == 1
        named = [path for path in captures if alone or mot.stem.startswith(path.stem)]
        if not named:
            raise ConfigError(
                "belongs to no capture, expected one whose name begins its own", str(mot), "add it"
            )
        capture = max(named, key=lambda path: len(path.stem))
        if capture in pairs:
            raise ConfigError(
                f"belongs to {capture.name}, as does {pairs[capture].name}", str(mot), "drop one"
            )
        pairs[capture] = mot
    return pairs


def import_capture(path: Path, mot: Path | None, settings: ImportSettings) -> list[tuple[str, Recording]]:
    """The recordings in one file, with the plates of `mot` as truth, or as loads that are known."""
    plates = None if mot is None else read_mot(mot, settings.plates or PlateSetting())
    files = " ".join(p.name for p in (path, mot) if p is not None)
    return [
        (name, assemble_recording(signals, plates, settings, str(path), files, name))
        for name, signals in read_signals(path, settings)
    ]


def read_signals(path: Path, settings: ImportSettings) -> list[tuple[str, Signals]]:
    """The named recordings in one file, as measured variables in SI."""
    ending = path.suffix.lower()
    if ending in CAPTURES:
        markers = CAPTURES[ending](path)
        found = {"time": markers.time, "position": markers.position}
        return [(path.stem, Signals(found, markers.name))]
    reference = settings.body.position
    if ending == ".csv":
        if settings.csv is None:
            raise ConfigError("needs the table [import.csv], which names its columns", str(path), "add it")
        found_in = []
        for name, rows in part(read_csv(path, settings.csv.delimiter), settings.csv, str(path)):
            columns = Channels(str(path), "column", CsvTable(rows, str(path)), table="import.csv")
            signals = motion_signals(columns, settings.csv, reference)
            found_in.append((f"{path.stem}-{name}" if name else path.stem, signals))
        return found_in
    if ending not in TABLES:
        known = ", ".join(key[1:] for key in (".csv", *CAPTURES, *TABLES))
        raise ConfigError(f"ends in {path.suffix!r}, expected {known}", str(path), "convert it first")
    if settings.channels is None:
        what = "needs the table [import.channels], which says what its channels are"
        raise ConfigError(what, str(path), "add it: `forceid import --help` shows one")
    return [(path.stem, motion_signals(TABLES[ending](path), settings.channels, reference))]


def with_geometry(settings: ImportSettings, signals: Signals) -> ImportSettings:
    """The settings with the places that the file knows, where they name none and it knows all."""
    known, body = signals.geometry, settings.body

    def fill(names: Sequence[str]) -> dict[str, tuple[float, float, float]]:
        complete = bool(names) and all(name in known for name in names)
        return {name: tuple(known[name].tolist()) for name in names} if complete else {}

    filled = {}
    if not body.position and not settings.segment:
        filled["position"] = fill(signals.node)
    if not body.sensor_position:
        filled["sensor_position"] = fill(signals.sensor)
    return settings.model_copy(update={"body": body.model_copy(update=filled)})


def assemble_recording(
    signals: Signals,
    plates: Plates | None,
    settings: ImportSettings,
    where: str,
    files: str,
    name: str,
) -> Recording:
    """A checked recording of measured variables, the settings and, where there are plates, the truth."""
    points, values, settings = None, signals.variables, with_geometry(settings, signals)
    clusters: dict[str, Any] = {}
    if "position" in values:
        markers = values["position"]
        points = mass_points(signals.node, markers, settings, where)
        still = at_rest(signals.node, settings, where)
        clusters = marker_clusters(signals.node, markers, settings, where, still)
        values = values | {"position": points.position}
        values = values | ({"marker_position": markers} if clusters else {})
    elif settings.segment:
        raise ConfigError(
            "has segments, expected markers to place them", "[import.segment]:", "drop the table"
        )
    for key in settings.noise_std:
        known_name(key, tuple(values), "[import] noise_std:")
    body = replace(build_body(settings, points, signals.sensor, where), **clusters)
    if "orientation" in values:
        check_quaternions(values["orientation"], f"{where}:/motion/orientation")
        values = values | {"orientation": canonical(values["orientation"])}
    gravity, noise_std = np.array(settings.gravity), dict(settings.noise_std)
    motion = Motion(**values, gravity=gravity, noise_std=noise_std)  # type: ignore[arg-type]
    judged, known = (None, None) if plates is None else split_plates(plates, settings)
    keep = window(motion.time, settings.start, settings.stop)
    if settings.until is not None:
        keep &= np.arange(len(keep)) < first_contact(motion, body, settings.until)
    recording = Recording(
        body=body,
        motion=replace(motion, **{k: v[keep] for k, v in values.items()}),  # type: ignore[arg-type]
        truth={} if judged is None else plate_truth(judged, motion.time, points, motion.time[keep]),
        title=f"{settings.title}: {name}" if settings.title else name,
        source=settings.source or files,
        history=f"forceid {__version__} import {files}",
        known_loads=known,
    )
    check_recording(recording, where)
    return replace(recording, sha256=hash_arrays(motion_groups(recording)))


def at_rest(name: tuple[str, ...], settings: ImportSettings, where: str) -> Array | None:
    """The markers (marker, 3) m of the static capture of the settings, None without one."""
    if not settings.static:
        return None
    path = Path(where).parent / settings.static
    if path.suffix.lower() not in CAPTURES:
        what = f"static names {settings.static!r}, expected a capture ({', '.join(CAPTURES)})"
        raise ConfigError(what, "[import]:", "give the name of one beside the others")
    shown = CAPTURES[path.suffix.lower()](path)
    return resting_markers(name, shown.name, shown.position)


def window(time: Array, start: float | None, stop: float | None) -> NDArray[np.bool_]:
    """Which times lie between start and stop (s), both included."""
    low, high = -np.inf if start is None else start, np.inf if stop is None else stop
    return ~((time < low) | (time > high))


def first_contact(motion: Motion, body: Body, until: UntilSetting) -> int:
    """The first row in which the lowest point of the body is within the clearance of the plane."""
    axis = "xyz".index(until.axis)
    if motion.position is not None:
        height = motion.position[..., axis]
    elif motion.center is not None and motion.orientation is not None and body.position is not None:
        offset = body.position - (0.0 if body.mass_center is None else body.mass_center)
        seen = np.isfinite(motion.orientation).all(-1)
        turned = np.full((len(motion.center), *offset.shape), np.nan)
        R_world_body = Rotation.from_quat(motion.orientation[seen]).as_matrix()
        turned[seen] = np.einsum("tij,nj->tni", R_world_body, offset)
        height = (motion.center[:, None] + turned)[..., axis]
    else:
        raise ConfigError(
            "needs points of the body", "[import.until]:", "give them as [import.body] position"
        )
    low = np.fmin.reduce(height, axis=1) - until.height < until.clearance
    return int(np.argmax(low)) if np.any(low) else len(motion.time)


def split_plates(plates: Plates, settings: ImportSettings) -> tuple[Plates | None, KnownLoads | None]:
    """The plates to compare with, and those that are known beforehand; None where there are none."""
    setting = settings.plates or PlateSetting()
    for name in setting.known:
        known_name(name, setting.plate, "[import.plates] known:")
    which = [k for k, name in enumerate(setting.plate) if name in setting.known]
    rest = [k for k in range(len(setting.plate)) if k not in which]
    names = tuple(f"plate_{setting.plate[k]}" for k in which)
    own = plates.of(which)
    known = KnownLoads(own.time, names, own.force, own.moment, point=own.point) if which else None
    return plates.of(rest) if rest else None, known


def plate_truth(plates: Plates, time: Array, points: Points | None, kept: Array) -> dict[str, Array]:
    """Force and moment of all plates about the mass center of the points, on the plates' own time.

    Between frames the mass center is interpolated linearly; where it is not known the moment is NaN.
    """
    if points is None or points.mass is None:
        what = "need the mass of the markers, expected it for the moment about the mass center"
        raise ConfigError(what, "plates", "give [[import.segment]] or [import.body] mass")
    carrying = points.mass > 0
    center = np.einsum("n,tni->ti", points.mass[carrying] / points.mass.sum(), points.position[:, carrying])
    keep = window(plates.time, kept[0], kept[-1]) if len(kept) else np.zeros(len(plates.time), bool)
    at = np.stack([np.interp(plates.time, time, c, left=np.nan, right=np.nan) for c in center.T], -1)
    moment = (np.cross(plates.point - at[:, None], plates.force) + plates.moment).sum(1)
    return {"time": plates.time[keep], "force": plates.force.sum(1)[keep], "moment": moment[keep]}
