"""Force and moment as second derivatives of what is plainly seen: the mass center and the turn of a body.

Where all mass is seen, by markers or as a measured mean motion, nothing is modeled: the mass center is the
mass-weighted mean, and the angular momentum is that of the nodes, however the body deforms. Elsewhere the
mass center is the combination of markers that no affine motion takes off it, or that of a rigid fit, and the
angular momentum that of the fit. Gaps of a marker are bridged by straight lines beside the other ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from forceid.estimation.body.inertia import Inertia, inertia_of
from forceid.estimation.body.kinematics import rotations
from forceid.estimation.body.rotors import momentum_inside
from forceid.estimation.body.thin_mass import SLENDER, thinned
from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.loads.channels import angular_channel
from forceid.estimation.loads.plain_cut import shows_motion, spectrum_of
from forceid.estimation.verdict.finding import FEW, SCATTERED
from forceid.motion import body_axes, fit_rotation, pose_rank, seen_together
from forceid.principal import axial, summation_operator
from forceid.records import Array, Body, Flags, Indices, Motion, all_finite
from forceid.rounding import SOLVED

LOUDER = 4.0  # in variance: what a mass center that deformation leaves alone may cost beside a rigid one


@dataclass(frozen=True)
class PlainChannel:
    """What a load drives: z (sample, 3) at times (sample,), of which the load is the second derivative.

    frame (sample,): which frame of the recording each sample is; whole (sample,): nothing was bridged there.
    residual (sample, column) m: what an affine motion leaves of the markers where z takes it for granted, no
    columns where it does not, of which the part `free` is not fitted; lever: change of z by one marker that
    is off. corner (3,) Hz: below it the noise of z adds up, as that of a turn does in a spin. summed: whether
    z adds up from frame to frame what a gap loses.
    """

    time: Array
    z: Array
    frame: Indices
    whole: Flags
    residual: Array
    free: float = 1.0
    lever: float = 0.0
    corner: Array = field(default_factory=lambda: np.zeros(3))
    summed: bool = False

    @property
    def lost(self) -> Indices:
        """Frames (sample,) before each sample that what z adds up lacks."""
        return self.frame - np.arange(len(self.frame)) if self.summed else np.zeros(len(self.frame), int)


class PlainRoute(NamedTuple):
    """Channels of force N s2 and of moment N m s2, None where the recording does not show them plainly."""

    force: PlainChannel | None = None
    moment: PlainChannel | None = None


def plain_route(body: Body, motion: Motion, deforms: bool = False) -> PlainRoute:
    """The channels of a recording of markers, those filled in left out, or of a mean motion.

    deforms: whether the body is known to, which its markers may hardly show. Source: principal equations 2.4.
    """
    inertia = inertia_of(body)
    thin = thinned(inertia, np.zeros((1, 3)) if body.position is None else body.position - inertia.center)
    if thin.on_line or thin.point:  # what of its moment is open needs no witness: H is that of a line
        inertia = replace(inertia, tensor=np.full((3, 3), np.nan))
    inside = momentum_inside(body, motion)
    if (measured := motion.measured) is not None and body.position is not None:
        return of_markers(inertia, body.position - inertia.center, motion, measured, inside, deforms)
    if motion.center is not None:
        return of_mean_motion(inertia, motion, motion.center, inside)
    return PlainRoute()


def of_markers(
    inertia: Inertia, X: Array, motion: Motion, x: Array, inside: Array, deforms: bool
) -> PlainRoute:
    """Channels of marker tracks x (time, node, 3); X (node, 3) m, reference shape about the mass center.

    inside ([time,] 3): angular momentum of what turns in the body, reference axes. A rigid fit is a part of
    them only where it leaves nothing of the markers that moves.
    """
    ever = all_finite(x).any(0)
    x, X, mass = x[:, ever], X[ever], inertia.weight[ever]
    whole = np.asarray(np.isfinite(x).all((1, 2)))
    rigid, rotation = rigid_fits(x, X)
    x = interpolated_tracks(motion.time, x, X, rotation)
    if not whole.all():
        rigid = rigid_fits(x, X)[0]
    in_body = body_axes(x, rigid, rotation).reshape(len(x), -1)
    seen = np.isfinite(in_body).all(1)
    bends = deforms or (seen.sum() >= FEW and shows_motion(spectrum_of(motion.time[seen], in_body[seen])))
    summed = inertia.weight.sum() > 0 and mass.sum() > (1 - SOLVED) * inertia.weight.sum()
    force = None
    if summed:
        center = np.einsum("n,tna->ta", mass / mass.sum(), x)
        force = channel(motion, inertia.mass, center, whole)
    elif (shares := affine_shares(X)) is not None:
        force = channel(motion, inertia.mass, np.einsum("n,tna->ta", shares, x), whole)
        if force is not None:
            lever = inertia.mass * float(np.linalg.norm(shares))
            U, s, _ = np.linalg.svd(np.column_stack([np.ones(len(X)), X]), full_matrices=False)
            U = U[:, s > SOLVED * s[0]]
            left = (x - np.einsum("nk,mk,tma->tna", U, U, x, optimize=True)).reshape(len(x), -1)
            free = 1 - U.shape[1] / len(X)
            force = replace(force, residual=left[force.frame], free=free, lever=lever)
    elif not bends:
        force = channel(motion, inertia.mass, rigid, whole)
    if not np.isfinite(inertia.tensor).all():
        return PlainRoute(force)
    J, h = np.broadcast_to(inertia.tensor, rotation.shape), np.broadcast_to(inside, (len(x), 3)).copy()
    if summed and inertia.nodal is not None and inertia.nodal.ndim == 1:
        J, momentum = inertia_and_momentum(motion.time, body_axes(x, center, rotation), mass)
        if bends:
            own = plain_moment_channel(motion, rotation, whole, J, momentum + inside)
            return PlainRoute(force, own if whole.mean() > 1 - SCATTERED else None)
        known = np.asarray(np.isfinite(J).all((1, 2)))
        J = np.broadcast_to(J[known].mean(0) if known.any() else inertia.tensor, rotation.shape)
    return PlainRoute(force, None if bends else plain_moment_channel(motion, rotation, whole, J, h))


def of_mean_motion(inertia: Inertia, motion: Motion, center: Array, inside: Array) -> PlainRoute:
    """Channels of a measured mass center (time, 3), and of the orientation where it was measured."""
    whole, T = np.asarray(np.isfinite(center).all(1)), len(center)
    force = channel(motion, inertia.mass, center, whole)
    if motion.orientation is None:
        return PlainRoute(force)
    R = rotations(motion.orientation)
    read = np.asarray(np.isfinite(R).all((1, 2)))
    J = np.broadcast_to(inertia.tensor, R.shape)
    return PlainRoute(force, plain_moment_channel(motion, R, read, J, np.broadcast_to(inside, (T, 3)).copy()))


def channel(motion: Motion, mass: float, center: Array, whole: Flags) -> PlainChannel | None:
    """The channel of the force: mass times the mass center (time, 3) with the fall taken out."""
    t = motion.time - motion.time[0]
    return seen_of(motion.time, mass * (center - 0.5 * t[:, None] ** 2 * motion.gravity), whole)


def plain_moment_channel(
    motion: Motion, rotation: Array, whole: Flags, inertia: Array, h: Array
) -> PlainChannel | None:
    """The channel of the moment: the integral of J omega + h, of inertia (time, 3, 3) and h (time, 3).

    None where few rotations (time, 3, 3) are seen, or where J is not known or near singular.
    """
    seen = np.asarray(np.isfinite(rotation).all((1, 2)) & np.isfinite(inertia).all((1, 2)))
    if seen.sum() < FEW:
        return None
    principal = np.linalg.eigvalsh(inertia[seen].mean(0))
    if principal[0] < SLENDER**2 * principal[-1]:
        return None
    rotation = np.where(seen[:, None, None], rotation, np.nan)
    alike = np.broadcast_to(np.eye(3), rotation.shape)  # errors of the turn about all axes
    known = None if motion.known is None else motion.known.turned
    turned = angular_channel(motion.time, rotation, alike, inertia, h, known)
    z = np.full((len(rotation), 3), np.nan)
    z[seen] = turned.z
    found = seen_of(motion.time, z, whole)
    white = np.diagonal(turned.noise_cov, axis1=1, axis2=2).mean(0) * np.median(np.diff(turned.time))
    corner = np.sqrt(np.diagonal(turned.drift).clip(0) / white) / (2 * np.pi)
    return None if found is None else replace(found, corner=corner, summed=True)


def seen_of(time: Array, z: Array, whole: Flags) -> PlainChannel | None:
    """A channel of those frames that show z (time, 3); None where they are few."""
    frame = np.flatnonzero(np.isfinite(z).all(1))
    if len(frame) < FEW:
        return None
    return PlainChannel(time[frame], z[frame], frame, whole[frame], np.zeros((len(frame), 0)))


def inertia_and_momentum(time: Array, b: Array, mass: Array) -> tuple[Array, Array]:
    """Inertia (time, 3, 3) of nodes b (time, node, 3) about their mass center, and h = sum m b x b'.

    NaN in frames where a node is not known.
    """
    J, h = np.full((len(b), 3, 3), np.nan), np.full((len(b), 3), np.nan)
    known = np.asarray(np.isfinite(b).all((1, 2)))
    if known.sum() > 1:
        b, time = b[known], time[known]
        square = (b.mT * mass) @ b
        J[known] = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
        h[known] = axial((b.mT * mass) @ np.gradient(b, time, axis=0))
    return J, h


def rigid_fits(x: Array, X: Array) -> tuple[Array, Array]:
    """Place of the mass center (time, 3) and rotation (time, 3, 3) of a rigid fit of X (node, 3), all alike.

    To the markers x (time, node, 3) that are seen, NaN where they do not fix it.
    """
    center, R = fit_rotation(x, X, np.ones(len(X)))
    patterns, which = seen_together(x)
    S = summation_operator(X).reshape(len(X), 3, 6)
    fixed = np.array([p.sum() > 2 and pose_rank(S[p].reshape(-1, 6)) == 6 for p in patterns])
    kept = fixed[which]
    return np.where(kept[:, None], center, np.nan), np.where(kept[:, None, None], R, np.nan)


def interpolated_tracks(time: Array, x: Array, X: Array, rotation: Array) -> Array:
    """Tracks (time, node, 3) with straight lines in their gaps, beside where the other markers put them."""
    if np.isfinite(x).all():
        return x
    beside = all_finite(x)
    w = beside / np.maximum(beside.sum(1, keepdims=True), 1)
    place = np.where(beside[..., None], x, 0.0)
    turned = np.einsum("tab,nb->tna", rotation, X)
    carried = turned + np.einsum("tn,tna->ta", w, place - np.where(beside[..., None], turned, 0.0))[:, None]
    off = np.einsum("tba,tnb->tna", rotation, x - carried)
    out, fixed = x.copy(), np.asarray(np.isfinite(rotation).all((1, 2)))
    for k in np.flatnonzero(~beside.all(0)):
        known, gone = beside[:, k] & fixed, ~beside[:, k] & fixed
        if known.any():
            line = straight(time[gone], time[known], off[known, k])
            out[gone, k] = carried[gone, k] + np.einsum("tab,tb->ta", rotation[gone], line)
    return out


def affine_shares(X: Array) -> Array | None:
    """Shares (node,) whose sum of markers is the mass center under any affine motion; None where it is noisy.

    X (node, 3) m about the mass center. None as well where the markers do not span it.

    >>> affine_shares(np.array([[1.0, 0, 0], [-1, 1, 0], [-1, -1, 0]])).round(9).tolist()
    [0.5, 0.25, 0.25]
    """
    span = np.vstack([X.T, np.ones(len(X))])
    target = np.array([0.0, 0.0, 0.0, 1.0])
    shares = np.linalg.pinv(span) @ target
    if not np.allclose(span @ shares, target, atol=SOLVED):
        return None
    S = summation_operator(X)
    rigid = np.trace(np.linalg.pinv(S.T @ S)[:3, :3]) / 3
    return np.asarray(shares) if shares @ shares < LOUDER * rigid else None
