"""How a body turns, as accelerometers on it show: the angular velocity whose rate and pull they read.

The angular acceleration is read at first hand; its integral is w, and w w^T is read beside. A smoother over
w joins both: w_k+1 = w_k + (alpha_k + alpha_k+1) dt / 2 with alpha as it is read, linearized in W(w) about
its path until that rests. Whatever f and modes may do is projected out, offsets that stay are states. The
sense of a steady spin leaves no trace. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice, product

import numpy as np
from scipy.optimize import least_squares

from forceid.errors import EstimationError
from forceid.estimation.instruments.acceleration_field import PAIRS, PULL, SHOWN, TURN, read_alike
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import ITERATIONS, SINGLE
from forceid.significance import TENTH, THOUSANDTH, WILD

ANY_RATE = 30.0  # times the rms of alpha, within which a sample of it lies: a thousandth of its claim
# of the spin, in which searches start, and none
SENSES = [np.array(v) / max(float(np.linalg.norm(v)), 1.0) for v in product((-1.0, 0.0, 1.0), repeat=3)]
SPINS_TRIED = 6  # of these: as a rule the first does, and what none of them finds no other did either
BESIDE = 10  # samples, on either side, from which a start is guessed
ROUNDS = 4  # in which alpha and the pull of the w that it makes are brought together, to start with
RESTS = 12  # smoothings in which a path that is near settles: it takes four


@dataclass(frozen=True)
class Turning:
    """omega, alpha (time, 3) rad/s, rad/s2, body axes, and their covariance (time, 6, 6).

    misfit: mean square of what is left of the readings, over their noise, by degree of freedom.
    """

    omega: Array
    alpha: Array
    cov: Array
    misfit: float


@dataclass(frozen=True)
class Shown:
    """What readings show of alpha and W beside all f and modes: root (time, 9, 9), value (time, 9), white."""

    root: Array
    value: Array


def pull(omega: Array) -> Array:
    """Entries (..., 6) of W = w w^T - w^2 1, in the order of PAIRS.

    >>> pull(np.array([0.0, 0.0, 2.0])).tolist()
    [-4.0, -4.0, 0.0, 0.0, 0.0, 0.0]
    """
    square = (omega**2).sum(-1)
    return np.stack([omega[..., i] * omega[..., j] - square * (i == j) for i, j in PAIRS], -1)


def pull_slope(omega: Array) -> Array:
    """Slopes (..., 6, 3) of `pull`."""
    d = np.zeros((*omega.shape[:-1], 6, 3))
    for k, (i, j) in enumerate(PAIRS):
        d[..., k, i] += omega[..., j]
        d[..., k, j] += omega[..., i]
        d[..., k, :] -= 2 * omega * (i == j)
    return d


def projected(y: Array, columns: Array) -> Shown:
    """Readings y (time, channel) without what f and modes may do; columns (channel, number)."""
    turning = np.r_[TURN, PULL]
    free = np.delete(columns, turning, 1)
    root, value = np.zeros((len(y), 9, 9)), np.zeros((len(y), 9))
    for rows, at in read_alike(y):
        N, B, z = free[rows], columns[rows][:, turning], y[np.ix_(at, rows)]
        away = np.eye(len(N)) - N @ np.linalg.pinv(N)
        U, s, V = np.linalg.svd(away @ B, full_matrices=False)
        kept = s > SHOWN * s.max(initial=0.0)
        Q, R = np.linalg.qr(s[kept, None] * V[kept])  # alpha, as good as unknown, in the first rows alone
        root[at, : kept.sum()], value[at, : kept.sum()] = R, z @ U[:, kept] @ Q
    return Shown(root, value)


def started(time: Array, shown: Shown, white: float) -> Iterator[Array]:
    """Paths (time, 3) of w to begin with, from spins in many senses at the sample of most pull.

    A spin is fitted to the samples around it, over as long as it turns by a radian, and followed from there.
    Those that fit best as they are come first.
    """
    guess = np.einsum("tab,tb->ta", np.linalg.pinv(shown.root), shown.value)[:, 3:]
    square = np.abs(np.linalg.eigvalsh(symmetric(guess))).max(1)
    k = int(square.argmax())
    fastest = float(np.sqrt(square[k]))
    reach = max(int((np.abs(time - time[k]) * fastest < 1).sum()) // 2, BESIDE)
    at = slice(max(k - reach, 0), k + reach + 1)
    near = Shown(shown.root[at], shown.value[at])
    off = partial(left_by, time[at], near, k - at.start)
    with np.errstate(over="ignore", invalid="ignore"):
        for w in sorted((fastest * v for v in SENSES), key=lambda w: float((off(w) ** 2).sum())):
            try:
                found = least_squares(off, w, max_nfev=ITERATIONS).x
                ahead = followed(time[k:], Shown(shown.root[k:], shown.value[k:]), found, white)
                past = slice(k, None, -1)
                behind = followed(time[past], Shown(shown.root[past], shown.value[past]), found, white)
            except np.linalg.LinAlgError:  # led off beyond what doubles hold
                continue
            yield np.concatenate([behind[:0:-1], ahead])


def left_by(time: Array, shown: Shown, middle: int, spin: Array) -> Array:
    """What a spin (3,) at a sample in the middle leaves of the readings around it, one after the other."""
    by_turn, by_pull = shown.root[..., :3], shown.root[..., 3:]
    back = np.linalg.pinv(by_turn)
    omega = np.tile(spin, (len(time), 1))
    for _ in range(ROUNDS):
        left = shown.value - np.einsum("tab,tb->ta", by_pull, pull(omega))
        alpha = np.einsum("tab,tb->ta", back, left)
        omega = spin + integral(time, alpha, middle)
    left = left - np.einsum("tab,tb->ta", by_turn, alpha)
    far = float(np.abs(shown.value).max()) / SINGLE
    return np.asarray(np.clip(np.nan_to_num(left.ravel(), nan=far), -far, far))


def followed(time: Array, shown: Shown, spin: Array, white: float) -> Array:
    """A path (time, 3) of w from a spin (3,) at its first sample on: from sample to sample by alpha, and
    corrected by what W says, as an extended Kalman filter does.
    """
    back = np.linalg.pinv(shown.root[:, :3, :3])
    by_pull, value = shown.root[:, :3, 3:], shown.value[:, :3]
    rows, read = shown.root[:, 3:, 3:], shown.value[:, 3:]  # of W alone
    noise = white**2 * np.eye(6)
    path, w, alpha = np.empty((len(time), 3)), spin, np.zeros(3)
    P = (TENTH**2 * float(spin @ spin) + white**2) * np.eye(3)
    for k in range(len(time)):
        if k:
            step = time[k] - time[k - 1]
            half = w + step * alpha
            w = w + 0.5 * step * (alpha + back[k] @ (value[k] - by_pull[k] @ pull(half)))
            P = P + (white * step) ** 2 * back[k] @ back[k].T
        H = rows[k] @ pull_slope(w)
        gain = np.linalg.solve(H @ P @ H.T + noise, H @ P).T
        w = w + gain @ (read[k] - rows[k] @ pull(w))
        P = P - gain @ H @ P
        alpha = back[k] @ (value[k] - by_pull[k] @ pull(w))
        path[k] = w
    return path


def symmetric(entries: Array) -> Array:
    """Matrices (..., 3, 3) of entries (..., 6) in the order of PAIRS."""
    W = np.zeros((*entries.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(PAIRS):
        W[..., i, j] = W[..., j, i] = entries[..., k]
    return W


def integral(time: Array, rate: Array, zero: int = 0) -> Array:
    """Integral (time, axis) of a rate by the trapezoid rule, zero at sample `zero`."""
    steps = 0.5 * np.diff(time)[:, None] * (rate[1:] + rate[:-1])
    total = np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(steps, 0)])
    return np.asarray(total - total[zero])


def turning_of(
    time: Array, y: Array, columns: Array, white: float, offset: float, limit: float, engine: Engine
) -> Turning | None:
    """The turn that readings y (time, channel) show by columns (channel, number) of the field.

    white, offset m/s2: standard deviations of a channel, from sample to sample and of what stays. None where
    none is found whose misfit is below a limit.
    """
    shown = projected(y, columns)
    for omega in islice(started(time, shown, white), SPINS_TRIED):
        found = settled(time, shown, omega, white, offset, engine)
        if found is not None and found.misfit < limit:
            return found
    return None


def sense_shown(turning: Turning) -> bool:
    """Whether w changes by more than its errors: of a spin that stays, no reading tells the sense."""
    std = np.sqrt(np.diagonal(turning.cov, axis1=1, axis2=2)[:, :3])
    return bool((np.abs(turning.omega - turning.omega[0]) > WILD * np.hypot(std, std[0])).any())


def settled(
    time: Array, shown: Shown, omega: Array, white: float, offset: float, engine: Engine
) -> Turning | None:
    """The path of w that smoothing comes to from one near it (time, 3); None where it does not rest."""
    if not np.isfinite(omega).all():
        return None
    root, value = shown.root / white, shown.value / white
    by_turn, by_pull, alone = root[:, :3, :3], root[:, :3, 3:], root[:, 3:, 3:]
    told = alone.any(2)
    half, T, one = 0.5 * np.diff(time)[:, None, None], len(time), np.eye(3)
    rate = np.gradient(omega, time, axis=0)
    bend = np.diff(rate, 2, axis=0)  # of alpha between samples, which the trapezoid rule leaves out
    missed = np.sqrt(np.mean(bend**2)) / 6 if len(bend) else 0.0
    back = np.linalg.pinv(by_turn)
    open_var = ANY_RATE**2 * float(np.mean(rate**2)) + 1.0
    read_cov = back @ back.mT + open_var * (one - back @ by_turn)  # of alpha as it is read, w given
    F, Q = np.tile(np.eye(15), (T - 1, 1, 1)), np.zeros((T - 1, 15, 15))
    u, H = np.zeros((T - 1, 15)), np.zeros((T, 6, 15))
    F[:, TURN, TURN] = 0.0
    H[:, :, 9:] = np.eye(6)
    fastest, steady = ANY_RATE * float(np.abs(omega).max()) + 1.0, max(offset / white, THOUSANDTH)
    P0 = np.diag(np.r_[np.full(3, fastest**2), np.zeros(3), np.full(9, steady**2)])
    P0[TURN, TURN] = read_cov[0]
    to_alpha = np.concatenate([np.zeros((T, 3, 3)), np.tile(-one, (T, 1, 1)), -back, np.zeros((T, 3, 6))], 2)
    for _ in range(RESTS):
        slope = pull_slope(omega)
        about = pull(omega) - np.einsum("tab,tb->ta", slope, omega)
        alpha = np.einsum("tab,tb->ta", back, value[:, :3] - np.einsum("tab,tb->ta", by_pull, about))
        by_omega = -back @ by_pull @ slope
        ahead = np.linalg.inv(one - half * by_omega[1:]) @ np.tile(one, (T - 1, 1, 1))
        F[:, :3, :3], F[:, :3, TURN] = ahead @ (one + half * by_omega[:-1]), -half * ahead
        F[:, :3, 6:9] = -half * ahead @ (back[1:] + back[:-1])
        u[:, :3] = np.einsum("tab,tb->ta", half * ahead, alpha[1:] + alpha[:-1])
        enters = np.concatenate([-half * ahead, np.tile(one, (T - 1, 1, 1))], 1)
        Q[:, :6, :6] = enters @ read_cov[1:] @ enters.mT
        Q[:, :3, :3] += (missed * half) ** 2 * one
        H[:, :, :3] = alone @ slope
        z = np.where(told, value[:, 3:] - np.einsum("tab,tb->ta", alone, about), np.nan)
        try:
            path = engine.smooth(StateSpace(F, Q, H, np.eye(6), np.zeros(15), P0, u), z)
        except EstimationError:  # so far off that doubles do not hold it
            return None
        moved = np.abs(path.x[:, :3] - omega)
        omega, std = path.x[:, :3], np.sqrt(np.diagonal(path.P, axis1=1, axis2=2)[:, :3])
        if not np.isfinite(omega).all():
            return None
        if (moved <= TENTH * std).all():
            to_alpha[:, :, :3] = by_omega
            alpha = alpha + np.einsum("tab,tb->ta", to_alpha, path.x)
            rows = np.concatenate([np.tile(np.eye(3, 15), (T, 1, 1)), to_alpha], 1)
            left = float(np.nansum((z - np.einsum("tab,tb->ta", H, path.x)) ** 2))
            return Turning(omega, alpha, rows @ path.P @ rows.mT, left / max(float(told.sum()), 1.0))
    return None
