"""Failures of the errors: outliers, exchanged labels, color, a size that is not the stated one, rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evidence.stress.failure import Failure
from evidence.subjects.flights.bodies import Setup
from evidence.subjects.flights.failures.record import NOISE, Faulty, measured
from forceid.records import Array


def tracks(case: Faulty) -> Array:
    """Marker tracks (time, node, 3) of a case."""
    x = case.recording.motion.position
    assert x is not None
    return x


def outliers(level: float, rng: np.random.Generator) -> Faulty:
    """Share of marker samples that are 20 mm off."""
    case = measured(Setup(), rng)
    x = tracks(case)
    off = 0.02 * rng.standard_normal(x.shape)
    return case.with_position(np.where(rng.random((*x.shape[:2], 1)) < level, x + off, x))


def outlier_size(level: float, rng: np.random.Generator) -> Faulty:
    """Size, in standard deviations of the noise, of errors of one marker sample in a hundred."""
    case = measured(Setup(), rng)
    x = tracks(case)
    off = level * NOISE * rng.standard_normal(x.shape)
    return case.with_position(np.where(rng.random((*x.shape[:2], 1)) < 0.01, x + off, x))


def swapped(level: float, rng: np.random.Generator) -> Faulty:
    """Frames in the middle in which two markers have traded labels."""
    case = measured(Setup(), rng)
    x = tracks(case).copy()
    first = (len(x) - int(level)) // 2
    run = slice(first, first + int(level))
    x[run, [1, 7]] = x[run, [7, 1]]
    return case.with_position(x)


def colored(level: float, rng: np.random.Generator) -> Faulty:
    """Correlation of the errors of a marker from frame to frame."""
    case = measured(Setup(), rng)
    x = case.flight.position
    return case.with_position(x + NOISE * correlated(x.shape, level, rng))


def shared_slow(level: float, rng: np.random.Generator) -> Faulty:
    """Size, over that of the noise, of slow errors (0.95 from frame to frame) that all markers share."""
    case = measured(Setup(), rng)
    x = tracks(case)
    return case.with_position(x + level * NOISE * correlated((len(x), 1, 3), 0.95, rng))


def correlated(shape: tuple[int, ...], kept: float, rng: np.random.Generator) -> Array:
    """Errors of unit variance that keep a share of themselves from frame to frame."""
    drawn = rng.standard_normal(shape)
    for k in range(1, len(drawn)):
        drawn[k] = kept * drawn[k - 1] + np.sqrt(1 - kept**2) * drawn[k]
    return drawn


def smoothed_before(level: float, rng: np.random.Generator) -> Faulty:
    """Cut (Hz) of the low-pass that tracks went through before, their noise stated as it was."""
    case = measured(Setup(frames=360), rng)
    return inner(case.with_position(low_passed(tracks(case), level, case.flight.setup.rate)))


def smoothed_unstated(level: float, rng: np.random.Generator) -> Faulty:
    """The same, and no noise stated."""
    return smoothed_before(level, rng).with_stated()


def low_passed(x: Array, cut: float, rate: float) -> Array:
    """Tracks through a Butterworth filter of order four, both ways."""
    from scipy.signal import butter, sosfiltfilt

    if cut >= rate / 2:
        return x
    return np.asarray(sosfiltfilt(butter(4, cut, fs=rate, output="sos"), x, axis=0))


def inner(case: Faulty, edge: int = 60) -> Faulty:
    """The case without its ends, where a filter rings."""
    keep = slice(edge, len(case.seen) - edge)
    f, r = case.flight, case.recording
    time = f.time[keep]
    truth = {name: value[keep] for name, value in f.truth.items()}
    flight = replace(
        f, time=time, position=f.position[keep], rotation=f.rotation[keep], inertia=f.inertia[keep],
        h=f.h[keep], truth=truth,
    )  # fmt: skip
    motion = replace(r.motion, time=time, position=tracks(case)[keep])
    return replace(
        case, flight=flight, seen=case.seen[keep], recording=replace(r, motion=motion, truth=truth)
    )


def stated_wrong(level: float, rng: np.random.Generator) -> Faulty:
    """Stated over true standard deviation of the noise."""
    return measured(Setup(), rng).with_stated(position=level * NOISE)


def not_stated(level: float, rng: np.random.Generator) -> Faulty:
    """Noise (m) that the file does not state."""
    return measured(Setup(), rng, noise=level).with_stated()


def stated(level: float, rng: np.random.Generator) -> Faulty:
    """Noise (m) that the file states."""
    return measured(Setup(), rng, noise=level)


def rounded(level: float, rng: np.random.Generator) -> Faulty:
    """Step (m) to which coordinates are rounded, on top of the stated noise; the bound knows of it."""
    case = measured(Setup(), rng)
    known = float(np.hypot(NOISE, level / np.sqrt(12)))
    return replace(case.with_position(np.round(tracks(case) / level) * level), noise=known)


FAILURES = (
    Failure(
        "outliers", "noise", "Outliers of 20 mm", "share of samples",
        (0, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4),
        "a wild marker pulls the pose of its frame", outliers,
    ),
    Failure(
        "outlier_size", "noise", "Size of 1 % outliers", "sigma", (0, 3, 6, 12, 25, 50, 100, 200),
        "outliers near the noise pass for noise that is larger", outlier_size,
    ),
    Failure(
        "swapped_labels", "noise", "Exchanged labels", "frames of 240", (0, 1, 3, 10, 30, 80, 160, 240),
        "two markers that trade places turn the body at a jump", swapped,
    ),
    Failure(
        "noise_color", "noise", "Color of the noise", "correlation", (0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99),
        "slow errors look like motion, and hence like force", colored,
    ),
    Failure(
        "shared_errors", "noise", "Slow errors in common", "sigma", (0, 0.03, 0.1, 0.2, 0.4, 0.7, 1, 3),
        "errors that all markers share do not average out at the mass center", shared_slow,
    ),
    Failure(
        "smoothed_before", "noise", "Smoothed before", "Hz", (100, 70, 50, 30, 20, 12, 8, 5),
        "smoothing at the source takes the noise away that tells what is not known", smoothed_before,
    ),
    Failure(
        "smoothed_unstated", "noise", "Smoothed before, noise not stated", "Hz",
        (100, 70, 50, 30, 20, 12, 8, 5),
        "nothing in the record tells its errors from its motion", smoothed_unstated,
    ),
    Failure(
        "noise_understated", "noise", "Noise stated too small", "stated / true",
        (1, 0.7, 0.5, 0.3, 0.1, 0.05, 0.02, 0.01), "noise passes for force", stated_wrong,
    ),
    Failure(
        "noise_overstated", "noise", "Noise stated too large", "stated / true",
        (1, 1.5, 2, 3, 8, 20, 50, 100),
        "force passes for noise", stated_wrong,
    ),
    Failure(
        "noise_not_stated", "noise", "Noise not stated", "m",
        (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03),
        "the record itself must tell noise from motion", not_stated,
    ),
    Failure(
        "noise_size", "noise", "Size of the noise", "m", (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1),
        "the load drowns in the noise", stated,
    ),
    Failure(
        "quantization", "noise", "Rounded coordinates", "m", (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1),
        "steps of rounding are errors that follow the motion", rounded,
    ),
)  # fmt: skip
