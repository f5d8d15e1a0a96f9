"""Gyros and accelerometers beside markers and alone, and spin about half a turn a frame: error over claim.

    python -m evidence.drawn.sensors [--seeds 8] [--jobs 2] [--only NAME...]

A rigid body under loads that are sums of 24 sines, drawn anew for every seed from the spectrum of a Matern
3/2 process. The estimator is told the noise, no more. Printed of every row: root mean square error of force
and moment, over what is claimed (the posterior bound along the estimated path), and how often the 95 %
intervals hold, over the central three quarters; then the verdicts. Without markers, in the axes of the body
at the start.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.written import asked
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation.run import estimate_recording
from forceid.scenes.recipe import SceneRecipe, simulate

SINES, HIGHEST = 24, 12.0  # Hz
FORCE, MOMENT, RATE = 1.0, 0.03, 20.0  # N, N m, 1/s
SECONDS, CLOCK, FRAMES = 0.6, 400.0, 100.0  # s, Hz, Hz of the markers
HALF = np.pi * FRAMES  # rad/s: half a turn a frame
BIASES = {"specific_force_bias": 0.3, "angular_velocity_bias": 0.05}
ROWS: dict[str, dict[str, Any]] = {
    "markers": {"sensors": False},
    "with markers": {},
    "clocks 3 ms late": {"gyro_clock": 3e-3, "accelerometer_clock": 3e-3},
    "biases that wander": {"gyro_walk": 0.05, "accelerometer_walk": 0.5},
    "without markers": {"markers": False, "noise_std": BIASES},
    "spin 0.7 half turns": {"sensors": False, "spin": (1.0, 2.0, 0.7 * HALF)},
    "spin 0.95 half turns": {"sensors": False, "spin": (1.0, 2.0, 0.95 * HALF)},
    "spin 1.05 half turns": {"sensors": False, "spin": (1.0, 2.0, 1.05 * HALF)},
    "spin 1.05, gyro": {"spin": (1.0, 2.0, 1.05 * HALF)},
    "spin 2.3, gyro": {"spin": (1.0, 2.0, 2.3 * HALF)},
}


def drawn(size: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Sines whose powers follow the spectrum of a Matern 3/2 load."""
    frequency = np.sort(rng.uniform(0.1, HIGHEST, SINES))
    power = (RATE**2 + (2 * np.pi * frequency) ** 2) ** -2.0
    level = size * np.sqrt(2 * power / power.sum())[:, None] * rng.standard_normal((SINES, 3))
    phase = rng.uniform(0, 2 * np.pi, SINES)
    return [
        {"amplitude": a.tolist(), "frequency": float(f), "phase": float(p)}
        for a, f, p in zip(level, frequency, phase, strict=True)
    ]


def one_flight(name: str, seed: int) -> tuple[Any, ...]:
    """Mean squared error and claimed variance (force, moment), coverage, verdict and its reasons."""
    given, rng = dict(ROWS[name]), np.random.default_rng(1000 + seed)
    sensors, told = given.pop("sensors", True), given.pop("noise_std", {})
    rate = CLOCK if sensors else FRAMES
    every = int(CLOCK / FRAMES) if sensors else 1
    loads = {"force": drawn(FORCE, rng), "moment": drawn(MOMENT, rng)}
    recording = simulate(
        SceneRecipe(
            scene="instrumented", duration=SECONDS, sample_rate=rate, noise_std=5e-4, seed=seed,
            parameters=loads | {"marker_every": every} | given,
        )
    )  # fmt: skip
    if not sensors:
        bare = replace(recording.motion, angular_velocity=None, specific_force=None)
        recording = replace(recording, motion=bare)
    try:
        found = estimate_recording(recording, load_settings(noise_std=told, lines="none"))
    except EstimationError as e:
        return np.full(2, np.nan), np.full(2, np.nan), np.full(2, np.nan), "refused", (str(e),)
    truth = np.stack([recording.truth["force"], recording.truth["moment"]], 1)
    if not given.get("markers", True):
        truth = truth @ Rotation.from_quat(recording.truth["orientation"][0]).as_matrix()
    n = len(truth)
    middle = slice(n // 8, n - n // 8)
    error = (np.stack([found.force, found.moment], 1) - truth)[middle]
    var = np.diagonal(found.wrench_cov, axis1=1, axis2=2)[middle].reshape(-1, 2, 3)
    held = (error**2 < 1.959964**2 * var).mean((0, 2))
    verdict = found.verdict
    return (error**2).mean((0, 2)), var.mean((0, 2)), held, verdict.level, verdict.reasons


def main() -> int:
    """Print the table."""
    given = asked("evidence.drawn.sensors", __doc__, page=False, seeds=8, jobs=2, only=tuple(ROWS))
    print("| | F rmse, N | over claim | 95 % hold | T rmse, N m | over claim | 95 % hold | verdicts |")
    print("|---|---|---|---|---|---|---|---|")
    with ProcessPoolExecutor(given.jobs) as pool:
        for name in given.only:
            flights = list(pool.map(one_flight, [name] * given.seeds, range(given.seeds)))
            square, claimed, held = (np.array([f[i] for f in flights]) for i in range(3))
            cells = []
            for i in (0, 1):
                error, claim = np.nanmean(square[:, i]), np.nanmean(claimed[:, i])
                cells += [
                    f"{np.sqrt(error):.3g}",
                    f"{np.sqrt(error / claim):.2f}",
                    f"{100 * np.nanmean(held[:, i]):.1f}",
                ]
            levels = [f[3] for f in flights]
            said = ", ".join(
                f"{levels.count(level)} {level}" for level in ("ok", "degraded", "refused") if level in levels
            )
            print(f"| {name} | {' | '.join(cells)} | {said} |", flush=True)
            for text in sorted({reason[:100] for f in flights for reason in f[4]}):
                print(f"    {name}: {text}", file=sys.stderr, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
