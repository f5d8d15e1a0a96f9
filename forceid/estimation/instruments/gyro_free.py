"""How a body turns, as accelerometers on it show: the angular velocity whose rate and pull they read.

The angular acceleration is read at first hand; its integral is w, and w w^T is read beside. A smoother over
(w, alpha) joins both: w_k+1 = w_k + (alpha_k + alpha_k+1) dt / 2 with alpha open, linearized in W(w) about
its path until that rests. Whatever f and modes may do is projected out, offsets that stay are states. The
sense of a steady spin leaves no trace. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
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
LOOKED_AT = 2000  # samples by which starts are judged


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


@dataclass(frozen=True)
class Guess:
    """A path of w over the samples `at`: spin (6,), w where it starts from and a drift of its rate, and omega
    (sample, 3); cost: of what it leaves of the readings.
    """

    spin: Array
    omega: Array
    at: slice
    cost: float = np.inf


def started(time: Array, shown: Shown) -> Iterator[Array]:
    """Paths (time, 3) of w to begin with: such as the readings of alpha leave, near to those of W.

    From a spin in many senses at the sample of most pull, over as long as it turns by a radian, and on from
    there over twice as long at a time. Those that fit best as they are come first.
    """
    guess = np.einsum("tab,tb->ta", np.linalg.pinv(shown.root), shown.value)[:, 3:]
    square = np.abs(np.linalg.eigvalsh(symmetric(guess))).max(1)
    k = int(square.argmax())
    fastest = float(np.sqrt(square[k]))
    reach = max(int((np.abs(time - time[k]) * fastest < 1).sum()) // 2, BESIDE)
    first = window(k, reach, len(time))
    spins = [np.r_[fastest * v, np.zeros(3)] for v in SENSES]
    flat = np.zeros((first.stop - first.start, 3))
    tried = [fitted(time, shown, k, Guess(p, flat + p[:3], first), first, 1) for p in spins]
    for found in sorted(tried, key=lambda one: one.cost):
        size = reach
        found = fitted(time, shown, k, found, first)
        while found.at.stop - found.at.start < len(time):
            size *= 2
            found = fitted(time, shown, k, found, window(k, size, len(time)))
        yield found.omega


def window(middle: int, reach: int, count: int) -> slice:
    """Samples at most `reach` from one in the middle, of so many."""
    return slice(max(middle - reach, 0), min(middle + reach + 1, count))


def fitted(time: Array, shown: Shown, middle: int, guess: Guess, at: slice, most: int = ITERATIONS) -> Guess:
    """A guess fitted to the readings of the samples `at`, which hold those of it, in `most` steps."""
    root, value, since = shown.root[at], shown.value[at], time[at] - time[middle]
    by_turn, by_pull = root[..., :3], root[..., 3:]
    back = np.linalg.pinv(by_turn)
    held = np.pad(guess.omega, ((guess.at.start - at.start, at.stop - guess.at.stop), (0, 0)), "edge")
    thin = slice(None, None, max(len(since) // LOOKED_AT, 1))
    far = float(np.abs(value).max()) / SINGLE

    def path(p: Array) -> tuple[Array, Array]:
        omega = held
        for _ in range(ROUNDS):
            left = value - np.einsum("tab,tb->ta", by_pull, pull(omega))
            alpha = np.einsum("tab,tb->ta", back, left)
            omega = p[:3] + since[:, None] * p[3:] + integral(time[at], alpha, middle - at.start)
        return omega, left - np.einsum("tab,tb->ta", by_turn, alpha)

    def off(p: Array) -> Array:
        return np.clip(np.nan_to_num(path(p)[1][thin].ravel(), nan=far), -far, far)

    with np.errstate(over="ignore", invalid="ignore"):
        found = least_squares(off, guess.spin, max_nfev=most)
        return Guess(found.x, path(found.x)[0], at, float(found.cost))


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
    for omega in islice(started(time, shown), SPINS_TRIED):
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
    dt, T = np.diff(time), len(time)
    rate = np.gradient(omega, time, axis=0)
    least = white / max(float(np.abs(shown.root[..., :3]).max()), SINGLE)
    spread = ANY_RATE * max(float(np.sqrt(np.mean(rate**2))), least)
    bend = np.diff(rate, 2, axis=0)  # of alpha between samples, which the trapezoid rule leaves out
    missed = np.sqrt(np.mean(bend**2)) / 12 if len(bend) else 0.0
    steady = np.full(9, max(offset / white, THOUSANDTH) ** 2)
    half = 0.5 * dt[:, None, None] * np.eye(3)
    F, Q = np.tile(np.diag(np.r_[1.0, 1, 1, 0, 0, 0, np.ones(9)]), (T - 1, 1, 1)), np.zeros((T - 1, 15, 15))
    F[:, :3, 3:6] = half
    carry = np.concatenate([half, np.tile(np.eye(3), (T - 1, 1, 1))], 1)
    Q[:, :6, :6] = spread**2 * carry @ carry.mT
    Q[:, :3, :3] += (missed * dt[:, None, None]) ** 2 * np.eye(3)
    fastest = ANY_RATE * float(np.abs(omega).max() + np.ptp(time) * least)
    P0 = np.diag(np.r_[np.full(3, fastest**2), np.full(3, spread**2), steady])
    H = np.zeros((T, 9, 15))
    H[:, :, 3:6], H[:, :, 6:] = root[..., :3], np.eye(9)
    dof = float(root.any(2).sum() - 3 * T)
    for _ in range(RESTS):
        slope = pull_slope(omega)
        H[:, :, :3] = root[..., 3:] @ slope
        about = pull(omega) - np.einsum("tab,tb->ta", slope, omega)
        z = value - np.einsum("tab,tb->ta", root[..., 3:], about)
        try:
            path = engine.smooth(StateSpace(F, Q, H, np.eye(9), np.zeros(15), P0), z)
        except EstimationError:  # so far off that doubles do not hold it
            return None
        moved = np.abs(path.x[:, :3] - omega)
        omega, cov = path.x[:, :3], path.P[:, :6, :6]
        if not np.isfinite(omega).all():
            return None
        if (moved <= TENTH * np.sqrt(np.diagonal(cov, axis1=1, axis2=2)[:, :3])).all():
            left = z - np.einsum("tab,tb->ta", H, path.x)
            return Turning(omega, path.x[:, 3:6], cov, float((left**2).sum()) / max(dof, 1.0))
    return None
