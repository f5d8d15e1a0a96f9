"""Failures of the errors: outliers, exchanged labels, color, a size that is not the stated one, rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evidence.stress.failure import failure
from evidence.subjects.flights.bodies import Setup
from evidence.subjects.flights.failures.record import NOISE, Faulty, measured
from forceid.records import Array


def tracks(case: Faulty) -> Array:
    """Marker tracks (time, node, 3) of a case."""
    x = case.recording.motion.position
    assert x is not None
    return x


@failure("noise", "Outliers of 20 mm", "share of samples", (0, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4))
def outliers(level: float, rng: np.random.Generator) -> Faulty:
    """A wild marker pulls the pose of its frame."""
    case = measured(Setup(), rng)
    x = tracks(case)
    off = 0.02 * rng.standard_normal(x.shape)
    return case.with_position(np.where(rng.random((*x.shape[:2], 1)) < level, x + off, x))


@failure("noise", "Size of 1 % outliers", "sigma", (0, 3, 6, 12, 25, 50, 100, 200))
def outlier_size(level: float, rng: np.random.Generator) -> Faulty:
    """Outliers near the noise pass for noise that is larger."""
    case = measured(Setup(), rng)
    x = tracks(case)
    off = level * NOISE * rng.standard_normal(x.shape)
    return case.with_position(np.where(rng.random((*x.shape[:2], 1)) < 0.01, x + off, x))


@failure("noise", "Exchanged labels", "frames of 240", (0, 1, 3, 10, 30, 80, 160, 240))
def swapped_labels(level: float, rng: np.random.Generator) -> Faulty:
    """Two markers that trade places turn the body at a jump."""
    case = measured(Setup(), rng)
    x = tracks(case).copy()
    first = (len(x) - int(level)) // 2
    run = slice(first, first + int(level))
    x[run, [1, 7]] = x[run, [7, 1]]
    return case.with_position(x)


@failure("noise", "Color of the noise", "correlation", (0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99))
def noise_color(level: float, rng: np.random.Generator) -> Faulty:
    """Slow errors look like motion, and hence like force."""
    case = measured(Setup(), rng)
    x = case.flight.position
    return case.with_position(x + NOISE * correlated(x.shape, level, rng))


@failure("noise", "Slow errors in common", "sigma", (0, 0.03, 0.1, 0.2, 0.4, 0.7, 1, 3))
def shared_errors(level: float, rng: np.random.Generator) -> Faulty:
    """Errors that all markers share do not average out at the mass center."""
    case = measured(Setup(), rng)
    x = tracks(case)
    return case.with_position(x + level * NOISE * correlated((len(x), 1, 3), 0.95, rng))


def correlated(shape: tuple[int, ...], kept: float, rng: np.random.Generator) -> Array:
    """Errors of unit variance that keep a share of themselves from frame to frame."""
    drawn = rng.standard_normal(shape)
    for k in range(1, len(drawn)):
        drawn[k] = kept * drawn[k - 1] + np.sqrt(1 - kept**2) * drawn[k]
    return drawn


@failure("noise", "Smoothed before", "Hz", (100, 70, 50, 30, 20, 12, 8, 5))
def smoothed_before(level: float, rng: np.random.Generator) -> Faulty:
    """Smoothing at the source takes the noise away that tells what is not known."""
    case = measured(Setup(frames=360), rng)
    return without_ends(case.with_position(butterworth_tracks(tracks(case), level, case.flight.setup.rate)))


@failure("noise", "Smoothed before, noise not stated", "Hz", (100, 70, 50, 30, 20, 12, 8, 5))
def smoothed_unstated(level: float, rng: np.random.Generator) -> Faulty:
    """Nothing in the record tells its errors from its motion."""
    return smoothed_before(level, rng).with_stated()


def butterworth_tracks(x: Array, cut: float, rate: float) -> Array:
    """Tracks through a Butterworth filter of order four, both ways."""
    from scipy.signal import butter, sosfiltfilt

    if cut >= rate / 2:
        return x
    return np.asarray(sosfiltfilt(butter(4, cut, fs=rate, output="sos"), x, axis=0))


def without_ends(case: Faulty, edge: int = 60) -> Faulty:
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


@failure(
    "noise", "Noise stated too large", "stated / true", (1, 1.5, 2, 3, 8, 20, 50, 100),
    name="noise_overstated", breaks="force passes for noise",
)  # fmt: skip
@failure(
    "noise", "Noise stated too small", "stated / true", (1, 0.7, 0.5, 0.3, 0.1, 0.05, 0.02, 0.01),
    name="noise_understated", breaks="noise passes for force",
)  # fmt: skip
def stated_wrong(level: float, rng: np.random.Generator) -> Faulty:
    """Stated over true standard deviation of the noise."""
    return measured(Setup(), rng).with_stated(position=level * NOISE)


@failure("noise", "Noise not stated", "m", (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03))
def noise_not_stated(level: float, rng: np.random.Generator) -> Faulty:
    """The record itself must tell noise from motion."""
    return measured(Setup(), rng, noise=level).with_stated()


@failure("noise", "Size of the noise", "m", (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))
def noise_size(level: float, rng: np.random.Generator) -> Faulty:
    """The load drowns in the noise."""
    return measured(Setup(), rng, noise=level)


@failure("noise", "Rounded coordinates", "m", (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))
def quantization(level: float, rng: np.random.Generator) -> Faulty:
    """Steps of rounding are errors that follow the motion."""
    case = measured(Setup(), rng)
    known = float(np.hypot(NOISE, level / np.sqrt(12)))
    return replace(case.with_position(np.round(tracks(case) / level) * level), noise=known)
