r"""A law fitted to flights: the one under which they fly again nearest to what was seen.

Errors of a smoothed wrench hang together over time, through the prior that smoothed it: taken one by one they
would promise far too much, and they are drawn to the prior. Both are avoided where the information came from.
Be z the poses of the frames, x0 the start of a flight and c the coefficients. The smoothed wrench is W = K z,
and its covariance over all times (D^T R^-1 D + Q^-1)^-1, of which Q^-1 is the prior and D^T R^-1 D what was
measured: D takes a wrench to poses, by twice integrating, and R is the covariance of the poses. A law W(c)
takes the place of the prior, and what is left of the likelihood is

    -2 log p(z | x0, c) = sum over frames of r^T R^-1 r,    r = pose seen - pose flown from x0 under c,

which is the likelihood of the wrench with its whole covariance over time, the prior taken out, and no longer
to first order. The air, the angles and the rates that the law goes by are those of the flight itself, so that
they hold no errors of their own (errors in variables, as the path is estimated along with c). It is minimized
by Gauss-Newton with damping (Levenberg and Marquardt), slopes by differences of flights. Source: principal
equations 2.4, 4b; Jategaonkar, Flight Vehicle System Identification, 4 (output error).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.errors import EstimationError
from forceid.laws.flying import Course, Path, fly
from forceid.laws.law import Law
from forceid.motion import log
from forceid.records import Array, Flags
from forceid.rounding import ITERATIONS
from forceid.significance import TENTH

START = 12  # numbers that a flight begins with
SLOPE_STEP = 0.3  # standard deviations that slopes by differences step: above rounding, within a parabola
MOST_SUBSTEPS = 64  # between two samples: more are asked for by flights that leave all bounds alone
FIRST_DAMPING = 0.0  # of the diagonal, to begin with: the smoothed wrench gives a good beginning
DAMPING_DOWN, DAMPING_UP = (
    4.0,
    8.0,
)  # factors by which a good step eases the damping, and a bad one adds to it
LEAST_DAMPING = 1e-4  # damping below which there is none
HOPELESS = 1e9  # times the diagonal: damping at which nothing moves any more
SETTLES = 1e-3  # of chi-square for each coefficient: moves it by a thirtieth of its deviation at most


@dataclass(frozen=True)
class Fit:
    """A law at its best: value (term,), start (flight, 12), cov (term, term) for poses with their errors.

    residual: of each flight (frame, 6), in standard deviations; slopes (frame, 6, 12 + term) of it; square:
    sum of squares of all; count: of the numbers seen.
    """

    law: Law
    value: Array
    start: Array
    cov: Array
    residual: tuple[Array, ...]
    slopes: tuple[Array, ...]
    square: float
    count: int

    @property
    def freedoms(self) -> int:
        """Numbers seen less numbers found."""
        return self.count - START * len(self.start) - len(self.value)


def paced(course: Course, law: Law, value: Array) -> Course:
    """The course with as many substeps as its flight under the law takes to be exact for its errors: first
    near the ground, then elsewhere.
    """
    course = replace(course, substeps=np.ones_like(course.substeps))
    path = fly(course, law, course.start[None], value[None])
    for part in (course.near, ~course.near):
        while part.any() and course.substeps[part].max() < MOST_SUBSTEPS:
            finer = replace(course, substeps=np.where(part, 2 * course.substeps, course.substeps))
            trial = fly(finer, law, course.start[None], value[None])
            apart = np.abs(residual(course, path) - residual(course, trial)).max()
            if apart < TENTH:
                break
            course, path = finer, trial
    return course


def residual(course: Course, path: Path) -> Array:
    """What was seen less what was flown (frame, 6, flight), in standard deviations; 0 where nothing was."""
    n = len(path.center)
    off = np.zeros((n, 6, path.center.shape[1]))
    off[:, :3] = np.swapaxes(course.center[:, None] - path.center, 1, 2)
    if course.turns:
        turn = course.rotation[:, None] @ np.swapaxes(path.rotation, 2, 3)
        good = np.isfinite(turn).all((2, 3))
        left = np.full((*good.shape, 3), np.nan)
        left[good] = log(turn[good]) if good.any() else left[good]
        off[:, 3:] = np.swapaxes(left, 1, 2)
    unseen: Flags = np.asarray(~np.isfinite(course.root).all((1, 2)))
    white = np.einsum("tij,tjf->tif", np.where(unseen[:, None, None], 0.0, course.root), off)
    white[unseen] = 0.0
    return np.asarray(white)


def count_of(course: Course) -> int:
    """Numbers that were seen of a course."""
    return int(np.isfinite(course.root).all((1, 2)).sum()) * (6 if course.turns else 3)


@dataclass(frozen=True)
class Linear:
    """The residual of a course about some numbers, and its slopes."""

    residual: Array
    slopes: Array


def linearized(course: Course, law: Law, start: Array, value: Array, step: Array) -> Linear:
    """The residual (frame, 6) of a flight and its slopes (frame, 6, 12 + term), by differences of steps."""
    at = np.concatenate([start, value])
    trial = np.concatenate([at[None], at + np.diag(step)])
    path = fly(course, law, trial[:, :START], trial[:, START:])
    white = residual(course, path)
    slopes = (white[..., 1:] - white[..., :1]) / step
    if not course.turns:
        slopes[..., 6:START] = 0.0
    return Linear(white[..., 0], slopes)


def start_steps(course: Course) -> Array:
    """Steps (12,) of a start that move the poses by SLOPE_STEP of their deviation."""
    seen = np.isfinite(course.root).all((1, 2))
    scale = np.diagonal(course.root[seen], axis1=1, axis2=2).mean(0)
    std = np.where(scale > 0, 1 / np.where(scale > 0, scale, 1.0), 1.0)
    span = max(float(course.time[-1]), 1e-9)
    return SLOPE_STEP * np.concatenate([std[:3], std[:3] / span, std[3:], std[3:] / span])


def solved(parts: Sequence[Linear], damping: float) -> tuple[list[Array], Array, Array]:
    """Moves of every start and of the coefficients that shrink the residuals, and the covariance of the last.

    The starts are eliminated, flight by flight.
    """
    k = parts[0].slopes.shape[2] - START
    shared, right, kept = np.zeros((k, k)), np.zeros(k), []
    for part in parts:
        J, r = part.slopes.reshape(-1, START + k), part.residual.ravel()
        N, g = J.T @ J, -J.T @ r
        size = np.sqrt(np.maximum(np.diag(N), 1e-300))
        A = N[:START, :START] / np.outer(size[:START], size[:START]) + (damping + 1e-12) * np.eye(START)
        B, gs = N[:START, START:] / size[:START, None], g[:START] / size[:START]
        X = np.linalg.solve(A, np.column_stack([B, gs]))
        shared += N[START:, START:] - B.T @ X[:, :-1]
        right += g[START:] - B.T @ X[:, -1]
        kept.append((X, size[:START]))
    if not k:
        return [X[:, -1] / size for X, size in kept], np.zeros(0), np.zeros((0, 0))
    size = np.sqrt(np.maximum(np.diag(shared), 1e-300))
    scaled = shared / np.outer(size, size)
    move = np.linalg.solve(scaled + (damping + 1e-12) * np.eye(k), right / size) / size
    with np.errstate(over="ignore"):  # infinite where nothing is told
        cov = np.linalg.inv(scaled + 1e-12 * np.eye(k)) / np.outer(size, size)
    return [(X[:, -1] - X[:, :-1] @ move) / s for X, s in kept], move, cov


def fit(courses: Sequence[Course], law: Law, start: Array, value: Array, spread: Array) -> Fit:
    """The law at its best for all courses at once, from a start (flight, 12) and coefficients (term,) near.

    spread (term,): of the coefficients, about. EstimationError: it does not settle.
    """
    start, value, parts, cov = settled(courses, law, start, value, SLOPE_STEP * spread)
    rest, slopes = (tuple(getattr(p, n) for p in parts) for n in ("residual", "slopes"))
    square = float(sum((r**2).sum() for r in rest))
    return Fit(law, value, start, cov, rest, slopes, square, sum(count_of(c) for c in courses))


def settled(
    courses: Sequence[Course], law: Law, start: Array, value: Array, step: Array
) -> tuple[Array, Array, list[Linear], Array]:
    """Starts and coefficients at rest, the flights about them, and the covariance of the coefficients."""
    own = [start_steps(c) for c in courses]

    def about(start: Array, value: Array) -> list[Linear]:
        each = zip(courses, start, own, strict=True)
        return [linearized(c, law, s, value, np.concatenate([o, step])) for c, s, o in each]

    damping, parts = FIRST_DAMPING, about(start, value)
    best = squares(parts)
    if not np.isfinite(best):
        what = "does not fly: it leaves all bounds under the law"
        raise EstimationError(
            what, courses[0].name, "leave out terms that may hold it, or shorten the record"
        )
    for _ in range(ITERATIONS):
        moves, move, _ = solved(parts, damping)
        trial = start + np.stack(moves), value + move
        expected = foreseen(parts, *solved(parts, 0.0)[:2])
        found = about(*trial)
        gain = best - squares(found)
        if gain > 0:
            (start, value), parts, best = trial, found, best - gain
        if min(abs(gain), expected) < SETTLES * max(1, len(value)):
            return start, value, parts, solved(parts, 0.0)[2]
        if gain > 0:
            damping = damping / DAMPING_DOWN if damping > LEAST_DAMPING else 0.0
        else:
            damping = max(damping, LEAST_DAMPING) * DAMPING_UP
        if damping > HOPELESS:
            break
    what = "does not settle under the law"
    raise EstimationError(what, courses[0].name, "leave out terms that its motion does not tell apart")


def foreseen(parts: Sequence[Linear], moves: Sequence[Array], move: Array) -> float:
    """How far the sum of squares would fall by moves of starts and coefficients, were all as straight."""
    after = [p.residual + p.slopes @ np.concatenate([own, move]) for p, own in zip(parts, moves, strict=True)]
    return float(sum((p.residual**2).sum() - (r**2).sum() for p, r in zip(parts, after, strict=True)))


def squares(parts: Sequence[Linear]) -> float:
    """Sum of squares of the residuals; infinite where a flight or its slopes leave all bounds."""
    total = sum(float((p.residual**2).sum() + 0.0 * p.slopes.sum()) for p in parts)
    return total if np.isfinite(total) else np.inf
