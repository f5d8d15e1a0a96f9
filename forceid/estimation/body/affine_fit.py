"""The affine map of every frame, x = c + F X, by least squares from the markers seen in it.

Source: pseudo-rigid bodies, section 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.motion import seen_together
from forceid.records import Array, Body, Motion, all_finite

FLAT = 1e-4  # of the size of a marker set: thinner than that it is plane, or a line


@dataclass(frozen=True)
class AffineFit:
    """What the markers of every frame say of c + F X, NaN where they do not fix it.

    center (time, 3) m: where the mass center went; F (time, 3, 3); span (3, r): orthonormal reference
    directions that the markers spread along, columns (time, 3, r) = F span, known where F itself is not, in
    the plane of a plane marker set; cov (time, 1 + r, 1 + r) of center and columns along one world axis,
    alike for all three and independent between them; off: whether the mass center lies off a plane marker
    set, and so is not known.
    """

    center: Array
    F: Array
    span: Array
    columns: Array
    cov: Array
    off: bool = False

    @property
    def plane(self) -> bool:
        """Whether the markers leave a direction open, so that F is not known along it."""
        return bool(self.span.shape[1] < 3)


def fit_affine(position: Array, shape: Array, noise_var: float) -> AffineFit:
    """Affine map of every frame from markers at position (time, node, 3) m, NaN = not seen.

    shape (node, 3) m: where the markers are in the reference, about the mass center, which is then at
    `center`; noise_var m2 of one coordinate. Markers in a plane give F in that plane only, and the center
    only if it lies in it. Source: pseudo-rigid bodies, section 0.
    """
    patterns, which = seen_together(position)
    ever = patterns.any(0)
    span, off = spanned_directions(shape[ever])
    r, T = span.shape[1], len(position)
    rows = np.hstack([np.ones((len(shape), 1)), shape @ span])
    found, cov = np.full((T, 3, 1 + r), np.nan), np.full((T, 1 + r, 1 + r), np.nan)
    for i, pattern in enumerate(patterns):
        A = rows[pattern]
        if len(A) <= r or np.linalg.matrix_rank(A / scale(A), tol=FLAT) <= r:
            continue
        at, gain = which.ravel() == i, np.linalg.pinv(A)
        found[at] = np.einsum("kn,tna->tak", gain, position[at][:, pattern])
        cov[at] = noise_var * gain @ gain.T
    center, columns = found[..., 0], found[..., 1:]
    if off:
        center = np.full_like(center, np.nan)
    F = columns @ span.T if r == 3 else np.full((T, 3, 3), np.nan)
    return AffineFit(center, F, span, columns, cov, off)


def spanned_directions(shape: Array) -> tuple[Array, bool]:
    """Directions (3, r) that points (node, 3) spread along, and whether the origin is off their flat."""
    mean = shape.mean(0)
    _, size, axes = np.linalg.svd(shape - mean, full_matrices=len(shape) < 3)
    size = np.append(size, np.zeros(3))[:3]
    wide = size > FLAT * size[0] if size[0] > 0 else np.zeros(3, bool)
    if wide.all():
        return np.eye(3), False
    span = axes[:3][wide[: len(axes)]].T
    off = mean - span @ (span.T @ mean)
    return span, bool(np.linalg.norm(off) > FLAT * max(size[0], 1e-300))


def shows_affine(body: Body, motion: Motion) -> bool:
    """Whether the markers that are ever seen fix an affine map, off a plane."""
    if motion.position is None or body.position is None:
        return False
    ever = all_finite(motion.position).any(0)
    return bool(ever.sum() > 3 and spanned_directions(body.position[ever])[0].shape[1] == 3)


def scale(A: Array) -> Array:
    """Sizes of the columns of a design, one where a column is empty."""
    size = np.sqrt((A**2).mean(0))
    return np.asarray(np.where(size > 0, size, 1.0))
