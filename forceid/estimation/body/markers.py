"""What the tracks of markers show of a body before anyone says how it deforms: noise, mean shape, residuals.

The levels of a model differ only in what they make of the residuals, so all of them go on from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.errors import DataError
from forceid.estimation.body.deforming.gauge import well_held
from forceid.estimation.body.deforming.modes import (
    Modes,
    deflected_shape,
    elastic_modes,
    given_modes,
    mean_shape,
)
from forceid.estimation.body.inertia import Inertia, inertia_of
from forceid.estimation.body.mass_center import MassCenter, tracked_mass_center
from forceid.estimation.body.rotors import momentum_inside
from forceid.estimation.body.thin_mass import observed_rank, thinned
from forceid.estimation.body.tracks.noise_axes import floored, rms_noise
from forceid.estimation.body.tracks.rounding import grid_step
from forceid.motion import ReadingCov, body_axes, fit_rotation, noise_variance, pose_rank
from forceid.principal import summation_operator
from forceid.records import Array, Body, Flags, KnownPart, Motion, all_finite
from forceid.significance import WILD

ROUNDOFF = float(np.finfo(np.float32).eps)  # of the size of the motion: noise below this is not believed
SIZE = 3.0  # times the reference shape, or its third, that no body stretches to


@dataclass(frozen=True)
class MarkerSet:
    """Tracks (time, node, 3) m of a body, NaN where not seen, and what they show at every level alike.

    filled (time, node) m2: error variance of positions that bridge a gap, zero elsewhere; measured: the
    tracks without those; inertia: of the body as a whole, thin: as its mass on a line or a point allows; X
    (node, 3) m: the reference shape about the mass center; seen (node,): nodes that carry a marker; root
    (3, 3) m: of the covariance of the noise of a reading, world axes, stated: whether the user stated it;
    mean: the mass center where it is a mean of markers; oriented: whether they fix a rotation. Where they do:
    weight (node,): of the rotation fit, and gauge (node, 3) m: what it is fitted to, whose gauge is that of
    the residuals; modes: that the body brings; shape (node, 3) m: the mean shape; residual (time, node, 3)
    m, body axes, of the frames that show best. known: what known loads do along the motion; inside ([time,]
    3): angular momentum of what turns inside.
    """

    body: Body
    time: Array
    tracks: Array
    filled: Array
    measured: Array
    inertia: Inertia
    thin: Inertia
    X: Array
    seen: Flags
    root: Array
    stated: bool
    mean: MassCenter | None
    oriented: bool
    weight: Array
    modes: Modes | None
    shape: Array
    gauge: Array
    residual: Array
    known: KnownPart | None
    inside: Array

    @property
    def noise_std(self) -> float:
        """Standard deviation (m) of the noise of a coordinate, in the mean square over the axes."""
        return rms_noise(self.root)

    @cached_property
    def grid(self) -> float:
        """Step (m) of the grid that the coordinates are on, zero where they are on none."""
        return grid_step(self.tracks)

    @property
    def white(self) -> ReadingCov:
        """The covariance of that noise, alike along all axes."""
        return ReadingCov(np.full(self.X.size, self.noise_std**2), np.zeros((self.X.size, 0)))

    @property
    def period(self) -> float:
        """Frames in a period of the lowest mode of the body, 1 where none is known."""
        modes = self.modes
        if modes is None or modes.compliance is None or not modes.compliance.any():
            return 1.0
        longest = 2 * np.pi * np.sqrt(modes.compliance.max())
        return float(np.clip(longest / np.median(np.diff(self.time)), 1.0, len(self.time)))


def markers_of(body: Body, motion: Motion, noise: dict[str, Array], stated: bool) -> MarkerSet:
    """What the markers of a motion show at every level.

    noise: roots (3, 3) of covariances by variable; where it has none of "position", high-order differences
    show it. DataError: tracks that are not of the size of the reference shape.
    """
    x, inertia = motion.position, inertia_of(body)
    assert x is not None
    assert body.position is not None
    X = body.position - inertia.center
    check_scale(x, X)
    seen = np.any(all_finite(x), axis=0)
    filled = np.zeros(x.shape[:2]) if motion.bridged is None else np.nan_to_num(motion.bridged)
    measured = np.where(filled[..., None] > 0, np.nan, x) if filled.any() else x
    # the better half of the frames tells the shapes: where half of them are whole, no bridge does
    best = (filled.sum(1) <= np.median(filled.sum(1)))[:, None, None]
    root = noise["position"] if "position" in noise else marker_noise(motion.time, measured) * np.eye(3)
    root = floored(root, ROUNDOFF * span_of(x))
    sigma, thin = rms_noise(root), thinned(inertia, X)
    mean = tracked_mass_center(motion, inertia, sigma**2)
    massive = seen & (inertia.weight > 0)
    weight = inertia.weight * seen if massive.any() and rank_of(X, massive) == 6 else seen.astype(float)
    oriented, modes, shape, gauge, residual = observed_rank(X, seen, sigma) == 6, None, X, X, x[:0]
    if oriented:
        modes = None if thin.on_line or thin.point else modes_of(body, inertia)
        var = np.where(best[..., 0], filled, 0.0).sum(0) / best.sum()
        told = x if best.all() else np.where(best, x, np.nan)
        shape = spinning_shape(motion.time, told, X, inertia, modes, weight, sigma, var)
        gauge = shape
        if modes is None and inertia.nodal is not None:  # shapes are found, and bend as far as the body does
            gauge, shape = gauge_and_mean(told, shape, weight)
        # in that gauge, before any marker's noise is weighed
        residual = body_axes(told, *fit_rotation(x, gauge, weight))
        residual -= shape
    return MarkerSet(
        body, motion.time, x, filled, measured, inertia, thin, X, seen, root, stated, mean, oriented, weight,
        modes, shape, gauge, residual, motion.known, momentum_inside(body, motion),
    )  # fmt: skip


def span_of(x: Array) -> float:
    """How far (m) readings (time, node, 3) reach along the axis along which they reach farthest."""
    known = x.reshape(-1, 3) if np.isfinite(x).all() else x[all_finite(x)]
    return max((float(np.ptp(along)) for along in known.T if len(along)), default=0.0)


def marker_noise(time: Array, x: Array) -> float:
    """Standard deviation (m) that high-order differences show, from the markers that are seen most."""
    frames = all_finite(x).sum(0)
    return float(np.sqrt(noise_variance(time, x[:, frames >= frames.max()].reshape(len(x), -1))))


def check_scale(x: Array, X: Array) -> None:
    """A DataError where marker tracks x (time, node, 3) are not of the size of the shape X (node, 3).

    A body may bend and stretch; three times its size is a unit that is not what it says.
    """
    seen: Flags = all_finite(x)
    moving = gyration_radius(x, seen)
    still = gyration_radius(np.broadcast_to(X, x.shape)[: 1 if seen.all() else None], seen)
    both = (moving > 0) & (still > 0)
    if not both.any():
        return
    ratio = float(np.median(moving[both] / np.broadcast_to(still, moving.shape)[both]))
    if not 1 / SIZE < ratio < SIZE:
        raise DataError(
            f"spans {ratio:.2g} times what the reference shape does (median of {both.sum()} frames), "
            "expected about the same",
            "/motion/position",
            "check the units of /motion/position and /body/position",
        )


def gyration_radius(x: Array, seen: Flags) -> Array:
    """Root mean square distance (time,) m of markers x (time, node, 3) from their mean, of those seen.

    >>> x = np.array([[[0.0, 0, 0], [0, 0, 2], [9, 9, 9]]])
    >>> gyration_radius(x, np.array([[True, True, False]])).tolist()
    [1.0]
    """
    seen = seen[: len(x)]
    count = np.maximum(seen.sum(1), 1)
    x = x if seen.all() else np.where(seen[..., None], x, 0.0)
    off = x - (x.sum(1) / count[:, None])[:, None]
    off = off if seen.all() else np.where(seen[..., None], off, 0.0)
    return np.asarray(np.sqrt(np.einsum("tna,tna->t", off, off) / count))


def rank_of(shape: Array, nodes: Flags) -> int:
    """Rank of the rigid-body modes that the named nodes see."""
    return pose_rank(summation_operator(shape[nodes])) if nodes.any() else 0


def spinning_shape(
    time: Array, x: Array, X: Array, inertia: Inertia, modes: Modes | None, weight: Array, sigma: float,
    bridged: Array,
) -> Array:  # fmt: skip
    """The mean shape, where the record shows that it is not the reference shape; else the reference.

    bridged (node,) m2: mean error variance of what bridges gaps, whose errors follow each other.
    """
    shape = mean_shape(x, X, weight)
    frames = all_finite(x).sum(0)
    error = np.sqrt(sigma**2 / frames.clip(1) + bridged)
    if not (np.abs(shape - X).max(1) > WILD * error).any():
        return X
    hidden = (inertia.weight > 0) & (frames == 0)
    if modes is None or inertia.nodal is None or not hidden.any():
        return shape
    return deflected_shape(time, x, X, modes, inertia.nodal, weight, sigma**2)


def gauge_and_mean(x: Array, shape: Array, weight: Array) -> tuple[Array, Array]:
    """What rotations are fitted to, and the mean shape, both (node, 3) m, of tracks x (time, node, 3) m."""
    gauge = well_held(x, shape, weight)
    if gauge is shape:
        return shape, shape
    center, R = fit_rotation(x, gauge, weight)
    mean, seen = shape.copy(), np.flatnonzero(all_finite(x).any(0))
    mean[seen] = np.nanmean(body_axes(x, center, R)[:, seen], axis=0)
    turn = fit_rotation(mean[None], shape, weight)[1][0]  # the axes stay those of the reference shape
    return gauge @ turn, mean @ turn


def modes_of(body: Body, inertia: Inertia) -> Modes | None:
    """The modes that a body brings with it, as shapes or as a stiffness."""
    nodal = inertia.nodal
    if body.position is None or nodal is None:
        return None if body.mode_shape is None else Modes(body.mode_shape)
    X = body.position - inertia.center
    if body.mode_shape is not None:
        return given_modes(body.mode_shape, body.mode_frequency, nodal, X)
    if body.stiffness is None or rank_of(X, inertia.weight > 0) < 6:  # masses on a line: no mass gauge
        return None
    return elastic_modes(nodal, body.stiffness, X)
