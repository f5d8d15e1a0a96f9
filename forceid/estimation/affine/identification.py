"""Constants of an elastic affine body from one free flight: the likeliest flight under weight alone.

The affine map of every frame holds all that markers say of F. Its likeliest free flight is found by
Gauss and Newton over the start and the constants, from a few periods on to the whole record, since a phase
that is off by a turn has a minimum of its own; their covariance is that of the Fisher information with the
noise that the markers show within the frames. Source: pseudo-rigid bodies, sections 1 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from forceid.errors import DataError
from forceid.estimation.affine.free_flight import LAWS, UNKNOWN, FreeBody
from forceid.estimation.body.affine_fit import fit_affine
from forceid.estimation.body.inertia import inertia_of, second_moment
from forceid.estimation.body.markers import marker_noise
from forceid.records import Array, Body, Motion, all_finite
from forceid.rounding import ITERATIONS

FIRST_FRAMES = 8  # frames of the first horizon: 72 numbers for the 21 unknown
FURTHER = 4  # times a horizon: a phase within a tenth of a turn is within half a turn then
ROUGH_FIT, FINE_FIT = (
    1e-4,
    1e-6,
)  # of the sum of squares, and of the unknown: less ends iterations, on the way and at last
GROSS = 4.0  # chi-square per degree of freedom: the flight is off by twice the noise
APART = 1.1  # times a constant: starts as near as that come to the same within the first period
MEASURED = 100  # numbers within frames that tell the noise to 7 %


@dataclass(frozen=True)
class Frames:
    """Affine maps F (time, 9) of the frames that show them, white (time, 3, 3): their columns times it are of
    unit variance; E (3, 3) kg m2; sigma m: of the noise, and dof: how many numbers within frames told it,
    0 where it is stated or rough. falls: chi-square per degree of freedom of a mass center that falls freely,
    NaN where it is not shown.
    """

    time: Array
    F: Array
    white: Array
    E: Array
    sigma: float
    dof: int
    falls: float

    @property
    def strains(self) -> float:
        """Chi-square per degree of freedom of a strain that does not change."""
        F = self.F.reshape(-1, 3, 3)
        strain = 0.5 * (F.mT @ F - np.eye(3))
        column = np.linalg.inv(self.white @ self.white.mT)  # covariance of the entries of a row of F
        c = np.diagonal(column, axis1=1, axis2=2)
        var = 0.25 * (c[:, :, None] + c[:, None]) * (1 + np.eye(3))  # to first order about a rotation
        weight = 1 / var
        off = strain - (weight * strain).sum(0) / weight.sum(0)
        upper = np.triu_indices(3)
        return float((off**2 / var)[:, upper[0], upper[1]].sum() / (6 * (len(F) - 1)))


@dataclass(frozen=True)
class FittedFlight:
    """The likeliest free flight of a law: p (21,) start and constants, cov (3, 3) of the constants,
    chi_square of dof numbers; of the first part of the record alone where even that is off.
    """

    law: str
    p: Array
    cov: Array
    chi_square: float
    dof: int

    @property
    def misfit(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi_square / self.dof


def frames_of(body: Body, motion: Motion, stated: float | None) -> Frames:
    """The affine map of every frame; stated: noise (m), where it is. Raises DataError for a motion that shows
    none, or a body without breadth.
    """
    x = motion.measured
    if x is None or body.position is None:
        raise DataError(
            "holds no markers", "/motion/position", "constants of a material show in markers only"
        )
    inertia = inertia_of(body)
    E = second_moment(inertia.tensor)
    if not (np.linalg.eigvalsh(E) > 1e-6 * np.trace(E)).all():
        raise DataError("has no breadth", "/body", "an affine body needs mass off a plane")
    X = body.position - inertia.center
    fit = fit_affine(x, X, 1.0)
    if fit.plane:
        raise DataError("lie in a plane", "/body/position", "mark a point off it: stretch across is not seen")
    left = x - fit.center[:, None] - np.einsum("tab,nb->tna", fit.F, X)
    count = all_finite(left).sum(1)
    dof = int(3 * (count[count > 4] - 4).sum())
    dof = dof if dof >= MEASURED else 0
    within = float(np.sqrt(np.nansum(left**2) / max(dof, 1)))
    sigma = within if dof else stated or marker_noise(motion.time, x)
    seen = np.isfinite(fit.F).all((1, 2))
    if 9 * seen.sum() < 4 * UNKNOWN:
        what = f"show F in {seen.sum()} frames, expected {-(-4 * UNKNOWN // 9)} at least"
        raise DataError(what, "/motion/position", "four markers off a plane do in a frame")
    time = motion.time[seen] - motion.time[seen][0]
    white = np.linalg.inv(np.linalg.cholesky(fit.cov[seen, 1:, 1:] * sigma**2)).mT
    std = sigma * np.sqrt(fit.cov[seen, 0, :1])
    fallen = (fit.center[seen] - 0.5 * time[:, None] ** 2 * motion.gravity) / std
    falls = float(np.linalg.lstsq(np.vander(time, 2) / std, fallen)[1].sum() / (3 * len(time) - 6))
    return Frames(time, fit.F[seen].reshape(-1, 9), white, E, sigma, dof, falls)


def fit_flight(frames: Frames, law: str, starts: int) -> FittedFlight | None:
    """The likeliest free flight of a law, None where none was found.

    starts: tried at most, until one is not off by twice the noise.
    """
    best = None
    for lam, mu in rough_constants(frames, law)[:starts]:
        found = grown_horizon(frames, law, lam, mu)
        if found is not None and (best is None or found.misfit < best.misfit):
            best = found
        if best is not None and best.misfit < GROSS:
            break
    return best


def grown_horizon(frames: Frames, law: str, lam: float, mu: float) -> FittedFlight | None:
    """A flight fitted to more and more of the record, from rough constants; None where one fit fails."""
    body, time = FreeBody(frames.E, law), frames.time
    period = 2 * np.pi * np.sqrt(np.trace(frames.E) / 3 / (lam + 2 * mu))
    horizon = max(period, time[min(FIRST_FRAMES, len(time) - 1)])
    first = max(3, int((time <= period / 8).sum()))
    slope, at = np.polyfit(time[:first], frames.F[:first], 1)
    p = np.concatenate([at, slope, [lam, mu, 0.0]])
    while True:
        count = int((time <= horizon).sum())
        tolerance = FINE_FIT if count == len(time) else ROUGH_FIT
        found = likeliest_flight(body, frames, count, p, tolerance)
        if found is None:
            return None
        p, r, J = found
        if count == len(time) or r @ r > GROSS * len(r):
            break
        horizon *= FURTHER
    size = np.linalg.norm(J, axis=0)
    if not (size > 0).all() or np.linalg.matrix_rank(J / size) < len(p):
        return None
    cov = np.linalg.inv((J / size).T @ (J / size)) / size / size[:, None]
    return FittedFlight(law, p, cov[18:, 18:], float(r @ r), len(r) - len(p))


def likeliest_flight(
    body: FreeBody, frames: Frames, count: int, start: Array, tolerance: float
) -> tuple[Array, Array, Array] | None:
    """The likeliest p (21,) of the first frames, from a start, with residuals and their slopes by p."""
    time, white, F = (a[:count] for a in (frames.time, frames.white, frames.F.reshape(-1, 3, 3)))

    @lru_cache(1)
    def flown(p: tuple[float, ...]) -> tuple[Array, Array]:
        path, by = body.fly(np.array(p), time)
        J = np.einsum("tabp,tbc->tacp", by.reshape(-1, 3, 3, UNKNOWN), white)
        return ((path.reshape(-1, 3, 3) - F) @ white).ravel(), J.reshape(-1, UNKNOWN)

    def residual(p: Array) -> Array:
        return flown(tuple(p))[0]

    def slopes(p: Array) -> Array:
        return flown(tuple(p))[1]

    if not np.isfinite(residual(start)).all():
        return None
    found = least_squares(
        residual, start, slopes, x_scale="jac", ftol=tolerance, xtol=tolerance, max_nfev=ITERATIONS
    )
    return found.x, np.asarray(found.fun), np.asarray(found.jac)


def rough_constants(frames: Frames, law: str) -> list[tuple[float, float]]:
    """Constants lam, mu that balance F'' E against the stress over windows of many widths, the best first.

    By parts: the second derivative falls on the window, (1 - s^2)^3.
    """
    one, other = (LAWS[law](*c) for c in ((1.0, 1.0), (2.0, 1.0)))
    time, F = frames.time, frames.F.reshape(-1, 3, 3)
    try:
        by_lam = other.gradient(F) - one.gradient(F)
    except DataError:  # it went through det F = 0, as this law does not let
        return []
    by_mu = one.gradient(F) - by_lam
    weight = np.gradient(time)
    span, found = np.ptp(time), []
    half = 2 * span / len(time)
    while half < span / 2:
        center = np.arange(time[0] + half, time[-1] - half, half / 2)[:400]
        s = (time - center[:, None]) / half
        inside = np.abs(s) < 1
        bump = np.where(inside, (1 - s**2) ** 3, 0.0) * weight
        bend = np.where(inside, 6 * (1 - s**2) * (5 * s**2 - 1), 0.0) / half**2 * weight
        driven = np.einsum("ct,tab->cab", bend, F @ frames.E).ravel()
        held = -np.stack([np.einsum("ct,tab->cab", bump, by).ravel() for by in (by_lam, by_mu)], 1)
        theta, left, *_ = np.linalg.lstsq(held, driven)
        if len(left) and theta[1] > 0:
            lam = max(theta[0], 0.0)
            found.append((float(left[0] / (driven**2).sum()), float(lam), float(theta[1])))
        half *= 1.5
    apart: list[tuple[float, float]] = []
    for _, lam, mu in sorted(found):
        if all(max(mu / m, m / mu) > APART for _, m in apart):
            apart.append((lam, mu))
    return apart
