"""The passes that filter, smoother and likelihood are made of, in plain numpy.

Covariances do not depend on the data: one pass over them serves any number of signals, and ends as soon
as they stand still, until a gap stirs them. From there on both means are one recursion with constant
matrices, y_k = A y_{k-1} + b_k, which a block scan turns into matrix products. Many models of one channel go
side by side (`single_channel`). LAPACK is called by hand: numpy's calls cost four times what they do.
passes.hpp holds the same in C++. Arguments as `linear.Arrays`: F, Q, H, R (time or 1, model, ., .), u (time
or 1, model, state); seen (time, channel) 1 where z is present; steady: whether F, Q, H, R are constant.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from forceid.kalman.covariance import combine as combine
from forceid.kalman.model import LOG_2PI, Filtered, Gains, StateSpace
from forceid.kalman.recursions.rest import Rest, channel_changes, scan
from forceid.kalman.recursions.single_channel import innovation_blocks, joseph
from forceid.records import Array, Flags, Indices
from forceid.significance import WHOLE

Runs = tuple[Indices, Array, Array, Array, Array, int]  # as covariance_pass gives them


def covariance_pass(F: Array, Q: Array, H: Array, R: Array, P0: Array, seen: Flags, steady: bool) -> Runs:
    """Filter covariances of one model as runs of samples that share them.

    Returns start (run,), P_pred, P (run, state, state), gain K (run, state, channel), W (run, channel,
    channel) which whitens an innovation, and the sample where its covariance is not positive definite, or -1.
    A channel that is missing has zero columns in K, zero rows and columns in W.
    """
    P, P_pred, rest, n, m = P0, P0, Rest(), len(P0), seen.shape[1]
    runs: list[tuple[int, Array, Array, Array]] = []
    failed, which = -1, seen.astype(bool)
    stirred = channel_changes(which)
    whole, some = np.asarray(which.all(1)).tolist(), np.asarray(which.any(1)).tolist()
    k = 0
    while k < len(seen):
        if k in stirred:
            rest = Rest()
        if k > 0:
            F_k = of(F, k - 1)
            P_pred = F_k @ P @ F_k.T + of(Q, k - 1)
            P_pred = 0.5 * (P_pred + P_pred.T)
        P, W = P_pred, np.zeros((m, m))
        if some[k]:
            c, H_k, R_k = which[k], of(H, k), of(R, k)
            if not whole[k]:
                H_k, R_k = H_k[c], R_k[c][:, c]
            PHt = P_pred @ H_k.T
            L, lost = lapack.dpotrf(H_k @ PHt + R_k, lower=1)
            if lost:
                failed = k
                break
            W_c = lapack.dtrtri(L, lower=1)[0]
            white = PHt @ W_c.T
            taken = white @ white.T
            if np.logical_or.reduce(taken.diagonal() > WHOLE * P_pred.diagonal()):
                P = joseph(P_pred, white @ W_c, H_k, R_k)
            else:
                P = P_pred - taken
            W[... if whole[k] else np.ix_(c, c)] = W_c
        runs.append((k, P_pred, P, W))
        still = steady and k > 0 and rest.reached(P)
        k = min((i for i in stirred if i > k), default=len(seen)) if still else k + 1
    first, *others = zip(*runs, strict=True) if runs else ((),) * 4
    P_preds, Ps, Ws = (np.array(a).reshape(-1, i, i) for a, i in zip(others, (n, n, m), strict=True))
    start = np.array(first, np.intp)
    K = P_preds @ (Ws @ (H[start, 0] if len(H) > 1 else H[:, 0])).swapaxes(1, 2) @ Ws
    return start, P_preds, Ps, K, Ws, failed


def mean_pass(F: Array, u: Array, H: Array, start: Indices, K: Array, x0: Array, z: Array) -> Array:
    """Filtered states (time, signal, state) under gains K of runs; z (time, signal, channel)."""
    x, z = np.empty((*z.shape[:2], x0.shape[1])), np.nan_to_num(z)
    for r, (first, stop) in enumerate(spans(start, len(z))):
        pred = x0 if first == 0 else x[first - 1] @ of(F, first - 1).T + of(u, first - 1)
        x[first] = pred + (z[first] - pred @ of(H, first).T) @ K[r].T
        if stop - first > 1:
            I_KH = np.eye(x.shape[2]) - K[r] @ of(H, 0)
            b = z[first + 1 : stop] @ K[r].T
            if u.any():
                b += (known_inputs(u, first, stop - 1) @ I_KH.T)[:, None]
            x[first + 1 : stop] = scan(I_KH @ of(F, 0), b, x[first])
    return x


def adjoint_pass(
    F: Array, u: Array, H: Array, start: Indices, P: Array, K: Array, W: Array, G: Array, z: Array, x: Array
) -> Array:
    """Smoothed states (time, signal, state): x + P a, with the adjoint a of Bryson and Frazier (1963).

    G (run, state, state): Rauch, Tung and Striebel's gain of a run where it is safe, else NaN; (0, state,
    state) where no run has one.
    """
    smoothed, z, a = np.empty_like(x), np.nan_to_num(z), np.zeros(x.shape[1:])
    for r, (first, stop) in reversed(list(enumerate(spans(start, len(z))))):
        S_inv = W[r].T @ W[r]
        if stop - first > 1 and r < len(G) and np.isfinite(G[r, 0, 0]):
            I_GF = np.eye(len(G[r])) - G[r] @ of(F, 0)
            smoothed[stop - 1] = x[stop - 1] + a @ P[r]
            b = x[first : stop - 1] @ I_GF.T
            smoothed[first : stop - 1] = scan(G[r], b[::-1], smoothed[stop - 1])[::-1]
            a = np.linalg.solve(P[r], (smoothed[first] - x[first]).T).T
        elif stop - first > 1:
            F_0, H_0, here = of(F, 0), of(H, 0), slice(first + 1, stop)
            pred = x[first : stop - 1] @ F_0.T
            if u.any():
                pred += known_inputs(u, first, stop - 1)[:, None]
            b = (z[here] - pred @ H_0.T) @ (F_0.T @ H_0.T @ S_inv).T
            path = scan(((np.eye(len(F_0)) - K[r] @ H_0) @ F_0).T, b[::-1], a)[::-1]
            smoothed[stop - 1] = x[stop - 1] + a @ P[r]
            smoothed[first + 1 : stop - 1] = x[first + 1 : stop - 1] + path[1:] @ P[r]
            a = path[0]
        smoothed[first] = x[first] + a @ P[r]
        if first > 0:
            F_k, H_k = of(F, first - 1), of(H, first)
            e = z[first] - (x[first - 1] @ F_k.T + of(u, first - 1)) @ H_k.T
            a = (a + (e @ S_inv - a @ K[r]) @ H_k) @ F_k
    return smoothed


def information_pass(
    F: Array, Q: Array, H: Array, R: Array, seen: Flags, steady: bool
) -> tuple[Indices, Array, int]:
    """Information (run, state, state) that all later samples hold on the state of a sample.

    Returns the last sample of each run, from the end of the record backwards; the information; and the sample
    where a covariance is not positive definite, or -1. No covariance of the state or of the noise is inverted
    (Fraser and Potter 1969 does both): a step that adds nothing, or a channel without white noise, is fine.
    """
    n, which, rest = F.shape[-1], seen.astype(bool), Rest()
    now, one, last = np.zeros((n, n)), np.eye(n), [len(seen) - 1]
    later, failed, stirred = [now], -1, channel_changes(which)
    whole, some = np.asarray(which.all(1)).tolist(), np.asarray(which.any(1)).tolist()
    k = len(seen) - 1
    while k > 0:
        if k + 1 in stirred:
            rest = Rest()
        F_k, Q_k = of(F, k - 1), of(Q, k - 1)
        Y = lapack.dgesv(one + now @ Q_k, one)[2]
        information = Y @ now
        if some[k]:
            c, H_k, R_k = which[k], of(H, k), of(R, k)
            if not whole[k]:
                H_k, R_k = H_k[c], R_k[c][:, c]
            S = H_k @ (Q_k @ Y) @ H_k.T + R_k
            L, lost = lapack.dpotrf(0.5 * (S + S.T), lower=1)
            if lost:
                failed = k
                break
            white = lapack.dtrtrs(L, H_k @ Y.T, lower=1)[0]
            information = information + white.T @ white
        now = F_k.T @ information @ F_k
        now = 0.5 * (now + now.T)
        last.append(k - 1)
        later.append(now)
        still = steady and rest.reached(now)
        k = max((i for i in stirred if i <= k), default=1) - 1 if still else k - 1
    return np.array(last), np.array(later), failed


def log_likelihood(
    F: Array, Q: Array, kind: Indices, H: Array, R: Array, u: Array, x0: Array, P0: Array, z: Array,
    seen: Flags, limit: float, steady: bool,
) -> Array:  # fmt: skip
    """Log-likelihood (model,) of many models, z (time, model or 1, channel), all with the same gaps.

    kind (time - 1, model): which of F, Q (kind, 1, state, state) each step takes; empty where these are in
    their order.

    Of a single channel, whitened innovations beyond `limit` count as outliers of just that size, and their
    sample is believed accordingly less (Huber's filter). A model that loses its sign to rounding goes as NaN.
    """
    total = np.zeros(len(x0))
    F, Q = (a[kind, 0] if kind.size else a for a in (F, Q))
    if seen.shape[1] == 1 and not (steady and len(x0) == 1 and limit == np.inf):
        for e, S in innovation_blocks(F, Q, H, R, u, x0, P0, z, seen, limit):
            with np.errstate(invalid="ignore", divide="ignore"):
                total -= 0.5 * (e**2 / S + np.log(S) + LOG_2PI).sum(0)
        return total
    for j in range(len(x0)):
        F_j, Q_j, H_j, R_j, u_j, z_j = (a[:, [j % a.shape[1]]] for a in (F, Q, H, R, u, z))
        start, P_pred, P, K, W, failed = covariance_pass(F_j, Q_j, H_j, R_j, P0[j], seen, steady)
        if failed >= 0:
            total[j] = np.nan
            continue
        x = mean_pass(F_j, u_j, H_j, start, K, x0[[j]], z_j)[:, 0]
        one = StateSpace(F_j[:, 0], Q_j[:, 0], H_j[:, 0], R_j[:, 0], x0[j], P0[j], u_j[:, 0])
        total[j] = Filtered(one, z_j[:, 0], x, Gains(len(z), start, P_pred, P, K, W)).log_likelihood
    return total


def innovations(
    F: Array, Q: Array, H: Array, R: Array, u: Array, x0: Array, P0: Array, z: Array, seen: Flags
) -> Array:
    """Whitened innovations (time, model) of models of one channel each: NaN where missing.

    Not finite, too, where a model loses its sign to rounding.
    """
    white = np.full((len(z), len(x0)), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        blocks = [e / np.sqrt(S) for e, S in innovation_blocks(F, Q, H, R, u, x0, P0, z, seen, np.inf)]
    white[seen[:, 0].astype(bool)] = np.concatenate(blocks)
    return white


def spans(start: Indices, time: int) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of each run."""
    return list(zip(start.tolist(), [*start[1:].tolist(), time], strict=True))


def of(a: Array, k: int) -> Array:
    """Matrix of sample or step k of one model."""
    matrix: Array = a[k, 0] if len(a) > 1 else a[0, 0]
    return matrix


def known_inputs(u: Array, first: int, stop: int) -> Array:
    """Known input of the steps from `first` to before `stop`, or the one of all."""
    return u[first:stop, 0] if len(u) > 1 else u[:, 0]
