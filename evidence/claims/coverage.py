"""Do 95 % intervals hold the truth? Every scene, rate, noise and seed, over the central three quarters.

    python -m evidence.claims.coverage [--seeds 5] [--jobs 2] [--scene NAME ...]

Nothing is told of the truth but the standard deviation of the noise. An error stays alike for about as long
as the load does, so one record gives few independent intervals: the share over all seeds is what counts.
"""

from __future__ import annotations

import sys
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from evidence.drawn.records.scored import (
    FORCE,
    MOMENT,
    RecordScore,
    error_over_claim,
    estimated_score,
    stacked,
)
from evidence.judged import silent_share
from evidence.written import asked, each, tabled
from forceid.records import Recording
from forceid.scenes.recipe import SceneRecipe, fly, load_recipe, measure, sample_times

SCENES = Path(__file__).parents[2] / "data" / "synthetic"
RATES = (250.0, 500.0, 1000.0, 2000.0)  # Hz
MARKER_NOISES = (1e-4, 3e-4, 1e-3)  # m
BY = {"scene": [0], "rate (Hz)": [1], "noise (m)": [2], "scene, rate, noise": [0, 1, 2], "all": []}

CoverageJob = tuple[str, float, float, int]  # scene, rate, noise, seed


@cache
def recipe_flight(scene: str, rate: float) -> tuple[SceneRecipe, Any, Any]:
    """A shipped recipe at another rate, its instants, and its exact flight."""
    recipe = load_recipe(SCENES / f"{scene}.toml").model_copy(update={"sample_rate": rate})
    time = sample_times(recipe, np.random.default_rng(recipe.seed))
    return recipe, time, fly(recipe, time)


def recorded(scene: str, rate: float, noise: float, seed: int) -> Recording:
    """One record of a scene."""
    recipe, time, flight = recipe_flight(scene, rate)
    rng = np.random.default_rng([seed, int(rate), int(1e6 * noise)])
    return measure(flight, recipe.model_copy(update={"noise_std": noise}), time, rng)


def scored_record(job: CoverageJob) -> tuple[CoverageJob, RecordScore]:
    """One record of a scene, estimated."""
    return job, estimated_score(recorded(*job))


def share_inside(cases: list[RecordScore], of: slice) -> float:
    """Share inside the intervals, of components that have a truth."""
    inside = stacked(cases, "inside")[:, of]
    return float(np.nanmean(inside)) if np.isfinite(inside).any() else np.nan


def group_table(title: str, cases: list[tuple[CoverageJob, RecordScore]]) -> str:
    """One way to group the records."""
    groups: dict[str, list[RecordScore]] = {}
    for job, case in cases:
        groups.setdefault(", ".join(str(job[k]) for k in BY[title]) or "all", []).append(case)
    rows = []
    for name, of in groups.items():
        held = (f"{100 * share_inside(of, load):.1f} %" for load in (FORCE, MOMENT))
        ok = sum(c.verdict == "ok" for c in of)
        rows.append(
            [
                name,
                str(len(of)),
                *held,
                f"{error_over_claim(of, FORCE):.2f}, {error_over_claim(of, MOMENT):.2f}",
                str(ok),
                silent_share(c.silent for c in of),
            ]
        )
    return tabled(
        (title, "records", "force", "moment", "error over claim F, T", "ok", "silently wrong"), rows
    )


def main() -> int:
    """Tables by scene, rate and noise; 1 where the share over all is outside of 92 to 98 %."""
    args = asked("evidence.claims.coverage", __doc__, page=False, seeds=5, jobs=2, scene=("all",))
    shipped = sorted(p.stem for p in SCENES.glob("*.toml"))
    names = shipped if "all" in args.scene else args.scene
    jobs = list(product(names, RATES, MARKER_NOISES, range(1, args.seeds + 1)))
    cases = list(each(scored_record, jobs, args.jobs, args.seeds))
    for title in BY:
        print(group_table(title, cases), end="\n\n")
    every = [case for _, case in cases]
    return 0 if all(0.92 <= share_inside(every, load) <= 0.98 for load in (FORCE, MOMENT)) else 1


if __name__ == "__main__":
    sys.exit(main())
