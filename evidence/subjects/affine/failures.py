"""Failures of bodies that move affinely: values that meet, collapse, stiffness, steps, alike moments."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.stress.failure import failure
from evidence.subjects.affine.bodies import (
    BALL,
    BLOCK,
    SOFT,
    DeformedFrames,
    Throw,
    followed,
    natural_constants,
    random_rotations,
    sprung,
    unstrained,
)
from evidence.subjects.affine.exact_polar import exact_polar
from evidence.subjects.affine.problem import AffineProblem
from evidence.vectors import EYE, hat
from forceid.records import Array

FACTORS = (1e-13, 1e-6)  # relative: of factors, and of rates, which rounding of F and F' may swamp
REDUCED_TOLERANCES = (1e-10, 1e-10)
FRAMES = 12  # of a seed, of factors
PATH = 97  # frames past a meeting
TIGHTEST = 3e-14  # relative, of DOP853
CONDITIONS = (1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12, 1e14)
GAPS = (0.3, 0.1, 1e-2, 1e-3, 2e-4, 5e-5, 1e-6, 0.0)


@failure("affine", "One short axis", "condition", CONDITIONS)
def flattened(level: float, rng: np.random.Generator) -> AffineProblem:
    """Det F goes to zero, and rounding of F turns what is left of an axis."""
    return turning_frames(np.array([1.0, 0.7, 1 / level]), rng)


@failure("affine", "Two short axes", "condition", CONDITIONS)
def needle(level: float, rng: np.random.Generator) -> AffineProblem:
    """A needle hardly shows its turn about itself."""
    return turning_frames(np.array([1.0, 1 / level, 0.5 / level]), rng)


def turning_frames(D: Array, rng: np.random.Generator) -> AffineProblem:
    """Frames of singular values D (3,) that turn and stretch."""
    L, R = random_rotations(rng, FRAMES), random_rotations(rng, FRAMES)
    U = (R.swapaxes(1, 2) * D) @ R
    omega = rng.standard_normal((FRAMES, 3))
    F = L @ U
    dF = F @ rng.standard_normal((3, 3)) * 0.1 + L @ hat(omega) @ U
    L, omega = exact_polar(F, dF)
    return AffineProblem(DeformedFrames(F, dF), L, omega, FACTORS)


@failure("affine", "Close stretches, one frame", "gap", (0.3, 1e-2, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 0.0))
def close_values(level: float, rng: np.random.Generator) -> AffineProblem:
    """Omega - lam is a difference over a gap, and rounding grows by the square of it."""
    L, R = random_rotations(rng, FRAMES), random_rotations(rng, FRAMES)
    D = np.array([1.0, 1 - level, 0.5])
    omega, lam, dD = rng.standard_normal((3, FRAMES, 3))
    A = hat(omega) * D + dD[..., None] * EYE + D[:, None] * hat(lam)
    F, dF = (L * D) @ R, L @ A @ R
    spins = np.concatenate([L @ omega[..., None], R.swapaxes(1, 2) @ lam[..., None]], 1)[..., 0]
    return AffineProblem(DeformedFrames(F, dF), np.broadcast_to(D, (FRAMES, 3)), spins, FACTORS)


@failure(
    "affine", "Stretches that meet along a path", "changes a frame", (20.0, 5.0, 2.0, 1.0, 0.3, 0.1, 1e-3,
    0.0),
)  # fmt: skip
def values_meet(level: float, rng: np.random.Generator) -> AffineProblem:
    """Axes turn by a quarter between two frames, or do not: frames cannot tell."""
    step = 1 / (PATH - 1)
    t = np.linspace(-0.5, 0.5, PATH) + rng.uniform(-0.5, 0.5) * step
    v = rng.uniform(0.2, 0.6)
    miss = level * v * step
    size = np.hypot(v * t, miss)
    theta = 0.5 * np.arctan2(miss, v * t) if miss else np.zeros(PATH)
    turning = -0.5 * miss * v / size**2 if miss else np.zeros(PATH)
    D = np.stack([1 + (size if miss else v * t), 1 - (size if miss else v * t), np.full(PATH, 0.5)], 1)
    dD = (
        np.stack([v**2 * t / size, -(v**2) * t / size, np.zeros(PATH)], 1) if miss else np.array([v, -v, 0.0])
    )
    spin = rng.uniform(-1, 1, (2, 3))
    z = EYE[2]
    P, Q = (np.asarray(Rotation.from_rotvec(np.outer(t, w)).as_matrix()) for w in spin)
    T = np.asarray(Rotation.from_rotvec(np.outer(theta, z)).as_matrix())
    L, R = P @ T, T.swapaxes(1, 2) @ Q
    # in axes of the factors: L^T L' = hat(omega), R' R^T = hat(lam)
    omega = (T.swapaxes(1, 2) @ spin[0]) + turning[:, None] * z
    lam = (T.swapaxes(1, 2) @ spin[1]) - turning[:, None] * z
    A = hat(omega) * D[:, None] + np.broadcast_to(dD, (PATH, 3))[..., None] * EYE + D[..., None] * hat(lam)
    F, dF = (L * D[:, None]) @ R, L @ A @ R
    spins = np.concatenate([L @ omega[..., None], R.swapaxes(1, 2) @ lam[..., None]], 1)[..., 0]
    return AffineProblem(DeformedFrames(F, dF, step), np.sort(D)[:, ::-1], spins, (1.0, 1e-6))


@failure("affine", "Axes that meet, two-sided equations", "gap", GAPS)
def axes_meet(level: float, rng: np.random.Generator) -> AffineProblem:
    """Rotations of the two-sided form turn without bound as 1/gap^2."""
    F = np.diag([1 + level, 1.0, 0.7])
    turn = random_rotations(rng, 2)
    F, V = turn[0] @ F @ turn[1], turn[0] @ (0.4 * rng.standard_normal((3, 3))) @ turn[1]
    return on_springs(F, V, np.linspace(-0.3, 0.3, 13))


def on_springs(F: Array, V: Array, time: Array) -> AffineProblem:
    """A ball on springs that has F and V (3, 3) at time 0 s, from time[0] < 0 on."""
    E, k = BALL, float(BALL[0, 0])
    back = Throw(E, (k,), F, -V, np.array([0.0, -time[0]]))
    F0, V0 = (x[-1] for x in sprung(back))
    throw = Throw(E, (k,), F0, -V0, time - time[0])
    return AffineProblem(throw, *sprung(throw), REDUCED_TOLERANCES)


@failure("affine", "Collapse", "shortest axis at the end", (0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-9, -1e-3, -0.3))
def collapse(level: float, rng: np.random.Generator) -> AffineProblem:
    """Det F passes zero, and no body goes on."""
    turn = random_rotations(rng, 2)
    end = np.arccos(level)  # of F_33 = cos t
    V = np.zeros((3, 3))
    V[:2, :2] = rng.uniform(-0.5, 0.5, (2, 2)) + 2 * hat(EYE[2])[:2, :2]
    throw = Throw(
        BALL, (BALL[0, 0],), turn[0] @ turn[1], turn[0] @ V @ turn[1], np.linspace(0, end, 21), 0.01
    )
    return AffineProblem(throw, *sprung(throw), REDUCED_TOLERANCES)


def elastic(throw: Throw, tolerance: float = 1e-12) -> AffineProblem:
    """The truth of an elastic body."""
    return AffineProblem(throw, *followed(throw, tolerance), REDUCED_TOLERANCES)


@failure(
    "affine", "Nearly incompressible, step 0.01 s", "lambda over mu", (1.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7,
    1e8),
)  # fmt: skip
def nearly_incompressible(level: float, rng: np.random.Generator) -> AffineProblem:
    """Volume vibrates many times a step."""
    c = 1.7 * level / 4 - 0.25
    throw = Throw(BALL, natural_constants(0.6, 0.25, c), *unstrained(rng, 0.1), np.linspace(0, 0.5, 11), 0.01)
    return elastic(throw, 1e-12 if level < 1e5 else 1e-9)


@failure("affine", "Long step", "rad of the fastest vibration", (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 3.0))
def long_step(level: float, rng: np.random.Generator) -> AffineProblem:
    """A step goes over the barrier, or vibrates against it."""
    fastest = np.sqrt(4 * (0.6 + 1.0 + 1.2) / 1.7)
    F0 = EYE + 0.15 * rng.standard_normal((3, 3))
    throw = Throw(BALL, SOFT, F0, rng.standard_normal((3, 3)), np.linspace(0, 5, 6), level / fastest)
    return elastic(throw)


@failure(
    "affine", "Incompressible start of another volume", "of det F", (0.0, 1e-15, 1e-13, 1e-11, 1e-10, 1e-8,
    1e-4, 1e-2),
)  # fmt: skip
def off_volume(level: float, rng: np.random.Generator) -> AffineProblem:
    """What is to be kept does not hold at the start."""
    F0, V0 = unstrained(rng, 0.1)
    material = (0.6, 0.25, 0.0, 0.0)
    time = np.linspace(0, 2, 11)
    truth = followed(Throw(BLOCK, material, F0, V0, time, held=True))
    throw = Throw(BLOCK, material, F0 * np.cbrt(1 + level), V0, time, 0.005, held=True)
    return AffineProblem(throw, *truth, (1e-6, 1e-6))


@failure(
    "affine", "Rigid limit with alike moments", "of their size", (0.5, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-13,
    0.0),
)  # fmt: skip
def alike_moments(level: float, rng: np.random.Generator) -> AffineProblem:
    """The modulus of the elliptic functions and its angle become ratios of small numbers."""
    J = np.array([1.0, 1.6, 1.6 * (1 + level)])
    turn = random_rotations(rng, 1)[0]
    w0, time = 2 * rng.standard_normal(3), np.linspace(0, 5, 11)

    def rates(_: float, y: Array) -> Array:
        L, w = y[:9].reshape(3, 3), y[9:]
        return np.concatenate([(L @ hat(w)).ravel(), np.cross(J * w, w) / J])

    y0 = np.concatenate([EYE.ravel(), w0])
    y = solve_ivp(rates, (0, time[-1]), y0, "DOP853", time, rtol=TIGHTEST, atol=1e-15).y.T
    L = turn @ y[:, :9].reshape(-1, 3, 3) @ turn.T
    tensor = (turn * J) @ turn.T
    return AffineProblem((tensor, turn @ w0, time), L, y[:, 9:] @ turn.T, REDUCED_TOLERANCES)
