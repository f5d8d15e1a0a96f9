"""Interfaces between partitions, and the resultants of multipliers on them.

Source: principal equations 2.11 A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forceid.partition.solution.assembly import Assembly
from forceid.records import Array, Indices

SAME_MOTION = 1e-9  # of the size of rigid modes, that those of two partitions may differ by and be one motion
OPEN = 1e-8  # of the largest resultant of unit multipliers, below which a direction is told


@dataclass(frozen=True)
class Meeting:
    """The partitions that meet, in order, and the assembled degrees of freedom that they alone share."""

    partitions: tuple[int, ...]
    dof: Indices


def meetings(system: Assembly) -> tuple[Meeting, ...]:
    """The interfaces, in the order of the partitions that meet there."""
    top = system.topology
    meets = np.zeros((len(top.glob), top.size), dtype=bool)
    for row, g in zip(meets, top.glob, strict=True):
        row[g] = True
    found: dict[tuple[int, ...], list[int]] = {}
    for dof in top.interface:
        found.setdefault(tuple(np.flatnonzero(meets[:, dof]).tolist()), []).append(int(dof))
    return tuple(Meeting(who, np.array(dof, dtype=np.intp)) for who, dof in sorted(found.items()))


def common_motions(system: Assembly) -> Array | None:
    """Rigid motions (size, n) that all partitions not held have as their modes; None where they differ."""
    top, modes = system.topology, system.rigid_modes
    n = max(r.shape[1] for r in modes)
    S = np.full((top.size, n), np.nan)
    for r, g in zip(modes, top.glob, strict=True):
        if n and r.shape[1] == n:
            if (np.abs(S[g] - r) > SAME_MOTION * np.abs(r).max()).any():
                return None
            S[g] = r
    return S if n and np.isfinite(S[top.interface]).all() else None


def interface_sums(system: Assembly, interfaces: Sequence[Meeting], S: Array) -> Array:
    """H (link * n, multiplier): resultants of every partition but the last on each interface."""
    top = system.topology
    found = []
    for interface in interfaces:
        for a in interface.partitions[:-1]:
            shared = top.glob[a][top.boundary[a]]
            H = np.zeros((S.shape[1], len(top.frame)))
            H[:, top.rows[a]] = np.where(np.isin(shared, interface.dof), S[shared].T, 0.0)
            found.append(H)
    return np.concatenate(found)


def unseen_resultants(system: Assembly, N: Array, H: Array, n: int) -> Array:
    """Orthonormal resultants (link * n, k) of forces that move no partition: the range of H P."""
    scale = np.linalg.norm(H.reshape(-1, n, H.shape[1]), axis=(0, 2))  # forces and moments, and their units
    scale = np.tile(np.where(scale > 0, scale, 1.0), len(H) // n)
    X = system.projection.balanced((H / scale[:, None]).T)
    U, s, _ = np.linalg.svd((X - N @ (system.R_b.T @ X)).T, full_matrices=False)
    kept = s > OPEN * np.linalg.norm(H / scale[:, None], 2)
    return np.asarray(np.linalg.qr(scale[:, None] * U[:, kept])[0])
