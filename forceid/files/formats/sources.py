"""From the files of a laboratory to recordings, as the import settings describe them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.spatial.transform import Rotation

from forceid import __version__
from forceid.errors import ConfigError
from forceid.files.checks.numbers import check_quaternions
from forceid.files.formats.bodies.body_file import with_body_file
from forceid.files.formats.bodies.person import Placed, with_person
from forceid.files.formats.bodies.turning import with_turning
from forceid.files.formats.captures.capture import Capture, Plates
from forceid.files.formats.captures.choice import chosen
from forceid.files.formats.captures.table import FORMATS, format_of
from forceid.files.formats.channels import Channels
from forceid.files.formats.clocks import agree, joined, spread
from forceid.files.formats.csv import CsvTable, part, read_csv
from forceid.files.formats.logs.table import LOGS, log_of
from forceid.files.formats.mat import read_mat
from forceid.files.formats.mocap import read_columns, read_mot
from forceid.files.formats.plates import pair_plates, plate_settings, plate_truth, split_plates, window
from forceid.files.formats.proposal import proposal
from forceid.files.formats.segments import (
    build_body,
    known_name,
    marker_clusters,
    mass_points,
    resting_markers,
)
from forceid.files.formats.signals import Signals, motion_signals
from forceid.files.formats.sto import read_sto
from forceid.files.formats.tdms import read_tdms
from forceid.files.formats.uff import read_uff
from forceid.files.schema import hash_arrays, motion_groups
from forceid.files.validate import check_recording
from forceid.files.values import canonical
from forceid.import_settings import ChannelSetting, ImportSettings, PlateSetting, UntilSetting
from forceid.import_settings import load_import_settings as load_import_settings
from forceid.records import Array, Body, Motion, Recording

TABLES: dict[str, Callable[[Path], Channels]] = {
    ".mat": read_mat, ".uff": read_uff, ".unv": read_uff, ".tdms": read_tdms,
    ".sto": read_sto,
}  # fmt: skip
TEXTS = (".csv", ".tsv", ".txt")  # of tables of named columns
ATTRIBUTE = 60_000  # bytes of a text beside a file's variables: HDF5 keeps 64 kB there


def import_sources(paths: Sequence[str | Path], settings: ImportSettings) -> list[tuple[str, Recording]]:
    """Named recordings from the files of a laboratory; a mot or sto file adds the truth to its capture.

    One recording a capture; one a group of a CSV file that is parted. ConfigError: settings that do not fit
    the files. DataError: files that do not hold what the settings or the contract ask for.
    """
    files = [Path(path) for path in paths]
    beside = [path for path in files if path.suffix.lower() in (".mot", ".sto")]
    if len(beside) == len(files):  # nothing that their loads could belong to
        beside = [path for path in files if path.suffix.lower() == ".mot"]
    captures = [path for path in files if path not in beside]
    plates = pair_plates(captures, beside)
    return [pair for path in captures for pair in import_named(path, plates.get(path), settings)]


def settings_for(sources: Sequence[str | Path], config: str = "") -> str:
    """The import settings that sources need, as commented TOML to fill in; see proposal.

    Of the first source, and of the force plates beside it. config: what the settings are to be called.
    """
    files = [Path(path) for path in sources]
    text = proposal(files, TABLES, config)
    beside = [path for path in files[1:] if path.suffix.lower() in (".mot", ".sto")]
    return text + "".join(plate_settings(read_columns(path)[0]) for path in beside[:1])


def import_named(path: Path, mot: Path | None, settings: ImportSettings) -> list[tuple[str, Recording]]:
    """The recordings in one file; settings that do not fit it are refused with its name."""
    try:
        return import_capture(path, mot, settings)
    except ConfigError as e:
        if str(path) in str(e):
            raise
        raise ConfigError(e.what, f"{path}: {e.where}", e.next_step) from e


def import_capture(path: Path, mot: Path | None, settings: ImportSettings) -> list[tuple[str, Recording]]:
    """The recordings in one file, with the plates of `mot` as truth, or as loads that are known."""
    said = {"import": settings.model_dump(mode="json", exclude_unset=True, exclude_none=True)}
    settings = with_body_file(settings, str(path))
    plates = None if mot is None else read_mot(mot, settings.plates or PlateSetting())
    read, own = read_signals(path, settings)
    if own is not None and plates is not None:
        read = [
            (name, without_plates(signals, own, "in place of which are others")) for name, signals in read
        ]
    plates = own if plates is None else plates
    used = [path, *([] if mot is None else [mot])]
    used += [path.parent / name for name in (settings.static, settings.body.file) if name]
    files = " ".join(p.name for p in used[: 1 + (mot is not None)])
    came: dict[str, Any] = {
        "import_settings": tomli_w.dumps(said)[:ATTRIBUTE],
        "source_sha256": "\n".join(f"{sha256(p.read_bytes()).hexdigest()}  {p.name}" for p in used),
    }
    found = []
    for name, signals in read:
        recording = assemble_recording(signals, plates, settings, str(path), files, name)
        left = [f"left out {what}" for what in signals.left_out]
        history = "\n".join([f"forceid {__version__} import {files}", *left])
        found.append((name, replace(recording, history=history, **came)))
    return found


def read_signals(path: Path, settings: ImportSettings) -> tuple[list[tuple[str, Signals]], Plates | None]:
    """The named recordings in one file, in SI; its plates, if asked for."""
    ending = path.suffix.lower()
    form = None if settings.csv is not None and ending in TEXTS else format_of(path)
    if form is None:
        return read_tables(path, settings), None
    capture = form.read(path)
    signals = chosen(capture, settings, str(path))
    if settings.channels is not None:
        signals = with_analog(signals, capture, settings.channels, str(path))
    plates, asked = capture.plates, settings.plates
    if plates is not None and asked is None:
        signals = without_plates(signals, plates, "which the table [import.plates] asks for")
        return [(path.stem, signals)], None
    if plates is not None and asked is not None:
        if "plate" in asked.model_fields_set:
            taken = [known_name(one, plates.name, "[import.plates] plate:") for one in asked.plate]
            plates = plates.of(taken)
        plates = plates.on_body(np.array(settings.gravity))
    return [(path.stem, signals)], plates


def with_analog(signals: Signals, capture: Capture, setting: ChannelSetting, where: str) -> Signals:
    """Signals of a capture with the sensors that its analog channels are, on one clock."""
    if capture.analog is None:
        raise ConfigError("holds no analog channels", f"{where}: [import.channels]", "drop the table")
    other = motion_signals(capture.analog, setting, {})
    if both := set(other.variables) & set(signals.variables) - {"time"}:
        what = f"names {min(both)}, which the capture has itself, expected sensors"
        raise ConfigError(what, f"{where}: [import.channels]", "leave it out")
    own, further = signals.variables["time"], other.variables["time"]
    time = own if agree(own, further) else joined([own, further])
    variables = {
        name: spread(value, clock, time)
        for part, clock in ((signals, own), (other, further))
        for name, value in part.variables.items()
        if name != "time"
    }
    left = [what for what in signals.left_out if not what.endswith("analog channels")]
    left_out = (*left, *other.left_out)
    return replace(signals, variables={"time": time, **variables}, sensor=other.sensor, left_out=left_out)


def without_plates(signals: Signals, plates: Plates, why: str) -> Signals:
    """Signals that say which plates are left out, and why."""
    return replace(signals, left_out=(*signals.left_out, f"force plates {', '.join(plates.name)}, {why}"))


def read_tables(path: Path, settings: ImportSettings) -> list[tuple[str, Signals]]:
    """The same of a file of named columns or channels, which the settings tell the meaning of."""
    ending, reference = path.suffix.lower(), settings.body.position
    if settings.csv is None and (log := log_of(path)) is not None:
        channels = log.read(path)
        said = settings.channels or ChannelSetting.model_validate(channels.sensor)
        return [(path.stem, motion_signals(channels, said, reference))]
    if ending in TEXTS:
        if settings.csv is None:
            what = "needs the table [import.csv], which names its columns"
            raise ConfigError(what, str(path), f"`forceid import --init {path.name}` writes one")
        found_in = []
        for name, rows in part(read_csv(path, settings.csv.delimiter), settings.csv, str(path)):
            columns = Channels(str(path), "column", CsvTable(rows, str(path)), table="import.csv")
            signals = motion_signals(columns, settings.csv, reference)
            found_in.append((f"{path.stem}-{name}" if name else path.stem, signals))
        return found_in
    if ending not in TABLES:
        known = ", ".join([*(one.name for one in (*FORMATS, *LOGS)), *(key[1:] for key in (".csv", *TABLES))])
        what = f"begins as no known format and ends in {path.suffix!r}, expected {known}"
        raise ConfigError(what, str(path), "convert it first")
    if settings.channels is None:
        what = "needs the table [import.channels], which says what its channels are"
        raise ConfigError(what, str(path), f"`forceid import --init {path.name}` writes one")
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
        settings, placed = with_person(settings, signals.node, where)
        names, markers = placed(signals.node, values["position"])
        points = mass_points(names, markers, settings, where)
        still = at_rest(names, placed, settings, where)
        clusters = marker_clusters(names, markers, settings, where, still)
        values = values | {"position": points.position}
        values = values | ({"marker_position": markers} if clusters else {})
    elif settings.segment or settings.body.table:
        raise ConfigError(
            "has segments, expected markers to place them", "[import.segment]:", "drop the table"
        )
    for key in settings.noise_std:
        known_name(key, tuple(values), "[import] noise_std:")
    turning, values = with_turning(settings, values)
    body = replace(build_body(settings, points, signals.sensor, where), **clusters, **turning)
    if "orientation" in values:
        check_quaternions(values["orientation"], f"{where}:/motion/orientation")
        values = values | {"orientation": canonical(values["orientation"])}
    gravity, noise_std = np.array(settings.gravity), dict(settings.noise_std)
    motion = Motion(**values, gravity=gravity, noise_std=noise_std)  # type: ignore[arg-type]
    beforehand = () if settings.plates is None else settings.plates.known
    judged, known = (None, None) if plates is None else split_plates(plates, beforehand)
    keep = window(motion.time, settings.start, settings.stop)
    if settings.until is not None:
        keep &= np.arange(len(keep)) < first_contact(motion, body, settings.until)
    recording = Recording(
        body=body,
        motion=replace(motion, **{k: v[keep] for k, v in values.items()}),  # type: ignore[arg-type]
        truth={} if judged is None else plate_truth(judged, motion.time, points, motion.time[keep]),
        title=f"{settings.title}: {name}" if settings.title else name,
        source=settings.source or files,
        known_loads=known,
    )
    check_recording(recording, where)
    return replace(recording, sha256=hash_arrays(motion_groups(recording)))


def at_rest(name: tuple[str, ...], placed: Placed, settings: ImportSettings, where: str) -> Array | None:
    """The markers (marker, 3) m of the static capture of the settings, None without one.

    placed: puts the points of a person beside markers.
    """
    if not settings.static:
        return None
    path = Path(where).parent / settings.static
    if (form := format_of(path)) is None:
        what = f"static names {settings.static!r}, expected a capture ({', '.join(f.name for f in FORMATS)})"
        raise ConfigError(what, "[import]:", "give the name of one beside the others")
    shown = form.read(path)
    return resting_markers(name, *placed(shown.name, shown.position))


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
