"""The channels of an affine motion that loads drive, as far as markers and mass show them.

m c'' = f + m g and (F E)'' = K, with the second moment E. Markers in a plane show F in that plane only, and
so K v where E v lies in it; a body without breadth across has no arm there: K v = 0. Source: pseudo-rigid
bodies, section 1; principal equations 4e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline
from scipy.linalg import null_space, qr

from forceid.config import Settings
from forceid.errors import DataError, EstimationError
from forceid.estimation.body.affine_fit import FLAT, AffineFit, fit_affine
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.markers import marker_noise
from forceid.estimation.verdict.catalogue import note
from forceid.flight.channels import Channel, start_of
from forceid.flight.priors.protocol import LoadPrior
from forceid.motion import ORDER as DIFFERENCES
from forceid.pseudorigid import polar
from forceid.records import Array, Finding, Flags, Recording
from forceid.rounding import SOLVED

STIFFNESSES = 14  # of a spline that are tried


@dataclass(frozen=True)
class AffineChannels:
    """Groups of three channels, world axes: the mass center with the fall removed, and F E V by columns.

    center: None where the markers do not show it; columns: as many as axes V (3, column) has, reference
    directions in which their errors are independent while all markers are seen; second_moment E (3, 3) kg m2;
    span (3, column): orthonormal directions of E V, along which F is known. rotation (time, 3, 3): a smooth
    path of the body's own axes, exact by definition; noise (time, channel, channel): of all channels, group
    by group; linked: their largest correlation between groups. findings: on what is open; whole:
    whether the columns hold all of the first moments.
    """

    time: Array
    center: Channel | None
    columns: tuple[Channel, ...]
    axes: Array
    second_moment: Array
    span: Array
    rotation: Array
    noise: Array
    linked: float
    findings: tuple[Finding, ...] = ()
    whole: bool = True

    @property
    def groups(self) -> tuple[Channel, ...]:
        """All groups, the center first."""
        return self.columns if self.center is None else (self.center, *self.columns)


def affine_channels(recording: Recording, settings: Settings) -> AffineChannels:
    """Channels of a recording of markers. DataError where they do not show the motion of a plane at least."""
    body, motion = recording.body, recording.motion
    if motion.position is None or body.position is None:
        raise DataError("holds no markers", "/motion/position", "an affine motion shows in markers only")
    inertia = inertia_of(body)
    E = 0.5 * np.trace(inertia.tensor) * np.eye(3) - inertia.tensor
    x, time = motion.position, motion.time - motion.time[0]
    stated = motion.noise_std | settings.noise_std
    sigma = stated.get("position") or marker_noise(motion.time, x)
    fit = fit_affine(x, body.position - inertia.center, sigma**2)
    observed, whole = observed_arms(E, fit.span)
    if observed.shape[1] < 2:
        raise DataError(
            f"holds markers that spread along {fit.span.shape[1]} directions, which show first moments of "
            f"force about {observed.shape[1]}, expected two at least",
            "/body/position",
            "give a marker off the line, or use --model modal or rigid",
        )
    known = np.asarray(np.isfinite(fit.columns).all((1, 2)))
    if known.sum() < 2 * DIFFERENCES:
        raise EstimationError(
            f"shows the affine map in {known.sum()} frames, fewer than {2 * DIFFERENCES}",
            "the recording",
            "restore the markers, or give a longer record",
        )
    # of the frame that sees best
    best = int(np.nanargmin(np.where(known, np.trace(fit.cov[:, 1:, 1:], axis1=1, axis2=2), np.nan)))
    by = fit.span.T @ E
    V = observed @ np.linalg.eigh(observed.T @ by.T @ fit.cov[best, 1:, 1:] @ by @ observed)[1]
    n, r = V.shape[1], fit.span.shape[1]
    turn = np.zeros((1 + r, 1 + n))
    turn[0, 0], turn[1:, 1:] = 1.0, by @ V
    cov = np.where(known[:, None, None], turn.T @ fit.cov @ turn, np.diag(np.diag(turn.T @ turn)))
    z = np.concatenate([fit.center[..., None], fit.columns @ by @ V], 2)
    z[..., 0] -= 0.5 * time[:, None] ** 2 * motion.gravity
    gain = (1 / inertia.mass, *n * (1.0,))
    eye, still = np.eye(3), np.zeros((3, 3))
    center, *columns = (
        Channel(time, z[..., B], gain[B], cov[:, B, B, None, None] * eye, still) for B in range(1 + n)
    )
    first = int(fit.off)  # the center is no channel where it is not shown
    cov = cov[:, first:, first:]
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    linked = np.abs(cov / std[:, None] / std[..., None] - np.eye(len(std[0])))[known].max()
    noise = np.einsum("tBC,ab->tBaCb", cov, eye).reshape(len(time), 3 * len(std[0]), -1)
    return AffineChannels(
        time, None if fit.off else center, tuple(columns), V, E, aligned_basis(E @ V),
        smooth_axes(time, completed(fit)), noise, float(linked), judge_undetermined(fit, n, whole), whole,
    )  # fmt: skip


def observed_arms(E: Array, span: Array) -> tuple[Array, bool]:
    """Reference directions v (3, n) with K v shown and not zero, and whether they hold all of K.

    E (3, 3) kg m2; span (3, r): directions along which F is known. K v = F'' E v is shown where E v lies in
    the span.

    >>> observed_arms(np.diag([1.0, 2.0, 3.0]), np.eye(3)[:, :2])[0].round(9).tolist()
    [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
    >>> observed_arms(np.diag([1.0, 2.0, 0.0]), np.eye(3))[0].shape
    (3, 2)
    """
    size, axes = np.linalg.eigh(E)
    wide = size > FLAT**2 * size[-1]
    none = axes[:, ~wide].T
    across = null_space(span.T).T @ E
    across = across[np.linalg.norm(across, axis=1) > FLAT * size[-1]]
    closed = np.concatenate([none, across / np.linalg.norm(across, axis=1, keepdims=True)])
    observed = aligned_basis(null_space(closed)) if len(closed) else np.eye(3)
    return observed, observed.shape[1] == int(wide.sum())


def aligned_basis(directions: Array) -> Array:
    """Orthonormal basis (3, n) of the same space: reference axes first, as far as they lie in it."""
    basis = np.linalg.qr(directions)[0]
    if basis.shape[1] == 3:
        return np.eye(3)
    Q, R, order = qr(basis @ basis.T, pivoting=True)
    found = Q[:, : basis.shape[1]] * np.sign(np.diag(R)[: basis.shape[1]])
    return np.asarray(found[:, np.argsort(order[: basis.shape[1]])] + 0.0)  # no minus zero


def along_axes(span: Array) -> Flags:
    """Which reference axes (3,) lie in a space with orthonormal basis span (3, n)."""
    return np.asarray(np.linalg.norm(np.eye(3) - span @ span.T, axis=0) < SOLVED)


def judge_undetermined(fit: AffineFit, observed: int, whole: bool) -> tuple[Finding, ...]:
    """What markers and mass leave open of stretch, force and first moments."""
    found = []
    if fit.plane:
        found.append(note("stretch-open"))
    elif observed < 3:
        found.append(note("stretch-without-breadth"))
    if fit.off:
        found.append(note("affine-force-open"))
    if not whole:
        found.append(note("first-moments-open", directions=observed))
    return tuple(found)


def completed(fit: AffineFit) -> Array:
    """F (time, 3, 3) of every frame, in a plane completed by its unit normal: enough for axes of the body."""
    if not fit.plane:
        return fit.F
    normals = (np.cross(*np.moveaxis(c, -1, 0))[..., None] for c in (fit.columns, fit.span))
    across, along = (n / np.linalg.norm(n, axis=-2, keepdims=True) for n in normals)
    return np.asarray(fit.columns @ fit.span.T + across @ along.T)


def smooth_axes(time: Array, F: Array) -> Array:
    """Rotations (time, 3, 3) near to those of F (time, 3, 3), NaN = not seen, along a smooth path.

    Any smooth path does: loads are only said to be smooth along it. By smoothing splines, alike for all
    entries, as stiff as foretells every other sample of the entry that varies most from those between.
    """
    known = np.isfinite(F).all((1, 2))
    t, entries = time[known], F[known].reshape(-1, 9)
    step = np.ptp(t) / (len(t) - 1)
    most = entries[:, entries.var(0).argmax()]
    turn = 2 * np.pi * np.geomspace(0.5 / np.ptp(t), 0.2 / step, STIFFNESSES)  # where a spline lets go
    stiffness = 1 / (turn**4 * step)

    def missed(lam: float) -> float:
        return float(
            ((make_smoothing_spline(t[::2], most[::2], lam=0.5 * lam)(t[1:-1:2]) - most[1:-1:2]) ** 2).sum()
        )

    lam = min(stiffness, key=missed)
    smooth = np.stack([make_smoothing_spline(t, column, lam=lam)(time) for column in entries.T], 1)
    return polar(smooth.reshape(-1, 3, 3))[0]


def prior_in_body_axes(prior: LoadPrior, channel: Channel) -> LoadPrior:
    """A prior of a load along axes of the body, as one of a channel in world axes."""
    start = start_of(channel.time, channel.moved, channel.gain)
    return replace(prior, axes=np.eye(3), body_axes=prior.axes, start=start)


def channel_in_body_axes(channel: Channel, rotation: Array) -> Channel:
    """The channel that the same load drives along the axes of the body: w'' = R^T z'', for tuning.

    By parts, w = R^T z - 2 int R'^T z + int int R''^T z: no derivative of what was measured. The noise of z
    enters as it is, and adds up by the second term; the third adds little more.
    """
    time, path = channel.time, CubicSpline(channel.time, rotation)
    seen = np.isfinite(channel.z).all(1)
    z = channel.moved
    filled = np.stack([np.interp(time, time[seen], axis[seen]) for axis in z.T], 1) if not seen.all() else z

    def summed(y: Array) -> Array:
        steps = 0.5 * (y[1:] + y[:-1]) * np.diff(time)[:, None]
        return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])

    def turned(times: int, of: Array) -> Array:
        return np.asarray(np.einsum("tba,tb->ta", path(time, times), of))

    w = turned(0, z) - 2 * summed(turned(1, filled)) + summed(summed(turned(2, filled)))
    rate = path(time, 1)
    var = np.where(seen, np.trace(channel.noise_cov, axis1=1, axis2=2) / 3, 0.0)
    step = float(np.median(np.diff(time)))
    drift = 4 * step * np.einsum("t,tba,tbc->ac", var, rate, rate) / seen.sum()
    return Channel(time, w, channel.gain, channel.noise_cov, drift)
