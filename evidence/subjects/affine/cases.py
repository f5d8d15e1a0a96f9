"""Bodies that move affinely on the chart: deformations to factor, and free bodies to follow, with the truth.

Factors are known to eighty digits, motions by DOP853 near rounding on forces that are no part of forceid. The
truth of many frames or bodies is that of the first few. Source: pseudo-rigid bodies, sections 1, 2, 8, 9.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from evidence.subjects.affine.bodies import (
    BALL,
    BLOCK,
    SOFT,
    DeformedFrames,
    Throw,
    followed,
    natural_constants,
    random_rotations,
    unstrained,
)
from evidence.subjects.affine.exact_polar import exact_polar
from evidence.vectors import EYE
from forceid.records import Array

FRAMES, KNOWN = 20_000, 200
BODIES, FOLLOWED = 1000, 20


@dataclass(frozen=True)
class AffineCase:
    """What is given, and the truth of both quantities, of the first frames or bodies where there are many.

    kind: "factors", "body", "bodies", "stiff" or "held"; quantities: what the truth is of; starts: F and F'
    of many bodies; resolved: relative error below which the truth is not known.
    """

    name: str
    title: str
    kind: str
    quantities: tuple[str, str]
    given: DeformedFrames | Throw
    resolved: float
    find: Callable[[], tuple[Array, Array]]
    starts: tuple[Array, Array] | None = None

    @cached_property
    def truth(self) -> tuple[Array, Array]:
        """Both quantities (sample, ...)."""
        return self.find()

    @cached_property
    def key(self) -> str:
        """Hash of what is given and of the truth."""
        digest = hashlib.sha256(self.name.encode())
        given = self.given
        arrays = (
            (given.F,) if isinstance(given, DeformedFrames) else (given.F0, given.dF0, given.time, given.E)
        )
        for array in (*arrays, *self.truth):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]


def factors(name: str, condition: float) -> AffineCase:
    """Many frames of one condition, two axes short."""
    rng = np.random.default_rng(1)
    D = np.array([1.0, 1 / condition, 0.5 / condition])
    F = (random_rotations(rng, FRAMES) * D) @ random_rotations(rng, FRAMES)

    def find() -> tuple[Array, Array]:
        L = exact_polar(F[:KNOWN], F[:KNOWN])[0]
        U = L.swapaxes(1, 2) @ F[:KNOWN]
        return L, 0.5 * (U + U.swapaxes(1, 2))

    title = f"Polar factors of {FRAMES} frames, condition {condition:.0e}"
    return AffineCase(name, title, "factors", ("rotation", "stretch"), DeformedFrames(F, F), 1e-15, find)


def thrown(name: str, title: str, kind: str, throw: Throw) -> AffineCase:
    """One free body."""
    find = partial(followed, throw)
    return AffineCase(name, title, kind, ("F", "F'"), throw, 1e-11, find)


def swinging() -> Throw:
    """A soft Mooney-Rivlin ball that spins and swings hard."""
    rng = np.random.default_rng(2)
    F0 = EYE + 0.15 * rng.standard_normal((3, 3))
    return Throw(BALL, SOFT, F0, 0.4 * rng.standard_normal((3, 3)), np.linspace(0, 20, 21))


def many(name: str) -> AffineCase:
    """The same ball from many starts."""
    throw, rng = swinging(), np.random.default_rng(3)
    F0 = EYE + 0.1 * rng.standard_normal((BODIES, 3, 3))
    V0 = 0.4 * rng.standard_normal((BODIES, 3, 3))

    def find() -> tuple[Array, Array]:
        paths = [followed(replace(throw, F0=F0[k], dF0=V0[k])) for k in range(FOLLOWED)]
        return np.stack([F for F, _ in paths], 1), np.stack([V for _, V in paths], 1)

    title = f"{BODIES} Mooney-Rivlin balls, 20 s"
    return AffineCase(name, title, "bodies", ("F", "F'"), throw, 1e-11, find, (F0, V0))


def case_called(name: str) -> AffineCase:
    """The case of a name."""
    if name.startswith("polar_"):
        return factors(name, float(name.removeprefix("polar_")))
    if name == "ball":
        return thrown(name, "Mooney-Rivlin ball, 20 s", "body", swinging())
    start = unstrained(np.random.default_rng(4), 0.1)
    if name == "stiff_ball":
        throw = Throw(BALL, natural_constants(0.6, 0.25, 1.7e4 / 4), *start, np.linspace(0, 2, 21))
        return thrown(name, "Nearly incompressible ball, lambda 1e4 mu, 2 s", "stiff", throw)
    if name == "held_block":
        throw = Throw(BLOCK, (0.6, 0.25, 0.0, 0.0), *start, np.linspace(0, 10, 21), held=True)
        return thrown(name, "Incompressible block, 10 s", "held", throw)
    return many(name)


CASES = ("polar_1e2", "polar_1e6", "polar_1e12", "ball", "balls_1000", "stiff_ball", "held_block")
