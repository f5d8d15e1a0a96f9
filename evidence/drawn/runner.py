"""Runners of 31 points whose limbs swing by 60 degrees: force beside the best low-pass, claims, and time.

    python -m evidence.drawn.runner -o FOLDER [--seeds 3]

Ten segments of drawn lengths turn about their joints at a drawn cadence, and the whole bounces and drifts;
all by closed forms, whose second derivatives are the truth. Errors of the points are white, or low-passed at
12 Hz as laboratories do, 1 mm each; readings are missing in runs or not; the noise is stated or not. The
Butterworth filter has the cut that is best on the truth, by axis, and is told beside the 6 Hz one.
"""

from __future__ import annotations

import time
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from evidence.drawn.people import off
from evidence.drawn.records.scored import low_passed
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

RATE, SECONDS, SIGMA = 100.0, 5.0, 1e-3
SWING = np.radians(60.0)
HEADS = "errors", "readings missing", "noise", "over the best cut", "over 6 Hz", "error over claim", "CPU (s)"
PARTS = {  # segment: what it hangs on, points, part of the mass
    "trunk": ("", 5, 0.50), "head": ("trunk", 2, 0.08),
    "left arm": ("trunk", 3, 0.03), "left forearm": ("left arm", 3, 0.02),
    "right arm": ("trunk", 3, 0.03), "right forearm": ("right arm", 3, 0.02),
    "left thigh": ("trunk", 3, 0.10), "left shank": ("left thigh", 3, 0.06),
    "right thigh": ("trunk", 3, 0.10), "right shank": ("right thigh", 3, 0.06),
}  # fmt: skip
ABOUT = """\
A run of 5 s at 100 Hz, 500 frames, of 31 points with mass whose segments swing by 60 degrees; errors of 1 mm,
white or low-passed at 12 Hz. The error of the force, rms over the record without its ends, is told over
that of the best Butterworth filter, its cut chosen on the truth. Then over that of one of 6 Hz, and over
the claim. Each is the worst axis of all runs. CPU: the longest. Seeds: {seeds}."""


def run(seed: int, colored: bool, lost: bool, stated: bool) -> Recording:
    """A recording and its force."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0, SECONDS, 1 / (10 * RATE))
    phase, cadence = 2 * np.pi * rng.uniform(1.2, 1.6) * fine, rng.uniform(0.03, 0.06)
    root = np.stack([3.0 * fine + 0.02 * np.sin(phase), 0.02 * np.sin(phase), cadence * np.sin(2 * phase)], 1)
    points, mass, end = [], [], {"": root}
    for name, (on, count, share) in PARTS.items():
        length, core = rng.uniform(0.2, 0.45), name in ("trunk", "head")
        angle = np.sin(phase + np.pi * name.startswith("right") + rng.uniform(-0.4, 0.4))
        angle *= (0.1 if core else 0.5) * SWING
        along = (1.0 if core else -1.0) * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
        for _ in range(count):
            beside = rng.uniform(-0.08, 0.08) * np.array([0.0, 1.0, 0.0])
            points.append(end[on] + length * rng.uniform(0.1, 1.0) * along + beside)
            mass.append(60.0 * share / count)
        end[name] = end[on] + length * along
    x, m = np.stack(points, 1), np.array(mass)
    center = np.einsum("n,tna->ta", m / m.sum(), x)
    at = slice(None, None, 10)
    noise = rng.standard_normal(x[at].shape)
    if colored:
        noise = sosfiltfilt(butter(2, 12.0, fs=RATE, output="sos"), noise, axis=0)
        noise /= noise.std()
    position = x[at] + SIGMA * noise
    while lost and np.isnan(position[..., 0]).mean() < 0.03:
        k, first = rng.integers(len(m)), rng.integers(len(position))
        position[first : first + rng.integers(3, 25), k] = np.nan
    motion = Motion(fine[at], position, gravity=GRAVITY, noise_std={"position": SIGMA} if stated else {})
    truth = {"force": m.sum() * (CubicSpline(fine, center)(fine[at], 2) - GRAVITY)}
    return Recording(Body(tuple(f"p{k}" for k in range(len(m))), x[0], m), motion, truth)


def kind_row(kind: tuple[bool, bool, bool], seeds: int) -> dict[str, Any]:
    """A kind of recording: worst axis over all seeds."""
    found = []
    for seed in range(seeds):
        recording = run(seed, *kind)

        truth, began = recording.truth["force"], time.process_time()
        estimate = estimate_recording(recording, load_settings())
        cpu = time.process_time() - began
        rivals = [
            off(low_passed(recording, cut)["force"] - truth) for cut in (6.0, *np.arange(2.0, 25.0, 0.5))
        ]
        best = np.min(rivals[1:], axis=0)
        error, claim = off(estimate.force - truth), off(estimate.force_std)
        found.append([np.max(error / of) for of in (best, rivals[0], claim)] + [cpu])
    worst = np.max(found, axis=0).tolist()
    colored, lost, stated = kind
    words = "low-passed" if colored else "white", "3 %" if lost else "none", "stated" if stated else "not"
    return dict(zip(HEADS, (*words, *worst), strict=True))


def main() -> None:
    """Run, estimate, and write the table."""
    given = asked("evidence.drawn.runner", __doc__, seeds=3)
    kinds = list(product((False, True), (False, True), (True, False)))
    rows = list(each(partial(kind_row, seeds=given.seeds), kinds, 1))
    about = ABOUT.format(seeds=given.seeds)
    paged(given.output, "runner", "Runners of 31 points", f"`{given.command}`", about, table(rows))


if __name__ == "__main__":
    main()
