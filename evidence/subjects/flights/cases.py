"""The cases of the chart: recordings whose applied force and moment are known, and what is judged."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np

import forceid
from evidence.subjects.flights.twin import twin
from forceid.errors import ConfigError, DataError
from forceid.files.stored.hdf5 import read_motion
from forceid.records import Array, Recording
from forceid.scenes.recipe import load_recipe, simulate

LOADS = {"force": slice(0, 3), "moment": slice(3, 6)}


@dataclass(frozen=True)
class Case:
    """A recording and the wrench (time, 6) that acted, NaN where nobody knows it.

    name: of the chart; blind: the recording with its truth taken out, which is all that a method sees; key:
    hash of what was measured. measured: whether an instrument, and not a recipe, says what the truth is.
    """

    name: str
    blind: Recording
    wrench: Array
    key: str
    measured: bool

    @property
    def judged(self) -> slice:
        """The central three quarters of the record."""
        samples = len(self.blind.motion.time)
        return slice(samples // 8, samples - samples // 8)


def shipped() -> dict[str, Path]:
    """Recipes of the scenes that come with forceid, by name."""
    package = Path(str(files("forceid.scenes")))
    folders = package, Path(forceid.__file__).parents[1] / "data" / "synthetic"
    return {path.stem: path for folder in folders for path in sorted(folder.glob("*.toml"))}


def sources(asked: Sequence[str], bodies: Collection[str] = ()) -> list[Path]:
    """Recipes and motion files that words name: shipped scenes, or paths; all shipped scenes for no word.

    bodies: names beside those, that are known and no recordings.

    >>> [path.name for path in sources(["flexible_boomerang"])]
    ['flexible_boomerang.toml']
    >>> sources(["flexible_bomerang"])
    Traceback (most recent call last):
    forceid.errors.ConfigError: unknown scene 'flexible_bomerang'; did you mean 'flexible_boomerang'?
    """
    known = shipped()
    found = []
    for word in asked or sorted(known):
        path = known.get(word, Path(word))
        if word in bodies:
            continue
        if path.suffix not in (".toml", ".h5"):
            near = difflib.get_close_matches(word, [*known, *bodies], n=1, cutoff=0.0)
            raise ConfigError(f"unknown scene '{word}'", next_step=f"did you mean '{near[0]}'?")
        found.append(path)
    names = [path.stem for path in found] + [word for word in asked or bodies if word in bodies]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"two scenes are called '{twice[0]}'", next_step="rename one of them")
    return found


def records(source: Path, seeds: int) -> Iterator[Case]:
    """The case of a source once for every seed of its noise; of a motion file, the one that there is.

    The first seed is the recipe's own; those that follow count up from it. A motion file without truth has
    its twins instead, one a seed.
    """
    if source.suffix == ".h5":
        recording = read_motion(source)
        if "force" in recording.truth:
            yield case_of(source.stem, recording, True, str(source))
            return
        for k in range(seeds):
            yield case_of(source.stem, twin(recording, np.random.default_rng(k), str(source)), False)
        return
    first = load_recipe(source).seed
    for k in range(seeds):
        yield case_of(source.stem, simulate(load_recipe(source, first + k)), False, str(source))


def case_of(name: str, recording: Recording, measured: bool, where: str = "") -> Case:
    """A recording with its truth as a case; DataError where it has none."""
    if "force" not in recording.truth:
        raise DataError(
            "holds no /truth/force, expected the force that acted",
            where or name,
            "the chart measures errors: import the plates with the markers, or take a scene",
        )
    time = recording.motion.time
    wrench = np.full((len(time), 6), np.nan)
    for load, part in LOADS.items():
        if load in recording.truth:
            known = recording.truth[load]
            at = recording.truth.get("time", time)
            wrench[:, part] = np.stack([np.interp(time, at, axis) for axis in known.T], 1)
    digest = hashlib.sha256()
    motion, body = recording.motion, recording.body
    for array in (
        time, wrench, motion.position, motion.center, motion.orientation, motion.specific_force,
        motion.angular_velocity, motion.gravity, body.position, body.mass, body.mass_matrix, body.inertia,
    ):  # fmt: skip
        digest.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
    digest.update(repr(sorted(motion.noise_std.items())).encode())
    return Case(name, replace(recording, truth={}), wrench, digest.hexdigest()[:16], measured)
