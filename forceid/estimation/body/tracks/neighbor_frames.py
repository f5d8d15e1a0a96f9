"""Frames that the neighbors of a marker make, and polynomials that continue it in them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from forceid.motion import fit_rotation
from forceid.records import Array, Flags, Indices
from forceid.rounding import SINGLE

TO_TURN = 3  # markers that turn a frame
SHOWN_IN = 16  # frames that tell which markers are near
NEAREST = 64  # markers that neighbors are chosen from: the error of a frame falls by the root of their number
REMEMBERED = 4096  # sets of weights, of some kB: an even clock has the same ones again and again


def neighbors(position: Array, seen: Flags, k: int) -> tuple[Indices, Array]:
    """The other nodes that are seen beside node k, those that keep their distance to it best first.

    Also the variance (m2) of that, no less than rounding. Of many, the nearest in some frames that show them.
    """
    with_k, among = position[seen[:, k]], np.arange(position.shape[1])
    if len(among) > NEAREST + 1:
        some = with_k[np.linspace(0, len(with_k) - 1, SHOWN_IN).astype(int)]
        apart = np.linalg.norm(some - some[:, [k]], axis=2)
        far = np.where(np.isfinite(apart), apart, 0.0).sum(0) / np.maximum(np.isfinite(apart).sum(0), 1)
        far[~np.isfinite(apart).any(0)] = np.inf
        among = np.sort(np.argsort(far, kind="stable")[: NEAREST + 1])
    distance = np.linalg.norm(with_k[:, among] - with_k[:, [k]], axis=2)
    often = (np.isfinite(distance).sum(0) >= 2) & (among != k)
    spread = np.full(len(often), np.inf)
    spread[often] = np.nanstd(distance[:, often], axis=0)
    order = np.argsort(spread, kind="stable")
    order = order[often[order]]
    size = float(np.nanmax(distance, initial=1e-9))
    return among[order], np.maximum(spread[order], np.finfo(float).eps * size) ** 2


def frame_of(x: Array, samples: int) -> tuple[Array, Array]:
    """Origin (time, 3) and rotation (time, 3, 3) of the frame that markers x (time, node, 3) make.

    None stand still in the world; one or two carry their mean along; three or more turn with their best fit
    to the first sample.
    """
    if x.shape[1] == 0:
        return np.zeros((samples, 3)), np.broadcast_to(np.eye(3), (samples, 3, 3))
    if x.shape[1] < TO_TURN:
        return x.mean(1), np.broadcast_to(np.eye(3), (samples, 3, 3))
    shape = x[0] - x[0].sum(0) / x.shape[1]
    return fit_rotation(x, shape, np.ones(x.shape[1]))


def lever_of(frame: Array, x: Array) -> float:
    """Mean variance of a place x (3,) that turns with markers (node, 3), over that of their coordinates.

    One where they do not turn it.

    >>> square = np.array([[1.0, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    >>> [round(lever_of(square, np.array([0.0, 0.0, z])), 3) for z in (0.0, 1.0)]
    [0.25, 0.417]
    """
    if len(frame) < TO_TURN:
        return 1.0
    mean = frame.sum(0) / len(frame)
    own, (x, y, z) = frame - mean, (x - mean).tolist()
    xx, xy, xz, _, yy, yz, _, _, zz = (own.T @ own).ravel().tolist()
    size = (xx + yy + zz) * (1 + SINGLE)
    a, b, c = size - xx, size - yy, size - zz  # of the inertia of the markers, whose inverse is by cofactors
    A, B, C = b * c - yz**2, a * c - xz**2, a * b - xy**2
    D, E, F = xz * yz + xy * c, xy * yz + xz * b, xy * xz + yz * a
    turned = x * x * (B + C) + y * y * (A + C) + z * z * (A + B) - 2 * (x * y * D + x * z * E + y * z * F)
    det = a * A - xy * D - xz * E
    return float(1 / len(frame) + (turned / det / 3 if det > 0 else 0.0))  # markers in one place turn nothing


def weights(at: Array, to: Array, degree: int) -> Array:
    """Weights (to, at) that continue samples at some times to others, by a polynomial of least squares."""
    return weights_of(at.tobytes(), to.tobytes(), degree)


@lru_cache(REMEMBERED)
def weights_of(at_bytes: bytes, to_bytes: bytes, degree: int) -> Array:
    """`weights` of times by their bytes."""
    at, to = (np.frombuffer(each) for each in (at_bytes, to_bytes))
    middle, half = to.mean(), max(float(np.abs(at - to.mean()).max()), 1e-300)
    rows = np.vander((at - middle) / half, degree + 1)
    return np.asarray(np.vander((to - middle) / half, degree + 1) @ np.linalg.pinv(rows))
