"""A filter that tells its output a lag behind: one frame after the other, what it has told is not kept.

Beside the state of the filter stand the frames that are pending: the output at each, as known so far, and its
covariance with the error of the state now. Every later frame moves them by that, as it moves the state, so
that each is at all times the smoother's with all frames so far. Covariances may change with every frame.
Source: Anderson and Moore (1979) 7.3, fixed-point smoothing. Compiled where a compiler was; the two are
written apart and compared.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from forceid.compiled import engine as compiled
from forceid.records import Array

OBSERVED = slice(0, 3)  # states that a frame shows
NO_FRAME = np.zeros(0)  # that it shows nothing
UNSEEN = np.zeros((0, 3))  # gain of a frame that shows nothing
EACH = np.ones(3)  # sums over what a frame shows


class Course(NamedTuple):
    """A filter behind a frame: state x (state,), with P (state, state), its covariance before that frame.

    gain (state, 3) and noise R (3, 3) of the frame, `UNSEEN` where it showed nothing. Of what is pending, the
    output y (3 frame,), C (3 frame, state) its covariance with the error of the state before the frame, and
    var (3 frame,) its variance.
    """

    x: Array
    P: Array
    gain: Array
    R: Array
    y: Array
    C: Array
    var: Array


def begun(x: Array, P: Array) -> Course:
    """A filter before its first frame, which `followed` takes with F = 1 and Q = 0."""
    n = len(x)
    return Course(x, P, UNSEEN, np.zeros((3, 3)), np.zeros(0), np.zeros((0, n)), np.zeros(0))


def followed(
    course: Course, x: Array, F: Array, Q: Array, rows: Array, z: Array, R: Array, most: float = np.inf
) -> tuple[Course, float]:
    """The filter behind one frame more, and how far that is off: squared, in units of what is expected.

    x (state,): where the step leads, F and Q (state, state) its derivative and what it adds; rows (3, state)
    read the output; z (3,) with noise R (3, 3): the first three states as the frame shows them, `NO_FRAME`
    where it shows none; most: beyond which the frame is taken to show nothing.
    """
    if FOLLOW is None:
        return followed_in_numpy(course, x, F, Q, rows, z, R, most)
    *found, off = FOLLOW(
        course.P, course.gain, course.R, course.y, course.C, course.var, F, Q, x, rows, z, R, most
    )
    x, P, gain, y, C, var = found
    return Course(x, P, gain, R, y, C, var), off


def followed_in_numpy(
    course: Course, x: Array, F: Array, Q: Array, rows: Array, z: Array, R: Array, most: float = np.inf
) -> tuple[Course, float]:
    """`followed`, step for step."""
    if len(course.gain):
        through = F @ course.gain
        F = F.copy()
        F[:, OBSERVED] -= through
        Q = Q + through @ course.R @ through.T
    P = F @ course.P @ F.T + Q
    P = 0.5 * (P + P.T)
    own = rows @ P
    C = np.concatenate([course.C @ F.T, own])
    y = np.concatenate([course.y, rows @ x])
    var = np.concatenate([course.var, np.einsum("ij,ij->i", own, rows)])
    if not len(z):
        return Course(x, P, UNSEEN, R, y, C, var), 0.0
    PH = P[:, OBSERVED]
    inverse = np.linalg.inv(PH[OBSERVED] + R)
    nu = z - x[OBSERVED]
    weighed = inverse @ nu
    off = float(nu @ weighed)
    if not off < most:
        return Course(x, P, UNSEEN, R, y, C, var), off
    seen = C[:, OBSERVED]
    y += seen @ weighed
    var -= (seen @ inverse * seen) @ EACH
    return Course(x + PH @ weighed, P, PH @ inverse, R, y, C, var), off


FOLLOW: Any = getattr(compiled, "follow", None)  # None where nothing was compiled, or before it was there


def without_first(course: Course, frames: int) -> Course:
    """The filter without the frames that have been pending longest."""
    first = 3 * frames
    return course._replace(y=course.y[first:], C=course.C[first:], var=course.var[first:])
