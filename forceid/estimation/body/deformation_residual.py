"""What markers show beyond the rigid motion, and how likely it is in a few shapes under a dynamic prior.

An affine map takes every marker along, and mass beside them by a lever: what the markers do beside the map
enters the momenta by it. A body that keeps its shape between markers and mass errs by no more than all mass
moving as the markers do beside the rigid motion (Cauchy and Schwarz). Where the lever makes more of what is
not affine, the map is the worse guess, however well it fits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import qr
from scipy.special import chdtri

from forceid.estimation.body.deforming.resonance import ringing_gain
from forceid.estimation.body.inertia import moments_of_whole
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.tracks.marker_errors import MarkerErrors, marker_errors
from forceid.estimation.body.tracks.noise_axes import NO_AXIS, uneven
from forceid.flight.channels import driven, load_chain, start_of
from forceid.flight.color import Color, LowPassed
from forceid.flight.tuning import MIDDLE, tune_loads
from forceid.kalman.engines import Engine
from forceid.kalman.model import LOG_2PI
from forceid.motion import body_axes, fit_rotation
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Motion, all_finite
from forceid.rounding import SINGLE, SOLVED
from forceid.significance import CHANCE, LAGS, SIGMAS

AT_A_LOOK = 64  # markers that a look takes: their numbers tell a variance to a percent in a hundred frames
GOLDEN_TURN = 0.5 * (np.sqrt(5) - 1)  # of a turn from one to the next: the most even of all ways round
TURNS = 16  # frames, evenly spread, at which what a turn does to errors is looked at
KNOWN = 0.25  # standard error of a variance, as a part of it: its root is known to an eighth


@dataclass(frozen=True)
class Beyond:
    """What no rigid motion explains, over the markers kept (node,).

    time (time,) s; y (time, freedom) m, NaN in frames not whole; basis (3 node, freedom) of y, orthonormal,
    orthogonal to the rigid modes; var m2: of the noise in each, and its correlation (lag,) from a frame on.
    """

    time: Array
    y: Array
    basis: Array
    kept: Flags
    var: float
    memory: Array = field(default_factory=lambda: np.zeros(LAGS))

    @property
    def frames(self) -> int:
        """Frames that are whole."""
        return int(np.isfinite(self.y).all(1).sum())

    def told_anew(self, color: LowPassed, std: float) -> Beyond:
        """The frames whose errors, of a deviation std m, are independent of tracks that were low-passed."""
        new, var = slice(None, None, color.every), color.counted * std**2
        memory = color.correlation(color.every * np.arange(1.0, LAGS + 1))
        return replace(self, time=self.time[new], y=self.y[new], var=var, memory=memory)

    def of(self, shapes: Array) -> Array:
        """What shapes (mode, node, 3) look like in y: (mode, freedom)."""
        return np.asarray(shapes[:, self.kept].reshape(len(shapes), len(self.basis)) @ self.basis)

    def without(self, shapes: Array) -> Beyond:
        """What no motion in shapes (mode, node, 3) explains either."""
        free = bases_beside(self.of(shapes).T, SINGLE)[1]
        return replace(self, y=self.y @ free, basis=self.basis @ free)


def bases_beside(columns: Array, least: float) -> tuple[Array, Array]:
    """Orthonormal bases (n, rank) of what columns (n, few) span, and (n, n - rank) of all beside it.

    least: singular values, over the largest, that count. By as many reflections as there are columns.

    >>> [basis.shape for basis in bases_beside(np.array([[1.0, 2.0], [1.0, 2.0], [0.0, 0.0]]), 1e-9)]
    [(3, 1), (3, 2)]
    """
    axes, size, _ = np.linalg.svd(columns, full_matrices=False)
    within = axes[:, size > least * size.max(initial=0.0)]
    if not within.shape[1]:
        return within, np.eye(len(columns))
    return within, qr(within)[0][:, within.shape[1] :]


def looks(seen: Flags) -> list[Flags]:
    """Markers (node,) in groups of about AT_A_LOOK at most, each spread over all of them.

    >>> [int(group.sum()) for group in looks(np.ones(130, bool))]
    [45, 43, 42]
    """
    at = np.flatnonzero(seen)
    count = max(1, -(-len(at) // AT_A_LOOK))
    which = (np.arange(len(at)) * GOLDEN_TURN % 1 * count).astype(int)
    return [np.isin(np.arange(len(seen)), at[which == k]) for k in range(count)]


def often_seen(position: Array, seen: Flags) -> Flags:
    """Markers (node,) that at least half of the frames show together: the least seen go first."""
    at = np.flatnonzero(seen)
    visible: Flags = all_finite(position[:, at])
    while len(at) > 3 and 2 * visible.all(1).sum() < len(visible):
        least = visible.mean(0).argmin()
        at, visible = np.delete(at, least), np.delete(visible, least, 1)
    return np.isin(np.arange(len(seen)), at)


def beyond_rigid(time: Array, position: Array, kin: Kinematics, group: Flags | None = None) -> Beyond:
    """What markers at `position` (time, node, 3) m do beside moving as one, in a group (node,).

    The first look where no group is given. The rotation is fitted in the mass gauge, in which the deformation
    of a frame is linear in its shapes, however large.
    """
    kept = often_seen(position, looks(kin.seen)[0] if group is None else group)
    weight = kin.inertia.weight * kept
    if (weight > 0).sum() < 4:
        weight = kept.astype(float)
    x, shape = position[:, kept], kin.shape[kept]
    residual = body_axes(x, *fit_rotation(x, kin.gauge[kept], weight[kept])) - shape
    U = bases_beside(summation_operator(shape), SOLVED)[1]
    return Beyond(time, residual.reshape(len(x), -1) @ U, U, kept, kin.noise["position"] ** 2)


def errors_beyond(kin: Kinematics, motion: Motion) -> tuple[MarkerErrors, Array | None] | None:
    """Errors of the markers as what neither pose nor shape makes shows them; their deviations (3,), world.

    No deviations of what may be a motion. None where pose and shapes move the markers in all directions, so
    few frames are whole that they hardly show it, or the errors are known to differ by axis.
    """
    if motion.measured is None or uneven(kin.noise_root["position"]) is not None:
        return None
    seen = beyond_rigid(motion.time, motion.measured, kin)
    if len(kin.shapes):
        seen = seen.without(kin.shapes)
    found = marker_errors(motion.time, seen.y)
    if found is None or found.relative > KNOWN:
        return None
    return found, by_axis(kin, seen, found) if found.alike else None


def by_axis(kin: Kinematics, seen: Beyond, errors: MarkerErrors) -> Array:
    """Standard deviations (3,) of the errors along world axes, all alike where they may well be.

    Errors with variances s along the axes show powers M s along them, by where the markers are.
    """
    known = np.isfinite(seen.y).all(1) & np.isfinite(kin.pose.rotation).all((1, 2))
    R = kin.pose.rotation[known]
    if not len(R):
        return np.full(3, errors.std)
    nodes = int(seen.kept.sum())
    beyond = (seen.y[known] @ seen.basis.T).reshape(len(R), nodes, 3) @ R.mT
    power = (beyond**2).mean(0).sum(0)
    blocks = (seen.basis @ seen.basis.T).reshape(nodes, 3, nodes, 3).swapaxes(1, 2).reshape(-1, 9)
    square, M = blocks.T @ blocks, np.zeros((3, 3))
    for turn in R[np.linspace(0, len(R) - 1, TURNS).astype(int)]:
        turned = np.kron(turn, turn)  # blocks in world axes; their mean squares by the pair of axes
        M += np.einsum("pi,ij,pj->p", turned, square, turned, optimize=True).reshape(3, 3) / TURNS
    if np.linalg.cond(M) * errors.relative > KNOWN:
        return np.full(3, errors.std)
    var = np.maximum(np.linalg.solve(M, power), (NO_AXIS * errors.std) ** 2)
    if np.ptp(var) < SIGMAS * np.sqrt(3) * errors.relative * var.max():
        return np.full(3, errors.std)
    return np.asarray(np.sqrt(var) * errors.std / np.sqrt(var.mean()))


def principal_axes(y: Array, directions: Array) -> Array:
    """Orthonormal basis (freedom, mode) of the span of directions (mode, freedom), axes of y (time, freedom).

    Along its own axes a motion has amplitudes that do not correlate, as separate priors take for granted.
    """
    if not len(directions):
        return np.zeros((y.shape[1], 0))
    basis, size, _ = np.linalg.svd(directions.T, full_matrices=False)
    basis = basis[:, size > SINGLE * size.max(initial=0.0)]
    q = (y @ basis)[np.isfinite(y).all(1)]
    return np.asarray(basis @ np.linalg.eigh(q.T @ q)[1][:, ::-1])


def dynamic_gain(time: Array, q: Array, var: float, engine: Engine) -> tuple[Array, Array]:
    """Log-likelihood of each amplitude q (time, mode) over that of white noise: of one that moves under a
    tuned dynamic prior, or rings.

    And its mean NIS; both (mode,). var: of the noise in each amplitude.
    """
    modes = q.shape[1]
    if not modes:
        return np.zeros(0), np.zeros(0)
    noise, none = np.full_like(q, var), np.zeros(modes)
    tuned = tune_loads(time, q, 1.0, noise, none, orders=(MIDDLE,), engine=engine)
    chain = load_chain(tuned.kernel.process, start_of(time, q, 1.0))
    models = driven(chain, 1.0, noise, none, np.diff(time))
    paths = [engine.filter(models.one(j), q[:, j]) for j in range(modes)]
    white = -0.5 * np.nansum(q**2 / var + np.log(var) + LOG_2PI + 0 * q, axis=0)
    dynamic, nis = np.array([(path.log_likelihood, np.nanmean(path.nis)) for path in paths]).T
    return np.logaddexp(dynamic - white, ringing_gain(time, q, var)) - np.log(2), nis


def errors_gain(beyond: Beyond, errors: MarkerErrors, engine: Engine) -> float:
    """Log-likelihood of errors of markers alone over that of white ones as in `Beyond`, less what they cost.

    As the evidence of a level that has no shape.
    """
    y, var, numbers = beyond.y, errors.std**2, 1.0
    white, own = (-0.5 * float(np.nansum(y**2 / v + np.log(v) + LOG_2PI + 0 * y)) for v in (beyond.var, var))
    if isinstance(color := errors.color, Color):
        numbers, one = 3.0, np.ones(y.shape[1])
        rest = np.full_like(y, (1 - color.share) * var)
        model = driven(color.process(color.share * var * one), 1.0, rest, 0 * one, np.diff(beyond.time))
        own = float(engine.log_likelihood(model, y[..., None]).sum())
    return own - white - 0.5 * numbers * float(np.log(beyond.frames))


def correlation(left: Array, dof: int, memory: Array) -> tuple[float, bool]:
    """Largest autocorrelation of what a level leaves (time, freedom) beyond that of noise, memory (lag,); and
    whether it is beyond chance.
    """
    if dof < 1:
        return 0.0, False
    y = left[np.isfinite(left).all(1)]
    power = float((y**2).sum())
    lags = range(1, min(LAGS, len(y) // 2) + 1)
    r = np.array([float((y[k:] * y[:-k]).sum()) for k in lags]) / max(power, 1e-300) - memory[: len(lags)]
    portmanteau = float((r**2).sum()) * len(y) * dof
    return float(r[np.abs(r).argmax()]), bool(portmanteau > chdtri(len(r), CHANCE))


def speaks_for_mass(kin: Kinematics, beyond: Beyond) -> bool:
    """Whether the affine map of `kin` is a better guess of mass without markers than a shape that is kept.

    Always where all mass is seen, which needs no map. With as many shapes as the markers show nothing checks
    the map: then all that moves may be beside it.
    """
    inertia = kin.inertia
    if inertia.nodal is not None and not (inertia.weight[~kin.seen] > 0).any():
        return True
    Z = np.column_stack([np.ones(len(kin.shape)), kin.shape])
    moments = moments_of_whole(inertia.mass, inertia.tensor)
    if inertia.nodal is not None:
        moments = np.asarray(Z.T @ (inertia.weight[:, None] * Z))
    reach = lever(kin.shape, beyond.kept, moments)
    axes = principal_axes(beyond.y, beyond.of(kin.shapes))
    left = beyond.y - beyond.y @ axes @ axes.T
    dof = beyond.y.shape[1] - axes.shape[1]
    moves = excess(beyond.y, beyond.y.shape[1], beyond.var)
    return reach**2 * (excess(left, dof, beyond.var) if dof else moves) <= moves


def lever(X: Array, marked: Flags, moments: Array) -> float:
    """Momentum, linear or angular, that alike and independent motions of markers give an affine body.

    X (node, 3) m about the mass center, marked (node,), moments (4, 4): sum of m Z Z over all mass, Z = [1,
    X]. Over that of a body whose mass all moves as the markers do; infinite where they show no affine map.
    """
    Z = np.column_stack([np.ones(len(X)), X])[marked]
    if not np.isfinite(moments).all() or np.linalg.matrix_rank(Z) < 4:
        return np.inf
    share = moments @ np.linalg.pinv(Z)
    mass, turning = moments[0, 0], float(np.trace(moments[1:, 1:]))
    force = float((share[0] ** 2).sum()) / mass**2
    moment = 2 * float((share[1:] ** 2).sum()) / (3 * mass * turning) if turning > 0 else 0.0
    return float(np.sqrt(max(force, moment)))


def excess(y: Array, dof: int, var: float) -> float:
    """Mean square (m2) per degree of freedom of y (time, freedom), NaN rows left out, beyond the noise."""
    whole = y[np.isfinite(y).all(1)]
    return max(float((whole**2).sum()) / len(whole) / dof - var, 0.0)
