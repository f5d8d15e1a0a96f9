"""Do 95 % intervals hold the truth? Every scene, rate, noise and seed, over the central three quarters.

    python -m evidence.drawn.coverage [--seeds 5] [--jobs 2] [--scene NAME ...]

Nothing is told of the truth but the standard deviation of the noise. An error stays alike for about as long
as the load does, so one record gives few independent intervals: the share over all seeds is what counts.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evidence.written import asked, each, tabled
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.scenes.recipe import SceneRecipe, fly, load_recipe, measure, sample_times

SCENES = Path(__file__).parents[2] / "data" / "synthetic"
QUANTILE = 1.959964  # of the normal distribution: 95 % lie within
RATES = (250.0, 500.0, 1000.0, 2000.0)  # Hz
NOISES = (1e-4, 3e-4, 1e-3)  # m


@dataclass(frozen=True)
class Held:
    """One record: squared error and claimed variance (6,), share inside the 95 % interval (6,), NIS, verdict.

    Channels: force, then moment; NaN where there is no such channel. path_nis: mean NIS of the poses.
    """

    scene: str
    rate: float
    noise: float
    seed: int
    square: Any
    claimed: Any
    inside: Any
    path_nis: float
    model: str
    verdict: str
    reasons: str


@cache
def flown(scene: str, rate: float) -> tuple[SceneRecipe, Any, Any]:
    """A shipped recipe at another rate, its instants, and its exact flight."""
    recipe = load_recipe(SCENES / f"{scene}.toml").model_copy(update={"sample_rate": rate})
    time = sample_times(recipe, np.random.default_rng(recipe.seed))
    return recipe, time, fly(recipe, time)


def one(job: tuple[str, float, float, int, dict[str, Any]]) -> Held:
    """One record of a scene, estimated with the settings of the job."""
    scene, rate, noise, seed, settings = job
    recipe, time, flight = flown(scene, rate)
    rng = np.random.default_rng([seed, int(rate), int(1e6 * noise)])
    recording = measure(flight, recipe.model_copy(update={"noise_std": noise}), time, rng)
    e = estimate_recording(recording, load_settings(**settings))
    middle = slice(len(time) // 8, len(time) - len(time) // 8)
    truth = np.full((len(time), 6), np.nan)
    for at, name in ((0, "force"), (3, "moment")):
        if name in recording.truth:
            truth[:, at : at + 3] = recording.truth[name]
    error = (np.concatenate([e.force, e.moment], 1) - truth)[middle]
    var = np.diagonal(e.wrench_cov, axis1=1, axis2=2)[middle]
    inside = np.where(np.isfinite(error), error**2 <= QUANTILE**2 * var, np.nan)
    return Held(
        scene, rate, noise, seed, (error**2).mean(0), var.mean(0), inside.mean(0),
        float(np.nanmean(e.nis)), e.model, e.verdict.level, "; ".join(e.verdict.reasons),
    )  # fmt: skip


def shares(cases: Iterable[Held]) -> tuple[float, float, float, float]:
    """Share inside of force and moment, and their rms error over what is claimed."""
    cases = list(cases)
    inside, square, claimed = (
        np.array([getattr(c, n) for c in cases]) for n in ("inside", "square", "claimed")
    )
    found = []
    for part in (slice(3), slice(3, 6)):
        known = np.isfinite(inside[:, part])
        found.append(float(inside[:, part][known].mean()) if known.any() else np.nan)
    for part in (slice(3), slice(3, 6)):
        ratio = square[:, part] / claimed[:, part]
        found.append(float(np.sqrt(np.nanmean(ratio))) if np.isfinite(ratio).any() else np.nan)
    return found[0], found[1], found[2], found[3]


def table(title: str, groups: dict[Any, list[Held]]) -> str:
    """One way to group the records."""
    rows = []
    for name, cases in groups.items():
        force, moment, over_f, over_t = shares(cases)
        held = (f"{100 * share:.1f} %" for share in (force, moment))
        ok = sum(c.verdict == "ok" for c in cases)
        rows.append([str(name), str(len(cases)), *held, f"{over_f:.2f}, {over_t:.2f}", str(ok)])
    return tabled((title, "records", "force", "moment", "error over claim F, T", "ok"), rows)


def grouped(cases: list[Held], *names: str) -> dict[Any, list[Held]]:
    """Cases by the named fields, in order."""
    groups: dict[Any, list[Held]] = defaultdict(list)
    for case in cases:
        groups[", ".join(f"{getattr(case, n)}" for n in names)].append(case)
    return groups


def main() -> int:
    """Tables by scene, rate and noise; 1 where the share over all is outside of 92 to 98 %."""
    args = asked("evidence.drawn.coverage", __doc__, page=False, seeds=5, jobs=2, scene=("all",))
    shipped = sorted(p.stem for p in SCENES.glob("*.toml"))
    names = shipped if "all" in args.scene else args.scene
    jobs = [
        (scene, rate, noise, seed, {})
        for scene in names
        for rate in RATES
        for noise in NOISES
        for seed in range(1, args.seeds + 1)
    ]
    cases = list(each(one, jobs, args.jobs, args.seeds))
    for title, groups in (
        ("scene", grouped(cases, "scene")),
        ("rate (Hz)", grouped(cases, "rate")),
        ("noise (m)", grouped(cases, "noise")),
        ("scene, rate, noise", grouped(cases, "scene", "rate", "noise")),
        ("all", {"all": cases}),
    ):
        print(table(title, groups), end="\n\n")
    force, moment, *_ = shares(cases)
    return 0 if 0.92 <= force <= 0.98 and 0.92 <= moment <= 0.98 else 1


if __name__ == "__main__":
    sys.exit(main())
