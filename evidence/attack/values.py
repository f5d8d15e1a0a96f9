"""Hostile values: something done to the numbers of a motion file, drawn from a seeded generator."""

from __future__ import annotations

from typing import Any

import numpy as np

from evidence.attack.bodies import put

ODD = (
    0.0,
    -0.0,
    5e-324,
    1e-300,
    1e-20,
    1e-9,
    1.0,
    -1.0,
    1e3,
    1e9,
    1e20,
    1e300,
    -1e300,
    np.nan,
    np.inf,
    2.0**53,
)
FACTORS = (1e-12, 1e-6, 1e-3, 0.5, 57.29577951308232, 1e3, 1e6, 1e12, -1.0)


def one(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """One entry is odd."""
    a.flat[rng.integers(a.size)] = rng.choice(ODD)
    return a


def some(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """A part of the entries is odd."""
    a[rng.random(a.shape) < rng.choice([0.01, 0.2, 0.9])] = rng.choice(ODD)
    return a


def every(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """All entries are one odd number."""
    a[...] = rng.choice(ODD)
    return a


def scaled(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """In other units."""
    return a * rng.choice(FACTORS)


def an_axis(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """An axis, a node or a frame is odd throughout."""
    which = [slice(None)] * a.ndim
    axis = int(rng.integers(a.ndim))
    which[axis] = int(rng.integers(a.shape[axis]))
    a[tuple(which)] = rng.choice(ODD)
    return a


def checkerboard(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """Every second entry is a gap."""
    a[np.indices(a.shape).sum(0) % 2 == rng.integers(2)] = np.nan
    return a


def gaps(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """Rows are lost: some, most, or all but a few."""
    keep = rng.random(len(a)) < rng.choice([0.05, 0.3, 0.9])
    a[~keep] = np.nan
    return a


def shuffled(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """In another order along one of its dimensions."""
    return rng.permuted(a, axis=int(rng.integers(a.ndim))) if rng.random() < 0.5 else rng.permutation(a)


def coarse(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """With few digits."""
    return np.round(a, int(rng.integers(0, 4)))


def noisy(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """With noise of any size."""
    return a + rng.choice([1e-6, 1e-2, 1.0, 1e3]) * rng.standard_normal(a.shape)


def mirrored(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """Mirrored along the last axis, or turned about."""
    return a[..., ::-1].copy() if rng.random() < 0.5 else np.moveaxis(a, 0, -1).reshape(a.shape)


def repeated(rng: np.random.Generator, a: np.ndarray) -> np.ndarray:
    """Rows that repeat those before them."""
    k = np.arange(len(a)) // int(rng.integers(2, 9)) * 2
    return a[np.minimum(k, len(a) - 1)]


def jittered(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """A clock that jitters."""
    return np.sort(t + rng.choice([1e-12, 1e-4, 3e-3, 1.0]) * rng.random(t.shape))


def gapped(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """A clock with a gap, or with a step that is next to none."""
    k = int(rng.integers(1, len(t)))
    if rng.random() < 0.5:
        return t + (np.arange(len(t)) >= k) * 10.0 ** rng.integers(-1, 9)
    t[k] = t[k - 1] + 10.0 ** rng.integers(-12, -3)
    return np.sort(t)


def far(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """A clock that begins long ago, or counts in other units."""
    return t * rng.choice([1e-9, 1e-3, 1e3, 1e9]) + rng.choice([0.0, -1e3, 1.7e9, 1.7e18])


def swapped(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """A clock that turns back, stands still, or is logarithmic."""
    return [t[::-1].copy(), 0 * t, np.geomspace(1e-6, 1e6, len(t)), t**3][rng.integers(4)]


ON_ANY = (one, some, every, scaled, an_axis, checkerboard, gaps, shuffled, coarse, noisy, mirrored, repeated)
ON_TIME = (jittered, gapped, far, swapped, one)


def by_value(rng: np.random.Generator, file: Any) -> str:
    """Do something to the values of one variable; what, in words."""
    names = [f"{g}/{n}" for g in ("body", "motion") for n in file[g] if file[g][n].dtype.kind == "f"]
    name = "motion/time" if rng.random() < 0.2 else str(rng.choice(names))
    tables = ON_TIME if name == "motion/time" else ON_ANY
    work, attrs, a = tables[rng.integers(len(tables))], dict(file[name].attrs), file[name][()]
    with np.errstate(all="ignore"):
        changed = work(rng, np.array(a, float).reshape(a.shape or (1,)))
    put(file, name, np.reshape(changed, a.shape), **attrs)
    return f"{work.__name__} {name}"
