"""Failures of force and first moments from markers on a body that moves affinely, or nearly so."""

from __future__ import annotations

from typing import Any

import numpy as np

from evidence.stress.failure import failure
from evidence.subjects.affine.flights import SWING, toned
from evidence.subjects.affine.problem import AffineProblem
from evidence.vectors import GRAVITY
from forceid.records import Array, Body, Motion, Recording

SIZE = np.array([0.24, 0.18, 0.14])  # m
NOISE = 3e-4  # m
RATE, FRAMES = 200.0, 100
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * SIZE
SPREAD = CORNERS[[0, 3, 5, 6, 1, 2, 4, 7]]  # the first four span a tetrahedron
BENDING = np.array([0.5, -0.8, 0.33])  # direction of what is not affine
BEND = 2 * np.pi * 2.0  # rad/s, of that
MASS = 0.5  # kg


def filmed(
    rng: np.random.Generator,
    place: Array = CORNERS,
    noise: float = NOISE,
    bent: float = 0.0,
    wild: float = 0.0,
    frames: int = FRAMES,
    whole: float | None = None,
) -> AffineProblem:
    """Markers at place (marker, 3) m, of equal masses, on a toned flight; its force and first moments.

    bent: out of the affine map, of the length; wild: share of samples that are off by a third of that; whole:
    swing of F of a body of which mass and inertia are known as a whole, None: one of known masses.
    """
    X = place - place.mean(0)
    E = MASS / len(X) * X.T @ X
    flight = toned(np.arange(frames) / RATE, rng, SWING if whole is None else whole)
    x = flight.center[:, None] + np.einsum("tab,nb->tna", flight.F, X)
    pull = MASS / len(X) * (flight.fall[:, None] + np.einsum("tab,nb->tna", flight.ddF, X))
    if bent:
        swing = bent * SIZE[0] * np.cos(BEND * flight.time + 0.7)
        across = np.einsum("t,n,b->tnb", swing, 4 * place[:, 0] * place[:, 1] / (SIZE[0] * SIZE[1]), BENDING)
        x, pull = x + across, pull - MASS / len(X) * BEND**2 * across
    arm = x - x.mean(1, keepdims=True)
    force, first = pull.sum(1) - MASS * GRAVITY, np.einsum("tna,tnb->tab", pull, arm).reshape(-1, 9)
    x = x + noise * rng.standard_normal(x.shape)
    hit = rng.random(x.shape[:2]) < wild
    x = np.where(hit[..., None], x + SIZE[0] / 3 * rng.standard_normal(x.shape), x)
    inertia = np.trace(E) * np.eye(3) - E
    known: dict[str, Any] = {"mass": np.full(len(X), MASS / len(X))}
    if whole is not None:
        known = {"total_mass": MASS, "mass_center": np.zeros(3), "inertia": inertia}
    body = Body(node=tuple(f"m{k}" for k in range(len(X))), position=X, **known)
    motion = Motion(flight.time, x, gravity=GRAVITY, noise_std={"position": noise})
    return AffineProblem(Recording(body, motion, {}), force, first, (np.nan, np.nan))


@failure(
    "affine_loads", "Markers near a plane", "of the thickness of the others", (1.0, 0.3, 0.1, 0.03, 0.01,
    1e-3, 1e-5, 0.0),
)  # fmt: skip
def plane_markers(level: float, rng: np.random.Generator) -> AffineProblem:
    """Markers in a plane do not show how the body stretches across it."""
    return filmed(rng, CORNERS * [1.0, 1.0, level])


@failure("affine_loads", "Few markers, affine body", "markers", (12, 8, 7, 6, 5, 4, 3, 2))
def few_affine_markers(level: float, rng: np.random.Generator) -> AffineProblem:
    """Twelve unknowns a frame: from four markers on nothing is left to check."""
    return filmed(rng, np.concatenate([SPREAD, 0.4 * CORNERS[:4]])[: int(level)])


@failure("affine_loads", "Loud markers, affine body", "m", (1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 0.1, 1.0))
def loud_markers(level: float, rng: np.random.Generator) -> AffineProblem:
    """Loads drown in the noise."""
    return filmed(rng, noise=level)


@failure("affine_loads", "Not affine", "of the length", (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))
def not_affine(level: float, rng: np.random.Generator) -> AffineProblem:
    """The body bends, and an affine map does not."""
    return filmed(rng, SPREAD[:6], bent=level)  # of eight corners an affine map takes nothing of it


@failure(
    "affine_loads", "Wild markers, affine body", "of the samples", (0.0, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2,
    0.4),
)  # fmt: skip
def wild_markers(level: float, rng: np.random.Generator) -> AffineProblem:
    """Markers are taken for others."""
    return filmed(rng, wild=level)


@failure("affine_loads", "Short flight, affine body", "frames", (200, 100, 60, 40, 25, 15, 12, 6))
def short_flight(level: float, rng: np.random.Generator) -> AffineProblem:
    """Too few frames tell a load from its noise."""
    return filmed(rng, frames=int(level))


@failure("affine_loads", "Inertia known as a whole", "of F", (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))
def known_as_whole(level: float, rng: np.random.Generator) -> AffineProblem:
    """The inertia of a body that stretches changes."""
    return filmed(rng, whole=level)
