"""Linear Gaussian filter, smoother and likelihood.

x_{k+1} = F_k x_k + u_k + w_k, z_k = H_k x_k + n_k, cov w = Q_k, cov n = R_k. x0, P0 describe the state
at the first sample, before that sample is used. The work is done by the passes of an engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from forceid.errors import EstimationError
from forceid.kalman.covariance import correlations
from forceid.kalman.model import Filtered, Gains, Smoothed, StateSpace, as_channels, same_at_all_times
from forceid.kalman.recursions.conditioning import mended_covariance_pass, smoothed_states
from forceid.kalman.recursions.conditioning import smoothed_covariances as smoothed_runs
from forceid.records import Array, Flags, Indices
from forceid.rounding import HARMLESS

NO_KINDS = np.zeros((0, 0), np.intp)  # of steps: matrices in their order
LONG_RUN = 1000  # samples of a run for which a gain of its own is worth its inverse


class Passes(Protocol):
    """An engine's work: the functions of `passes`, in numpy or compiled."""

    covariance_pass: Callable[..., tuple[Indices, Array, Array, Array, Array, int]]
    mean_pass: Callable[..., Array]
    adjoint_pass: Callable[..., Array]
    information_pass: Callable[..., tuple[Indices, Array, int]]
    combine: Callable[[Array, Array], Array]
    log_likelihood: Callable[..., Array]
    innovations: Callable[..., Array]


def filter(passes: Passes, model: StateSpace, z: Array) -> Filtered:
    """Kalman filter over z (time, channel), (time,) or (time, signal, channel); NaN = missing."""
    z = as_channels(z)
    if z.ndim == 3 and not same_gaps(z):
        return filter_each(lambda one: filter(passes, model, one), z)
    F, Q, H, R, u = arrays(model, z)
    runs, C = mended_covariance_pass(
        passes.covariance_pass, F, Q, H, R, model.P0, pattern(z), time_invariant(model)
    )
    require_positive(runs[-1])
    g = Gains(len(z), *runs[:-1])
    signals = z if z.ndim == 3 else z[:, None]
    x0 = np.broadcast_to(model.x0, (signals.shape[1], model.P0.shape[-1]))
    x = passes.mean_pass(F, u, H, g.start, g.K, x0, signals)
    return Filtered(model, z, x if z.ndim == 3 else x[:, 0], g, C)


def innovations(passes: Passes, model: StateSpace, z: Array) -> Array:
    """Whitened innovations (time, model) of many models, each of a channel of its own, z (time, model).

    As of `filter`, but for digits that the first samples after an unknown start may lose; NaN = missing.
    """
    if same_gaps(z[..., None]):
        given = *arrays(model, z[..., None]), model.x0, model.P0, z[..., None], pattern(z[:, :1])
        white = np.asarray(passes.innovations(*given))
        if np.array_equal(np.isfinite(white), np.isfinite(z)):
            return white
    each = ((model.one(j), z[:, j]) for j in range(z.shape[1]))
    return np.concatenate([filter(passes, one, own).innovation for one, own in each], 1)


def smooth(passes: Passes, model: StateSpace, z: Array) -> Smoothed:
    """Fixed-interval smoother over z (time, channel), (time,) or (time, signal, channel); NaN = missing.

    Rauch-Tung-Striebel's result, in a form that divides by no covariance of the state and takes no
    difference of two: the predicted one is singular in all but name where a prior is smooth, and a
    difference turns negative after a start as good as unknown. The state by the adjoint of Bryson and
    Frazier (1963), the covariance by the information of later samples.
    """
    z = as_channels(z)
    if z.ndim == 3 and not same_gaps(z):
        return smooth_apart(lambda one: smooth(passes, model, one), z)
    return with_covariances(passes, *filter_and_smooth_states(passes, model, z))


def with_covariances(passes: Passes, f: Filtered, x: Array) -> Smoothed:
    """The smoother's covariances beside its states x (time, [signal,] state), of signals with common gaps."""
    F, Q, H, R, _ = arrays(f.model, f.z)
    start, runs, failed = smoothed_runs(
        passes.information_pass, passes.combine, F, Q, H, R, pattern(f.z), time_invariant(f.model),
        f.gains.start, f.gains.P, f.factors,
    )  # fmt: skip
    require_positive(failed)
    return Smoothed(x, start, runs, f)


def smooth_states(passes: Passes, model: StateSpace, z: Array) -> Array:
    """States (time, state) of `smooth` without their covariances, at a third of its cost or less."""
    return filter_and_smooth_states(passes, model, z)[1]


def filter_and_smooth_states(passes: Passes, model: StateSpace, z: Array) -> tuple[Filtered, Array]:
    """Both `filter` and `smooth_states`, of signals with common gaps, for the covariances of one."""
    f = filter(passes, model, z)
    return f, backward(passes, f)


def backward(passes: Passes, f: Filtered) -> Array:
    """States (time, [signal,] state) given all samples, of a filter's."""
    F, Q, H, _, u = arrays(f.model, f.z)
    g, x, z = f.gains, *(a if f.z.ndim == 3 else a[:, None] for a in (f.x, f.z))
    G = steady_gains(F, u, g)
    smoothed = passes.adjoint_pass(F, u, H, g.start, g.P, g.K, g.W, G, z, x)
    if f.factors is not None:
        smoothed = smoothed_states(F, Q, u, g.start, f.factors, x, smoothed)
    return smoothed if f.z.ndim == 3 else smoothed[:, 0]


def followed(passes: Passes, f: Filtered, missed: Array, first: int) -> Array:
    """States from `first` on (time, signal, state) that a smoother gives a record whose filter misses it.

    By missed (time, signal, channel), before each sample. No other states move these, as those of a load. In
    the loop that the filter closes: what they move may grow by itself until no digit is left of it.
    """
    F, _, H, _, _ = arrays(f.model, missed)
    g, n, own = f.gains, F.shape[-1], slice(first, None)
    x, u, untold = np.zeros((*missed.shape[:2], n)), np.zeros((1, 1, n)), np.zeros((0, n, n))
    later = passes.adjoint_pass(F, u, H, g.start, g.P, g.K, g.W, untold, missed, x)
    F, K, blind = (np.ascontiguousarray(a) for a in (F[..., own, own], g.K[:, own], 0 * H[..., own]))
    now = passes.mean_pass(F, u[..., own], blind, g.start, K, x[0, :, own], missed)
    return np.asarray(now + later[..., own])


def steady_gains(F: Array, u: Array, g: Gains) -> Array:
    """Rauch, Tung and Striebel's gain P F^T P_pred^-1 of each run (run, state, state) that is long; else NaN.

    None at all, (0, state, state), where no run is. It halves the work of many channels, and inverts two
    covariances: used where both are conditioned well.
    """
    n, m = g.K.shape[-2:]
    long = np.flatnonzero(np.diff(np.append(g.start, g.time)) > LONG_RUN)
    if 2 * m < n or u.any() or not len(long):
        return np.zeros((0, n, n))
    G = np.full(g.P.shape, np.nan)
    for r in long:
        if max(np.linalg.cond(correlations(a)[0]) for a in (g.P[r], g.P_pred[r])) < HARMLESS:
            G[r] = np.linalg.solve(g.P_pred[r], F[0, 0] @ g.P[r]).T
    return G


def log_likelihood(passes: Passes, model: StateSpace, z: Array, limit: float = np.inf) -> Array:
    """Log-likelihood of z (time, channel) or (time,); of each of many models or signals (time, ., channel).

    limit: whitened innovations of a single channel beyond it count as outliers of just that size, and their
    sample is believed accordingly less (Huber's filter). Of many models, those that lose their sign to
    rounding go as NaN; one model raises EstimationError.
    """
    z = as_channels(z)
    if z.ndim == 3 and not same_gaps(z):
        own = model.unfolded
        each = [log_likelihood(passes, each_model(own, j), z[:, j], limit) for j in range(z.shape[1])]
        return np.array(each)
    F, Q, H, R, u = arrays(model, z)
    kind, steady = NO_KINDS if model.kind is None else model.kind, time_invariant(model)
    count = max(1 if model.x0.ndim == 1 else len(model.x0), 1 if z.ndim == 2 else z.shape[1])
    x0 = np.broadcast_to(model.x0, (count, model.x0.shape[-1]))
    P0 = np.broadcast_to(model.P0, (count, *model.P0.shape[-2:]))
    signals = z if z.ndim == 3 else z[:, None]
    total = passes.log_likelihood(F, Q, kind, H, R, u, x0, P0, signals, pattern(z), limit, steady)
    if model.x0.ndim == 1 and np.isnan(total).any() and limit == np.inf:
        total = np.atleast_1d(filter(passes, model, z).log_likelihood)
    elif model.x0.ndim == 1 and np.isnan(total).any():
        require_positive(passes.covariance_pass(F, Q, H, R, model.P0, pattern(z), steady)[-1])
    return np.asarray(total if model.x0.ndim == 2 or z.ndim == 3 else total[0])


def arrays(model: StateSpace, z: Array) -> tuple[Array, Array, Array, Array, Array]:
    """F, Q, H, R (time or 1, model or 1, ., .) and u (time or 1, model or 1, state) of a model.

    Raises EstimationError where a shape does not fit the others, or z (time, ..., channel).
    """
    n, m, T = model.P0.shape[-1], z.shape[-1], len(z)
    u = np.zeros(n) if model.u is None else model.u
    given = {"F": model.F, "Q": model.Q, "H": model.H, "R": model.R, "u": u}
    sizes = {"F": (n, n), "Q": (n, n), "H": (m, n), "R": (m, m), "u": (n,)}
    out = []
    for name, a in given.items():
        core = sizes[name]
        times: tuple[int, ...] = (T, 1) if name in "HR" else (T - 1, T, 1)
        if model.kind is not None and name in "FQ":  # of kinds, not of steps
            times = (len(a),)
        lead = a.shape[: a.ndim - len(core)]
        if a.shape[a.ndim - len(core) :] != core or (lead and lead[0] not in times) or len(lead) > 2:
            expected = " or ".join(str((*t, *core)) for t in ((), (times[0],)))
            raise EstimationError(f"has {name} of shape {a.shape}, expected {expected}", "the linear model")
        a = a if len(lead) == 2 else a[:, None] if len(lead) == 1 else a[None, None]
        out.append(a[:1] if model.kind is None and same_at_all_times(a) else a)
    for name, shape in (("x0", (n,)), ("P0", (n, n))):
        if getattr(model, name).shape[-len(shape) :] != shape:
            found = getattr(model, name).shape
            raise EstimationError(f"has {name} of shape {found}, expected {shape}", "the linear model")
    return out[0], out[1], out[2], out[3], out[4]


def time_invariant(model: StateSpace) -> bool:
    """Whether F, Q, H, R are the same at every sample."""
    return model.kind is None and all(
        a.ndim == 2 or same_at_all_times(a) for a in (model.F, model.Q, model.H, model.R)
    )


def pattern(z: Array) -> Flags:
    """Channels present (time, channel), of z (time, channel) or (time, signal, channel) with common gaps."""
    return np.isfinite(z if z.ndim == 2 else z[:, 0])


def same_gaps(z: Array) -> bool:
    """Whether all signals z (time, signal, channel) have the same gaps."""
    seen = np.isfinite(z)
    return bool((seen == seen[:, :1]).all())


def each_model(model: StateSpace, j: int) -> StateSpace:
    """Model of signal j: its own start where there is one, or its own model of many."""
    if model.P0.ndim == 3:
        return model.one(j)
    return model if model.x0.ndim == 1 else replace(model, x0=model.x0[j])


def filter_each(solve: Callable[[Array], Filtered], z: Array) -> Filtered:
    """Filter of signals with gaps of their own: each by itself, then side by side."""
    each = [solve(z[:, j]) for j in range(z.shape[1])]
    start, pick = shared_runs([f.gains.start for f in each])
    side = (
        np.stack([getattr(f.gains, name)[i] for f, i in zip(each, pick, strict=True)], 1)
        for name in ("P_pred", "P", "K", "W")
    )
    return Filtered(each[0].model, z, np.stack([f.x for f in each], 1), Gains(len(z), start, *side))


def smooth_apart(solve: Callable[[Array], Smoothed], z: Array) -> Smoothed:
    """Smoother of signals with gaps of their own: each by itself, then side by side."""
    each = [solve(z[:, j]) for j in range(z.shape[1])]
    start, pick = shared_runs([s.start for s in each])
    runs = np.stack([s.runs[i] for s, i in zip(each, pick, strict=True)], 1)
    filtered = iter([s.filtered for s in each])
    return Smoothed(np.stack([s.x for s in each], 1), start, runs, filter_each(lambda _: next(filtered), z))


def shared_runs(starts: list[Indices]) -> tuple[Indices, list[Indices]]:
    """Runs (run,) in which nothing changes for any of many signals, and where each finds its own."""
    start = np.unique(np.concatenate(starts))
    return start, [np.searchsorted(own, start, "right") - 1 for own in starts]


def require_positive(failed: int) -> None:
    """Raise where a pass names a sample."""
    if failed >= 0:
        raise EstimationError(
            f"gives an innovation covariance that is not positive definite at sample {failed}",
            "the linear model",
            "state a measurement noise above zero",
        )
