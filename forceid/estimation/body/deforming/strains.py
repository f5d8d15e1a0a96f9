"""The strains of an affine body: shapes E_k X with E_k symmetric, six in space, three in a plane.

Along the principal axes of the second moment of mass the kinetic energy of strain rates is a sum of squares,
and a shear of two of these axes goes by itself in any isotropic material. Its stretches go together: in
combinations whose momenta do not correlate along a record, which are the natural ones of a body that swings
(Feeny and Kappagantu, J. Sound Vib. 211 (1998) 607). So a prior for each amplitude alone is near the truth.
Source: principal equations 4g; pseudo-rigid bodies, sections 1 and 3.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.deforming.modes import fit_amplitudes, split_rigid
from forceid.estimation.body.inertia import second_moment
from forceid.estimation.body.markers import MarkerSet
from forceid.principal import summation_operator
from forceid.records import Array
from forceid.rounding import SINGLE


def strain_axes(points: Array, second_moment: Array | None = None) -> tuple[Array, Array]:
    """Axes (axis, 3) in which points (node, 3) spread, and the second moment (axis,) of mass along each.

    They are principal ones of second_moment (3, 3) within that space, of the points themselves where none is
    given. Points on a plane spread along two.
    """
    centered = points - points.mean(0)
    _, size, directions = np.linalg.svd(centered, full_matrices=False)
    spread = directions[size > SINGLE * size[0]]
    if second_moment is None:
        second_moment = centered.T @ centered
    moment, turn = np.linalg.eigh(spread @ second_moment @ spread.T)
    return turn.T @ spread, moment


def strain_shapes(shape: Array, axes: Array) -> Array:
    """Nodal patterns E_k X (strain, node, 3) of the strains along axes (axis, 3): stretches, then shears."""
    count = len(axes)
    pairs = [(i, i) for i in range(count)] + [(i, j) for i in range(count) for j in range(i)]
    strains = [0.5 * (np.outer(axes[i], axes[j]) + np.outer(axes[j], axes[i])) for i, j in pairs]
    return np.array([shape @ E for E in strains]).reshape(len(strains), *shape.shape)


def affine_shapes(markers: MarkerSet) -> Array:
    """Unit shapes (mode, node, 3) of an affine body in its gauge, each as near as may be to a natural mode.

    What strains, strains everywhere: masses without markers too, where the body is known by its masses.
    None where markers are too few for all of them.
    """
    inertia, shape, seen = markers.inertia, markers.shape, markers.seen
    none = np.zeros((0, *shape.shape))
    hidden = inertia.nodal is not None and bool((inertia.weight[~seen] > 0).any())
    second = second_moment(inertia.tensor)
    # of the reference, which may be flat: noise gives the mean shape a breadth
    spread = markers.X if hidden else markers.X[seen]
    axes, moment = strain_axes(spread, second if np.isfinite(second).all() else None)
    raw, gauge = strain_shapes(shape, axes), markers.weight
    if hidden and inertia.nodal is not None:
        gauge = inertia.nodal
    own = split_rigid(raw if hidden else raw * seen[:, None], shape, gauge)[1].reshape(len(raw), -1)
    if np.linalg.matrix_rank(own, tol=SINGLE * np.linalg.norm(own)) < len(own):
        return none
    stretches = slice(0, len(axes))
    unit = 1 / np.sqrt(np.maximum(moment, SINGLE * moment.max()))
    own[stretches] *= unit[:, None]  # of unit modal mass
    amplitude = amplitudes(markers, own)
    if not len(amplitude):
        return none
    noise = markers.noise_std**2 * np.linalg.inv(own @ own.T)
    correlation = np.cov(amplitude.T) - noise
    own[stretches] = np.linalg.eigh(correlation[stretches, stretches])[1].T @ own[stretches]
    return np.asarray(own / np.linalg.norm(own, axis=1)[:, None]).reshape(-1, *shape.shape)


def amplitudes(markers: MarkerSet, flat: Array) -> Array:
    """Amplitudes (frame, mode) of shapes (mode, dof) in the frames that fix all of them."""
    shapes = flat.reshape(-1, *markers.shape.shape)
    q = fit_amplitudes(markers.residual, shapes, summation_operator(markers.shape), markers.white)[0]
    return np.asarray(q[np.isfinite(q).all(1)])
