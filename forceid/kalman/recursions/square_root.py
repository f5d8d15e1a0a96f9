"""Filter and smoother covariances as factors, led through orthogonal steps: the array form.

A factor C of P = C C^T has the square root of its condition, and a triangularization that keeps the digits of
each column loses none of it. One step serves all: to eliminate from errors what a sample, a step or all later
samples explain.
Arguments and runs as in `passes`.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack, lu

from forceid.kalman.covariance import is_positive_definite, square_root
from forceid.kalman.recursions import passes
from forceid.kalman.recursions.passes import Runs, of
from forceid.kalman.recursions.rest import Rest, channel_changes
from forceid.records import Array, Flags, Indices


def triangle(W: Array) -> Array:
    """Triangular L (..., row, row or fewer) with L L^T = W W^T: covariances add as factors side by side.

    Elimination with row exchange first, then reflections of its well-conditioned part (Peters and Wilkinson
    1970): a row that is eliminated goes by the column that carries most of it, so small columns keep their
    digits beside columns as large as unknown, which reflections alone mix into them.
    """
    if W.ndim > 2:
        part, upper = lu(W.swapaxes(-1, -2), permute_l=True, check_finite=False)
        return np.asarray(np.linalg.qr(part, mode="r") @ upper, float).swapaxes(-1, -2)
    both = lapack.dgetrf(W.T)[0]  # by hand: the calls above cost as much as what they do
    rank = min(W.shape)
    part = np.tril(both[:, :rank], -1)
    np.fill_diagonal(part, 1.0)  # rows in another order: reflections ask for none
    return np.asarray(np.triu(lapack.dgeqrf(part)[0][:rank]) @ np.triu(both[:rank]), float).T


def eliminate(A: Array, B: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Errors B e, given A e + noise v of white e, v: L, K, rest of [[A, noise], [B, 0]] made triangular.

    L is a factor of the covariance of what is given, K the part of B e that it shows once it is whitened,
    `rest` a factor of what remains of B e: no difference is taken. An axis of samples may lead.
    """
    m = A.shape[-2]
    upper = np.concatenate([A, np.broadcast_to(noise, (*A.shape[:-2], *noise.shape[-2:]))], -1)
    lower = np.concatenate([B, np.zeros((*B.shape[:-1], noise.shape[-1]))], -1)
    both = triangle(np.concatenate([upper, lower], -2))
    return both[..., :m, :m], both[..., m:, :m], both[..., m:, m:]


def squared(*parts: Array) -> Array:
    """The sum of W W^T over factors W of a covariance."""
    return np.asarray(np.add.reduce([W @ W.T for W in parts]))


def array_covariance_pass(
    F: Array, Q: Array, H: Array, R: Array, P0: Array, seen: Flags, steady: bool
) -> tuple[Runs, Array]:
    """Filter covariances as `passes.covariance_pass` gives them, and factors C (run, state, state) of P.

    Source: Kailath, Sayed, Hassibi (2000), Linear Estimation, chapter 12.
    """
    n, m = P0.shape[-1], seen.shape[1]
    Q_root, R_root = square_root(Q), square_root(R)
    before, rest, which = square_root(P0), Rest(), seen.astype(bool)
    runs: list[tuple[int, Array, Array, Array, Array, Array]] = []
    failed, stirred, k = -1, channel_changes(which), 0
    while k < len(seen):
        if k in stirred:
            rest = Rest()
        if k > 0:  # as wide as it comes: it is made triangular with what the sample shows
            before = np.hstack([of(F, k - 1) @ runs[-1][5], of(Q_root, k - 1)])
        K, W = np.zeros((n, m)), np.zeros((m, m))
        if (c := which[k]).any():
            HC, noise = of(H, k)[c] @ before, of(R_root, k)[c]
            L, K_white, C = eliminate(HC, before, noise)
            sign, depth = np.sign(np.diagonal(L)), np.abs(np.diagonal(L))
            if not (depth > m * np.finfo(float).eps * np.abs(L).max(1)).all():
                failed = k
                break
            W_c = white_share(L * sign, np.eye(len(L)))
            K[:, c] = (K_white * sign) @ W_c
            W[np.ix_(c, c)] = W_c
        else:
            C = triangle(before)
        P_pred, P = squared(before), squared(C)
        runs.append((k, P_pred, P, K, W, C))
        still = steady and k > 0 and rest.reached(P)
        k = min((i for i in stirred if i > k), default=len(seen)) if still else k + 1
    shapes = ((n, n), (n, n), (n, m), (m, m), (n, n))
    first, *others = zip(*runs, strict=True) if runs else ((),) * 6
    P_preds, Ps, Ks, Ws, Cs = (np.array(a).reshape(-1, *s) for a, s in zip(others, shapes, strict=True))
    return (np.array(first, np.intp), P_preds, Ps, Ks, Ws, failed), Cs


def array_information_pass(
    F: Array, Q: Array, H: Array, R: Array, seen: Flags, steady: bool
) -> tuple[Indices, Array, int]:
    """Factors U (run, state, state) of the information U^T U that all later samples hold on the state of one.

    Otherwise as `passes.information_pass`, which stands in where R is not positive definite.
    """
    if not is_positive_definite(R):
        last, information, failed = passes.information_pass(F, Q, H, R, seen, steady)
        return last, square_root(information).swapaxes(-1, -2), failed
    n, which, rest = F.shape[-1], seen.astype(bool), Rest()
    Q_root, R_root = square_root(Q), square_root(R)
    now, stirred, k = np.zeros((n, n)), channel_changes(which), len(seen) - 1
    runs, later = [k], [now]
    while k > 0:
        if k + 1 in stirred:
            rest = Rest()
        if (c := which[k]).any():
            now = np.vstack([now, white_share(triangle(of(R_root, k)[c]), of(H, k)[c])])
        # what the sample and later ones say of F x + G e, with no say of the white e
        G, F_k = of(Q_root, k - 1), of(F, k - 1)
        now = eliminate((now @ G).T, (now @ F_k).T, np.eye(n))[2].T[:n]
        runs.append(k - 1)
        later.append(now)
        still = steady and rest.reached(now.T @ now)
        k = max((i for i in stirred if i <= k), default=1) - 1 if still else k - 1
    return np.array(runs), np.array(later), -1


def combine_factors(C: Array, U: Array) -> Array:
    """Covariances (run, state, state) given all samples, of factors C of the filter's and U of later ones.

    Later samples are one more measurement U x with white noise of one.
    """
    root = eliminate(U @ C, C, np.eye(U.shape[-2]))[2]
    return np.asarray(root @ root.swapaxes(-1, -2))


def step_back(C: Array, F: Array, Q_root: Array) -> tuple[Array, Array]:
    """L, K of one step: a state with factor C moves by K w if the next one moves by L w.

    K L^-1 is the gain of Rauch, Tung and Striebel, here applied in two steps: after a start as good as
    unknown neither it nor a product with the covariance has digits left.
    """
    L, K, _ = eliminate(F @ C, C, Q_root)
    # what is known for certain does not move
    certain = np.abs(np.diagonal(L)) <= len(L) * np.finfo(float).eps * np.abs(L).max(1)
    np.fill_diagonal(L := L.copy(), np.where(certain, 1e300, np.diagonal(L)))
    return L, K


def white_share(L: Array, move: Array) -> Array:
    """Solve L w = move for w (state, .), L a lower triangle: turned about, an upper one needs no pivot."""
    return np.asarray(np.linalg.solve(L[::-1, ::-1], move[::-1])[::-1])
