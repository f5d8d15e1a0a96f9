"""Who factors deformations, and how: forceid, and what one writes with numpy and scipy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import polar as scipy_polar

from evidence.subject import Answer, at_once
from evidence.subjects.affine.bodies import DeformedFrames
from evidence.subjects.affine.problem import AffineProblem
from evidence.vectors import EYE
from forceid.pseudorigid import bipolar_path, bipolar_rates, polar, polar_rates
from forceid.pseudorigid.factors.bipolar_path import FRAME_TURN
from forceid.records import Array, Flags

RESIDUAL = 1e-13  # of F, that factors may leave
TOLD = "rates are not defined about axes between close values"


def polar_factor(problem: AffineProblem) -> Answer:
    """`polar` and `polar_rates`."""
    given: DeformedFrames = problem.given
    found = polar_rates(given.F, given.dF)
    every = np.tile(found.rounding[:, None] / np.sqrt(3), (1, 3))
    return with_rounding(problem, polar(given.F)[0], found.omega, every)


def with_rounding(problem: AffineProblem, motion: Array, rate: Array, rounding: Array) -> Answer:
    """An answer whose rates come with what rounding may have cost."""
    at = np.isfinite(rate) & np.isfinite(rounding)
    told = float(np.linalg.norm(rounding[at])) / max(float(np.linalg.norm(rate[at])), 1e-300)
    if told <= problem.promised[1]:
        return Answer((motion, rate))
    return Answer((motion, rate), (problem.promised[0], told), "degraded", ("rounding of F swamps rates",))


def by_loop(F: Array) -> Array:
    """Rotations by scipy.linalg.polar, frame by frame."""
    return np.array([scipy_polar(f)[0] for f in F])


def by_svd(F: Array) -> Array:
    """Rotations L R of numpy.linalg.svd of all at once."""
    L, _, R = np.linalg.svd(F)
    return np.asarray(L @ R)


def unscaled(F: Array) -> Array:
    """Newton's iteration as one finds it in textbooks, until nothing changes by 1e-12, at most a hundred."""
    X = F
    for _ in range(100):
        last, X = X, 0.5 * (X + np.linalg.inv(X).swapaxes(1, 2))
        if np.abs(X - last).max() < 1e-12:
            break
    return np.asarray(X)


def by_formula(by: Callable[[Array], Array], problem: AffineProblem) -> Answer:
    """Rotations by a function, and their rates by the formula of section 2."""
    given: DeformedFrames = problem.given
    L = by(given.F)
    A, U = L.swapaxes(1, 2) @ given.dF, L.swapaxes(1, 2) @ given.F
    skew = A - A.swapaxes(1, 2)
    inertia = np.trace(U, axis1=1, axis2=2)[:, None, None] * EYE - U
    vee = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], 1)
    return Answer((L, np.linalg.solve(inertia, vee[..., None])[..., 0]))


def rates_here(problem: AffineProblem) -> Answer:
    """`bipolar_rates`."""
    given: DeformedFrames = problem.given
    r = bipolar_rates(given.F, given.dF)
    both = np.concatenate([r.rounding, r.rounding], -1)
    answer = with_rounding(problem, r.D, spins(r.L, r.R, r.omega, r.lam), both)
    return answer if r.defined.all() else replace(answer, verdict="degraded", reasons=(TOLD,))


def spins(L: Array, R: Array, omega: Array, lam: Array) -> Array:
    """Spins of both bases (frame, 6) in axes that no labels change: L omega, R^T lam."""
    return np.concatenate([L @ omega[..., None], R.swapaxes(1, 2) @ lam[..., None]], 1)[..., 0]


def svd_rotations(F: Array) -> tuple[Array, Array, Array]:
    """numpy.linalg.svd with both factors made rotations."""
    L, D, R = np.linalg.svd(F)
    flip = np.linalg.det(R) < 0
    R[flip, 2] *= -1
    L[flip, :, 2] *= -1
    return L, D, R


def svd_rates(given: DeformedFrames, L: Array, D: Array, R: Array) -> Array:
    """Spins (frame, 6) of factors by the formulas of section 2."""
    A = L.swapaxes(1, 2) @ given.dF @ R.swapaxes(1, 2)
    i, j = np.array([1, 2, 0]), np.array([2, 0, 1])
    s = (A[:, j, i] - A[:, i, j]) / (D[:, i] + D[:, j])
    d = (A[:, j, i] + A[:, i, j]) / (D[:, i] - D[:, j])
    return spins(L, R, (s + d) / 2, (s - d) / 2)


def rates_svd(problem: AffineProblem) -> Answer:
    """numpy.linalg.svd and the formulas."""
    L, D, R = svd_rotations(problem.given.F)
    return Answer((D, svd_rates(problem.given, L, D, R)))


def path_here(problem: AffineProblem) -> Answer:
    """`bipolar_path`."""
    given: DeformedFrames = problem.given
    p = bipolar_path(given.F, given.dF)
    assert p.omega is not None
    assert p.lam is not None
    rate, defined = spins(p.L, p.R, p.omega, p.lam), np.asarray(p.defined.all(-1))
    off = of_path(problem, p.L, p.D, p.R, rate, p.continuous, defined)
    if not p.continuous.all():
        said = ("frames do not show how the axes go on",)
        return Answer((p.D, p.D), None, "degraded", said, off)
    if not defined.all():
        return Answer((p.D, p.D), None, "degraded", (TOLD,), off)
    return Answer((p.D, p.D), off=off)


def of_path(
    problem: AffineProblem, L: Array, D: Array, R: Array, rate: Array, shown: Flags, defined: Flags
) -> tuple[float, float]:
    """Largest unflagged turn of a basis between frames over TURN, or residual over 1e-13; error of rates."""
    F = problem.given.F
    left = np.linalg.norm(F - (L * D[:, None]) @ R, axis=(1, 2)) / np.linalg.norm(F, axis=(1, 2))
    step = np.stack([L[:-1].swapaxes(1, 2) @ L[1:], R[1:] @ R[:-1].swapaxes(1, 2)])
    angle = np.arccos(np.clip(0.5 * (np.trace(step, axis1=2, axis2=3) - 1), -1, 1)).max(0)
    jump = np.where(shown[1:], angle, 0.0).max()
    known = defined & np.isfinite(rate).all(1)
    miss = np.linalg.norm((rate - problem.rate)[known]) / np.linalg.norm(problem.rate[known])
    return float(max(jump / FRAME_TURN, left[defined].max() / RESIDUAL)), float(miss)


def path_svd(problem: AffineProblem) -> Answer:
    """numpy.linalg.svd frame by frame."""
    L, D, R = svd_rotations(problem.given.F)
    return unflagged(problem, L, D, R)


def path_signs(problem: AffineProblem) -> Answer:
    """The same, with signs as in the frame before."""
    L, D, R = svd_rotations(problem.given.F)
    for k in range(1, len(L)):
        sign = np.sign((L[k] * L[k - 1]).sum(0) + (R[k] * R[k - 1]).sum(1))
        L[k], R[k] = L[k] * sign, R[k] * sign[:, None]
    return unflagged(problem, L, D, R)


def unflagged(problem: AffineProblem, L: Array, D: Array, R: Array) -> Answer:
    """Factors of a path that say nothing."""
    every = np.ones(len(L), bool)
    off = of_path(problem, L, D, R, svd_rates(problem.given, L, D, R), every, every)
    return Answer((D, D), off=off)


POLAR = (
    at_once("polar", polar_factor),
    at_once("scipy.linalg.polar", partial(by_formula, by_loop), kind="peer"),
    at_once("numpy svd", partial(by_formula, by_svd), kind="peer"),
    at_once("Newton, unscaled", partial(by_formula, unscaled), kind="peer"),
)
RATES = (at_once("bipolar_rates", rates_here), at_once("numpy svd", rates_svd, kind="peer"))
PATHS = (
    at_once("bipolar_path", path_here), at_once("numpy svd", path_svd, kind="peer"),
    at_once("numpy svd, signs matched", path_signs, kind="peer"),
)  # fmt: skip
