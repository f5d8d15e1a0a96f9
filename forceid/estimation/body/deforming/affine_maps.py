"""What the shapes of a level do to a body as affine maps: x = c + R G X, G = G_0 + sum q_k G_k.

Exact for an affine level; of other shapes it is the map that fits them best. Source: pseudo-rigid bodies,
section 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.body.affine_fit import spanned_directions
from forceid.estimation.body.inertia import second_moment
from forceid.estimation.body.kinematics import Kinematics
from forceid.records import Array
from forceid.rounding import SINGLE


@dataclass(frozen=True)
class AffineShapes:
    """What the shapes of an affine level do to a body: G = still + sum q_k by_amplitude[k], body axes.

    still (3, 3), by_amplitude (mode, 3, 3): of the reference shape; along span (3, r), orthonormal reference
    directions in which its markers spread, zero across; second_moment E (3, 3) kg m2; off: whether the mass
    center lies off the plane of the markers.
    """

    still: Array
    by_amplitude: Array
    span: Array
    second_moment: Array
    off: bool

    @property
    def plane(self) -> bool:
        """Whether the markers leave a direction open, so that F is not known along it."""
        return bool(self.span.shape[1] < 3)

    @property
    def whole(self) -> bool:
        """Whether all mass has its arms where F is known, so that all first moments are."""
        E, across = self.second_moment, np.eye(3) - self.span @ self.span.T
        return bool(np.linalg.norm(across @ E) <= SINGLE * np.linalg.norm(E))

    @property
    def breadth(self) -> bool:
        """Whether mass lies off any plane."""
        size = np.linalg.eigvalsh(self.second_moment)
        return bool(size[0] > SINGLE**2 * size[-1])

    def of(self, q: Array) -> Array:
        """The sum of q_k G_k (time, 3, 3) of amplitudes or their rates q (time, mode)."""
        return np.asarray(np.einsum("tk,kab->tab", q, self.by_amplitude))


def affine_shapes_of(kin: Kinematics) -> AffineShapes:
    """The shapes of an affine level, by what they make of the places of the markers in the reference."""
    assert kin.markers is not None
    X = kin.markers.X[kin.seen]
    span, off = spanned_directions(X)
    back = span @ np.linalg.pinv((X - X.mean(0)) @ span)
    shapes = np.concatenate([kin.shape[None], kin.shapes])[:, kin.seen]
    maps = np.einsum("an,knb->kba", back, shapes - shapes.mean(1, keepdims=True))
    return AffineShapes(maps[0], maps[1:], span, second_moment(kin.inertia.tensor), off)
