"""Force and nine first moments of force on affine bodies: error over the bound, coverage, the model chosen.

    python -m evidence.theory.affine -o docs [--seeds 8] [--jobs 2] [--scene NAME ...]

Writes affine.md and affine.png. Every seed draws loads and noise anew, and is estimated as
`forceid estimate` does, under model = "auto", or "affine" where that takes another. "Alone": by the columns
of K only, without the flight of the mean motion, as `affine_loads` has it. The bound is the deviation that
this claims under priors fitted to the true loads. Errors are over the central three quarters.
"""

from __future__ import annotations

import sys
import time as clock
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from evidence.drawn.coverage import SCENES as DATA
from evidence.drawn.records.scored import QUANTILE, judged_part
from evidence.subjects.flights.true_prior import fitted_prior
from evidence.written import asked, each, pictured, tabled, written
from forceid.config import load_settings
from forceid.estimation.affine.channels import AffineChannels, affine_channels, prior_in_body_axes
from forceid.estimation.affine.loads import smooth_affine
from forceid.estimation.affine.priors import tune_channels
from forceid.estimation.body.affine_fit import fit_affine
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import start_of
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.engines import engine
from forceid.records import Array, Estimate, Recording
from forceid.report.plots.bands import draw_estimate
from forceid.report.plots.style import BLUE, STYLE, draw_band, draw_line, label
from forceid.scenes.recipe import fly, load_recipe, measure, sample_times

STIFF = {
    "a": 6.0, "b": 1.0, "c": 4.0, "size": (0.3, 0.2, 0.2), "spin": (0.5, 8.0, 1.0), "force": 3.0,
    "first_moment": 0.4, "drawn_frequency": 5.0,
}  # fmt: skip
HEAVY = {
    "radius": 0.15, "mass": 1.0, "tension": 20.0, "bulk": 20.0, "spin": (0.2, 0.1, 12.0), "force": 2.0,
    "first_moment": 0.1, "drawn_frequency": 4.0,
}  # fmt: skip
BREATHES = {"tension": 2.0, "bulk": 6.0, "strike": 2.0, "first_moment": 0.02, "drawn_frequency": 1.5}
SCENES: dict[str, tuple[str, dict[str, Any], dict[str, Any], str]] = {
    # recipe, its parameters, its measurement, what it is
    "spinning_block": ("spinning_block", {}, {}, "8 markers, 0.3 mm, 500 Hz, 1.2 s"),
    "wobbling_drop": ("wobbling_drop", {}, {}, "12 markers, 0.3 mm, 500 Hz, 1 s"),
    "stiff_block": (
        "spinning_block", STIFF, {"sample_rate": 250.0, "noise_std": 5e-4},
        "as spinning_block, stiffer, spun about another axis, faster loads; 0.5 mm, 250 Hz",
    ),
    "heavy_drop": (
        "wobbling_drop", HEAVY, {"noise_std": 2e-4},
        "as wobbling_drop, heavier, stiffer, faster spin and loads; 0.2 mm",
    ),
    "breathing_drop": (
        "wobbling_drop", BREATHES, {"duration": 2.0, "sample_rate": 300.0},
        "as wobbling_drop, hardly compressible: it breathes above what a smooth prior follows",
    ),
}  # fmt: skip
STATED = ("spinning_block", "wobbling_drop")  # the scenes whose goals are stated
GOAL, LOW, HIGH = 1.2, 0.92, 0.98
ENTRIES = [f"{f}{arm}" for f in "xyz" for arm in "xyz"]  # force along, arm along
ROWS = {
    "rms error, mN m": "square", "claimed, mN m": "claimed", "bound, mN m": "bound",
    "rms error of the columns alone, mN m": "alone", "rms error under the true priors, mN m": "told",
}  # fmt: skip


@dataclass(frozen=True)
class Held:
    """One record. means: mean squares of error and claim and shares inside 95 %, by name.

    Of first moments (9,): square, claimed, inside; bound and told, of claim and error under the true priors;
    alone, of the columns without the flight. Of force (3,): square, claimed and inside of `force` and of
    `force_alone`. model: chosen by `auto`; vetoed: rigid is; beyond: log evidence of it over rigid, and over
    the best modal one; seconds: CPU of the columns.
    """

    scene: str
    means: dict[str, Array]
    model: str
    vetoed: bool
    beyond: tuple[float, float]
    seconds: float


def scene_record(name: str, seed: int) -> tuple[Recording, Array]:
    """A record of a scene with loads and noise of its own, and the true positions."""
    base, parameters, measurement, _ = SCENES[name]
    recipe = load_recipe(DATA / f"{base}.toml", seed)
    given = recipe.parameters | parameters | {"drawn_seed": 100 + seed}
    recipe = recipe.model_copy(update=measurement | {"parameters": given})
    rng = np.random.default_rng(seed)
    time = sample_times(recipe, rng)
    flight = fly(recipe, time)
    return measure(flight, recipe, time, rng), flight.position


def held(prefix: str, found: Array, cov: Array, truth: Array) -> dict[str, Array]:
    """Mean squares of error and claim, and the share inside, of something with covariance, by name."""
    square, var = judged_part((found.reshape(truth.shape) - truth) ** 2), judged_part(variance(cov))
    inside = square <= QUANTILE**2 * var
    return {f"{prefix}{k}": v.mean(0) for k, v in (("square", square), ("claimed", var), ("inside", inside))}


def judged_scene(job: tuple[str, int]) -> Held:
    """One record of a scene, judged."""
    recording, position = scene_record(*job)
    settings, chosen = load_settings(), engine()
    truth, force = recording.truth["first_moment"].reshape(-1, 9), recording.truth["force"]
    began = clock.process_time()
    channels = affine_channels(recording, settings)
    priors = tune_channels(channels, chosen)
    alone = smooth_affine(channels, priors, chosen)
    seconds = clock.process_time() - began
    told = smooth_affine(channels, [priors[0], *true_priors(channels, recording, position)], chosen)
    estimate = estimate_recording(recording, settings)
    again = estimate.model != "affine"
    judged = estimate_recording(recording, load_settings(model="affine")) if again else estimate
    known = held("told_", told.first_moment, told.first_moment_cov, truth)
    means = {
        **held("", judged.first_moment, judged.first_moment_cov, truth),  # type: ignore[arg-type, union-attr]
        **held("force_", judged.force, judged.wrench_cov[:, :3, :3], force),
        **held("force_alone_", alone.force, alone.force_cov, force),
        "bound": known["told_claimed"], "told": known["told_square"],
        "alone": judged_part((alone.first_moment.reshape(-1, 9) - truth) ** 2).mean(0),
    }  # fmt: skip
    rungs = {k.split("_ev")[0]: v for k, v in estimate.ladder.items() if k.endswith("_evidence")}
    modal = max((v for k, v in rungs.items() if k.startswith("modal")), default=np.nan)
    own, rigid = (rungs.get(level, np.nan) for level in ("affine", "rigid"))
    vetoed = bool(estimate.ladder.get("rigid_vetoed", 0.0))
    return Held(job[0], means, estimate.model, vetoed, (own - rigid, own - modal), seconds)


def true_priors(channels: AffineChannels, recording: Recording, position: Array) -> list[LoadPrior]:
    """Priors of the columns of K, fitted to their truth along the axes of the body."""
    F = fit_affine(position, recording.body.position, 1.0).F
    K = recording.truth["first_moment"] @ np.linalg.inv(F).mT @ channels.axes
    priors = []
    for B, column in enumerate(channels.columns):
        tuned, axes = fitted_prior(channels.time, np.einsum("tba,tb->ta", channels.rotation, K[..., B]))
        start = start_of(channels.time, column.moved, column.gain)
        priors.append(prior_in_body_axes(LoadPrior(tuned, axes, start), column))
    return priors


def variance(cov: Array) -> Array:
    """Variances (time, n) of covariances (time, n, n)."""
    return np.asarray(np.diagonal(cov, axis1=1, axis2=2))


def mean_of(cases: list[Held], key: str) -> Array:
    """Mean over records."""
    return np.asarray(np.mean([c.means[key] for c in cases], axis=0))


def rms_over(cases: list[Held], key: str, other: str) -> float:
    """Rms of one over that of the other, of all components together."""
    return float(np.sqrt(mean_of(cases, key).sum() / mean_of(cases, other).sum()))


def said_of(cases: list[Held], load: str) -> str:
    """Error over claim and coverage of a force."""
    inside = mean_of(cases, f"{load}_inside").mean()
    ratio = rms_over(cases, f"{load}_square", f"{load}_claimed")
    return f"error over claim {ratio:.2f}, inside 95 %: {100 * inside:.1f} %"


def section(name: str, own: list[Held]) -> tuple[str, bool]:
    """The table of a scene, and whether its goals are met."""

    def line(title: str, values: Array, whole: float, form: str) -> list[str]:
        return [title, *(f"{v:{form}}" for v in [*values, whole])]

    square, claimed, bound, inside = (mean_of(own, key) for key in ("square", "claimed", "bound", "inside"))
    roots = {title: 1e3 * np.sqrt(mean_of(own, key)) for title, key in ROWS.items()}
    ratio = np.sqrt(square / bound)
    rows = [line(title, root, float(np.sqrt((root**2).mean())), ".1f") for title, root in roots.items()]
    rows += [
        line("error over bound", ratio, rms_over(own, "square", "bound"), ".2f"),
        line("error over claim", np.sqrt(square / claimed), rms_over(own, "square", "claimed"), ".2f"),
        line("inside 95 %, %", 100 * inside, 100 * float(inside.mean()), ".1f"),
    ]
    models, vetoed = [c.model for c in own], sum(c.vetoed for c in own)
    names = ", ".join(f"{m} {models.count(m)}" for m in sorted(set(models)))
    least = np.min([c.beyond for c in own], axis=0)
    good = bool(ratio.max() <= GOAL and LOW <= inside.mean() <= HIGH and set(models) == {"affine"})
    good &= vetoed == len(own)
    return (
        f"""## {name}

{SCENES[name][3]}; {len(own)} flights.

{tabled(("", *ENTRIES, "all"), rows)}

Force: {said_of(own, "force")}; alone {said_of(own, "force_alone")}. Model chosen: {names}; log evidence \
over rigid at least {least[0]:.3g}, over the best modal one at least {least[1]:.3g}; rigid vetoed in \
{vetoed} of {len(own)}. CPU of the columns {np.median([c.seconds for c in own]):.2f} s a flight.
Every entry at most {GOAL} of the bound, coverage {100 * LOW:.0f} to {100 * HIGH:.0f} percent, affine and \
not rigid: {"met" if good else "NOT MET"}.
""",
        good,
    )


@rc_context(STYLE)
def moment_figure(recording: Recording, estimate: Estimate) -> Figure:
    """Nine first moments of a flight with their bands and truth, and their errors below."""
    found, true = np.asarray(estimate.first_moment), recording.truth["first_moment"]
    std = np.sqrt(variance(np.asarray(estimate.first_moment_cov))).reshape(found.shape)
    figure = Figure(figsize=(10.0, 8.6), layout="constrained")
    panels = figure.subplots(6, 3, sharex=True, height_ratios=3 * (2.0, 1.0))
    for k, entry in enumerate(ENTRIES):
        i, j = divmod(k, 3)
        above, below = panels[2 * i, j], panels[2 * i + 1, j]
        half, off = 2 * std[:, i, j], found[:, i, j] - true[:, i, j]
        draw_estimate(above, estimate.time, found[:, i, j], half, true[:, i, j])
        draw_band(below, estimate.time, -1e3 * half, 1e3 * half, color=BLUE, alpha=0.22)
        draw_line(below, estimate.time, 1e3 * off, color=BLUE)
        most = 3e3 * float(np.median(half))
        below.set_ylim(-most, most)
        label(above, f"$N_{{{entry}}}$", "N m" if j == 0 else "", "")
        label(below, "", "mN m" if j == 0 else "", "time (s)" if i == 2 else "")
    figure.suptitle("spinning_block: first moments, truth dashed; errors in their two-sigma bands below")
    return figure


def main() -> int:
    """The tables; 1 where a goal is missed."""
    args = asked("evidence.theory.affine", __doc__, seeds=8, jobs=2, scene=tuple(SCENES))
    jobs = [(name, seed) for name in args.scene for seed in range(1, args.seeds + 1)]
    cases = list(each(judged_scene, jobs, args.jobs))
    parts = {name: section(name, [c for c in cases if c.scene == name]) for name in args.scene}
    text = "\n\n".join([
        "# First moments of force on affine bodies", (__doc__ or "").strip(),
        "![Nine first moments of a flight](affine.png)",
        "\n".join(part for part, _ in parts.values()),
    ])  # fmt: skip
    written(args.output, "affine.md", text)
    shown, _ = scene_record("spinning_block", 1)
    pictured(args.output, "affine", moment_figure(shown, estimate_recording(shown, load_settings())), dpi=110)
    print(text)
    return int(not all(good for name, (_, good) in parts.items() if name in STATED))


if __name__ == "__main__":
    sys.exit(main())
