"""What a camera makes of places: errors of every kind, and what its user states of them."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from evidence.calibration import distributions as of
from evidence.calibration.distributions import Drawn
from forceid.records import Array

SETTLED = 200  # samples before the record, in which an error that follows itself settles


def seen(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Readings (time, marker, 3) m of places, NaN where one is missing."""
    return MAKERS[drawn.error](drawn, x, rng)


def white(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Independent errors of one deviation."""
    return x + drawn.noise * rng.standard_normal(x.shape)


def following(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Errors (time, ...) of unit variance, each of which remembers the one before."""
    keeps = np.exp(-1 / of.log_even(rng, of.REMEMBERED))
    raw = rng.standard_normal((shape[0] + SETTLED, *shape[1:])) * np.sqrt(1 - keeps**2)
    return np.asarray(lfilter([1.0], [1.0, -keeps], raw, axis=0)[SETTLED:])


def colored(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Half of the variance follows itself, of every marker on its own."""
    part = np.sqrt(of.COLORED) * following(x.shape, rng)
    return x + drawn.noise * (part + np.sqrt(1 - of.COLORED) * rng.standard_normal(x.shape))


def shared(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Half of the variance follows itself and is that of all markers at once."""
    part = np.sqrt(of.COLORED) * following((len(x), 1, 3), rng)
    return x + drawn.noise * (part + np.sqrt(1 - of.COLORED) * rng.standard_normal(x.shape))


def low_passed(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Readings went through a low-pass of Butterworth, forward and backward: places and errors alike."""
    sos = butter(2, 2 * of.log_even(rng, of.CUTS), output="sos")
    error = sosfiltfilt(sos, rng.standard_normal(x.shape), axis=0)
    return np.asarray(sosfiltfilt(sos, x, axis=0) + drawn.noise * error / error.std())


def outliers(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """A few readings are far off."""
    x = white(drawn, x, rng)
    wild = rng.random(x.shape[:2]) < of.log_even(rng, of.OUTLIERS)
    off = [of.log_even(rng, of.WILD) * of.direction(rng) for _ in range(int(wild.sum()))]
    x[wild] += drawn.noise * np.reshape(off, (-1, 3))
    return x


def gaps(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Runs of readings of up to half of the markers are missing."""
    x = white(drawn, x, rng)
    for marker in rng.permutation(x.shape[1])[: int(rng.integers(1, max(2, x.shape[1] // 2 + 1)))]:
        length = max(1, int(of.log_even(rng, of.MISSING) * len(x)))
        first = int(rng.integers(0, len(x) - length))
        x[first : first + length, marker] = np.nan
    return x


def rounded(drawn: Drawn, x: Array, rng: np.random.Generator) -> Array:
    """Readings have few digits."""
    step = float(rng.choice(of.DIGITS))
    return np.asarray(step * np.round(white(drawn, x, rng) / step))


MAKERS = {
    "white": white, "colored": colored, "low-passed": low_passed, "outliers": outliers, "gaps": gaps,
    "rounded": rounded, "shared": shared,
}  # fmt: skip


def stated(drawn: Drawn, rng: np.random.Generator) -> dict[str, float]:
    """What the user states of the noise."""
    if drawn.stated == "nothing":
        return {}
    off = of.log_even(rng, of.MISSTATED) ** (1 if rng.random() < 0.5 else -1)
    return {"position": drawn.noise * (off if drawn.stated == "wrong" else 1.0)}
