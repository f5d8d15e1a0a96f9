"""Errors that follow themselves: with a memory, or low-passed at the source, motion and all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gamma, kv

from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import Process, block_diagonal, matern, matern_density
from forceid.kalman.model import StateSpace, at_all_times, same_at_all_times
from forceid.records import Array
from forceid.significance import WHOLE


@dataclass(frozen=True)
class Color:
    """Errors of which a share of the variance is a Matern process of an order and rate 1/s; white the rest.

    step s: of the samples that the white part belongs to; size: the std of what has a memory, where it is
    that at all times and along all axes; None where it is the share of whatever the errors are.
    """

    order: int
    rate: float
    share: float
    step: float
    size: float | None = None

    def density(self, w: Array) -> Array:
        """Spectral density at w (...) rad/s over that of white errors of the same variance.

        >>> Color(1, 5.0, 0.5, 0.01).density(np.array([0.0, 1e9])).round(3).tolist()
        [20.5, 0.5]
        """
        return 1 - self.share + self.share * matern_density(self.order, 1.0, self.rate, w) / self.step

    @cached_property
    def slow(self) -> float:
        """By how much the errors add up, over white ones of the same variance."""
        return float(self.density(np.zeros(1))[0])

    def passed(self, gain: Array) -> Array:
        """What passes of these errors in a second derivative, over white ones: see `passed`."""
        return passed(self.density, gain, self.step)

    def parts(self, var: Array) -> tuple[Array, Array]:
        """Variances (axis,) of what has a memory in errors of variances var (time, axis), and (time, axis) of
        what is white.

        The first as it is mostly: of markers on one face it changes as they turn.
        """
        if self.size is None:
            median = np.median if np.isfinite(var).all() else np.nanmedian  # which is slow
            return self.share * median(var, axis=0), (1 - self.share) * var
        held = np.minimum(
            self.size**2, WHOLE * np.nanmin(var, axis=0)
        )  # of errors that a search makes smaller
        return held, var - held

    def process(self, var: Array) -> Process:
        """Errors with a memory, of variances var (...)."""
        return matern(self.order, np.sqrt(var), np.full(np.shape(var), self.rate))

    def beside(self, model: StateSpace, root: Array, step: Array) -> StateSpace:
        """A model of which the errors of covariance root root^T, root (time, channel, error), are colored so.

        R of the model is left what is white of them; the states of the errors follow its own.
        """
        one, errors, T = matern(self.order, 1.0, self.rate), root.shape[-1], len(root)
        root = np.sqrt(self.share) * root if self.size is None else self.size * np.eye(*root.shape[1:])
        unique, which = np.unique(np.round(step, 12), return_inverse=True)
        each = discretize_steps(one, unique)
        F, Q = (np.asarray(np.kron(np.eye(errors), a), float) for a in each)
        if len(unique) > 1:
            F, Q = F[which], Q[which]
        H = np.zeros((T, root.shape[-2], errors * self.order))
        H[..., :: self.order] = root
        more = F.shape[-1]

        def beyond(own: Array, further: Array) -> Array:
            own = own.reshape(-1, *own.shape[-2:])
            return at_all_times(block_diagonal(own[:1] if same_at_all_times(own) else own, further), T - 1)

        return StateSpace(
            beyond(model.F, F), beyond(model.Q, Q),
            np.concatenate([np.broadcast_to(model.H, (T, *model.H.shape[-2:])), H], -1),
            model.R - root @ root.mT, np.pad(model.x0, (0, more)),
            block_diagonal(model.P0, np.asarray(np.kron(np.eye(errors), one.P0), float)),
            None if model.u is None else np.pad(model.u, ((0, 0), (0, more))),
        )  # fmt: skip


@dataclass(frozen=True)
class LowPassed:
    """Errors of tracks through a Butterworth filter of an order, both ways, of a cut Hz; white before it.

    The filter took motion away with the errors: samples closer than those whose errors are independent tell
    nothing more. step s: of the samples.
    """

    order: int
    cut: float
    step: float

    def density(self, w: Array) -> Array:
        """Spectral density at w (...) rad/s over that of white errors of the same variance.

        >>> LowPassed(4, 5.0, 0.01).density(np.array([0.0, 1e9])).round(1).tolist()
        [11.1, 0.0]
        """
        return np.asarray(self.slow * self.power(w / (2 * np.pi)))

    def power(self, f: Array) -> Array:
        """What the filter lets pass of the power at frequencies f (...) Hz; none beyond half the rate.

        As the filter of a clock is made: by the tangent that takes its highest frequency to infinity.
        """
        turn = np.tan(np.pi * np.minimum(np.asarray(f) * self.step, 0.5 - np.finfo(float).eps))
        return np.asarray((1 + (turn / np.tan(np.pi * self.cut * self.step)) ** (2 * self.order)) ** -2.0)

    @cached_property
    def slow(self) -> float:
        """By how much the errors add up, over white ones of the same variance."""
        f = (np.arange(1024) + 0.5) / 2048 / self.step
        return float(1 / self.power(f).mean())

    def correlation(self, lag: Array) -> Array:
        """Correlation of errors that are lag (...) samples apart.

        >>> LowPassed(4, 5.0, 0.01).correlation(np.array([0, 7])).round(2).tolist()
        [1.0, 0.44]
        """
        f = (np.arange(1024) + 0.5) / 2048 / self.step
        power = self.power(f)
        return np.asarray(np.cos(2 * np.pi * self.step * np.multiply.outer(lag, f)) @ power / power.sum())

    @property
    def every(self) -> int:
        """Samples from one to the next of which errors are independent."""
        return max(round(self.slow), 1)

    @property
    def counted(self) -> float:
        """Variance that such a sample counts with, over its own: its share of the density below the cut."""
        return max(self.slow / self.every, 1.0)

    def passed(self, gain: Array) -> Array:
        """What passes of these errors in a second derivative, over white ones: see `passed`."""
        return passed(self.density, gain, self.step)


@dataclass(frozen=True)
class SharedErrors:
    """Errors of the place of a body that follow themselves: std m along each axis, rate 1/s; step s."""

    std: float
    rate: float
    step: float

    @property
    def cov(self) -> Array:
        """What they add to the covariance (6, 6) of a pose, center first."""
        return np.diag([self.std**2] * 3 + [0.0] * 3)

    def density(self, w: Array) -> Array:
        """Spectral density m2 s at w (...) rad/s.

        >>> SharedErrors(2.0, 5.0, 0.01).density(np.zeros(1)).round(9).tolist()
        [1.6]
        """
        return np.asarray(self.std**2 * matern_density(1, 1.0, self.rate, w))

    def beside(self, var: Array) -> Color:
        """The color of the errors of a mass center of variances var (...) in all, white but for these."""
        share = min(self.std**2 / max(float(np.nanmedian(var)), self.std**2), 1.0)
        return Color(1, self.rate, share, self.step, self.std)

    def colored(self, model: StateSpace, step: Array) -> StateSpace:
        """A model whose channels begin with the mass center, with states of these errors."""
        root = np.zeros((len(step) + 1, model.R.shape[-1], 3))
        return Color(1, self.rate, 1.0, self.step, self.std).beside(model, root, step)


Colored = Color | LowPassed


def passed(density: Callable[[Array], Array], gain: Array, step: float) -> Array:
    """What passes of errors of a density in a second derivative, over white ones, of which gain 1/s4 passes.

    gain (...): of one that follows all frequencies up to a cut, and none beyond.
    """
    cut = cutoff_of_gain(gain, step)
    w = cut[..., None] * (np.arange(64) + 0.5) / 64
    return np.asarray((w**4 * density(w)).sum(-1) / (w**4).sum(-1))


def cutoff_of_gain(gain: Array, step: float) -> Array:
    """Cut-off in rad/s of what follows all below it and lets that gain 1/s4 of white errors through."""
    return np.asarray((5 * np.pi * gain / step) ** 0.2)


def root_of(cov: Array, turn: Array | None = None) -> Array:
    """Symmetric roots (time, n, n) of covariances, zero where they are not known.

    turn (time, n, n): to axes in which they stand still, so that their roots do.
    """
    known = np.where(np.isfinite(cov), cov, 0.0)
    still = known if turn is None else turn.mT @ known @ turn
    size, axes = np.linalg.eigh(0.5 * (still + still.mT))
    root = (axes * np.sqrt(np.maximum(size, 0.0))[:, None]) @ axes.mT
    return np.asarray(root if turn is None else turn @ root)


def autocorrelation(order: int, rate: Array, lag: Array) -> Array:
    """Of Matern processes of some order and rate (...) 1/s, at lags (...) s."""
    nu, x = order - 0.5, np.maximum(rate * lag, np.finfo(float).eps)
    return np.asarray(2 ** (1 - nu) / gamma(nu) * x**nu * kv(nu, np.minimum(x, 600.0)))  # beyond, zero
