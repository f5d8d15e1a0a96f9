"""Gyros and accelerometers beside markers and alone, and spin about half a turn a frame: error over claim.

    python -m evidence.claims.sensors [--seeds 8] [--jobs 2] [--only NAME...]

A rigid body under loads that are sums of 24 sines, drawn anew for every seed from the spectrum of a Matern
3/2 process. The estimator is told the noise, no more. Printed of every row: root mean square error of force
and moment, over what is claimed (the posterior bound along the estimated path), and how often the 95 %
intervals hold, over the central three quarters; then the verdicts. Without markers, in the axes of the body
at the start.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import FORCE, MOMENT, RecordScore, estimated_score, pooled
from evidence.judged import silent_share
from evidence.written import asked, each, tabled
from forceid.scenes.recipe import SceneRecipe, simulate

SINES, HIGHEST = 24, 12.0  # Hz
SIZES = {"force": 1.0, "moment": 0.03}  # N, N m
RATE = 20.0  # 1/s
SECONDS, CLOCK, FRAMES = 0.6, 400.0, 100.0  # s, Hz, Hz of the markers
HALF_TURN_RATE = np.pi * FRAMES  # rad/s: half a turn a frame
BIASES = {"specific_force_bias": 0.3, "angular_velocity_bias": 0.05}
SENSOR_ROWS: dict[str, dict[str, Any]] = {
    "markers": {"sensors": False},
    "with markers": {},
    "clocks 3 ms late": {"gyro_clock": 3e-3, "accelerometer_clock": 3e-3},
    "biases that wander": {"gyro_walk": 0.05, "accelerometer_walk": 0.5},
    "without markers": {"markers": False, "noise_std": BIASES},
    "spin 0.7 half turns": {"sensors": False, "spin": (1.0, 2.0, 0.7 * HALF_TURN_RATE)},
    "spin 0.95 half turns": {"sensors": False, "spin": (1.0, 2.0, 0.95 * HALF_TURN_RATE)},
    "spin 1.05 half turns": {"sensors": False, "spin": (1.0, 2.0, 1.05 * HALF_TURN_RATE)},
    "spin 1.05, gyro": {"spin": (1.0, 2.0, 1.05 * HALF_TURN_RATE)},
    "spin 2.3, gyro": {"spin": (1.0, 2.0, 2.3 * HALF_TURN_RATE)},
}


def drawn_sines(size: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Sines whose powers follow the spectrum of a Matern 3/2 load."""
    frequency = np.sort(rng.uniform(0.1, HIGHEST, SINES))
    power = (RATE**2 + (2 * np.pi * frequency) ** 2) ** -2.0
    level = size * np.sqrt(2 * power / power.sum())[:, None] * rng.standard_normal((SINES, 3))
    phase = rng.uniform(0, 2 * np.pi, SINES)
    return [
        {"amplitude": a.tolist(), "frequency": float(f), "phase": float(p)}
        for a, f, p in zip(level, frequency, phase, strict=True)
    ]


def one_flight(job: tuple[str, int]) -> RecordScore:
    """A flight of a row, estimated."""
    name, seed = job
    given, rng = dict(SENSOR_ROWS[name]), np.random.default_rng(1000 + seed)
    sensors, told = given.pop("sensors", True), given.pop("noise_std", {})
    given |= {"marker_every": int(CLOCK / FRAMES) if sensors else 1}
    loads = {load: drawn_sines(size, rng) for load, size in SIZES.items()}
    recording = simulate(
        SceneRecipe(
            scene="instrumented", duration=SECONDS, sample_rate=CLOCK if sensors else FRAMES, noise_std=5e-4,
            seed=seed, parameters=loads | given,
        )
    )  # fmt: skip
    if not sensors:
        bare = replace(recording.motion, angular_velocity=None, specific_force=None)
        recording = replace(recording, motion=bare)
    turn = None
    if not given.get("markers", True):
        turn = Rotation.from_quat(recording.truth["orientation"][0]).as_matrix()
    return estimated_score(recording, turn, noise_std=told, lines="none")


def main() -> int:
    """Print the table."""
    given = asked("evidence.claims.sensors", __doc__, page=False, seeds=8, jobs=2, only=tuple(SENSOR_ROWS))
    jobs = [(name, seed) for name in given.only for seed in range(given.seeds)]
    flights, rows = list(each(one_flight, jobs, given.jobs)), []
    for k, name in enumerate(given.only):
        own = flights[k * given.seeds : (k + 1) * given.seeds]
        cells = []
        for of in (FORCE, MOMENT):
            error, over, held = pooled(own, of)
            cells += [f"{error:.3g}", f"{over:.2f}", f"{100 * held:.1f}"]
        levels = [score.verdict for score in own]
        said = (f"{levels.count(v)} {v}" for v in ("ok", "degraded", "refused") if v in levels)
        rows.append([name, *cells, ", ".join(said), silent_share(score.silent for score in own)])
        for text in sorted({reason[:100] for score in own for reason in score.reasons}):
            print(f"    {name}: {text}", file=sys.stderr)
    over = "over claim", "95 % hold"
    print(tabled(("", "F rmse, N", *over, "T rmse, N m", *over, "verdicts", "silently wrong"), rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
