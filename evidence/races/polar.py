"""Polar factors of a million frames, and their error where the singular values lie badly."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy.linalg

from evidence.races.paired import Contestant, Goal, Limit, Race
from forceid.pseudorigid.decomposition import bipolar, polar

CONDITION = 2**20  # a power of two: the matrices are exact
SETS = {  # singular values
    "flat": (CONDITION, CONDITION, 1),
    "graded": (CONDITION, 2**10, 1),
    "thin": (CONDITION, 1, 1),
}
ERRORS = {name: f"error of L, {name} set" for name in SETS}
ORTHOGONALITY = "loss of orthogonality"
Decompose = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def loop(F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """scipy, frame by frame."""
    L, U = np.empty_like(F), np.empty_like(F)
    for k, frame in enumerate(F):
        L[k], U[k] = scipy.linalg.polar(frame)
    return L, U


def batched_svd(F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """numpy's SVD of all frames."""
    W, s, Vt = np.linalg.svd(F)
    return W @ Vt, Vt.swapaxes(1, 2) * s[:, None] @ Vt


def from_bipolar(F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L R and R^T D R of the bipolar factors."""
    L, D, R = bipolar(F)
    return L @ R, R.swapaxes(1, 2) * D[:, None] @ R


WAYS: dict[str, Decompose] = {
    "forceid": polar,
    "forceid bipolar": from_bipolar,
    "scipy.linalg.polar": loop,
    "batched SVD": batched_svd,
}


def races(quick: bool, full: bool) -> Iterator[Race]:
    frames = 100_000 if quick else 1_000_000
    rng = np.random.default_rng(0)
    F = rng.standard_normal((frames, 3, 3))
    F[np.linalg.det(F) < 0, 0] *= -1
    base = "scipy.linalg.polar"
    goals: list[Goal | Limit] = [Goal("forceid", base, 20)]
    goals += [Limit("forceid", figure, 1e-13) for figure in (*ERRORS.values(), ORTHOGONALITY)]
    contestants = [contestant(name, way, F) for name, way in WAYS.items()]
    yield Race("Polar factors", contestants, base, frames, 500, goals, unit="frame", clock="us")


def contestant(name: str, way: Decompose, F: np.ndarray) -> Contestant:
    def prepare(size: int):
        return lambda: way(F[:size])

    errors = ill_conditioned_errors(way)
    return Contestant(
        name, prepare, lambda found: {"L": found[0], "U": found[1]}, figures=lambda answer: errors
    )


def ill_conditioned_errors(way: Decompose) -> dict[str, float]:
    """Largest error of L against the exact one, of matrices of CONDITION that are exact themselves."""
    found, apart = {}, 0.0
    for name, values in SETS.items():
        F, exact = exact_polar(500, values)
        L = way(F)[0]
        found[ERRORS[name]] = float(np.abs(L - exact).max())
        apart = max(apart, float(np.abs(L.swapaxes(1, 2) @ L - np.eye(3)).max()))
    return found | {ORTHOGONALITY: apart}


def exact_polar(count: int, values: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """F of whole numbers that doubles hold, and its polar rotation: a whole rotation times whole stretch."""
    rng = np.random.default_rng(3)
    q, p = rng.integers(-7, 8, (count, 4)), rng.integers(-3, 4, (count, 4))
    for quaternion in (q, p):
        quaternion[:, 0] += ~quaternion.any(1)
    A, B = whole_rotation(q), whole_rotation(p)
    F = A @ (B * np.array(values)) @ B.swapaxes(1, 2)
    assert np.abs(F).max() < 2**53
    return F.astype(float), A / (q * q).sum(1)[:, None, None]


def whole_rotation(q: np.ndarray) -> np.ndarray:
    """|q|^2 times the rotation of quaternions q (n, 4) of whole numbers."""
    w, v = q[:, :1, None], q[:, 1:]
    cross = -np.cross(v[:, None], np.eye(3, dtype=int))
    square = (w[:, :, 0] ** 2 - (v * v).sum(1, keepdims=True))[..., None]
    return square * np.eye(3, dtype=int) + 2 * v[:, :, None] * v[:, None] + 2 * w * cross.swapaxes(1, 2)
