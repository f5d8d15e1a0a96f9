"""A low-pass of a record for its second derivative: the quintic smoothing spline of a cut-off frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

from forceid.motion.window import DEGREE
from forceid.records import Array

KNOTS = 8.0  # in a period of the cut-off: the gain there is that of the spline itself within a percent
JERK = np.array([-1.0, 3.0, -3.0, 1.0])  # third differences of the coefficients
OVERLAP = {-2: 1 / 120, -1: 26 / 120, 0: 66 / 120, 1: 26 / 120, 2: 1 / 120}  # of quadratic B-splines
END_KNOTS = 12  # knots from an end beyond which the spline knows nothing of it: a decay of exp(-4.7)


@dataclass(frozen=True)
class SmoothingSpline:
    """The map of a record at times (time,) s to the spline that is least rough beside it.

    The least of the squares left plus a multiple of the integral of the squared third derivative, so that its
    gain in frequency is 1 / (1 + (f / cutoff)^6): one half at the cut-off (Hz). Linear in the record; keeps
    parabolas at any cut-off, ends included; a clock may be irregular and samples may lack.

    >>> t = np.linspace(0, 1, 101)
    >>> SmoothingSpline(t, 0.5).second(t[:, None] ** 2)[[0, 50, 100], 0].round(6).tolist()
    [2.0, 2.0, 2.0]
    """

    time: Array
    cutoff: float

    @cached_property
    def pieces(self) -> int:
        """Knot intervals: KNOTS in a period of the cut-off, and no more than the record has samples."""
        span, count = float(np.ptp(self.time)), len(self.time) - 1
        return max(int(np.ceil(min(KNOTS * self.cutoff * span, count))), 1)

    @cached_property
    def interval(self) -> float:
        """Length of a knot interval, s."""
        return float(np.ptp(self.time)) / self.pieces

    @cached_property
    def knots(self) -> Array:
        """Knots, equally far apart, those beyond the ends as well."""
        return np.asarray(self.time[0] + self.interval * np.arange(-DEGREE, self.pieces + DEGREE + 1))

    @cached_property
    def basis(self) -> csr_array:
        """Values of the B-splines (time, coefficient), sparse."""
        inside = np.clip(self.time, self.knots[DEGREE], self.knots[-DEGREE - 1])
        return csr_array(BSpline.design_matrix(inside, self.knots, DEGREE))

    @cached_property
    def gram(self) -> Array:
        """Lower bands of B^T B (DEGREE + 1, coefficient)."""
        values = self.basis.data.reshape(len(self.time), DEGREE + 1)
        first, count = self.basis.indices[:: DEGREE + 1], self.pieces + DEGREE
        band = np.zeros((DEGREE + 1, count))
        for k in range(DEGREE + 1):
            for a in range(DEGREE + 1 - k):
                band[k] += np.bincount(first + a, values[:, a] * values[:, a + k], count)
        return band

    @cached_property
    def factor(self) -> Array:
        """Cholesky factor of B^T B and the penalty, in lower bands."""
        band, count = self.gram.copy(), self.pieces + DEGREE
        step = float(np.ptp(self.time)) / (len(self.time) - 1)
        weight = 1 / (step * self.interval**5 * (2 * np.pi * self.cutoff) ** 6)
        for apart, overlap in OVERLAP.items():
            for i in range(4):
                for j in range(4):
                    if (k := j + apart - i) >= 0:  # entry of row m + i, column m + apart + j, of every m
                        first = i + max(0, -apart)
                        rows = slice(first, first + count - 3 - abs(apart))
                        band[k, rows] += weight * overlap * JERK[i] * JERK[j]
        return np.asarray(cholesky_banded(band, lower=True, check_finite=False))

    @cached_property
    def bend(self) -> csr_array:
        """Values of the B-splines that the second differences of the coefficients go with, per interval^2."""
        inside = np.clip(self.time, self.knots[DEGREE], self.knots[-DEGREE - 1])
        return csr_array(BSpline.design_matrix(inside, self.knots[2:-2], DEGREE - 2) / self.interval**2)

    def second(self, z: Array) -> Array:
        """Second derivative (time, channel) of the spline of a record z (time, channel), no gaps."""
        right = np.asarray(self.basis.T @ z)
        coefficients = cho_solve_banded((self.factor, True), right, check_finite=False)
        return np.asarray(self.bend @ np.diff(coefficients, 2, axis=0))

    def gain(self) -> Array:
        """Variance (time,) of that second derivative per variance of white noise in the record.

        From the weights themselves within END_KNOTS of the ends, and constant between; one end of a regular
        clock is the other's mirror image.
        """
        count = self.pieces + DEGREE
        near = min(END_KNOTS + DEGREE, count)
        found = np.full(len(self.time), np.nan)
        place, steps = (self.time - self.time[0]) / self.interval, np.diff(self.time)
        regular = np.ptp(steps) < 1e-6 * steps[0]
        for first in (0,) if regular else (0, count - near):
            unit = np.zeros((count, near))
            unit[first + np.arange(near), np.arange(near)] = 1.0
            rows = cho_solve_banded((self.factor, True), unit, check_finite=False)
            cov = rows.T @ banded_times(self.gram, rows)
            bent = np.diff(np.diff(cov, 2, axis=0), 2, axis=1)
            close = (place <= near - DEGREE) if first == 0 else (place >= count - near)
            at = np.zeros((int(close.sum()), near + DEGREE))  # those of no knot that is near stand behind
            which = self.bend.indices.reshape(len(close), -1)[close] - first
            np.put_along_axis(at, which, self.bend.data.reshape(len(close), -1)[close], 1)
            at = at[:, : near - 2]
            found[close] = np.sum(at @ bent * at, axis=1)
        found = np.where(np.isnan(found), found[place <= near - DEGREE][-1], found)
        half = len(found) // 2
        return np.concatenate([found[: len(found) - half], found[:half][::-1]]) if regular else found


def banded_times(band: Array, x: Array) -> Array:
    """A symmetric matrix in lower bands times x (row, column)."""
    out: Array = band[0][:, None] * x
    for k in range(1, len(band)):
        part = band[k, : len(x) - k, None]
        out[k:] += part * x[:-k]
        out[:-k] += part * x[k:]
    return out
