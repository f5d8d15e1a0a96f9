"""Bodies whose mass lies on or near a line, or on a point: how their moment is found, what of it is known.

Of masses on a line along n the angular momentum about their center is H = J n x n', whatever the body does
about the line; it has no part along n, and neither has the moment: T.n = -H.n' = 0. So nothing changes if the
body is given the inertia J about all axes and turns with n without spin: H and T are the same, and the tensor
is regular. The direction of two points of the line is then as good as a rotation. What a body near a line has
beside, the momentum of its spin and of its flatness, is small and follows from the turn about the line that
markers off it show, see `spin`. Of masses on a point H = 0, and no moment acts about it. Source: principal
equations 2.4, 2.6.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.body.inertia import Inertia, second_moment
from forceid.estimation.body.spin import Spin, directions, spin_about, spun, without_spin
from forceid.flight.smoother import FlightState
from forceid.motion import Pose, body_axes
from forceid.records import Array, Flags, all_finite
from forceid.rounding import ROUNDED, SINGLE
from forceid.significance import SIGMAS

# width over length, both rms: poses err by about 1e-3 rad, and the momentum that such an error of the line
# makes along it is that of a spin near half as fast as the turn itself: such a state does not settle
SLENDER = 0.05
NARROW = 0.01  # width over length at which the momentum of a spin is 1e-4 of that of a turn as fast


def thinned(inertia: Inertia, X: Array) -> Inertia:
    """The inertia of a body whose mass lies near a line or on a point, and says so; else as it is.

    X (node, 3) m about the mass center.

    >>> rod = Inertia(2.0, np.zeros(3), np.diag([0.0, 2, 2]), None, np.zeros(0))
    >>> thinned(rod, np.zeros((0, 3))).line.round(9).tolist()
    [1.0, 0.0, 0.0]
    """
    if not np.isfinite(inertia.tensor).all():
        return inertia
    second, axes = principal_second_moments(inertia.tensor)
    _, width, length = np.sqrt(np.maximum(second, 0.0) / inertia.mass)
    size = float(np.sqrt((X**2).sum(1).max(initial=0.0)))
    if length <= max(SINGLE * size, ROUNDED):
        return replace(inertia, point=True)
    if width > SLENDER * length:
        return inertia
    along = axes[:, 2] * np.sign(axes[np.abs(axes[:, 2]).argmax(), 2])
    across = 0.5 * (np.trace(inertia.tensor) - along @ inertia.tensor @ along)
    beside = inertia.tensor - across * np.eye(3) if width > SINGLE * length else None
    return replace(inertia, line=along, tensor=across * np.eye(3), beside=beside, affine=None)


def as_sphere(inertia: Inertia, X: Array) -> Inertia:
    """The same for sensors alone, which need a tensor to turn any body: of a point as well.

    Any does for that: it cancels in the turn, and no moment is read from it.
    """
    inertia = thinned(inertia, X)
    return replace(inertia, tensor=inertia.mass * np.eye(3)) if inertia.point else inertia


def principal_second_moments(tensor: Array) -> tuple[Array, Array]:
    """Principal second moments of mass (3,) kg m2, ascending, and their axes as columns (3, 3)."""
    second, axes = np.linalg.eigh(second_moment(tensor))
    return np.asarray(second), np.asarray(axes)


def on_line(inertia: Inertia, noise_std: float) -> bool:
    """Whether mass leaves its line by less than a reading errs, m, and by less than NARROW of its length."""
    if inertia.line is None or inertia.beside is None:
        return inertia.on_line
    second, _ = principal_second_moments(inertia.tensor + inertia.beside)
    width, length = np.sqrt(np.maximum(second[1:], 0.0) / inertia.mass)
    return bool(width <= min(noise_std, NARROW * length))


def observed_rank(X: Array, seen: Flags, noise_std: float) -> int:
    """Rank of the rigid motions that markers show beside their noise: 6, 5 on a line, 3 on a point, 0.

    >>> observed_rank(np.array([[0.0, 0, 0], [1, 0, 0], [2, 1e-4, 0]]), np.ones(3, bool), 1e-3)
    5
    """
    if not seen.any():
        return 0
    size = np.linalg.svd(X[seen] - X[seen].mean(0), compute_uv=False)
    return (3, 5, 6, 6)[int((size > max(SINGLE * size[0], SIGMAS * noise_std)).sum())]


def followed_line(
    time: Array, pose: Pose, position: Array | None, X: Array, inertia: Inertia, noise_std: float
) -> tuple[Pose, Spin | None]:
    """The pose whose rotation follows the line of the mass without spin, and the spin, None where unseen.

    pose: with the rotations of markers that fix them, NaN else; position (time, node, 3): where nodes on the
    line are seen, None where a mean motion was measured; X (node, 3) about the mass center. Rotations are NaN
    where the line is not seen, or its spin is not and would matter.
    """
    assert inertia.line is not None
    n, var = np.full_like(pose.center, np.nan), np.full(len(time), np.nan)
    turned = np.isfinite(pose.rotation).all((1, 2))
    if not turned.any() and not on_line(inertia, noise_std):
        return pose, None
    if position is not None and on_line(inertia, noise_std):
        n, var = seen_line(position, X, inertia, noise_std)
    by_fit = turned & ~np.isfinite(var)
    n[by_fit] = pose.rotation[by_fit] @ inertia.line
    rotation = without_spin(time, n, inertia.line)
    spin = spin_about(time, pose, rotation, n, inertia) if turned.any() else None
    cov = pose.cov.copy()
    cov[:, 3:, 3:] = var[:, None, None] * np.eye(3)
    cov[:, 3:, :3] = 0.0
    along = n[by_fit, :, None] * n[by_fit, None]
    across = np.eye(3) - along
    known = across @ pose.cov[by_fit, 3:, 3:] @ across
    cov[by_fit, 3:, 3:] = known + 0.5 * np.trace(known, axis1=1, axis2=2)[:, None, None] * along
    cov[by_fit, 3:, :3] = across @ pose.cov[by_fit, 3:, :3]
    cov[:, :3, 3:] = cov[:, 3:, :3].swapaxes(1, 2)
    if turned.any() or position is None:
        return replace(pose, rotation=rotation, cov=cov), spin
    residual = body_axes(position, pose.center, rotation) - X
    dof = np.maximum(3.0 * all_finite(residual).sum(1) - 5, 0.0)
    chi_square = np.where(dof > 0, np.nansum(residual**2, axis=(1, 2)) / noise_std**2, np.nan)
    return replace(pose, rotation=rotation, cov=cov, residual=residual, chi_square=chi_square, dof=dof), None


def seen_line(position: Array, X: Array, inertia: Inertia, noise_std: float) -> tuple[Array, Array]:
    """Direction of the line of the mass and its variance, as `directions`, by the markers that lie on it."""
    assert inertia.line is not None
    along = X @ inertia.line
    off = np.linalg.norm(X - along[:, None] * inertia.line, axis=1)
    near = max(SINGLE * float(np.abs(along).max(initial=0.0)), noise_std)
    usable: Flags = np.asarray(off <= near)
    weight = None
    if inertia.nodal is not None:
        weight = inertia.nodal * along if inertia.nodal.ndim == 1 else inertia.nodal[::3, ::3] @ along
        weight = np.where(np.abs(weight) > ROUNDED * np.abs(weight).max(), weight, 0.0)
    return directions(position, along, usable, weight, noise_std)


def with_known_moment(
    state: FlightState, inertia: Inertia, spin: Spin | None, measured: Array | None = None
) -> FlightState:
    """The state with what is known of the moment beside the flight: along a line of mass, and about a point.

    On a point no moment acts. Along a line the smoother's own says nothing; there momentum, moment and rate
    of turn are those of the spin, or none, and the moment errs by what an error of the line turns of it.
    measured (time, 3, 3): rotations of the frames, those of a flight of a point that turns none.
    """
    if inertia.point:
        cov = state.wrench_cov.copy()
        cov[:, 3:], cov[:, :, 3:] = 0.0, 0.0
        none = np.where(np.isfinite(state.force), 0.0, np.nan)
        rotation = state.rotation if measured is None else measured
        return replace(state, moment=none, H=none, wrench_cov=cov, rotation=rotation)
    if inertia.line is None or not np.isfinite(state.rotation).any():
        return state
    n = state.rotation @ inertia.line
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    across = np.eye(3) - n[:, :, None] * n[:, None]
    both = np.zeros((len(n), 6, 6))
    both[:, :3, :3], both[:, 3:, 3:] = np.eye(3), across

    def kept(v: Array) -> Array:
        return np.asarray(np.einsum("tab,tb->ta", across, v))

    moment, cov = kept(state.moment), both @ state.wrench_cov @ both
    turned = np.cross(n, moment)
    tilted = np.einsum("ta,tab,tb->t", turned, state.pose_cov[:, 3:, 3:], turned)
    cov[:, 3:, 3:] += tilted[:, None, None] * n[:, :, None] * n[:, None]
    state = replace(state, moment=moment, H=kept(state.H), omega=kept(state.omega), wrench_cov=cov)
    return state if spin is None else spun(state, spin, n, inertia.line)
