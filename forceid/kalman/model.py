"""A linear Gaussian model, and what a filter and a smoother know of its state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from forceid.records import Array, Indices

LOG_2PI = float(np.log(2 * np.pi))  # of the density of a normal number


@dataclass(frozen=True)
class StateSpace:
    """A linear Gaussian model; each matrix is constant, or carries a leading axis of time.

    F, Q (state, state) lead from a sample to the next; H (channel, state), R (channel, channel);
    x0 (state,), P0 (state, state); u (state,) or (time, state) is a known input of the step, or None.
    Many models at once, for the likelihood: F, Q, H, R (time or 1, model, ., .), u (time or 1, model, state),
    x0 (model, state), P0 (model, state, state); every model then sees the same gaps. Their steps may be of
    kinds: F, Q (kind, state, state), and kind (time - 1, model) says of which each is.
    """

    F: Array
    Q: Array
    H: Array
    R: Array
    x0: Array
    P0: Array
    u: Array | None = None
    kind: Indices | None = None

    @property
    def unfolded(self) -> StateSpace:
        """The same, its F and Q written out for each step."""
        if self.kind is None:
            return self
        return replace(self, F=self.F[self.kind], Q=self.Q[self.kind], kind=None)

    def reordered(self, order: Indices) -> StateSpace:
        """The same, its states in another order (state,); of one model."""
        if (order[1:] > order[:-1]).all():
            return self
        F, Q, P0 = (a[..., order[:, None], order] for a in (self.F, self.Q, self.P0))
        u = None if self.u is None else self.u[..., order]
        return StateSpace(F, Q, self.H[..., order], self.R, self.x0[order], P0, u)

    def at(self, name: str, k: int) -> Array:
        """Matrix `name` of sample (or step) k."""
        a: Array = getattr(self, name)
        if a.ndim > (1 if name == "u" else 2):
            a = a[k] if len(a) > 1 else a[0]
        return a

    def one(self, j: int) -> StateSpace:
        """Model j of many, by itself."""
        F, Q, H, R = (
            a if a.ndim < 4 else a[:, min(j, a.shape[1] - 1)] for a in (self.F, self.Q, self.H, self.R)
        )
        u = None if self.u is None else self.u[:, j]
        return StateSpace(F, Q, H, R, self.x0[j], self.P0[j], u)


@dataclass(frozen=True)
class Gains:
    """Covariances of a filter, compactly: a run of samples that share them is stored once.

    start (run,): first sample of each run, of `time` samples; P_pred, P (run, state, state) before and after
    the update, gain K (run, state, channel), W (run, channel, channel): whitens an innovation. Signals with
    gaps of their own have an axis of signals behind that of runs.
    """

    time: int
    start: Indices
    P_pred: Array
    P: Array
    K: Array
    W: Array


@dataclass(frozen=True)
class Filtered:
    """What the filter knows: x (time, state) after each sample, and `gains`, its covariances in runs.

    Expanded or worked out on demand: P, P_pred (time, state, state) after and before each sample, x_pred
    before it, innovation (time, channel) z - H x_pred whitened by its covariance, NaN where z is missing;
    nis (time,) its mean square over the channels present; log_likelihood. Of many signals z (time, signal,
    channel) all but covariances have an axis of signals after that of time. factors (run, state, state): of
    the covariances P where plain ones would lose digits, NaN elsewhere, or None.
    """

    model: StateSpace
    z: Array
    x: Array
    gains: Gains
    factors: Array | None = None

    @property
    def P(self) -> Array:
        """Covariance after each sample, (time, state, state)."""
        return expand(self.gains.P, self.gains.start, self.gains.time)

    @property
    def P_pred(self) -> Array:
        """Covariance before each sample, (time, state, state)."""
        return expand(self.gains.P_pred, self.gains.start, self.gains.time)

    def for_smoother(self) -> Filtered:
        """What of it the smoother's covariances need, which is less than half."""
        g = self.gains
        return replace(self, gains=replace(g, P_pred=g.P_pred[:0], K=g.K[:0], W=g.W[:0]))

    @property
    def x_pred(self) -> Array:
        """State before each sample, (time, state)."""
        F, u = self.model.F, self.model.u
        pred = np.empty_like(self.x)
        pred[0] = self.model.x0
        pred[1:] = along(F, self.x[:-1])
        if u is not None:
            pred[1:] += u if u.ndim == 1 or self.x.ndim == 2 else u[:, None]
        return pred

    @cached_property
    def innovation(self) -> Array:
        """Whitened innovations (time, channel), NaN where z is missing."""
        e = self.z - along(self.model.H, self.x_pred)
        seen, e = np.isfinite(e), np.nan_to_num(e)
        W = self.gains.W
        white = np.empty_like(e)
        single = np.diff(np.append(self.gains.start, self.gains.time)) == 1
        white[self.gains.start[single]] = along(W[single], e[self.gains.start[single]])
        for r in np.flatnonzero(~single):
            stop = self.gains.start[r + 1] if r + 1 < len(W) else None
            run = slice(self.gains.start[r], stop)
            white[run] = along(np.broadcast_to(W[r], (len(e[run]), *W[r].shape)), e[run]) if W.ndim > 3 else (
                e[run] @ W[r].T
            )  # fmt: skip
        white[~seen] = np.nan
        return white

    @property
    def nis(self) -> Array:
        """Mean square of the whitened innovations of each sample, NaN where none is."""
        return mean_square(self.innovation)

    @property
    def log_likelihood(self) -> Any:
        """Log-likelihood of all samples: a number, or one of each signal (signal,)."""
        white, W = self.innovation, self.gains.W
        scale = np.diagonal(W, axis1=-2, axis2=-1)
        log_det = np.log(scale, where=scale > 0, out=np.zeros(scale.shape)).sum(-1)
        count = np.diff(np.append(self.gains.start, self.gains.time))
        square = np.nansum(white**2, axis=(0, -1)) + np.isfinite(white).sum(axis=(0, -1)) * LOG_2PI
        total = (count * log_det.T).sum(-1) - 0.5 * square
        return float(total) if total.ndim == 0 else total


@dataclass(frozen=True)
class Smoothed:
    """State x (time, state) given all samples; its covariances `runs` (run, state, state) from `start` on.

    P (time, state, state): expanded; filtered: what the filter knew.
    """

    x: Array
    start: Indices
    runs: Array
    filtered: Filtered

    @property
    def P(self) -> Array:
        """Covariance given all samples, (time, state, state)."""
        return expand(self.runs, self.start, len(self.x))

    @property
    def std(self) -> Array:
        """Standard deviation of each state given all samples, (time, state)."""
        var = np.diagonal(self.runs, axis1=-2, axis2=-1)
        return expand(np.sqrt(np.maximum(var, 0.0)), self.start, len(self.x))


def same_at_all_times(a: Array) -> bool:
    """Whether a matrix (time, ...) is held once, and is the same at all times."""
    return len(a) == 1 or a.strides[0] == 0


def at_all_times(a: Array, time: int) -> Array:
    """A matrix (1 or time, ...) at so many times: one that stays the same is held once, and read alone."""
    return a if len(a) == time else np.broadcast_to(a, (time, *a.shape[1:]))


def expand(runs: Array, start: Indices, time: int) -> Array:
    """Values (run, ...) that hold from start (run,) on, for each sample (time, ...)."""
    return np.repeat(runs, np.diff(np.append(start, time)), axis=0)


def along(a: Array, x: Array) -> Array:
    """Matrix times vector: a (., .), or (time, ., .) or (time, signal, ., .); x (time, [signal,] .)."""
    if a.ndim == 3 and same_at_all_times(a):
        a = a[0]
    if a.ndim == 2:
        return np.asarray(x @ a.T)
    if x.ndim == 3 and a.ndim == 3:
        return np.asarray(x @ a.swapaxes(-1, -2))
    return np.asarray((a @ x[..., None])[..., 0])


def mean_square(innovation: Array) -> Array:
    """Mean over the channels present of squared whitened innovations (..., channel); NaN where none is."""
    seen = np.isfinite(innovation)
    return np.where(seen.any(-1), np.nansum(innovation**2, -1) / np.maximum(seen.sum(-1), 1), np.nan)


def as_channels(z: Array) -> Array:
    """Measurements with a channel axis: (time,) becomes (time, 1)."""
    z = np.asarray(z, float)
    return z[:, None] if z.ndim == 1 else z
