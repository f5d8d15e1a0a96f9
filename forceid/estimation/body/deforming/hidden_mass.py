"""What mass without markers may do beside the markers, as shapes of its own that no marker sees.

Where markers deform and nobody says how the rest of the body follows, its mass may move as far as they do,
in a way that no marker shows. Only six numbers of that motion matter, its momentum and angular momentum: so
six shapes stand for it, of nodes that move as independently as markers do. They do so about a rigid motion
that nobody sees: the one fitted to the markers is off by what these deform, and a node far out by a multiple
of it. A body known as a whole has its mass at four nodes without markers, which make its mass, center and
inertia. Modes of a body move all of its mass at once: so these shapes follow the modes that markers show, by
constant weights that nobody knows, and the motion of the whole tells of them what it can.
Source: theory of one model, section 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.body.inertia import moments_of_whole
from forceid.estimation.body.markers import MarkerSet
from forceid.estimation.body.tetrahedron import tetrahedron
from forceid.flight.modes import Followers
from forceid.flight.vibration import Vibration
from forceid.motion import Frames, Products, inertia_products
from forceid.principal import summation_operator
from forceid.records import Array, Flags
from forceid.rounding import SINGLE
from forceid.significance import TENTH


@dataclass(frozen=True)
class HiddenMass:
    """Shapes (mode, node, 3) of mass without markers, each for one standard deviation of a marker by itself.

    mass (node,) kg or (dof, dof) of nodes at shape (node, 3) m: those of the body, and four more where it is
    known as a whole. leak (6, mode): the rigid motion that a shape gives what carries markers, m and rad;
    freedom: coordinates of markers beside the rigid motion.
    """

    mass: Array
    shape: Array
    shapes: Array
    leak: Array
    freedom: int

    def products(self, shapes: Array) -> Products:
        """What amplitudes of shapes (mode, node, 3) of the body, and then of these, do to the inertia."""
        more = len(self.shape) - shapes.shape[1]
        told = np.pad(shapes, ((0, 0), (0, more), (0, 0)))
        return inertia_products(self.mass, self.shape, np.concatenate([told, self.shapes]))

    def beside(self, frames: Frames) -> Frames:
        """What frames say of the shapes that markers show and of these, which only move their poses."""
        turn = np.zeros((len(frames.rotation), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = np.nan_to_num(frames.rotation)
        return replace(frames, leak=np.concatenate([frames.leak, turn @ self.leak], 2))

    def carried(self, position: Array) -> tuple[Array, Array]:
        """Displacement and tilt (point, mode, 3) that the shapes give points (point, 3) among the markers."""
        moved = (summation_operator(position) @ self.leak).reshape(len(position), 3, -1).swapaxes(1, 2)
        return np.asarray(moved), np.tile(self.leak[3:].T, (len(position), 1, 1))

    def followers(self, told: Vibration) -> Followers:
        """These shapes as they follow the modes that markers show, those that take next to no force left out.

        A marker by itself moves by what all modes do, shared among the coordinates that are free.
        """
        hasty = (told.std * told.frequency**2) ** 2
        ascending = np.argsort(hasty)
        leaders = ascending[np.cumsum(hasty[ascending]) > TENTH**2 * hasty.sum()]
        return Followers(len(self.shapes), np.sort(leaders), float(self.freedom**-0.5))


def hidden_mass(markers: MarkerSet) -> HiddenMass | None:
    """Shapes of the mass that carries no marker; None where all mass does, or its inertia is not known."""
    inertia = markers.thin
    if inertia.point or inertia.line is not None or not np.isfinite(inertia.tensor).all():
        return None
    mass, shape, unseen, spread = inertia.nodal, markers.shape, ~markers.seen, 1.0
    if mass is None:
        spread = min(1.0, 2 / np.sqrt(markers.seen.sum()))  # as if spread over as many nodes as carry markers
        corners = tetrahedron(moments_of_whole(inertia.mass, inertia.tensor))
        mass = np.append(np.zeros(len(shape)), np.full(4, inertia.mass / 4))
        shape = np.concatenate([shape, corners])
        unseen = np.ones(len(shape), bool)
    weight = mass if mass.ndim == 1 else np.abs(mass).reshape(len(mass) // 3, 3, -1).sum((1, 2))
    free: Flags = np.repeat(unseen & (weight > 0), 3)
    if not free.any():
        return None
    rigid = summation_operator(shape)
    momentum = rigid.T * np.repeat(mass, 3) if mass.ndim == 1 else rigid.T @ mass
    scale = np.sqrt(np.repeat([inertia.mass, np.trace(inertia.tensor) / 2], 3))
    # each node by itself, and all of them as the rigid motion that is fitted is off
    fitted = rigid[free] @ of_fit(markers)
    moved = np.concatenate([spread * momentum[:, free], momentum[:, free] @ fitted], 1)
    _, size, axes = np.linalg.svd(moved / scale[:, None], full_matrices=False)
    axes = axes[size > SINGLE * size[0]]
    raw = np.zeros((len(axes), len(free)))
    raw[:, free] = spread * axes[:, :-6] + axes[:, -6:] @ fitted.T
    raw = raw.reshape(len(axes), *shape.shape)
    alpha, shapes = split_rigid(raw, shape, mass)
    return HiddenMass(mass, shape, shapes, -alpha.T, 3 * int(markers.seen.sum()) - 6)


def of_fit(markers: MarkerSet) -> Array:
    """Root (6, 6) of the covariance of a rigid motion fitted to independent markers of unit variance."""
    seen = markers.seen
    S, weight = summation_operator(markers.shape[seen]), np.repeat(markers.weight[seen], 3)
    fit = np.linalg.solve(S.T * weight @ S, S.T * weight)
    return np.asarray(np.linalg.qr(fit.T)[1].T)
