"""Scene recipes: a TOML file that says what flies, how it is measured, and what goes wrong on the way."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, Field
from scipy.spatial.transform import Rotation

from forceid.errors import ConfigError
from forceid.records import Array, Motion, Recording
from forceid.scenes.flights import (
    flexible_boomerang,
    frisbee,
    hinged,
    instrumented,
    particle,
    planar_boomerang,
    spinner,
    spinning_block,
    top,
    wobbling_drop,
)
from forceid.scenes.mechanics import KnownFlight
from forceid.sections import Section, read_toml, to_toml, validate

# each with its Parameters, fly(parameters, time) for the exact flight at sampled instants, and of a body with
# sensors sensor_channels(parameters, channels seen, truth, rng): those channels and those of the sensors,
# with the standard deviations of the sensors' noise
SCENES: dict[str, Any] = {
    scene.__name__.rpartition(".")[2]: scene
    for scene in (
        flexible_boomerang, frisbee, hinged, instrumented, particle, planar_boomerang, spinner,
        spinning_block, top, wobbling_drop,
    )
}  # fmt: skip


class Dropout(Section):
    """One marker not seen for `from` <= t <= `to` (s). node: its name or its zero-based index."""

    model_config = ConfigDict(populate_by_name=True)

    node: str | int
    start: float = Field(alias="from")
    stop: float = Field(alias="to")


class SceneRecipe(Section):
    """A scene and its measurement.

    duration s and sample_rate Hz give samples at 0, 1 / rate, ... before `duration`. jitter 1: each
    instant comes late by a uniform share of the step below `jitter`; the file holds the true instants.
    measure: "markers", or "mean_motion" for center and orientation. noise_std m: white, per component of
    markers or center; orientation_noise_std rad: per world axis. stated_noise: write them into the file.
    markers: "all" or the nodes that carry one (names or zero-based indices); the others are never seen.
    dropout_fraction 1: share of the marker samples lost at random. dropout: markers lost for a while.
    parameters: those of the scene.
    """

    scene: str
    title: str = ""
    duration: float = Field(gt=0.0)
    sample_rate: float = Field(gt=0.0)
    jitter: float = Field(default=0.0, ge=0.0, lt=1.0)
    seed: int = Field(default=0, ge=0)
    measure: Literal["markers", "mean_motion"] = "markers"
    noise_std: float = Field(default=0.0, ge=0.0)
    orientation_noise_std: float = Field(default=0.0, ge=0.0)
    stated_noise: bool = True
    markers: Literal["all"] | tuple[str | int, ...] = "all"
    dropout_fraction: float = Field(default=0.0, ge=0.0, lt=1.0)
    dropout: tuple[Dropout, ...] = ()
    parameters: dict[str, Any] = Field(default_factory=dict)


def load_recipe(path: str | Path, seed: int | None = None) -> SceneRecipe:
    """The recipe in a TOML file, with `seed` in place of its own where given; ConfigError if it is wrong."""
    table = read_toml(path) | ({} if seed is None else {"seed": seed})
    recipe = validate(SceneRecipe, table, str(path))
    _parameters(recipe, str(path))
    return recipe


def simulate(recipe: SceneRecipe, rng: np.random.Generator | None = None) -> Recording:
    """The recording a recipe describes, with the exact loads in `truth`.

    Randomness comes from `rng`, or from the recipe's seed. Raises ConfigError for an unknown scene,
    parameter or node.

    >>> toss = SceneRecipe(scene="particle", duration=0.5, sample_rate=100, noise_std=1e-3)
    >>> simulate(toss).motion.position.shape
    (50, 1, 3)
    >>> simulate(toss.model_copy(update={"scene": "partikel"}))
    Traceback (most recent call last):
    forceid.errors.ConfigError: recipe: unknown scene 'partikel'; did you mean 'particle'?
    """
    rng = np.random.default_rng(recipe.seed) if rng is None else rng
    time = sample_times(recipe, rng)
    return measure(fly(recipe, time), recipe, time, rng)


def sample_times(recipe: SceneRecipe, rng: np.random.Generator) -> Array:
    """The instants (time,) s at which the recipe samples."""
    count = int(np.ceil(recipe.duration * recipe.sample_rate * (1.0 - 1e-12)))
    return np.asarray((np.arange(count) + recipe.jitter * rng.random(count)) / recipe.sample_rate)


def fly(recipe: SceneRecipe, time: Array) -> KnownFlight:
    """The exact flight of the recipe's scene at `time` (time,) s."""
    parameters = _parameters(recipe, "recipe:")
    flight: KnownFlight = SCENES[recipe.scene].fly(parameters, time)
    return flight


def measure(flight: KnownFlight, recipe: SceneRecipe, time: Array, rng: np.random.Generator) -> Recording:
    """A flight as the recipe's instruments see it: noise, missing markers, dropouts (NaN, never 0)."""
    see = _see_markers if recipe.measure == "markers" else _see_mean_motion
    seen, std = see(flight, recipe, time, rng)
    if instruments := getattr(SCENES[recipe.scene], "sensor_channels", None):
        parameters, truth = _parameters(recipe, "recipe:"), {"time": time, **flight.truth}
        seen, more = instruments(parameters, seen, truth, rng)
        std = {name: level for name, level in std.items() if name in seen} | more
    stated = {name: value for name, value in std.items() if recipe.stated_noise and value > 0.0}
    return Recording(
        body=flight.body,
        motion=Motion(time, gravity=flight.gravity, noise_std=stated, **seen),  # type: ignore[arg-type]
        truth={"time": time, **flight.truth},
        title=recipe.title or recipe.scene.replace("_", " "),
        source=f"forceid scene {recipe.scene}",
        history=f"made by forceid simulate from the recipe\n{to_toml(recipe)}",
    )


def _see_markers(
    flight: KnownFlight, recipe: SceneRecipe, time: Array, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, float]]:
    noise = recipe.noise_std * rng.standard_normal(flight.position.shape)
    lost = rng.random(flight.position.shape[:2]) < recipe.dropout_fraction
    node = flight.body.node
    if recipe.markers != "all":
        carried = {_node_index(marker, node) for marker in recipe.markers}
        lost[:, [i for i in range(len(node)) if i not in carried]] = True
    for drop in recipe.dropout:
        lost[(drop.start <= time) & (time <= drop.stop), _node_index(drop.node, node)] = True
    position = np.where(lost[..., None], np.nan, flight.position + noise)
    return {"position": position}, {"position": recipe.noise_std}


def _see_mean_motion(
    flight: KnownFlight, recipe: SceneRecipe, time: Array, rng: np.random.Generator
) -> tuple[dict[str, Array], dict[str, float]]:
    if "orientation" not in flight.truth:
        raise ConfigError(f"scene '{recipe.scene}' has no orientation", "recipe:", 'use measure = "markers"')
    center = flight.truth["center"] + recipe.noise_std * rng.standard_normal((len(time), 3))
    tilt = Rotation.from_rotvec(recipe.orientation_noise_std * rng.standard_normal((len(time), 3)))
    orientation = (tilt * Rotation.from_quat(flight.truth["orientation"])).as_quat(canonical=True)
    std = {"center": recipe.noise_std, "orientation": recipe.orientation_noise_std}
    return {"center": center, "orientation": orientation}, std


def _parameters(recipe: SceneRecipe, where: str) -> Section:
    if recipe.scene not in SCENES:
        near = difflib.get_close_matches(recipe.scene, SCENES, n=1, cutoff=0.0)
        raise ConfigError(f"unknown scene '{recipe.scene}'", where, f"did you mean '{near[0]}'?")
    kind: type[Section] = SCENES[recipe.scene].Parameters
    return validate(kind, recipe.parameters, f"{where} [parameters]")


def _node_index(node: str | int, names: tuple[str, ...]) -> int:
    if isinstance(node, int):
        if 0 <= node < len(names):
            return node
        raise ConfigError(f"node {node} is not among the {len(names)} nodes", "recipe:", "count from 0")
    if node in names:
        return names.index(node)
    near = difflib.get_close_matches(node, names, n=1, cutoff=0.0)
    raise ConfigError(f"unknown node '{node}'", "recipe:", f"did you mean '{near[0]}'?")
