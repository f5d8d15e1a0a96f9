"""Where the plain form of the filter would lose digits, and the array form in its place there.

Two things cost digits. Channels that say nearly the same of a state that is nearly unknown: the condition c
of their innovation covariance S, in units of its diagonal, costs a covariance about eps^2 c^3. And a start
as good as unknown, of which the first samples show some directions and not others: the predicted covariance
then has a condition that costs eps times itself. Stretches of such samples go through `square_root`, and
cost ten times more; all others are left as the engine found them.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from forceid.kalman.covariance import correlations, is_positive_definite, square_root
from forceid.kalman.recursions import square_root as array_form
from forceid.kalman.recursions.passes import Runs, of
from forceid.kalman.recursions.rest import LAG
from forceid.records import Array, Flags, Indices
from forceid.rounding import HARMLESS, SINGLE

ALIKE = 1e5  # condition of S from which the array form is used
START_UNKNOWN = SINGLE / np.finfo(float).eps  # condition of a predicted covariance that costs more digits


def mended_covariance_pass(
    plain: Callable[..., Runs], F: Array, Q: Array, H: Array, R: Array, P0: Array, seen: Flags, steady: bool
) -> tuple[Runs, Array | None]:
    """Runs of the engine's pass `plain`, mended where it loses digits.

    Also factors C (run, state, state) of P there, NaN elsewhere; None where nothing was to mend.
    """
    begun = through_start(plain, F, Q, H, R, P0, seen, steady)
    if begun is not None:
        return begun
    runs = plain(F, Q, H, R, P0, seen, steady)
    start, P_pred, P, _, W, failed = runs
    if (lost := failed >= 0) and not is_positive_definite(R):
        return runs, None
    if lost:  # through the samples that show a state for the first time, then look again
        past = min(failed + 1 - (-len(P0) // seen.shape[1]), len(seen) - 1)
        start, bad = np.array([0, max(past, 1)]), np.array([True, False])
    else:
        bad = nearly_dependent(H, R, start, P_pred, W)
        bad[: barely_known(P_pred, P, W)] = True
        if not bad.any():
            return runs, None
    parts: list[tuple[Indices, Array, Array, Array, Array, Array]] = []
    for first, stop, array in segments(start, bad, len(seen)):
        if first > 0:
            P0 = stepped(parts[-1][2][-1], of(F, first - 1), of(Q, first - 1))
        part = *stretch(F, Q, H, R, first, stop), P0, seen[first:stop], steady
        if not array:
            start, P_pred, P, K, W, failed = plain(*part)
            C = np.full_like(P, np.nan)
            array = failed >= 0 or (lost and bool(nearly_dependent(part[2], part[3], start, P_pred, W).any()))
        if array:
            (start, P_pred, P, K, W, failed), C = array_form.array_covariance_pass(*part)
        parts.append((first + start, P_pred, P, K, W, C))
        if failed >= 0:
            failed += first
            break
    start, P_pred, P, K, W, C = (np.concatenate(a) for a in zip(*parts, strict=True))
    return (start, P_pred, P, K, W, failed), C


def through_start(
    plain: Callable[..., Runs], F: Array, Q: Array, H: Array, R: Array, P0: Array, seen: Flags, steady: bool
) -> tuple[Runs, Array] | None:
    """The pass where only a start as good as unknown asks for the array form, as a rule it does; else None.

    So no sample behind the start is gone through twice.
    """
    stop = int(seen.any(1).argmax()) + 1 - (-len(P0) // seen.shape[1])
    if not 1 < stop < len(seen):
        return None
    first = *stretch(F, Q, H, R, 0, stop), P0, seen[:stop], steady
    at, P_pred, P, _, W, failed = plain(*first)
    if failed >= 0 or len(at) < stop or barely_known(P_pred, P, W) != stop:
        return None
    head, C = array_form.array_covariance_pass(*first)
    if head[-1] >= 0:
        return None
    P0 = stepped(head[2][-1], of(F, stop - 1), of(Q, stop - 1))
    at, *rest, failed = plain(*stretch(F, Q, H, R, stop, len(seen)), P0, seen[stop:], steady)
    if failed >= 0 or nearly_dependent(H, R, at + stop, rest[0], rest[-1]).any():
        return None
    start = np.concatenate([head[0], at + stop])
    P_pred, P, K, W = (np.concatenate(both) for both in zip(head[1:-1], rest, strict=True))
    factors = np.full_like(P, np.nan)
    factors[: len(C)] = C
    return (start, P_pred, P, K, W, failed), factors


def stepped(P: Array, F: Array, Q: Array) -> Array:
    """The covariance that a covariance becomes in a step."""
    P = F @ P @ F.T + Q
    return 0.5 * (P + P.T)


def stretch(
    F: Array, Q: Array, H: Array, R: Array, first: int, stop: int
) -> tuple[Array, Array, Array, Array]:
    """The model of the samples from `first` to before `stop`."""
    return steps(F, first, stop), steps(Q, first, stop), samples(H, first, stop), samples(R, first, stop)


def smoothed_covariances(
    plain: Callable[..., tuple[Indices, Array, int]], combine: Callable[[Array, Array], Array],
    F: Array, Q: Array, H: Array, R: Array, seen: Flags, steady: bool, start: Indices, P: Array,
    C: Array | None,
) -> tuple[Indices, Array, int]:  # fmt: skip
    """Runs, their covariances given all samples, and the sample where one is not positive definite, or -1.

    Of the filter's runs P from `start` on; plain, combine: the engine's information pass and its end; factors
    C of P where the filter was mended, NaN elsewhere, or None.
    """
    hard = C is not None and alike_by_steps(Q, H, R)
    failed = len(seen)
    if not hard:
        last, later, failed = plain(F, Q, H, R, seen, steady)
    if failed >= 0 and is_positive_definite(R):
        hard = True
        last, later, failed = array_form.array_information_pass(F, Q, H, R, seen, steady)
    begin = np.append(last[1:] + 1, 0)[::-1]  # of each run of later samples, forward
    both = np.union1d(start, begin)
    known, ahead = np.searchsorted(start, both, "right") - 1, np.searchsorted(begin, both, "right") - 1
    later = later[::-1]
    if C is None and not hard:
        return both, combine(P[known], later[ahead]), failed
    rooted = np.zeros(len(both), bool) if C is None else np.isfinite(C[known, 0, 0])
    mend, out = rooted | hard, np.empty((len(both), *P.shape[1:]))
    out[~mend] = combine(P[known[~mend]], later[ahead[~mend]])
    roots, U = square_root(P[known[mend]]), later[ahead[mend]]
    if C is not None:
        roots = np.where(rooted[mend, None, None], C[known[mend]], roots)
    out[mend] = array_form.combine_factors(roots, U if hard else square_root(U).swapaxes(-1, -2))
    return both, out, failed


def smoothed_states(
    F: Array, Q: Array, u: Array, start: Indices, C: Array, x: Array, smoothed: Array
) -> Array:
    """States (time, signal, state) given all samples, by steps back where the filter has factors C.

    x: states of the filter; smoothed: by the adjoint, right where there are no factors.
    """
    out, constant = smoothed.copy(), len(F) == len(Q) == 1
    run, now = np.searchsorted(start, np.arange(len(x)), "right") - 1, -1
    for k in np.flatnonzero(np.isfinite(C[run[:-1], 0, 0]))[::-1]:
        F_k = of(F, k)
        if run[k] != now or not constant:
            L, K = array_form.step_back(C[run[k]], F_k, square_root(of(Q, k)))
            now = run[k]
        move = out[k + 1] - x[k] @ F_k.T - of(u, k)
        out[k] = x[k] + (K @ array_form.white_share(L, move.T)).T
    return out


def alike_by_steps(Q: Array, H: Array, R: Array) -> bool:
    """Whether the noise of a step alone brings an innovation covariance beyond ALIKE."""
    if R.shape[-1] == 1 or not is_positive_definite(R):
        return False
    H, R = (a[1:, 0] if len(a) > 1 else a[:, 0] for a in (H, R))
    S = H @ Q[:, 0] @ H.swapaxes(1, 2) + R
    return beyond(ALIKE, S)


def nearly_dependent(H: Array, R: Array, start: Indices, P_pred: Array, W: Array) -> Flags:
    """Runs whose innovation covariance is beyond ALIKE: trace of the inverse of its correlations."""
    if W.shape[-1] == 1:
        return np.zeros(len(W), bool)
    # |h| sqrt(diag P) bounds the deviation that a state gives a channel, and needs no inverse
    size = np.sqrt(np.maximum(np.diagonal(P_pred, axis1=1, axis2=2), 0.0))
    h, noise = np.abs(H[:, 0]), np.diagonal(R[:, 0], axis1=1, axis2=2)
    # einsum, not @: a product this thin is slow in BLAS
    shown = np.einsum("ij,rj->ri", h[0], size) if len(H) == 1 else np.einsum("rij,rj->ri", h[start], size)
    S = shown**2 + (noise[start] if len(R) > 1 else noise)
    bad = np.asarray(np.einsum("rij,rij,rj->r", W, W, S) > ALIKE)
    at = np.flatnonzero(bad)
    if len(at):
        blank = np.diagonal(W[at], axis1=1, axis2=2) == 0
        L = np.linalg.inv(W[at] + blank[:, None] * np.eye(W.shape[-1]))
        bad[at] = ((W[at] ** 2).sum(1) * (L**2).sum(2)).sum(1) > ALIKE
    return bad


def barely_known(P_pred: Array, P: Array, W: Array) -> int:
    """Runs at the start of a record in which samples meet a state of which some directions are unknown."""
    n, m = P.shape[-1], W.shape[-1]
    met = int(np.argmax(W[:, range(m), range(m)].any(1)))
    stop = min(met + 1 - (-n // m), len(P))
    before, after = (np.diagonal(a[met:stop], axis1=1, axis2=2) for a in (P_pred, P))
    if not (before.max(0) > HARMLESS * after.min(0)).any():
        return 0
    return stop if beyond(START_UNKNOWN, P_pred[met:stop]) else 0


def beyond(condition: float, P: Array) -> bool:
    """Whether a covariance (..., ., .), in units of its diagonal, has an eigenvalue below 1 / condition."""
    return not is_positive_definite(correlations(P)[0] - np.eye(P.shape[-1]) / condition)


def segments(start: Indices, bad: Flags, time: int) -> list[tuple[int, int, bool]]:
    """First sample, the one after the last, and whether the array form is due, of stretches in turn."""
    stop = np.append(start[1:], time)
    first, last = start[bad], stop[bad]
    new = np.append(True, first[1:] >= last[:-1] + 2 * LAG)
    first, last = first[new], last[np.append(new[1:], True)]
    edges = [0, *np.stack([first, last], 1).ravel().tolist(), time]
    return [(a, b, bool(i % 2)) for i, (a, b) in enumerate(pairwise(edges)) if b > a]


def steps(a: Array, first: int, stop: int) -> Array:
    """Matrices of the steps between the samples from `first` to before `stop`."""
    return a if len(a) == 1 else a[min(first, len(a) - 1) : max(stop - 1, first + 1)]


def samples(a: Array, first: int, stop: int) -> Array:
    """Matrices of the samples from `first` to before `stop`."""
    return a if len(a) == 1 else a[first:stop]
