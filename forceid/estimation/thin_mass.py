"""Bodies whose mass lies on a line or on a point: what of their moment is known beforehand, and the rest.

Of masses on a line along n the angular momentum about their center is H = J n x n', whatever the body does
about the line; it has no part along n, and neither has the moment: T.n = -H.n' = 0. So nothing changes if the
body is given the inertia J about all axes and turns with n without spin: H and T are the same, and the tensor
is regular. The direction of two points of the line is then as good as a rotation. Of masses on a point H = 0,
and no moment acts about it. Source: principal equations 2.4, 2.6.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.inertia import Inertia
from forceid.kalman.flight import FlightState
from forceid.motion.line_motion import directions, without_spin
from forceid.motion.pose import RANK_TOLERANCE, Pose, body_axes
from forceid.records import Array, Flags

NARROW = 0.01  # of its length: mass nearer to a line turns about it with 1e-4 of its inertia across
NOTHING = 1e-12  # m: no body is so small
UNSEEN = 3.0  # sigma: markers nearer to a line say of a turn about it less than 1/3 rad, which no fit can use


def thinned(inertia: Inertia, X: Array, noise_std: float) -> Inertia:
    """The inertia of a body whose mass lies on a line or a point, and says so; any other stays as it is.

    X (node, 3) m about the mass center; noise_std m: mass that leaves a line by less than one reading errs,
    and by less than NARROW of its length, lies on it.

    >>> rod = Inertia(2.0, np.zeros(3), np.diag([0.0, 2, 2]), None, np.zeros(0))
    >>> thinned(rod, np.zeros((0, 3)), 1e-3).line.round(9).tolist()
    [1.0, 0.0, 0.0]
    """
    J = inertia.tensor
    if not np.isfinite(J).all():
        return inertia
    second, axes = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
    _, middle, longest = np.sqrt(np.maximum(second, 0.0) / inertia.mass)
    size = float(np.sqrt((X**2).sum(1).max(initial=0.0)))
    if longest <= max(RANK_TOLERANCE * size, NOTHING):
        return replace(inertia, point=True)
    if middle > max(RANK_TOLERANCE * longest, min(noise_std, NARROW * longest)):
        return inertia
    along = axes[:, 2] * np.sign(axes[np.abs(axes[:, 2]).argmax(), 2])
    return replace(inertia, line=along, tensor=second[2] * np.eye(3), affine=None)


def shown_rank(X: Array, seen: Flags, noise_std: float) -> int:
    """Rank of the rigid motions that markers show beside their noise: 6, 5 on a line, 3 on a point, 0.

    >>> shown_rank(np.array([[0.0, 0, 0], [1, 0, 0], [2, 1e-4, 0]]), np.ones(3, bool), 1e-3)
    5
    """
    if not seen.any():
        return 0
    size = np.linalg.svd(X[seen] - X[seen].mean(0), compute_uv=False)
    return (3, 5, 6, 6)[int((size > max(RANK_TOLERANCE * size[0], UNSEEN * noise_std)).sum())]


def line_pose(
    time: Array, pose: Pose, position: Array | None, X: Array, inertia: Inertia, noise_std: float
) -> Pose:
    """The pose whose rotation follows the line of the mass without spin, from what shows that line.

    pose: with the rotations of markers that fix them, NaN else; position (time, node, 3): where nodes on the
    line are seen, None where a mean motion was measured; X (node, 3) about the mass center. Rotations stay
    NaN where the line is not seen.
    """
    assert inertia.line is not None
    n, var = np.full_like(pose.center, np.nan), np.full(len(time), np.nan)
    if position is not None:
        n, var = seen_line(position, X, inertia, noise_std)
    across = np.eye(3) - n[:, :, None] * n[:, None]
    turn = var[:, None, None] * np.eye(3)
    whole = np.isfinite(pose.rotation).all((1, 2)) & ~np.isfinite(var)
    n[whole] = pose.rotation[whole] @ inertia.line
    across[whole] = np.eye(3) - n[whole, :, None] * n[whole, None]
    known = across[whole] @ pose.cov[whole, 3:, 3:] @ across[whole]
    half = 0.5 * np.trace(known, axis1=1, axis2=2)
    turn[whole] = known + half[:, None, None] * n[whole, :, None] * n[whole, None]
    cov = pose.cov.copy()
    cov[:, 3:, 3:] = turn
    cov[:, 3:, :3] = np.where(whole[:, None, None], across @ cov[:, 3:, :3], 0.0)
    cov[:, :3, 3:] = cov[:, 3:, :3].swapaxes(1, 2)
    rotation = without_spin(time, n, inertia.line)
    if np.isfinite(pose.chi_square).any() or position is None:
        return replace(pose, rotation=rotation, cov=cov)
    residual = body_axes(position, pose.center, rotation) - X
    dof = np.maximum(3.0 * np.isfinite(residual).all(2).sum(1) - 5, 0.0)
    chi_square = np.where(dof > 0, np.nansum(residual**2, axis=(1, 2)) / noise_std**2, np.nan)
    return replace(pose, rotation=rotation, cov=cov, residual=residual, chi_square=chi_square, dof=dof)


def seen_line(position: Array, X: Array, inertia: Inertia, noise_std: float) -> tuple[Array, Array]:
    """Direction of the line of the mass and its variance, as `directions`, by the markers that lie on it."""
    assert inertia.line is not None
    along = X @ inertia.line
    off = np.linalg.norm(X - along[:, None] * inertia.line, axis=1)
    usable: Flags = np.asarray(off <= max(RANK_TOLERANCE * float(np.abs(along).max(initial=0.0)), noise_std))
    weight = None
    if inertia.nodal is not None:
        weight = inertia.nodal * along if inertia.nodal.ndim == 1 else inertia.nodal[::3, ::3] @ along
        weight = np.where(np.abs(weight) > 1e-12 * np.abs(weight).max(), weight, 0.0)
    return directions(position, along, usable, weight, noise_std)


def with_known_moment(state: FlightState, inertia: Inertia) -> FlightState:
    """The state with what is known beforehand: no moment along the line of the mass, none about a point.

    Momentum, moment and rate of turn lose their part along the line, their covariance is singular there.
    """
    if inertia.point:
        cov = state.wrench_cov.copy()
        cov[:, 3:], cov[:, :, 3:] = 0.0, 0.0
        none = np.where(np.isfinite(state.force), 0.0, np.nan)
        return replace(state, moment=none, H=none, wrench_cov=cov)
    if inertia.line is None or not np.isfinite(state.rotation).any():
        return state
    n = state.rotation @ inertia.line
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    across = np.eye(3) - n[:, :, None] * n[:, None]
    both = np.zeros((len(n), 6, 6))
    both[:, :3, :3], both[:, 3:, 3:] = np.eye(3), across

    def kept(v: Array) -> Array:
        return np.asarray(np.einsum("tab,tb->ta", across, v))

    return replace(
        state, moment=kept(state.moment), H=kept(state.H), omega=kept(state.omega),
        wrench_cov=both @ state.wrench_cov @ both,
    )  # fmt: skip
