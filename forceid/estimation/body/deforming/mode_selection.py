"""Which modes a set of markers tells apart, and how likely their amplitudes make each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices

SELECT_ROUNDS, AGAIN = 200, 30  # of the climb to the most likely variances, and once modes have left
MODES = 40  # modes looked at: with each the search slows
BLIND = 1e-3  # of the mode that shows best: what shows less is rigid motion, or other modes, to the markers
IDLE = 0.1  # of evidence: modes that bring less leave together, others one by one


@dataclass(frozen=True)
class ObservedShapes:
    """What markers show of some shapes once every rigid motion is taken away.

    rows (channel,): of the markers, among all degrees of freedom; axes (channel, shown), orthonormal.
    """

    rows: Indices
    axes: Array

    def of(self, u: Array) -> Array:
        """The coordinates (..., shown) of displacements u (..., node, 3); rigid ones have none."""
        return np.asarray(u.reshape(*u.shape[:-2], u.shape[-2] * 3)[..., self.rows] @ self.axes)


def observed_shapes(markers: Flags, position: Array, shapes: Array) -> ObservedShapes:
    """What markers (node,) on a body at `position` (node, 3) show of shapes (mode, node, 3)."""
    rows = np.flatnonzero(np.repeat(markers, 3))
    rigid = np.linalg.qr(summation_operator(position - position.mean(0))[rows])[0]
    seen = shapes.reshape(len(shapes), position.size)[:, rows].T
    U, size, _ = np.linalg.svd(seen - rigid @ (rigid.T @ seen), full_matrices=False)
    U = U[:, size > 1e-9 * size.max(initial=0.0)]
    return ObservedShapes(rows, U - rigid @ (rigid.T @ U))


def log_evidence(scatter: Array, frames: int, directions: Array, var: Array, noise: Array) -> float:
    """Log-likelihood of `frames` samples with the mean square `scatter` (shown, shown), up to a constant.

    Each is noise of covariance (shown, shown) plus directions (mode, shown) at independent amplitudes of
    variance var (mode,).
    """
    V = noise + directions.T @ (var[:, None] * directions)
    return float(-0.5 * frames * (np.linalg.slogdet(V)[1] + np.trace(np.linalg.solve(V, scatter))))


def likely_variances(
    scatter: Array, directions: Array, noise_var: float, start: Array | None = None
) -> Array:
    """Variances (mode,) of most `log_evidence`, by steps of which each raises it (Hunter and Lange 2004)."""
    level = max(float(np.trace(scatter)) / max(len(scatter), 1), noise_var)
    var, rounds = start, AGAIN
    if var is None:
        var, rounds = level / (directions**2).sum(1), SELECT_ROUNDS
    for _ in range(rounds):
        V = noise_var * np.eye(len(scatter)) + directions.T @ (var[:, None] * directions)
        a = np.linalg.solve(V, directions.T)
        seen, wanted = np.einsum("ik,ik->k", a, scatter @ a), np.einsum("kj,jk->k", directions, a)
        var = var * np.sqrt(seen / np.maximum(wanted, 1e-300))
    return var


def common_level(scatter: Array, alike: Array, noise_var: float) -> float:
    """The most likely size of what makes samples of covariance noise_var + size * alike (shown, shown)."""
    size, axes = np.linalg.eigh(alike)
    seen = np.einsum("ij,ij->j", axes, scatter @ axes)
    level = max(float(np.trace(scatter)), noise_var) / max(float(size.sum()), np.finfo(float).tiny)
    for _ in range(SELECT_ROUNDS):
        var = noise_var + level * size
        level *= float(np.sqrt((size * seen / var**2).sum() / max((size / var).sum(), np.finfo(float).tiny)))
    return level


def observable_modes(
    scatter: Array, frames: int, directions: Array, noise_var: float, most: int | None = None
) -> tuple[Indices, Array]:
    """Which modes (telling,) a record shows, and the variances of their amplitudes.

    Of the lowest modes those that the markers can tell apart, at most MODES: all at their likely variances,
    then without those, the least missed first, that bring less evidence than one number more costs (Schwarz
    1978). Or simply the first `most` of them.
    """
    kept, noise = independent_directions(directions), noise_var * np.eye(len(scatter))
    kept = kept[: MODES if most is None else most]
    var = likely_variances(scatter, directions[kept], noise_var)
    while len(kept) and most is None:
        D = directions[kept]
        full = log_evidence(scatter, frames, D, var, noise)
        without = [np.delete(np.arange(len(kept)), k) for k in range(len(kept))]
        brings = np.array([full - log_evidence(scatter, frames, D[k], var[k], noise) for k in without])
        if brings.min() > 0.5 * np.log(frames):
            break
        stays = brings > max(brings.min(), IDLE)
        kept = kept[stays]
        var = likely_variances(scatter, directions[kept], noise_var, var[stays])
    return kept, var


def independent_directions(directions: Array) -> Indices:
    """The directions (mode, shown), in order, that lead out of the span of those before them."""
    size = np.linalg.norm(directions, axis=1).max(initial=0.0)
    basis, kept = np.zeros((0, directions.shape[1])), []
    for k, d in enumerate(directions):
        for _ in range(2):
            d = d - basis.T @ (basis @ d)
        if np.linalg.norm(d) > BLIND * size:
            basis = np.vstack([basis, d / np.linalg.norm(d)])
            kept.append(k)
    return np.array(kept, dtype=np.intp)
