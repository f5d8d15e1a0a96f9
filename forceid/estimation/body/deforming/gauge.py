"""The shape that rotations are fitted to, of bodies that bend so far that their mean shape hardly holds them.

A rotation fitted to a shape X turns a frame until sum m X x y = 0, y its nodes in the axes of the body.
That holds it by the stiffness K = sum m ((X . y) I - y X^T). Where a body bends until K loses rank, the
axes slip by half a turn within a few frames, and all amplitudes with them, though the body moves smoothly.
Which X is taken is a gauge: momentum and angular momentum are the same in each. So it may be one that holds
every frame well. Source: principal equations 2.5, 4b.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.motion import fit_rotation
from forceid.records import Array
from forceid.rounding import SOLVED
from forceid.significance import THOUSANDTH, WORSE


def well_held(position: Array, shape: Array, weight: Array) -> Array:
    """The shape X (node, 3) m that rotations of the frames are fitted to: the mean shape where that will do.

    position (time, node, 3) m, NaN where not seen; shape (node, 3) m: the mean shape; weight (node,).
    Another one where rotations would err more than WORSE times as much as if each frame were fitted to
    itself. By the mean square of variances: the spin of axes that slip goes as 1 / K, and what it asks of a
    moment as 1 / K^2.

    >>> bar = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> well_held(np.stack([bar, bar + 1.0]), bar, np.ones(4)) is bar
    True
    """
    held = weight > 0
    m, x = weight[held] / weight.sum(), position[np.isfinite(position[:, held]).all((1, 2))][:, held]
    x = x[:: -(-len(x) // CHANNEL_SAMPLES) or 1]
    own, rho = shape[held] - m @ shape[held], np.asarray(x - np.einsum("n,tna->ta", m, x)[:, None])
    spread = np.linalg.eigvalsh(moments(np.einsum("n,tna,tnb->tab", m, rho, rho)))
    tells = spread[:, 0] > SOLVED * spread[:, 2]  # on a line none is held
    rho, spread = rho[tells], spread[tells]
    if not len(rho):
        return shape
    least, size = (1 / spread).sum(1), float(np.sqrt(m @ (own**2).sum(1)))  # of variance: fitted to itself
    if slip(own / size, rho, m, least)[0] < np.log(WORSE**2):
        return shape

    def cost(X: Array) -> tuple[float, Array]:
        value, slope = slip(X.reshape(own.shape), rho, m, least)
        return value, slope.ravel()

    best = minimize(cost, (own / size).ravel(), jac=True, method="L-BFGS-B", tol=THOUSANDTH)
    out = shape.copy()
    out[held] = size * best.x.reshape(own.shape)
    return out


def moments(second: Array) -> Array:
    """Moments of inertia (..., 3, 3) of second moments alike."""
    return np.asarray(np.trace(second, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - second)


def slip(X: Array, rho: Array, m: Array, least: Array) -> tuple[float, Array]:
    """How far rotations fitted to X (node, 3) err beyond the least, and the slope (node, 3) of that.

    Log of the root mean square, over the frames, of the variance c = tr(K^-1 G K^-1) / least, G the moments
    of inertia of X. rho (time, node, 3): frames about their center; m (node,): shares of the mass; least
    (time,).
    """
    y = rho @ fit_rotation(rho, X, m)[1]
    G = moments(np.einsum("n,na,nb->ab", m, X, X))
    K = moments(np.einsum("n,tna,nb->tab", m, y, X))
    size, axes = np.linalg.eigh(0.5 * (K + K.mT))
    least_hold = SOLVED * np.abs(size).max(1, keepdims=True)  # of a frame that is mirrored to the last digit
    L = (axes / np.where(np.abs(size) > least_hold, size, least_hold)[:, None]) @ axes.mT
    c = np.einsum("tab,tba->t", L @ G, L) / least
    part = c / least / (c**2).sum()
    # a change of X changes G, and K in two ways: by itself, and as the fit turns y by K^-1 sum m dX x y
    W, Z = np.einsum("t,tab->ab", part, L @ L), part[:, None, None] * (L @ L @ G @ L)
    turned = np.einsum("n,tna->ta", m, np.cross(y, np.einsum("tab,nb->tna", Z, X)))
    by_turn = np.cross(y, np.einsum("tab,tb->ta", L, turned)[:, None]).sum(0)
    by_K = np.einsum("taa,tnb->nb", Z, y) - np.einsum("tab,tna->nb", Z, y) + by_turn
    slope = 2 * m[:, None] * (np.trace(W) * X - X @ W - by_K)
    return 0.5 * float(np.log((c**2).mean())), slope
