"""Where a joint is on a part that deforms, and what may move it there that no marker shows.

A shape moves the place of a joint as it moves the nodes around: an affine map fitted to their displacements,
each by the inverse square of its distance (moving least squares, Lancaster and Salkauskas 1981), exact at a
node and for affine shapes. What is left moves the joint on its parts as a process does that has an
acceleration, whose size and rate the record tells. Source: principal equations 2.8.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.methods.problem import Solution
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import block_diagonal, matern
from forceid.kalman.model import StateSpace
from forceid.motion import exp
from forceid.records import Array
from forceid.rounding import SINGLE

BENT_ORDER = 3  # of the process: the lowest that has an acceleration, as what has mass does


@dataclass(frozen=True)
class Bending:
    """What may move joints on their parts: std (row,) m and rad, zero for a row that holds; rate 1/s."""

    std: Array
    rate: float

    @property
    def rows(self) -> Array:
        """Rows (row, state) that read it out of its states; there are none for what holds."""
        moving = np.flatnonzero(self.std)
        found = np.zeros((len(self.std), BENT_ORDER * len(moving)))
        found[moving, BENT_ORDER * np.arange(len(moving))] = 1.0
        return found

    def moved(self, by: Array) -> Bending:
        """e^by[0] times as large, e^by[1] times as fast."""
        return replace(self, std=self.std * np.exp(by[0]), rate=self.rate * float(np.exp(by[1])))

    def model(self, step: Array) -> StateSpace:
        """Its states over steps (step,) s, which nothing measures by itself."""
        var = self.std[self.std > 0] ** 2
        one = matern(BENT_ORDER, 1.0, self.rate)
        unique, which = np.unique(np.round(step, 12), return_inverse=True)
        F, Q = (a[which] for a in discretize_steps(one, unique))
        n = BENT_ORDER * len(var)
        none = np.zeros((len(step), 0, 0))
        F, Q = block_diagonal(none, *[F] * len(var)), block_diagonal(none, *(v * Q for v in var))
        P0 = block_diagonal(*(v * one.P0 for v in var))
        return StateSpace(F, Q, np.zeros((0, n)), np.zeros((0, 0)), np.zeros(n), P0)


@dataclass(frozen=True)
class Carried:
    """A joint on a part: arm (time, 3) m from the mass center, turn (time, 3, 3) of its directions, body
    axes.
    """

    arm: Array
    turn: Array


def carried(joint: Joint, part: Part, solution: Solution | None, time: int) -> Carried:
    """Where a joint is on a part as its mean shape and its shapes carry it."""
    arm, turn = np.tile(joint.at - part.center, (time, 1)), np.tile(np.eye(3), (time, 1, 1))
    if solution is None:
        return Carried(arm, turn)
    kin, X = solution.kinematics, part.recording.body.position
    assert X is not None
    followed = kin.seen | kin.shapes.any(axis=(0, 2))
    fields = np.concatenate([(kin.shape - (X - part.center))[None], kin.shapes])[:, followed]
    place, gradient = affine_about(joint.at, X[followed], fields)
    amplitude = np.concatenate([np.ones((time, 1)), solution.deformation.amplitude], 1)
    skew = np.einsum("tk,kab->tab", amplitude, 0.5 * (gradient - gradient.mT))
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], 1)
    return Carried(arm + amplitude @ place, exp(axis))


def affine_about(at: Array, X: Array, fields: Array) -> tuple[Array, Array]:
    """Values (field, 3) and gradients (field, 3, 3) at a place (3,) of fields (field, node, 3) on nodes X
    (node, 3).
    """
    off = X - at
    length = float(np.sqrt((off**2).sum(1).mean()))
    near = np.maximum((off**2).sum(1), (SINGLE * length) ** 2) ** -0.5
    design = near[:, None] * np.concatenate([np.ones((len(X), 1)), off / length], 1)
    found = np.linalg.pinv(design / near.max(), rcond=SINGLE**2) @ (near[:, None] / near.max() * fields)
    return found[:, 0], found[:, 1:].mT / length
