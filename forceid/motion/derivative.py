"""Derivatives of a record by difference, Savitzky-Golay or spline: linear maps of known noise gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded
from scipy.sparse import block_diag, csr_array, diags_array, eye_array

from forceid.motion.window import DEGREE, Window
from forceid.records import Array, Flags

Index = NDArray[np.intp]
BATCH = 2**21  # numbers held at once by a batch of local fits
BLOCK = 8  # lengths of a kernel in a block of its convolution: an eighth of every transform is overlap
SHORTEST_BLOCK = 512  # samples: shorter blocks cost more calls than they save multiplications


@dataclass(frozen=True)
class Derivatives:
    """value, first and second derivative (time, channel) of a record, NaN where it does not fix them.

    gain (time, channel, 3, 3): covariance of the three at each sample per unit variance of white noise in
    the record, from the weights themselves: exact at the ends and around gaps as well.
    """

    value: Array
    first: Array
    second: Array
    gain: Array


def derivatives(time: Array, z: Array, window: Window) -> Derivatives:
    """Value, first and second derivative of every channel by one linear map of the record.

    time (time,) s, regular or not; z (time, channel), NaN = not seen. difference: the parabola through
    three samples `count` apart; savgol: the polynomial of degree `order` through the nearest 2 count + 1
    samples (Savitzky and Golay 1964), one-sided at the ends; spline: least-squares quintic B-spline, a
    knot every `count` samples. A gap longer than `seconds` (and two samples) parts the record: inside it
    the result is NaN, beside it one-sided. A shorter gap is bridged, so NaN never spreads.

    >>> t = np.linspace(0, 1, 11)
    >>> derivatives(t, t[:, None] ** 2, Window("savgol", 2, 3, 0.3)).second[0].round(9)
    array([2.])
    """
    seen = np.isfinite(z)
    alike: dict[bytes, list[int]] = {}  # channels with the same gaps share one map
    for channel, column in enumerate(seen.T):
        alike.setdefault(column.tobytes(), []).append(channel)
    out, gain = np.full((3, *z.shape), np.nan), np.full((len(time), len(alike), 3, 3), np.nan)
    which = np.zeros(z.shape[1], dtype=int)
    fit = fit_spline if window.method == "spline" else fit_local
    for i, channels in enumerate(alike.values()):
        which[channels] = i
        for part, whole in parts(time, seen[:, channels[0]], window):
            fitted = fit(time[part], z[part][:, channels], time[whole], window)
            if fitted is not None:
                out[:, whole, channels], gain[whole, i] = fitted
    full = np.broadcast_to(gain, (*z.shape, 3, 3)) if len(alike) == 1 else gain[:, which]
    return Derivatives(out[0], out[1], out[2], full)


def parts(time: Array, seen: Flags, window: Window) -> list[tuple[Index, slice]]:
    """Stretches of the record without a long gap: indices of the samples seen, and all samples they span."""
    at = np.flatnonzero(seen)
    longest = max(window.seconds, 2 * np.median(np.diff(time))) * (1 + 1e-6)
    runs = np.split(at, np.flatnonzero(np.diff(time[at]) > longest) + 1)
    return [(run, slice(run[0], run[-1] + 1)) for run in runs if len(run)]


def fit_local(t: Array, z: Array, at: Array, window: Window) -> tuple[Array, Array] | None:
    """Local polynomials through z (sample, channel) at times t: (3, time, channel) at `at`, and its gain."""
    h = min(window.count, (len(t) - 1) // 2)
    stencil = h * np.arange(-1, 2) if window.method == "difference" else np.arange(-h, h + 1)
    if h < 1 or len(stencil) <= window.order:
        return None
    last = len(t) - 1 - h
    if len(at) == len(t) and np.ptp(np.diff(t)) < 1e-6 * (t[1] - t[0]):
        E, X, C = local_basis(t, t[: 2 * h + 1], h + stencil[None], window.order)
        kernel = np.zeros((3, 2 * h + 1))
        kernel[:, h + stencil] = E[h] @ C[0] @ X[0].T
        out = np.empty((3, *z.shape))
        out[:, h : last + 1] = moved_along(kernel, z)
        out[:, :h] = (E[:h] @ (C @ (X.mT @ z[h + stencil]))).swapaxes(0, 1)
        out[:, last:] = (E[h:] @ (C @ (X.mT @ z[last + stencil]))).swapaxes(0, 1)
        place = np.arange(len(t))
        return out, (E @ C @ E.mT)[np.minimum(place, h) + np.maximum(place - last, 0)]
    index = np.clip(np.searchsorted((t[1:] + t[:-1]) / 2, at), h, last)[:, None] + stencil
    out, gain = np.empty((3, len(at), z.shape[1])), np.empty((len(at), 3, 3))
    rows = max(BATCH // (len(stencil) * max(window.order + 1, z.shape[1])), 1)
    for k in range(0, len(at), rows):
        some = slice(k, k + rows)
        E, X, C = local_basis(t, at[some], index[some], window.order)
        out[:, some] = (E @ (C @ (X.mT @ z[index[some]]))).swapaxes(0, 1)
        gain[some] = E @ C @ E.mT
    return out, gain


def moved_along(kernel: Array, z: Array) -> Array:
    """Kernels (k, width) along z (time, channel), where they cover samples: (k, time - width + 1, channel).

    By transforms of blocks that overlap (Stockham 1966, overlap-save).

    >>> moved_along(np.array([[-1.0, 1.0]]), np.array([[1.0], [4.0], [9.0]])).round(9).tolist()
    [[[3.0], [5.0]]]
    """
    over, channels = kernel.shape[1] - 1, z.shape[1]
    covered = len(z) - over
    size = 1 << int(np.ceil(np.log2(min(max(BLOCK * (over + 1), SHORTEST_BLOCK), len(z)))))
    step = size - over
    blocks = -(-covered // step)
    long = np.zeros((blocks * step + over, channels))
    long[: len(z)] = z
    waves = np.fft.rfft(sliding_window_view(long, size, axis=0)[::step])
    found = np.fft.irfft(np.fft.rfft(kernel[:, ::-1], size)[:, None, None] * waves, size)[..., over:]
    return found.swapaxes(2, 3).reshape(len(kernel), -1, channels)[:, :covered]


def local_basis(t: Array, at: Array, index: Index, order: int) -> tuple[Array, Array, Array]:
    """Polynomials and two derivatives (time, 3, order + 1) at `at`, at t[index], and their (X^T X)^-1."""
    ends = t[index[:, [0, -1]]]
    middle, half = ends.mean(1), np.diff(ends)[:, 0] / 2
    X = legendre.legvander((t[index] - middle[:, None]) / half[:, None], order)
    s, unit = (at - middle) / half, np.eye(order + 1)
    E = np.stack([legendre.legvander(s, order - d) @ legendre.legder(unit, d) for d in range(3)], 1)
    scaled = np.asarray(E / half[:, None, None] ** np.arange(3)[:, None])
    return scaled, X, np.linalg.inv(X.mT @ X)


def fit_spline(t: Array, z: Array, at: Array, window: Window) -> tuple[Array, Array] | None:
    """Least-squares spline through samples z (sample, channel) at times t: as `fit_local`.

    The covariance of its coefficients is (B^T B)^-1, of which only the band is formed.
    """
    pieces = min(round((len(t) - 1) / window.count), len(t) - DEGREE)
    if pieces < 1:
        return None
    breaks = np.interp(np.linspace(0, len(t) - 1, pieces + 1), np.arange(len(t)), t)
    knots = np.r_[[breaks[0]] * DEGREE, breaks, [breaks[-1]] * DEGREE]
    B = BSpline.design_matrix(t, knots, DEGREE)
    G = (B.T @ B).tocsr()
    band = np.zeros((DEGREE + 1, G.shape[0]))
    for k in range(DEGREE + 1):
        band[k, : G.shape[0] - k] = G.diagonal(k)
    coefficients = solveh_banded(band, np.asarray(B.T @ z), lower=True)
    E, rise = [], csr_array(eye_array(G.shape[0]))  # rise: from coefficients to those of the derivative
    for degree in (DEGREE, DEGREE - 1, DEGREE - 2):
        E.append(BSpline.design_matrix(at, knots, degree) @ rise)
        knots = knots[1:-1]
        slope = degree / (knots[degree:] - knots[:-degree])
        rise = csr_array(
            diags_array([-slope, slope], offsets=[0, 1], shape=(len(slope), len(slope) + 1)) @ rise
        )
    C = inverse_band(G)
    gain = np.array([[(Ea @ C).multiply(Eb).sum(1) for Eb in E] for Ea in E])
    return np.stack([Ed @ coefficients for Ed in E]), np.moveaxis(gain, 2, 0)


def inverse_band(G: csr_array) -> csr_array:
    """Those entries of G^-1 that a spline needs, G of half width DEGREE (block Takahashi recursion).

    >>> G = csr_array(np.diag(np.full(9, 4.0)) + np.diag(np.ones(4), 5) + np.diag(np.ones(4), -5))
    >>> bool(np.allclose(inverse_band(G).toarray()[:5, :5], np.linalg.inv(G.toarray())[:5, :5]))
    True
    """
    n, b = G.shape[0], DEGREE
    Z = block_diag([G, eye_array(-n % b)]).tobsr((b, b))
    across = Z.indices - np.repeat(np.arange(len(Z.indptr) - 1), np.diff(Z.indptr))
    D, U = Z.data[across == 0], Z.data[across == 1]
    for i in range(1, len(D)):
        D[i] -= U[i - 1].T @ np.linalg.solve(D[i - 1], U[i - 1])
    D[:] = np.linalg.inv(D)
    for i in range(len(D) - 2, -1, -1):
        gain = D[i] @ U[i]
        U[i] = -gain @ D[i + 1]
        D[i] -= U[i] @ gain.T
    Z.data[across == 0], Z.data[across == 1], Z.data[across == -1] = D, U, U.mT
    return csr_array(Z.tocsr()[:n, :n])
