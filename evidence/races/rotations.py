"""W4: the rotation of every frame from 3, 8 and 100 markers, and its error where markers lie badly."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.races.paired import Goal, Limit, Race, Racer
from forceid.motion import fit_rotation

CONDITION = 5e5
FLAT, THIN = "error, flat set (rad)", "error, thin set (rad)"
RotationFit = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def our_fit(x: np.ndarray, X: np.ndarray, w: np.ndarray) -> np.ndarray:
    return fit_rotation(x, X, w)[1]


def align_vectors(x: np.ndarray, X: np.ndarray, w: np.ndarray) -> np.ndarray:
    """scipy, frame by frame, on markers about their weighted mean."""
    X = X - w @ X / w.sum()
    R = np.empty((len(x), 3, 3))
    for k, frame in enumerate(x):
        R[k] = Rotation.align_vectors(frame - w @ frame / w.sum(), X, weights=w)[0].as_matrix()
    return R


def batched_svd(x: np.ndarray, X: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Kabsch with numpy's batched SVD: one product for all G, no gaps looked for."""
    fold = w[:, None] * (X - w @ X / w.sum())
    G = np.swapaxes(x, 1, 2) @ fold
    U, _, Vt = np.linalg.svd(G)
    U[..., 2] *= np.linalg.det(U @ Vt)[:, None]
    return U @ Vt


FITS: dict[str, RotationFit] = {
    "forceid": our_fit,
    "Rotation.align_vectors": align_vectors,
    "batched SVD": batched_svd,
}


def races(quick: bool) -> Iterator[Race]:
    errors = {name: ill_conditioned_errors(fit) for name, fit in FITS.items()}
    for markers in (3, 8, 100):
        frames = (5_000 if quick else 50_000) if markers < 100 else (1_000 if quick else 5_000)
        rng = np.random.default_rng(markers)
        X, w = rng.standard_normal((markers, 3)), rng.uniform(0.5, 1.5, markers)
        x = rotated_markers(X, frames, rng) + 1e-3 * rng.standard_normal((frames, markers, 3))
        contestants = [rotation_contestant(name, fit, x, X, w, errors[name]) for name, fit in FITS.items()]
        goals: list[Goal | Limit] = []
        if markers < 100:
            goals = [Goal("forceid", "Rotation.align_vectors", 100)]
            goals += [Limit("forceid", which, 1e-13) for which in (FLAT, THIN)]
        title, base = f"W4 rotation per frame, {markers} markers", "Rotation.align_vectors"
        yield Race(title, contestants, base, frames, 500, goals, unit="frame", clock="us")


def rotation_contestant(
    name: str, fit: RotationFit, x: np.ndarray, X: np.ndarray, w: np.ndarray, errors: dict[str, float]
) -> Racer:
    def prepare(size: int):
        return lambda: fit(x[:size], X, w)

    return Racer(name, prepare, lambda R: {"R": R}, figures=lambda answer: errors)


def rotated_markers(X: np.ndarray, frames: int, rng: np.random.Generator) -> np.ndarray:
    """Markers (frame, node, 3) under rotations drawn evenly."""
    R = Rotation.random(frames, rng=rng).as_matrix()
    return X @ R.swapaxes(1, 2)


def ill_conditioned_errors(fit: RotationFit) -> dict[str, float]:
    """Largest error against the fit in extended precision, same data, of two marker sets with G of CONDITION.

    Flat: the smallest singular value of G is that much below the largest. Thin: the two smaller ones are, so
    that the turn about the long axis hangs on them; rounding of G alone then costs the condition times eps.
    """
    rng = np.random.default_rng(9)
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])  # second moment 4 I
    weak = CONDITION**-0.5
    found = {}
    for name, size in {FLAT: (1.0, 0.8, weak), THIN: (1.0, 1.2 * weak, weak)}.items():
        # askew in the body: along its axes, the columns of G would keep their own relative accuracy
        X, w = corners * size @ Rotation.from_rotvec([0.4, -0.9, 0.6]).as_matrix(), np.ones(4)
        x = rotated_markers(X, 300, rng)
        found[name] = float(small_angle(extended(x, X), fit(x, X, w)).max())
    return found


def extended(x: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The fit of unit weights to 64-bit mantissas: Newton's method from a double solution."""
    R = batched_svd(x, X, np.ones(len(X))).astype(np.longdouble)
    x, X = x.astype(np.longdouble), X.astype(np.longdouble)
    rho, arm = x - x.mean(1, keepdims=True), X - X.mean(0)
    for _ in range(4):
        body = np.einsum("tab,tna->tnb", R, rho)
        slope = np.cross(arm, body).sum(1)
        B = np.einsum("na,tnb->tab", arm, body)
        hessian = np.trace(B, axis1=1, axis2=2)[:, None, None] * np.eye(3) - 0.5 * (B + B.swapaxes(1, 2))
        R = orthogonal(R @ (np.eye(3) + extended_cross_matrix(solve_by_cramer(hessian, slope))))
    return R


def solve_by_cramer(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A^-1 b of 3 by 3 matrices by Cramer's rule, in the precision given (LAPACK has double only)."""
    columns = A.swapaxes(1, 2)
    adjugate = np.stack([np.cross(columns[:, i - 2], columns[:, i - 1]) for i in range(3)], axis=1)
    determinant = (adjugate[:, 0] * columns[:, 0]).sum(-1)
    return np.einsum("tij,tj->ti", adjugate, b) / determinant[:, None]


def orthogonal(R: np.ndarray) -> np.ndarray:
    """The nearest rotation of a matrix that is nearly one: Newton-Schulz, twice."""
    for _ in range(2):
        R = 0.5 * R @ (3 * np.eye(3) - R.swapaxes(1, 2) @ R)
    return R


def extended_cross_matrix(r: np.ndarray) -> np.ndarray:
    X = np.zeros((*r.shape, 3), r.dtype)
    X[..., 2, 1], X[..., 0, 2], X[..., 1, 0] = r[..., 0], r[..., 1], r[..., 2]
    return X - X.swapaxes(-1, -2)


def small_angle(R: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angle between small-angle neighbors, in extended precision."""
    D = R.swapaxes(1, 2) @ other.astype(np.longdouble)
    return np.sqrt(((D - D.swapaxes(1, 2)) ** 2).sum((1, 2)) / 8)
