"""Bodies in parts whose motion is written down first: the loads and interface forces that go with it.

A smooth motion u of the assembled body is chosen, then f = sum L_s^T K_s u_s and, for equal shares of that,
lambda_s = B_s^T (f_s - K_s u_s), in extended precision. Rigid motions of a part make no force: they are taken
off before K_s is applied, and off the forces after it, as K_s in double precision strains them a little.
Source: principal equations 2.7, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from forceid.partition.grids import (
    Parts,
    assemble_elements,
    bar,
    box_element,
    box_grid,
    gathered,
    solid_parts,
)
from forceid.partition.operators.topology import compatible, without_fixed
from forceid.partition.system import PartitionedSystem
from forceid.principal.operator import summation_operator
from forceid.records import Array, Flags, Indices

FINE = np.longdouble  # twice as fine as a double on x86 by 2^11; a double elsewhere
RATE = (0.3, 1.5)  # rad/m, of the waves that smooth motions are


@dataclass(frozen=True)
class Loaded:
    """What a solver gets, in lists of one entry a part, and the truth.

    load (size,) assembled N, or (dof,) of all parts; lam (multiplier,) N and u (dof,) m: the truth, u of a
    floating body without motion of the whole; tolerance: of conjugate gradients.
    """

    stiffness: Sequence[Any]
    mass: Sequence[Any]
    boolean: Sequence[Any]
    modes: Sequence[Any]
    load: Array
    lam: Array
    u: Array
    tolerance: float = 1e-10

    def system(self) -> PartitionedSystem:
        """The system as a user sets it up: raises what that raises."""
        return PartitionedSystem(self.stiffness, self.mass, self.boolean, self.modes)


def plates(parts: tuple[int, int], r: int = 3, young: Any = 1000.0, thin: float = 1.0) -> Parts:
    """Plates of one meter by 1/thin, r elements an edge both ways; young Pa for all, or one a part."""
    body = solid_parts(parts, r, young)
    if thin == 1:
        return body
    nodes, elements = box_grid(parts, r)
    low = np.array([1.0, 1 / thin])
    K, M = (
        assemble_elements(elements, m, 2, len(nodes[0])) for m in box_element(low / r, 1000.0, 0.3, 2.0, 0.1)
    )
    count = len(nodes)
    return Parts((K,) * count, (M,) * count, body.boolean, tuple(x * low for x in nodes), body.place * low)


def wedges(count: int, r: int = 2) -> Parts:
    """Sectors of a disk, braced by bars, r cells along a radius of one meter, that all meet in its center."""
    across = max(1, round(8 / count))  # cells of a sector
    name = {(i, j): 1 + (i - 1) * (across + 1) + j for i in range(1, r + 1) for j in range(across + 1)}
    name |= {(0, j): 0 for j in range(across + 1)}
    pairs = set()
    for i, j in product(range(r), range(across + 1)):
        pairs.add((name[i, j], name[i + 1, j]))
        if j < across:
            pairs.add((name[i + 1, j], name[i + 1, j + 1]))
            pairs |= {(name[i, j], name[i + 1, j + 1]), (name[i, j + 1], name[i + 1, j])}
    bars = np.array(sorted(pairs))
    places = np.array([(0, 0), *((i, j) for i in range(1, r + 1) for j in range(across + 1))])
    K: list[Any] = []
    M: list[Any] = []
    nodes: list[Array] = []
    for s in range(count):
        angle = 2 * np.pi / count * (s + places[:, 1] / across)
        x = places[:, :1] / r * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        each = [bar(x[p], 5e4, 1.0) for p in bars]
        k, m = (assemble_elements(bars, np.array(of), 2, len(x)) for of in zip(*each, strict=True))
        K, M, nodes = [*K, k], [*M, m], [*nodes, x]
    return gathered(K, M, nodes)


def smooth_motion(x: Array, rng: np.random.Generator) -> Array:
    """A smooth motion (node, axis) m at x (node, axis) m: a draw of one wave along each axis."""
    axes = x.shape[1]
    low, high = RATE
    rate = rng.uniform(low, high, size=(axes, axes))
    phase = rng.uniform(0, 2 * np.pi, size=(axes,))
    return np.stack([np.sin(x @ rate[a] + phase[a]) for a in range(axes)], axis=1)


def loaded(
    parts: Parts,
    fixed: Flags | None,
    u: Array,
    about: Array | None = None,
    modes: Sequence[Any] | None = None,
    strained: bool = False,
) -> Loaded:
    """A body with its assembled nodes `fixed` (node,) held, None = floating, and loads for u (node, axis) m.

    about (axis,) m: the origin of its rigid modes, None = its middle; modes: those of each part, if these are
    others; strained: rigid modes make what force K gives them, for they are not those of K.
    """
    axes = parts.place.shape[1]
    at_rest = np.zeros(len(parts.place), bool) if fixed is None else fixed
    boolean, kept = without_fixed(parts.boolean, np.flatnonzero(np.repeat(at_rest, axes)))
    K, M = (
        [m[rows][:, rows] for m, rows in zip(of, kept, strict=True)] for of in (parts.stiffness, parts.mass)
    )
    middle = parts.place.mean(axis=0)
    R = [
        compatible(summation_operator(x, middle), rows) for x, rows in zip(parts.position, kept, strict=True)
    ]
    R = given = R if modes is None else list(modes)
    if about is not None:
        given = [
            summation_operator(x, about) if r.shape[1] else r for x, r in zip(parts.position, R, strict=True)
        ]
    glob = [L.indices for L in boolean]
    count = np.bincount(np.concatenate(glob), minlength=boolean[0].shape[1])
    moved = u[~at_rest].ravel()
    if fixed is None:
        moved = unmoved(moved, parts.place, count)
    force = [part_force(k, r, moved[g], strained) for k, r, g in zip(K, R, glob, strict=True)]
    total = np.zeros(len(count), FINE)
    np.add.at(total, np.concatenate(glob), np.concatenate(force))
    load = total.astype(float)
    lam = np.concatenate(
        [((load.astype(FINE) / count)[g] - p)[count[g] > 1] for g, p in zip(glob, force, strict=True)]
    )
    return Loaded(K, M, boolean, given, load, lam.astype(float), np.concatenate([moved[g] for g in glob]))


def unmoved(u: Array, place: Array, count: Indices) -> Array:
    """Motion (size,) less its rigid part, by least squares over nodes of all parts, count (size,) each."""
    S = summation_operator(place, place.mean(axis=0))
    w = np.sqrt(count)[:, None]
    for _ in range(2):
        u = u - S @ np.linalg.lstsq(w * S, w[:, 0] * u, rcond=None)[0]
    return u


def part_force(K: Any, R: Array, u: Array, strained: bool = False) -> Array:
    """K u (dof,) of one part in extended precision, with nothing for its rigid modes R (dof, mode)."""
    Q = np.zeros((len(u), 0), FINE) if strained else orthonormal(R)
    inner = u.astype(FINE) - Q @ (Q.T @ u.astype(FINE))
    force = K.toarray().astype(FINE) @ inner
    balanced: Array = force - Q @ (Q.T @ force)
    return balanced


def orthonormal(R: Array) -> Array:
    """The columns of R (dof, mode) made orthonormal in extended precision."""
    Q: Array = np.zeros(R.shape, FINE)
    for k in range(R.shape[1]):
        column = R[:, k].astype(FINE)
        for _ in range(2):
            column = column - Q[:, :k] @ (Q[:, :k].T @ column)
        Q[:, k] = column / np.sqrt(column @ column)
    return np.asarray(Q)
