"""Failures of bodies in parts: loads out of balance, cross points, stiffness that jumps, mechanisms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from evidence.stress.failure import failure
from evidence.subjects.parts.bodies import FINE, Loaded, loaded, plates, smooth_motion, wedges
from forceid.partition.grids import Parts, gathered
from forceid.principal.operator import summation_operator

TILES = (4, 2)  # plates along and across
AT = np.array([(i, j) for i in range(TILES[0]) for j in range(TILES[1])])
YOUNG = 1000.0  # Pa
STIFFNESS_JUMPS = (1.0, 1e2, 1e4, 1e6, 1e8, 1e9, 1e10, 1e12)


def held_body(parts: Parts, rng: np.random.Generator, **known: object) -> Loaded:
    """A body held at x = 0, in a smooth motion that leaves it at rest there."""
    x = parts.place
    u = smooth_motion(x, rng) * x[:, :1] / x[:, 0].max()
    return loaded(parts, np.isclose(x[:, 0], 0), u, **known)  # type: ignore[arg-type]


@failure(
    "partition", "Floating, out of balance", "of the loads", (0.0, 1e-15, 1e-13, 1e-11, 1e-9, 1e-6, 1e-3,
    1.0),
)  # fmt: skip
def floating(level: float, rng: np.random.Generator) -> Loaded:
    """Nothing holds the body, and its loads do not add up to zero."""
    parts = plates((3, 2))
    heavy = 10.0 ** rng.uniform(-0.5, 0.5, len(parts.mass))
    parts = replace(parts, mass=tuple(w * m for w, m in zip(heavy, parts.mass, strict=True)))
    body = loaded(parts, None, smooth_motion(parts.place, rng))
    way, pull = rng.standard_normal(3), np.zeros(len(body.load))
    for m, L, R in zip(parts.mass, parts.boolean, body.modes, strict=True):
        pull += L.T @ (m @ (R @ way))  # what its inertia takes, so that relief leaves the motion as it is
    return replace(body, load=body.load + level * np.linalg.norm(body.load) / np.linalg.norm(pull) * pull)


@failure("partition", "Parts along an edge", "parts", (1, 2, 3, 4, 5, 6, 7, 8))
def cross_points(level: float, rng: np.random.Generator) -> Loaded:
    """Many nodes are shared by four parts, and many parts float."""
    return held_body(plates((int(level), int(level)), r=2), rng)


@failure("partition", "Parts that meet in a point", "parts", (2, 3, 4, 6, 8, 12, 16, 32))
def wedge_parts(level: float, rng: np.random.Generator) -> Loaded:
    """Multipliers of many parts pull at one node."""
    parts = wedges(int(level))
    x = parts.place
    return loaded(parts, x[:, 0] < -0.4, smooth_motion(x, rng) * (x[:, :1] + 1))


@failure("partition", "Parts in a row", "parts", (2, 4, 8, 16, 24, 32, 48, 64))
def many_parts(level: float, rng: np.random.Generator) -> Loaded:
    """A slender row bends by what little its parts turn against each other."""
    return held_body(plates((int(level), 1), r=1), rng)


@failure("partition", "Stiffness jumps, strips", "", STIFFNESS_JUMPS)
def jump_of_strips(level: float, rng: np.random.Generator) -> Loaded:
    """Loads of stiff strips are known to rounding, and soft ones have to carry that."""
    return held_body(plates(TILES, r=2, young=(YOUNG * np.where(AT[:, 0] % 2, level, 1.0)).tolist()), rng)


@failure("partition", "Stiffness jumps, checkerboard", "", STIFFNESS_JUMPS)
def jump_of_checkers(level: float, rng: np.random.Generator) -> Loaded:
    """Stiff fields hang at their corners, and their loads are known to rounding."""
    return held_body(plates(TILES, r=2, young=(YOUNG * np.where(AT.sum(1) % 2, level, 1.0)).tolist()), rng)


@failure("partition", "Stiffness jumps, equal loads", "", STIFFNESS_JUMPS)
def jump_under_load(level: float, rng: np.random.Generator) -> Loaded:
    """Stiff parts hardly strain, and what passes between two of them is lost in their motion."""
    parts = plates(TILES, r=2, young=(YOUNG * np.where(AT[:, 0] % 2, level, 1.0)).tolist())
    x = parts.place
    inside = x[:, 0] - np.floor(x[:, 0])
    soft = np.floor(x[:, 0]) % 2 == 0
    # the length that counts: of soft strips as it is, of stiff ones as much less as they are stiffer
    counts = np.ceil(np.floor(x[:, 0]) / 2) + np.where(soft, inside, 0.0)
    counts += (np.floor(np.floor(x[:, 0]) / 2) + np.where(soft, 0.0, inside)) / level
    wave = smooth_motion(counts[:, None] * [1.0, 0.0], rng) * counts[:, None]
    bulge = np.where(soft, np.sin(np.pi * inside) ** 2, 0.0)[:, None] * smooth_motion(x, rng)
    return loaded(parts, np.isclose(x[:, 0], 0), wave + bulge)


@failure(
    "partition", "Part on weak springs", "of its stiffness", (1.0, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12,
    1e-14),
)  # fmt: skip
def near_mechanism(level: float, rng: np.random.Generator) -> Loaded:
    """Rounding of the loads moves the part as much as they do."""
    plate = plates((1, 1))
    x = plate.position[0]
    right, left = (x[np.isclose(x[:, 0], at)] for at in (1, 0))
    way = np.array([1.5, 0.0])  # from one plate to the other
    n = 2 * len(left)
    spring = sp.csr_array(level * YOUNG / n * np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(n)))
    K, M = plate.stiffness[0], plate.mass[0]
    parts = gathered([K, spring, K], [M, 0 * spring, M], [x, np.concatenate([right, left + way]), x + way])
    fixed = np.isclose(parts.place[:, 0], 0)
    free = summation_operator(x + way, parts.place.mean(axis=0))
    modes = [np.zeros((len(x) * 2 - n, 0)), np.concatenate([np.eye(n)] * 2), free]
    return loaded(parts, fixed, smooth_motion(parts.place, rng) * parts.place[:, :1], modes=modes)


@failure(
    "partition", "Thin elements", "length over height", (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0,
    10000.0),
)  # fmt: skip
def thin_parts(level: float, rng: np.random.Generator) -> Loaded:
    """Bending costs little beside stretching."""
    return held_body(plates((3, 2), r=2, thin=level), rng)


@failure("partition", "Rigid modes about a far point", "m", (1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e7, 1e11))
def far_origin(level: float, rng: np.random.Generator) -> Loaded:
    """A turn about a far point looks like a translation."""
    return held_body(plates((3, 2)), rng, about=level * np.array([0.8, -0.6]))


@failure(
    "partition", "Stiffness of few digits", "of each entry", (0.0, 1e-14, 1e-13, 1e-11, 1e-10, 1e-9, 1e-8,
    1e-6),
)  # fmt: skip
def stiffness_digits(level: float, rng: np.random.Generator) -> Loaded:
    """Rigid modes strain the stiffness, and it is not told which of the two is right."""
    parts = plates((3, 2))
    off = [rng.standard_normal(k.shape) for k in parts.stiffness]
    coarse = [sp.csr_array(k * (1 + level * (e + e.T))) for k, e in zip(parts.stiffness, off, strict=True)]
    return held_body(replace(parts, stiffness=tuple(coarse)), rng, strained=True)


@failure(
    "partition", "Loads that cancel between parts", "of the others", (1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12,
    1e14),
)  # fmt: skip
def loads_that_cancel(level: float, rng: np.random.Generator) -> Loaded:
    """The load is the small difference of large ones."""
    body = held_body(plates((3, 2)), rng)
    glob = [L.indices for L in body.boolean]
    count = np.bincount(np.concatenate(glob))
    shares = np.concatenate([(body.load / count)[g] for g in glob])
    at, g = np.concatenate([count[g] > 1 for g in glob]), np.concatenate(glob)
    apart = np.where(at, rng.standard_normal(len(g)), 0.0)
    apart -= (np.bincount(g, apart) / count)[g]
    apart *= level * np.linalg.norm(shares) / np.linalg.norm(apart)
    # what cancels is taken as it is held: to the last digit, it is what the loads have over their shares
    given = shares + apart
    total = np.zeros(len(count), FINE)
    np.add.at(total, g, given.astype(FINE))
    rest = body.load - total
    first = np.unique(g, return_index=True)[1]
    given[first] += rest.astype(float)
    return replace(body, load=given, lam=body.lam + (given - shares)[at])


@failure("partition", "Loose tolerance", "of the gaps", (1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.1))
def loose_tolerance(level: float, rng: np.random.Generator) -> Loaded:
    """Conjugate gradients stop before the gaps are closed."""
    return replace(held_body(plates(TILES), rng), tolerance=level)
