"""Whether a filter tells the truth about itself: NIS, NEES, whiteness, and what errors that last do to it.

Errors of stated size but unstated correlation: the likelihood cannot tell slow ones from motion, and white
ones are the kindest guess. The smoother is linear, so its answer to one displaced sample tells what errors
of any correlation make of it. Source: the error covariance of a suboptimal linear smoother, Gelb (1974) 7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from forceid.kalman.model import Filtered, Smoothed, StateSpace
from forceid.records import Array
from forceid.significance import CHANCE, LAGS

RATES = np.geomspace(0.3, 300.0, 31)  # 1/s, of the correlation of errors that are tried


@dataclass(frozen=True)
class Consistency:
    """What innovations say of a model.

    nis: their mean square, one if covariances are true, inside `band` in 99 of 100 records; correlation: of
    the lag whose autocorrelation is farthest outside of `white`; sentence: what that means, or "".
    """

    nis: float
    band: tuple[float, float]
    correlation: float
    white: float
    sentence: str

    @property
    def ok(self) -> bool:
        """Whether the model passes."""
        return not self.sentence


def consistency(filtered: Filtered) -> Consistency:
    """Test of the innovations of a filter: size by NIS, color by autocorrelation up to lag 20.

    Too small a process noise leaves large innovations that follow each other, too small a measurement noise
    large ones that alternate; too large a noise leaves small ones. Source: Bar-Shalom, Li and Kirubarajan
    2001, section 5.4; principal equations 6.

    >>> from forceid import kalman
    >>> level = kalman.StateSpace(np.eye(1), np.zeros((1, 1)), np.eye(1), np.eye(1), np.zeros(1), np.eye(1))
    >>> z = 5 * np.random.default_rng(0).standard_normal(300)
    >>> consistency(kalman.filter(level, z)).sentence.split(":")[0]
    'over-confident'
    """
    white = filtered.innovation.reshape(len(filtered.x), -1)
    values = white[np.isfinite(white)]
    nis, band = float(np.mean(values**2)), chi_square_band(values.size)
    r, count = autocorrelation(white, LAGS)
    limit = np.sqrt(chdtri(1.0, CHANCE / LAGS) / np.maximum(count, 1))
    worst = int(np.argmax(np.abs(r) / limit))
    correlation, threshold = float(r[worst]), float(limit[worst])
    found = []
    if nis > band[1]:
        found.append(f"over-confident: innovations are {np.sqrt(nis):.3g} times as large as claimed")
    if nis < band[0]:
        found.append(f"under-confident: innovations are {np.sqrt(nis):.3g} times as large as claimed")
    if abs(correlation) > threshold:
        cause = "the load moves faster than its prior" if r[0] > 0 else "the measurement is believed too much"
        if nis < band[0]:
            cause = "the noises are not in proportion"
        found.append(
            f"not white: innovations {worst + 1} samples apart are correlated by {correlation:+.2f}; {cause}"
        )
    return Consistency(nis, band, correlation, threshold, "; ".join(found))


def autocorrelation(white: Array, lags: int) -> tuple[Array, Array]:
    """Autocorrelation (lag,) of whitened innovations (time, channel), and how many pairs are behind it."""
    seen, v = np.isfinite(white), np.nan_to_num(white)
    power = max(float((v**2).sum() / max(seen.sum(), 1)), 1e-300)
    count = np.array([(seen[k:] & seen[:-k]).sum() for k in range(1, lags + 1)])
    total = np.array([(v[k:] * v[:-k]).sum() for k in range(1, lags + 1)])
    return total / np.maximum(count, 1) / power, count


def nees(x: Array, P: Array, truth: Array) -> Array:
    """Normalized error squared (time,) of states x with covariance P against the truth, per state.

    Its mean is one where the claimed covariance is true; its band is `chi_square_band(records * states)`
    over independent records.

    >>> nees(np.array([[2.0]]), np.array([[[4.0]]]), np.zeros((1, 1))).tolist()
    [1.0]
    """
    error = (x - truth)[..., None]
    return np.asarray((error * np.linalg.solve(P, error)).sum((-2, -1)) / x.shape[-1])


def chi_square_band(count: int, chance: float = CHANCE) -> tuple[float, float]:
    """Band that holds the mean of `count` independent squared normals but for `chance`."""
    return tuple(float(chdtri(count, p) / count) for p in (1 - chance / 2, chance / 2))  # type: ignore[return-value]


def slow_noise_cov(
    model: StateSpace, rows: Array, time: Array, std: float, smoother: Callable[[StateSpace, Array], Smoothed]
) -> Array:
    """Covariance (load, load) that errors of the channels add to smoothed rows @ x, at their worst speed.

    time (time,) s of the model's samples; rows (load, state); std: of an error that is alike from sample to
    sample over 1/rate seconds (Matern 1/2), independent over channels, at the rate that does most harm. In
    the interior of a record: from the middle of it.
    """
    middle, channels = len(time) // 2, model.H.shape[-2]
    kernel = np.empty((channels, len(rows), len(time)))
    still = replace(model, x0=np.zeros(len(model.x0)), u=None)
    for c in range(channels):
        z = np.zeros((len(time), channels))
        z[middle, c] = 1.0
        kernel[c] = rows @ smoother(still, z).x.T
    apart = np.abs(time[:, None] - time)
    found = [np.einsum("cat,ts,cbs->ab", kernel, np.exp(-rate * apart), kernel) for rate in RATES]
    return np.asarray(std**2 * max(found, key=np.trace))
