"""What the estimators reach: error over bound, calibration, lines, wrong noise, scenes and measured cases.

`make study` writes docs/estimation.md and its pictures: every number there is from one run of this file.
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.races.models import root
from evidence.written import asked, pictured, written
from forceid import kalman
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.files.sources import import_sources
from forceid.import_settings import load_import_settings
from forceid.report.style import BLUE, GRAY, GREEN, STYLE, VERMILION, panels
from forceid.scenes.recipe import load_recipe, simulate

ROOT = Path(__file__).parents[2]
STEP, SAMPLES, DRAWS = 0.004, 500, 48
TRUTH = np.log([1.0, 10 * np.pi, 3e-4])  # std N, rate 1/s, noise m
SPAN = 3.0  # e-folds that tuning may be off the truth, either way
SEEDS = range(1, 9)
TRIALS = ("DJ1", "DJ2", "DJ3", "squats1")


def driven_mass(theta: Any) -> kalman.StateSpace:
    """0.1 kg under a Matern 3/2 force, its position measured at 250 Hz: principal equations 5.5."""
    std, rate, noise = np.exp(theta)
    chain = kalman.integrate(kalman.integrate(kalman.matern(2, std, rate), 0.01), 1e-4)
    F, Q = kalman.discretize(chain, STEP)
    R = noise**2 * np.eye(1)
    return kalman.StateSpace(F, Q, 10 * chain.output[None], R, np.zeros(4), chain.P0)


def drawn(model: kalman.StateSpace, samples: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """A path x (time, state) of the model and its measurements z (time, channel)."""
    n, m = len(model.x0), len(model.H)
    x = np.empty((samples, n))
    x[0] = model.x0 + root(model.P0) @ rng.standard_normal(n)
    w = rng.standard_normal((samples, n)) @ root(model.Q).T
    for k in range(samples - 1):
        x[k + 1] = model.F @ x[k] + w[k]
    return x, x @ model.H.T + rng.standard_normal((samples, m)) @ root(model.R).T


def one_draw(seed: int) -> dict[str, float]:
    """Squared error of the force over the bound, and NEES of the whole state, oracle and tuned."""
    truth = driven_mass(TRUTH)
    x, z = drawn(truth, SAMPLES, np.random.default_rng(seed))
    oracle = kalman.smooth(truth, z)
    bounds = [(t - SPAN, t + SPAN) for t in TRUTH]
    starts = [TRUTH + d for d in ([1.5, -1.0, 1.0], [-1.5, 1.0, -1.0])]
    fit = kalman.tune(driven_mass, TRUTH + 1.0, z, bounds=bounds, starts=starts)
    tuned = kalman.smooth(fit.model, z)
    found = {}
    for name, smoothed in (("oracle", oracle), ("tuned", tuned)):
        error = smoothed.x[:, 2] - x[:, 2]
        found[f"{name} error"] = float(np.mean(error**2))
        found[f"{name} claimed"] = float(np.mean(error**2 / smoothed.P[:, 2, 2]))
        # samples further apart than the memory of the load are independent
        apart = slice(20, None, 60)
        found[f"{name} nees"] = float(
            np.mean(kalman.nees(smoothed.x[apart, 2:3], smoothed.P[apart, 2:3, 2:3], x[apart, 2:3]))
        )
        found[f"{name} count"] = len(x[apart])
    found["bound"] = float(np.mean(oracle.P[:, 2, 2]))
    return found


def efficiency(map_: Any) -> tuple[str, Any]:
    """Monte Carlo of a model drawn from its own prior, settings known or tuned by likelihood."""
    draws = list(map_(one_draw, range(DRAWS)))
    rows = ["| settings | rmse over bound | NEES mean | its 95 % band |", "|---|---|---|---|"]
    ratio = {}
    for name in ("oracle", "tuned"):
        ratio[name] = np.sqrt([d[f"{name} error"] / d["bound"] for d in draws])
        pooled = np.sqrt(np.mean([d[f"{name} error"] for d in draws]) / np.mean([d["bound"] for d in draws]))
        nees = np.mean([d[f"{name} nees"] for d in draws])
        low, high = kalman.chi_square_band(int(sum(d[f"{name} count"] for d in draws)), 0.05)
        rows.append(f"| {name} | {pooled:.3f} | {nees:.3f} | {low:.3f} to {high:.3f} |")
    text = (
        f"{DRAWS} records of {SAMPLES} samples: 0.1 kg under a Matern 3/2 force of 1 N and 10 pi 1/s, "
        "position at 250 Hz to 0.3 mm, drawn from that prior. Tuned: standard deviation, rate and noise by "
        "`kalman.tune`, from three starts up to e^1.5 off, within e^3 of the truth. NEES of the force at "
        "samples 0.24 s apart.\n\n" + "\n".join(rows)
    )
    figure, axes = panels(1, 1, (5.2, 3.0))
    ax = axes[0, 0]
    bins = np.linspace(0.8, 1.4, 25)
    ax.hist(ratio["oracle"], bins, color=BLUE, alpha=0.35, label="settings known")
    ax.hist(ratio["tuned"], bins, color=VERMILION, histtype="step", lw=1.6, label="tuned by likelihood")
    ax.axvline(1.0, color=GRAY, lw=1.0)
    ax.set(xlabel="rms error of the force over its bound, each record", ylabel="records")
    ax.set_title("Efficiency of the smoother")
    ax.legend()
    return text, figure


def wrong_noise(map_: Any) -> tuple[str, Any]:
    """What NIS, NEES and whiteness say where Q or R is wrong by decades."""
    factors = np.logspace(-2, 2, 9)
    truth = driven_mass(TRUTH)
    x, z = drawn(truth, 4000, np.random.default_rng(3))
    curves: dict[str, list[tuple[float, float, float]]] = {"Q": [], "R": []}
    rows = ["| wrong by | NIS | error over claimed sigma | `kalman.consistency` says |", "|---|---|---|---|"]
    for which in curves:
        for factor in factors:
            wrong = replace(truth, **{which: factor * getattr(truth, which)})
            s = kalman.smooth(wrong, z)
            error = s.x[:, 2] - x[:, 2]
            claimed = float(np.sqrt(np.mean(error**2 / s.P[:, 2, 2])))
            best = float(np.sqrt(np.mean(error**2) / np.mean(kalman.smooth(truth, z).P[:, 2, 2])))
            test = kalman.consistency(s.filtered)
            curves[which].append((test.nis, claimed, best))
            if factor in (factors[0], factors[-1]):
                rows.append(f"| {which} x {factor:g} | {test.nis:.3g} | {claimed:.2f} | {test.sentence} |")
    figure, axes = panels(1, 2, (8.4, 3.2))
    for ax, which, noise in zip(axes[0], curves, ("process", "measurement"), strict=True):
        values = np.array(curves[which])
        ax.loglog(factors, values[:, 1], color=VERMILION, marker="o", ms=3, label="error over claimed")
        ax.loglog(factors, np.sqrt(values[:, 0]), color=BLUE, marker="s", ms=3, label="innovations, same")
        ax.loglog(factors, values[:, 2], color=GREEN, marker="^", ms=3, label="error over bound")
        ax.axhline(1.0, color=GRAY, lw=0.8)
        ax.set(xlabel=f"{noise} noise variance over the true one")
        ax.set_title(f"Wrong {which}")
    axes[0, 0].legend()
    return "One record of 4000 samples of the same model.\n\n" + "\n".join(rows), figure


def closed_forms(map_: Any) -> tuple[str, Any]:
    """Covariance recursion against the closed-form bounds of integrated white noise."""
    speeds = np.logspace(-2, 0.3, 14)
    figure, axes = panels(1, 2, (8.4, 3.2), sharey=True)
    worst = {}
    for ax, n in zip(axes[0], (3, 4), strict=True):
        ratio = np.empty((len(speeds), n))
        for i, speed in enumerate(speeds):  # r = 1 with unit step, w = speed
            F, Q = kalman.discretize(kalman.integrated_wiener(n, speed ** (2 * n), 1e8), 1.0)
            model = kalman.StateSpace(F, Q, np.eye(1, n), np.eye(1), np.zeros(n), 1e8 * np.eye(n))
            var = np.diag(kalman.steady(model).smoothed)
            closed = [kalman.integrated_wiener_bound(n, k, speed ** (2 * n), 1.0) for k in range(n)]
            ratio[i] = var / closed
        worst[n] = np.abs(ratio[speeds < 0.05] - 1).max()
        for k in range(n):
            ax.semilogx(speeds, ratio[:, k], marker="o", ms=2.5, label=f"derivative {k}")
        ax.axvspan(speeds[0], 0.05, color=GRAY, alpha=0.12, lw=0)
        ax.set(xlabel="w dt", ylabel="recursion over closed form" if n == 3 else "", ylim=(0.94, 1.06))
        ax.set_title(f"{n}-fold integrated white noise")
        ax.legend()
    text = "Largest distance of `kalman.steady` from the closed form where w dt < 0.05: " + ", ".join(
        f"{d:.1e} for n = {n}" for n, d in worst.items()
    )
    return text + ".", figure


def flight_of(job: tuple[str, int, dict[str, Any]]) -> dict[str, Any]:
    """Errors of one scene under one seed of noise, over the central three quarters."""
    scene, seed, settings = job
    recording = simulate(load_recipe(ROOT / "data" / "synthetic" / f"{scene}.toml", seed))
    began = time.process_time()
    e = estimate_recording(recording, load_settings(**settings))
    spent = time.process_time() - began
    inner = slice(len(e.time) // 8, -(len(e.time) // 8))
    force = (e.force - recording.truth["force"])[inner]
    out = {
        "scene": scene, "seed": seed, "verdict": e.verdict.level, "seconds": spent,
        "force": np.sqrt((force**2).mean(0)), "nees": (force**2 / e.force_std[inner] ** 2).mean(0),
    }  # fmt: skip
    if np.isfinite(e.moment).any():
        moment = (e.moment - recording.truth["moment"])[inner]
        out["moment"] = np.sqrt((moment**2).mean(0))
        out["moment nees"] = (moment**2 / e.moment_std[inner] ** 2).mean(0)
    return out


def spin_lines(map_: Any) -> tuple[str, Any]:
    """A load at twice the spin: with lines chosen by evidence, and with none."""
    with_lines = list(map_(flight_of, [("spin_synchronous", s, {}) for s in SEEDS]))
    plain = list(map_(flight_of, [("spin_synchronous", s, {"lines": "none"}) for s in SEEDS]))
    rows = [
        "| seed | force error x, y, z (N) | without lines | NEES x, y, z | verdict |",
        "|---|---|---|---|---|",
    ]
    for a, b in zip(with_lines, plain, strict=True):
        cells = (", ".join(f"{v:.4f}" for v in r["force"]) for r in (a, b))
        nees = ", ".join(f"{v:.2f}" for v in a["nees"])
        rows.append(f"| {a['seed']} | {' | '.join(cells)} | {nees} | {a['verdict']} |")
    force, without = (np.array([r["force"] for r in runs]) for runs in (with_lines, plain))
    nees = np.array([r["nees"] for r in with_lines])
    text = (
        "`data/synthetic/spin_synchronous.toml`, eight seeds of noise: 0.2 N along x at twice the spin. "
        f"Mean error {', '.join(f'{v:.4f}' for v in force.mean(0))} N, largest {force.max():.4f} N; channels "
        f"without the line at most {(force[:, 1:] / without[:, 1:]).max():.2f} times their plain prior; NEES "
        f"mean {', '.join(f'{v:.2f}' for v in nees.mean(0))}.\n\n" + "\n".join(rows)
    )
    figure, axes = panels(1, 1, (5.6, 3.2))
    ax = axes[0, 0]
    for axis, color in enumerate((VERMILION, GREEN, BLUE)):
        ax.semilogy(list(SEEDS), without[:, axis], color=color, ls="--", marker="s", ms=3, lw=0.8)
        ax.semilogy(list(SEEDS), force[:, axis], color=color, marker="o", ms=4, label=f"force {'xyz'[axis]}")
    ax.axhline(0.025, color=GRAY, lw=0.8)
    ax.set(xlabel="seed of the noise", ylabel="rms error (N)")
    ax.set_title("Load at twice the spin: lines by evidence, and none (dashed)")
    ax.legend(loc="center right", bbox_to_anchor=(1.0, 0.82), ncols=3)
    return text, figure


def scenes(map_: Any) -> tuple[str, Any]:
    """Every shipped scene by the default settings, and by the engine without a compiler."""
    names = sorted(p.stem for p in (ROOT / "data" / "synthetic").glob("*.toml"))
    seed = {n: load_recipe(ROOT / "data" / "synthetic" / f"{n}.toml").seed for n in names}
    ours = list(map_(flight_of, [(n, seed[n], {}) for n in names]))
    plain = list(map_(flight_of, [(n, seed[n], {"engine": "numpy"}) for n in names]))
    rows = [
        "| scene | force error (N) | NEES | moment error (N m) | NEES | verdict | CPU s, numpy engine |",
        "|---|---|---|---|---|---|---|",
    ]
    for a, b in zip(ours, plain, strict=True):
        cells = [f"{np.sqrt(np.mean(a['force'] ** 2)):.2g}", f"{a['nees'].mean():.2f}"]
        moment = a.get("moment")
        cells += ["-", "-"] if moment is None else [
            f"{np.sqrt(np.mean(moment**2)):.2g}", f"{a['moment nees'].mean():.2f}"
        ]  # fmt: skip
        cells += [a["verdict"], f"{a['seconds']:.1f}, {b['seconds']:.1f}"]
        rows.append(f"| {a['scene']} | {' | '.join(cells)} |")
    text = "Shipped recipes and seeds; rms per axis over the central three quarters.\n\n"
    return text + "\n".join(rows), None


def person(trial: str) -> dict[str, Any]:
    """One measured trial against the force plates, and the low-pass cut that is best on the truth."""
    from scipy.signal import butter, filtfilt

    folder = Path(os.environ.get("FORCEID_REAL", ROOT.parent / "shared" / "real")) / "jump_squat_mocap_plate"
    settings = load_import_settings(ROOT / "config" / "jump_squat.toml")
    ((_, recording),) = import_sources([folder / f"{trial}.trc", folder / f"{trial}_grf.mot"], settings)
    e = estimate_recording(recording, load_settings())
    truth = np.stack(
        [np.interp(e.time, recording.truth["time"], recording.truth["force"][:, a]) for a in range(3)], 1
    )
    judged = slice(0, None)
    if trial.startswith("DJ"):  # on the box before, which is no plate
        judged = slice(int(np.argmax(truth[:, 1] > 20)) - 12, None)
    body, x = recording.body, recording.motion.position
    center = np.einsum("n,tna->ta", body.mass / body.mass.sum(), x)
    seen = np.isfinite(center).all(1)
    center = np.stack([np.interp(e.time, e.time[seen], c) for c in center[seen].T], 1)
    rate = 1 / np.median(np.diff(e.time))
    acceleration = np.gradient(np.gradient(center, e.time, axis=0), e.time, axis=0)
    pushed = body.mass.sum() * (acceleration - recording.motion.gravity)
    cut = {}
    for hertz in np.arange(3.0, 21.0, 0.5):
        error = filtfilt(*butter(2, hertz / (rate / 2)), pushed, axis=0)[judged] - truth[judged]
        cut[hertz] = np.sqrt((error**2).mean(0))
    table = np.array(list(cut.values()))
    error = (e.force - truth)[judged]
    return {
        "trial": trial, "error": np.sqrt((error**2).mean(0)), "best": table.min(0),
        "cut": np.array(list(cut))[table.argmin(0)], "claimed": np.sqrt((e.force_std[judged] ** 2).mean(0)),
        "verdict": e.verdict.level,
    }  # fmt: skip


def measured(map_: Any) -> tuple[str, Any]:
    """Jumps and squats, where the recordings are at hand."""
    rows = [
        "| trial | error x, y, z (N) | best low-pass cut on the truth | claimed sigma | verdict |",
        "|---|---|---|---|---|",
    ]
    for r in map_(person, TRIALS):
        cells = (", ".join(f"{v:.3g}" for v in r[k]) for k in ("error", "best", "claimed"))
        rows.append(f"| {r['trial']} | {' | '.join(cells)} | {r['verdict']} |")
    return (
        "Drop jumps and squats on force plates, 1 mm stated. The rival: a zero-phase second-order "
        "Butterworth on second differences of the mass center, its cut chosen on the truth for each axis.\n\n"
        + "\n".join(rows)
    ), None


PARTS = {
    "efficiency": ("Error over bound", efficiency),
    "wrong_noise": ("Noise wrong by decades", wrong_noise),
    "closed_forms": ("Closed-form bounds", closed_forms),
    "lines": ("A load at twice the spin", spin_lines),
    "scenes": ("The shipped scenes", scenes),
    "measured": ("Measured cases", measured),
}


def main() -> int:
    """Run the parts asked for; write the page when all ran."""
    import matplotlib as mpl

    args = asked("evidence.theory.estimation", __doc__, only=tuple(PARTS))
    page = [
        "# What the estimators reach\n",
        f'Made by `make study` on engine "{kalman.engine("auto").name}"; every number is from that run.\n',
    ]
    with mpl.rc_context(STYLE), ProcessPoolExecutor(2) as pool:
        for name in args.only:
            title, part = PARTS[name]
            began = time.perf_counter()
            text, figure = part(pool.map)
            page.append(f"## {title}\n\n{text}\n")
            if figure is not None:
                pictured(args.output, f"estimation_{name}", figure)
                page.append(f"![{title}](estimation_{name}.png)\n")
            print(page[-1] if figure is None else page[-2], flush=True)
            print(f"({name}: {time.perf_counter() - began:.0f} s)", file=sys.stderr, flush=True)
    if args.only == list(PARTS):
        written(args.output, "estimation.md", "\n".join(page))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
