"""Force plates beside a capture: whose they are, what is compared with them, and what is known of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forceid.errors import ConfigError
from forceid.files.formats.captures.capture import Plates
from forceid.files.formats.segments import Points, known_name
from forceid.import_settings import PlateSetting
from forceid.records import Array, KnownLoads


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


def plate_settings(columns: Sequence[str]) -> str:
    """The table [import.plates] that finds every plate in the columns of a MOT file, as TOML.

    >>> read = ("force_v", "force_p", "torque_")
    >>> print(plate_settings([f"{n}_ground_{k}{a}" for n in "12" for k in read for a in "xyz"]).strip())
    [import.plates]  # {plate} in the names of columns is each of these
    plate = ["1", "2"]
    force = "{plate}_ground_force_v"
    point = "{plate}_ground_force_p"
    moment = "{plate}_ground_torque_"
    """
    bases = [name[:-2] for name in columns if name.lower().endswith("vx")]
    begin, end = shared_beginning(bases), shared_beginning([base[::-1] for base in bases])[::-1]
    begin, end = begin[: begin.rfind("_") + 1], end[end.find("_") :] if "_" in end else ""
    one = PlateSetting()
    if len(bases) > 1:
        plates, pattern = (
            [base[len(begin) : len(base) - len(end)] for base in bases],
            f"{begin}{{plate}}{end}",
        )
    else:
        plates, pattern = list(one.plate), bases[0] if bases else one.force[:-1]
    turned = (pattern + "m", *(pattern.replace("force", word) for word in ("torque", "moment")))
    moment = next((t for t in turned if t.format(plate=plates[0]) + "x" in columns), one.moment)
    named = {"force": pattern + "v", "point": pattern + "p", "moment": moment}
    lines = [f"{what} = {json.dumps(name)}" for what, name in {"plate": plates, **named}.items()]
    return "\n".join(["", "[import.plates]  # {plate} in the names of columns is each of these", *lines, ""])


def shared_beginning(names: Sequence[str]) -> str:
    """What all names begin with."""
    return "".join(signs[0] for signs in takewhile(lambda of: len(set(of)) == 1, zip(*names, strict=False)))


def split_plates(plates: Plates, known: Sequence[str]) -> tuple[Plates | None, KnownLoads | None]:
    """The plates to compare with, and those that are known beforehand; None where there are none."""
    for name in known:
        known_name(name, plates.name, "[import.plates] known:")
    which = [k for k, name in enumerate(plates.name) if name in known]
    rest = [k for k in range(len(plates.name)) if k not in which]
    own = plates.of(which)
    names = tuple(f"plate_{name}" for name in own.name)
    loads = KnownLoads(own.time, names, own.force, own.moment, point=own.point) if which else None
    return plates.of(rest) if rest else None, loads


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


def window(time: Array, start: float | None, stop: float | None) -> NDArray[np.bool_]:
    """Which times lie between start and stop (s), both included."""
    low, high = -np.inf if start is None else start, np.inf if stop is None else stop
    return ~((time < low) | (time > high))
