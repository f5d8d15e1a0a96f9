"""Second derivatives of a measured record: difference, Savitzky-Golay, spline; each linear, with its noise gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import legendre
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded
from scipy.ndimage import correlate1d
from scipy.sparse import bsr_array, csr_array, diags_array

from forceid.records import Array

Route = Literal["difference", "savgol", "spline"]
DEGREE = 5  # of the spline: its second derivative is a smooth cubic
BLOCK = 2**21  # numbers held at once by a batch of local fits


@dataclass(frozen=True)
class Window:
    """How much a route smooths: `count` samples, which is `seconds`, with polynomials of degree `order`.

    count: difference, the lag; savgol, the samples on either side; spline, the samples a knot interval.
    """

    method: Route
    order: int
    count: int
    seconds: float


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


def windows(method: Route, time: Array) -> list[Window]:
    """Candidate windows, least smoothing first: each a tenth longer than the last, up to half the record.

    >>> [w.count for w in windows("difference", np.arange(30.0))]
    [1, 2, 3, 4, 5, 6, 7]
    """
    step = float(np.median(np.diff(time)))
    ladder = np.unique(np.round(1.1 ** np.arange(np.log(max(len(time) // 4, 1)) / np.log(1.1))).astype(int))
    if method == "difference":
        return [Window(method, 2, int(h), h * step) for h in ladder]
    if method == "spline":
        return [Window(method, DEGREE, int(n), n * step) for n in ladder if n > 1]
    found = [Window(method, p, int(h), h * step) for p in (2, 4) for h in ladder if 2 * h >= p + 2]
    return sorted(found, key=lambda w: w.count / (1, 1.65)[w.order == 4])  # lengths of equal noise


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
    patterns, which = np.unique(np.isfinite(z), axis=1, return_inverse=True)
    out = np.full((3, *z.shape), np.nan)
    gain = np.full((len(time), patterns.shape[1], 3, 3), np.nan)
    fit = fit_spline if window.method == "spline" else fit_local
    for i, seen in enumerate(patterns.T):
        channels = which.ravel() == i
        for part, whole in parts(time, seen, window):
            fitted = fit(time[part], z[part][:, channels], time[whole], window)
            if fitted is not None:
                out[:, whole, channels], gain[whole, i] = fitted
    full = np.broadcast_to(gain, (*z.shape, 3, 3)) if gain.shape[1] == 1 else gain[:, which.ravel()]
    return Derivatives(out[0], out[1], out[2], full)


def parts(time: Array, seen: Array, window: Window) -> list[tuple[Array, slice]]:
    """Stretches of the record without a long gap: indices of the samples seen, and all samples they span."""
    at = np.flatnonzero(seen)
    longest = max(window.seconds, 2 * np.median(np.diff(time))) * (1 + 1e-6)
    runs = np.split(at, np.flatnonzero(np.diff(time[at]) > longest) + 1)
    return [(run, slice(run[0], run[-1] + 1)) for run in runs if len(run)]


def fit_local(t: Array, z: Array, at: Array, window: Window) -> tuple[Array, Array] | None:
    """Local polynomials through samples z (sample, channel) at times t: (3, time, channel) and the gain at `at`."""
    h = min(window.count, (len(t) - 1) // 2)
    stencil = h * np.arange(-1, 2) if window.method == "difference" else np.arange(-h, h + 1)
    if h < 1 or len(stencil) <= window.order:
        return None
    step = np.diff(t)
    if len(at) == len(t) and np.ptp(step) < 1e-6 * step[0]:
        weight, gain = local_weights(t[: 2 * h + 1], t[: 2 * h + 1], h + stencil[None], window.order)
        kernel = np.zeros((3, 2 * h + 1))
        kernel[:, h + stencil] = weight[h]
        out = np.stack([correlate1d(z, k, axis=0) for k in kernel])
        out[:, :h] = np.einsum("tds,sc->dtc", weight[:h], z[h + stencil])
        out[:, len(t) - h :] = np.einsum("tds,sc->dtc", weight[h + 1 :], z[len(t) - 1 - h + stencil])
        place = np.arange(len(t))
        return out, gain[np.minimum(place, h) + np.maximum(place - (len(t) - 1 - h), 0)]
    nearest = np.searchsorted((t[1:] + t[:-1]) / 2, at)
    index = np.clip(nearest, h, len(t) - 1 - h)[:, None] + stencil
    out, gain = np.empty((3, len(at), z.shape[1])), np.empty((len(at), 3, 3))
    rows = max(BLOCK // (len(stencil) * max(window.order + 1, z.shape[1])), 1)
    for k in range(0, len(at), rows):
        some = slice(k, k + rows)
        weight, gain[some] = local_weights(t, at[some], index[some], window.order)
        out[:, some] = (weight @ z[index[some]]).swapaxes(0, 1)
    return out, gain


def local_weights(t: Array, at: Array, index: Array, order: int) -> tuple[Array, Array]:
    """Weights (time, 3, stencil) of the polynomial through t[index] and its derivatives at `at`; their Gram."""
    ends = t[index[:, [0, -1]]]
    middle, half = ends.mean(1), np.diff(ends)[:, 0] / 2
    X = legendre.legvander((t[index] - middle[:, None]) / half[:, None], order)
    unit = np.eye(order + 1)
    E = np.stack(
        [
            legendre.legvander((at - middle) / half, order - d) @ legendre.legder(unit, d) / half[:, None] ** d
            for d in range(3)
        ],
        1,
    )
    weight = E @ np.linalg.solve(X.mT @ X, X.mT)
    return weight, weight @ weight.mT


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
    G = (B.T @ B).todia()
    coefficients = solveh_banded(
        np.stack([np.r_[G.diagonal(-k), np.zeros(k)] for k in range(DEGREE + 1)]), B.T @ z, lower=True
    )
    lift = diags_array(np.ones(pieces + DEGREE)).tocsr()
    E = []
    for degree in (DEGREE, DEGREE - 1, DEGREE - 2):
        inner = knots[DEGREE - degree : len(knots) - (DEGREE - degree)]
        E.append(csr_array(BSpline.design_matrix(at, inner, degree)) @ lift)
        rise = degree / (inner[1 + degree : -1] - inner[1 : -1 - degree])
        lift = diags_array([-rise, rise], offsets=[0, 1], shape=(len(rise), len(rise) + 1)) @ lift
    C = inverse_band(csr_array(G))
    gain = np.array([[(Ea @ C).multiply(Eb).sum(1) for Eb in E] for Ea in E])
    return np.stack([Ed @ coefficients for Ed in E]), np.moveaxis(gain, 2, 0)


def inverse_band(G: csr_array) -> csr_array:
    """The band of G^-1 that a spline needs, for G of half width DEGREE (block Takahashi recursion).

    >>> G = np.diag(np.full(9, 4.0)) + np.diag(np.ones(8), 1) + np.diag(np.ones(8), -1)
    >>> band = inverse_band(csr_array(G)).toarray()[:5, :5]
    >>> bool(np.allclose(band, np.linalg.inv(G)[:5, :5]))
    True
    """
    n, b = G.shape[0], DEGREE
    m = -(-n // b)
    wide = np.zeros((m, b, 2 * b))
    coo = G.tocoo()
    row, column = coo.coords
    upper = column >= row // b * b
    row, column = row[upper], column[upper]
    wide[row // b, row % b, column - row // b * b] = coo.data[upper]
    beyond = np.arange(m * b).reshape(m, b) >= n
    wide[:, :, :b] += np.eye(b) * beyond[:, None]
    D, U = wide[..., :b], wide[..., b:]
    inv = np.empty_like(D)
    inv[0] = np.linalg.inv(D[0])
    for i in range(1, m):
        inv[i] = np.linalg.inv(D[i] - U[i - 1].T @ inv[i - 1] @ U[i - 1])
    Z, side = inv.copy(), np.zeros_like(U)
    for i in range(m - 2, -1, -1):
        gain = inv[i] @ U[i]
        side[i] = -gain @ Z[i + 1]
        Z[i] -= side[i] @ gain.T
    blocks = np.concatenate([Z, side[:-1], side[:-1].mT])
    i = np.arange(m)
    at = np.r_[i, i[:-1], i[1:]], np.r_[i, i[1:], i[:-1]]
    order = np.lexsort((at[1], at[0]))
    start = np.r_[0, np.cumsum(np.bincount(at[0], minlength=m))]
    return bsr_array((blocks[order], at[1][order], start), shape=(m * b, m * b)).tocsr()[:n, :n]
