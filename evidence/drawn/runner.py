"""Runners of 31 points whose limbs swing by 60 degrees: force beside the best low-pass, claims, and time.

    python -m evidence.drawn.runner -o FOLDER [--seeds 3]

Ten segments of drawn lengths turn about their joints at a drawn cadence, and the whole bounces and drifts;
all by closed forms, whose second derivatives are the truth. Errors of the points are white, or low-passed at
12 Hz as laboratories do, 1 mm each; readings are missing in runs or not; the noise is stated or not. The
Butterworth filter has the cut that is best on the truth, by axis, and is told beside the 6 Hz one.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from evidence.written import asked, table, written
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
RATE, SECONDS, SIGMA = 100.0, 5.0, 1e-3
SWING = np.radians(60.0)
PARTS = {  # segment: what it hangs on, points, part of the mass
    "trunk": ("", 5, 0.50), "head": ("trunk", 2, 0.08),
    "left arm": ("trunk", 3, 0.03), "left forearm": ("left arm", 3, 0.02),
    "right arm": ("trunk", 3, 0.03), "right forearm": ("right arm", 3, 0.02),
    "left thigh": ("trunk", 3, 0.10), "left shank": ("left thigh", 3, 0.06),
    "right thigh": ("trunk", 3, 0.10), "right shank": ("right thigh", 3, 0.06),
}  # fmt: skip


def run(seed: int, colored: bool, lost: bool, stated: bool) -> tuple[Recording, np.ndarray]:
    """A recording and its force (time, 3) N."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0, SECONDS, 1 / (10 * RATE))
    phase, cadence = 2 * np.pi * rng.uniform(1.2, 1.6) * fine, rng.uniform(0.03, 0.06)
    root = np.stack([3.0 * fine + 0.02 * np.sin(phase), 0.02 * np.sin(phase), cadence * np.sin(2 * phase)], 1)
    points, mass, end = [], [], {"": root}
    for name, (on, count, share) in PARTS.items():
        length = rng.uniform(0.2, 0.45)
        size = 0.1 if name in ("trunk", "head") else 0.5
        angle = size * SWING * np.sin(phase + np.pi * name.startswith("right") + rng.uniform(-0.4, 0.4))
        up = 1.0 if name in ("trunk", "head") else -1.0
        along = up * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
        across = np.stack([0 * angle, 1 + 0 * angle, 0 * angle], 1)
        for _ in range(count):
            beside = rng.uniform(-0.08, 0.08)
            points.append(end[on] + length * rng.uniform(0.1, 1.0) * along + beside * across)
            mass.append(60.0 * share / count)
        end[name] = end[on] + length * along
    x, m = np.stack(points, 1), np.array(mass)
    center = np.einsum("n,tna->ta", m / m.sum(), x)
    at = slice(None, None, 10)
    force = m.sum() * (CubicSpline(fine, center)(fine[at], 2) - GRAVITY)
    noise = rng.standard_normal(x[at].shape)
    if colored:
        noise = sosfiltfilt(butter(2, 12.0, fs=RATE, output="sos"), noise, axis=0)
        noise /= noise.std()
    position = x[at] + SIGMA * noise
    while lost and np.isnan(position[..., 0]).mean() < 0.03:
        k, first = rng.integers(len(m)), rng.integers(len(position))
        position[first : first + rng.integers(3, 25), k] = np.nan
    body = Body(tuple(f"p{k}" for k in range(len(m))), x[0], m)
    told = {"position": SIGMA} if stated else {}
    return Recording(body, Motion(fine[at], position, gravity=GRAVITY, noise_std=told)), force


def low_passed(recording: Recording, cut: float) -> np.ndarray:
    """Force by a zero-phase Butterworth filter and second differences, gaps filled by straight lines."""
    motion, m = recording.motion, recording.body.mass
    assert motion.position is not None
    assert m is not None
    x = motion.position.copy()
    for track in x.reshape(len(x), -1).T:
        seen = np.isfinite(track)
        track[~seen] = np.interp(motion.time[~seen], motion.time[seen], track[seen])
    center = np.einsum("n,tna->ta", m / m.sum(), x)
    center = sosfiltfilt(butter(2, cut / 0.802, fs=RATE, output="sos"), center, axis=0)
    bent = np.zeros_like(center)
    bent[1:-1] = (center[2:] - 2 * center[1:-1] + center[:-2]) * RATE**2
    return np.asarray(m.sum() * (bent - motion.gravity))


def study(seeds: int) -> list[dict[str, Any]]:
    """A row a kind of recording: worst axis over all seeds."""
    rows = []
    for colored in (False, True):
        for lost in (False, True):
            for stated in (True, False):
                ratio, six, claim, cpu = [], [], [], []
                for seed in range(seeds):
                    recording, force = run(seed, colored, lost, stated)
                    inner = slice(20, -20)

                    def rms(value: np.ndarray, force: np.ndarray = force, inner: slice = inner) -> np.ndarray:
                        return np.asarray(np.sqrt(((value - force)[inner] ** 2).mean(0)))

                    began = time.process_time()
                    found = estimate_recording(replace(recording), load_settings())
                    cpu.append(time.process_time() - began)
                    cuts = [rms(low_passed(recording, cut)) for cut in np.arange(2.0, 25.0, 0.5)]
                    error = rms(found.force)
                    ratio.append(error / np.min(cuts, axis=0))
                    six.append(error / rms(low_passed(recording, 6.0)))
                    claim.append(error / np.sqrt((found.force_std[inner] ** 2).mean(0)))
                rows.append(
                    {
                        "errors": "low-passed" if colored else "white",
                        "readings missing": "3 %" if lost else "none", "noise": "stated" if stated else "not",
                        "over the best cut": float(np.max(ratio)), "over 6 Hz": float(np.max(six)),
                        "error over claim": float(np.max(claim)), "CPU (s)": float(np.max(cpu)),
                    }
                )  # fmt: skip
                print({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True)
    return rows


PAGE = """# Runners of 31 points

`{command}`

A run of 5 s at 100 Hz, 500 frames, of 31 points with mass whose segments swing by 60 degrees; errors of 1 mm,
white or low-passed at 12 Hz. Error of the force, rms over the record without its ends, over that of the best
Butterworth filter, its cut chosen on the truth, over that of one of 6 Hz, and over the claim: each the worst
axis of all runs. CPU: the longest. Seeds: {seeds}.

"""


def main() -> None:
    """Run, estimate, and write the table."""
    given = asked("evidence.drawn.runner", __doc__, seeds=3)
    text = PAGE.format(command=given.command, seeds=given.seeds)
    written(given.output, "runner.md", f"{text}{table(study(given.seeds))}\n")


if __name__ == "__main__":
    main()
