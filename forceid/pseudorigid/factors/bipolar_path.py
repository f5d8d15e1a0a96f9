"""Bipolar factors F = L diag(D) R followed over time, through singular values that meet.

D is not ordered: values cross where the motion does. Apart from each other the factors are known up to the 24
proper signed permutations Q, (L Q^T, Q D Q^T, Q R), and the one nearest to the last frame is taken. Where
values are close against the step between frames, only their block is known; it is turned to be nearest to the
frames on both sides (Procrustes). Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.pseudorigid.factors.decomposition import bipolar, bipolar_rates
from forceid.pseudorigid.factors.matching import SIGNED, multiplied_up, nearest_rotation, nearest_signed
from forceid.pseudorigid.validation import real_values
from forceid.records import Array, Flags, Indices

CLUSTER_GAP = 0.5  # of the change between frames: a gap so small is a cluster
NOISE_GAP = 1e-11  # of the largest: in a gap so small the factors are noise
SURE_TURN = 0.1  # rad from a cluster's block to exact factors that are taken instead
FRAME_TURN = 0.3  # rad against each other that L and R may turn from frame to frame unseen


@dataclass(frozen=True)
class BipolarPath:
    """Factors L (..., time, 3, 3), D (..., time, 3), not ordered, and R, along F = L diag(D) R.

    defined (..., time, 3): False about axis k where the two other singular values are close against the step
    between frames: L and R are a choice in their plane, and rates are not defined. continuous (..., time):
    False where the frames do not show that L and R go on from the frame before. omega, lam (..., time, 3)
    rad/s, NaN where not defined, and dD: the rates, if dF was given. Unpacks to L, D, R.
    """

    L: Array
    D: Array
    R: Array
    defined: Flags
    continuous: Flags
    omega: Array | None = None
    lam: Array | None = None
    dD: Array | None = None

    @property
    def crossed(self) -> Flags:
        """Frames (..., time) since the one before which two values changed places.

        They crossed, or missed each other by so little that frames cannot tell: up to 0.3 or so of the change
        between frames. Had they missed, L and R would have turned by a quarter there.
        """
        order = np.argsort(self.D, axis=-1)
        out = np.zeros(self.D.shape[:-1], bool)
        out[..., 1:] = (order[..., 1:, :] != order[..., :-1, :]).any(-1)
        return out

    def __iter__(self) -> Iterator[Array]:
        """L, D, R."""
        return iter((self.L, self.D, self.R))


def bipolar_path(F: ArrayLike, dF: ArrayLike | None = None) -> BipolarPath:
    """Bipolar factors of frames F (..., time, 3, 3), det F > 0, as continuous in time as the frames show.

    dF (..., time, 3, 3): its rate, for rates of the factors. An analytic motion has analytic factors; one
    that is only smooth may have none, and what its frames cannot show is flagged. F is met to rounding, and
    to the gap at most where not all of `defined`. Raises DataError. Source: pseudo-rigid bodies 2.

    >>> t = np.linspace(-0.1, 0.1, 5)
    >>> L, D, R = bipolar_path([np.diag([1 + s / 2, 1 - s / 2, 0.5]) for s in t])
    >>> D[:, 0].round(12).tolist(), bool(np.allclose(L, L[0]))
    ([1.05, 1.025, 1.0, 0.975, 0.95], True)
    """
    F = real_values(F, "F", "give frames (..., time, 3, 3)")
    if F.ndim < 3:
        raise DataError(f"has shape {F.shape}, expected (..., time, 3, 3)", "F", "use bipolar for one frame")
    L, D, R = bipolar(F)
    tolerance = np.maximum(CLUSTER_GAP * _stretch_step(L, D, R), NOISE_GAP * D[..., 0])[..., None]
    gap = D[..., :2] - D[..., 1:]
    near, noise = gap <= tolerance, gap <= NOISE_GAP * D[..., :1]
    begins = np.zeros(D.shape[:-1], bool)
    begins[..., :1] = True
    first = begins.ravel()
    turned, runs = _followed(
        L.reshape(-1, 3, 3), R.reshape(-1, 3, 3), near.reshape(-1, 2), noise.reshape(-1, 2), first
    )
    Q = turned.reshape(F.shape)
    L, D, R = L @ Q.swapaxes(-1, -2), np.einsum("...ik,...k->...i", Q * Q, D), Q @ R
    defined = np.abs(D[..., [1, 2, 0]] - D[..., [2, 0, 1]]) > tolerance
    defined &= ~near.all(-1, keepdims=True)
    continuous = _shown(turn_of_bases(L, R).reshape(-1, 3), runs, first).reshape(D.shape[:-1])
    if dF is None:
        return BipolarPath(L, D, R, defined, continuous)
    rates = bipolar_rates(F, dF, (L, D, R), tolerance / D.max(-1, keepdims=True))
    omega, lam = (np.where(defined, rate, np.nan) for rate in (rates.omega, rates.lam))
    return BipolarPath(L, D, R, defined, continuous, omega, lam, rates.dD)


def _followed(L: Array, R: Array, near: Flags, noise: Flags, first: Flags) -> tuple[Array, Indices]:
    """Q (n, 3, 3) of frames of paths one after another, `first` where one begins, and their runs in clusters.

    A run (run, 2): its first frame and the one after it. A signed permutation of the factors of a frame turns
    those of all that follow alike, so that neighbors are matched all at once and multiplied up.
    """
    clustered = near.any(1)
    link = 2 * np.tile(np.eye(3), (len(L) + 1, 1, 1))  # of each frame to the one before
    link[1:-1] = L[:-1].swapaxes(1, 2) @ L[1:] + R[:-1] @ R[1:].swapaxes(1, 2)
    number = nearest_signed(link[:-1])
    number[clustered | first] = 0
    start = np.flatnonzero(clustered & (first | ~np.roll(clustered, 1)))
    end = np.flatnonzero(clustered & (np.roll(first, -1) | ~np.roll(clustered, -1))) + 1
    head, tail = ~first[start], ~np.append(first, True)[end]  # whether there is a frame before, and one after
    ahead = _carried(start, end - start, 1, np.where(head[:, None, None], link[start], link[0]), link, near)
    through = head & tail
    number[end[through]] = nearest_signed(ahead[end[through] - 1] @ link[end[through]])
    number[end[tail & ~head]] = 0
    back = SIGNED[np.append(number, 0)[end]] @ link[end].swapaxes(1, 2)
    behind = _carried(end - 1, end - start, -1, back, link, near)

    every = np.flatnonzero(clustered)
    run = np.repeat(np.arange(len(start)), end - start)
    part = (every - start[run] + 1) / (end - start + 1)[run]
    part = np.where(through[run], part, tail[run] & ~head[run])[:, None, None]
    block = nearest_rotation((1 - part) * ahead[every] + part * behind[every], near[every])
    exact = SIGNED[nearest_signed(block)]
    sure = np.einsum("nij,nij->n", exact, block) > 1 + 2 * np.cos(SURE_TURN)
    sure &= ~noise[every].any(1)
    block[sure] = exact[sure]
    Q = SIGNED[multiplied_up(number, first)]
    Q[every] = Q[every] @ block
    return Q, np.stack([start, end], 1)


def _carried(start: Indices, length: Indices, way: int, G: Array, link: Array, near: Flags) -> Array:
    """Q (n, 3, 3) of each frame nearest to the last, along runs at once, from G (run, 3, 3) of the first."""
    Q = np.zeros((len(near), 3, 3))
    for m in range(int(length.max(initial=0))):
        on = length > m
        at = start[on] + way * m
        if m:
            G = Q[at - way] @ (link[at] if way > 0 else link[at + 1].swapaxes(1, 2))
        Q[at] = nearest_rotation(G if m else G[on], near[at])
    return Q


def _stretch_step(L: Array, D: Array, R: Array) -> Array:
    """Change (..., time) of the right or the left stretch between neighbors, the lesser: no spin is in it."""
    change = np.full(D.shape[:-1], np.inf)
    for V in (R, L.swapaxes(-1, -2)):
        U = V.swapaxes(-1, -2) * D[..., None, :] @ V
        between = np.sqrt(((U[..., 1:, :, :] - U[..., :-1, :, :]) ** 2).sum((-1, -2)))
        ends = np.zeros((*between.shape[:-1], 1))
        both = np.maximum(np.concatenate([ends, between], -1), np.concatenate([between, ends], -1))
        change = np.minimum(change, both)
    return change


def turn_of_bases(L: Array, R: Array) -> Array:
    """Half of what R turned since the last frame less what L did, rad (..., time, 3), zero at the first."""
    turn = np.zeros(L.shape[:-1])
    of_L = L[..., :-1, :, :].swapaxes(-1, -2) @ L[..., 1:, :, :]
    of_R = R[..., 1:, :, :] @ R[..., :-1, :, :].swapaxes(-1, -2)
    shape = of_L.shape[:-1]
    by_R, by_L = (Rotation.from_matrix(a.reshape(-1, 3, 3)).as_rotvec() for a in (of_R, of_L))
    turn[..., 1:, :] = 0.5 * (by_R - by_L).reshape(shape)
    return turn


def _shown(turn: Array, runs: Indices, first: Flags) -> Flags:
    """Whether frames (n,) show that the factors go on: small turns, through clusters those of both sides."""
    shown = np.asarray(np.linalg.norm(turn, axis=1) <= FRAME_TURN)
    last = np.append(first, True)[1:]
    start, end = runs.T
    through = ~first[start] & ~last[end - 1]
    start, end = start[through], end[through]
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)])
    before, after = ~first[start - 1], ~last[end]
    rate = before[:, None] * turn[start - 1] + after[:, None] * turn[np.minimum(end + 1, len(turn) - 1)]
    rate /= np.maximum(before + after.astype(float), 1)[:, None]
    off = sums[end + 1] - sums[start] - (end - start + 1)[:, None] * rate
    for s, e in runs[through][np.linalg.norm(off, axis=1) > FRAME_TURN]:
        shown[s : e + 1] = False
    return shown
