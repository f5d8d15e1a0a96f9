"""Parameters of a linear model by maximum likelihood, with the exact score, and how far to trust them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from forceid.errors import EstimationError
from forceid.kalman.model import StateSpace
from forceid.kalman.tuning.gradient import NAMES, score
from forceid.records import Array, Flags
from forceid.rounding import CENTRAL_STEP, COMPLEX_STEP
from forceid.significance import PATIENCE, SIGMAS, THOUSANDTH

Build = Callable[[Array], StateSpace]


@dataclass(frozen=True)
class Fit:
    """Most likely parameters theta (parameter,), and what is known of them.

    covariance (parameter, parameter): inverse of the observed information, NaN in the directions in which
    there is none; model: build(theta); at_bound (parameter,): pushed against a bound; flat: some direction
    that the record does not fix within the bounds; bimodal: another maximum, e^PATIENCE as likely at least,
    more than three standard deviations away: rival is its theta, else None.
    """

    theta: Array
    covariance: Array
    log_likelihood: float
    model: StateSpace
    at_bound: Flags
    flat: bool
    bimodal: bool
    rival: Array | None


def tune(
    build: Build,
    theta: ArrayLike,
    z: Array,
    bounds: Sequence[tuple[float, float]] | None = None,
    starts: Sequence[ArrayLike] = (),
    engine: str = "auto",
) -> Fit:
    """Maximum likelihood over the parameters of build(theta) -> StateSpace, from theta and further starts.

    z (time, channel), NaN = missing; bounds: (lower, upper) of each parameter. Choose parameters of order
    one: logarithms of std and rates. Derivatives of the matrices are taken by complex steps where build
    passes complex numbers on, else by central differences. A point where the model is refused counts as
    impossible; EstimationError if every start is. Source: Koopman and Shephard (1992).

    >>> from forceid import kalman
    >>> z = 3.0 * np.random.default_rng(0).standard_normal(400)
    >>> def build(p):
    ...     return StateSpace(np.eye(1), np.zeros((1, 1)), np.eye(1), np.exp(2 * p[0]) * np.eye(1),
    ...                       np.zeros(1), np.zeros((1, 1)))
    >>> fit = tune(build, [0.0], z)
    >>> bool(np.isclose(np.exp(fit.theta[0]), np.sqrt(np.mean(z**2))))
    True
    >>> bool(np.isclose(fit.covariance[0, 0], 1 / 800, rtol=1e-3))
    True
    """
    first = np.asarray(theta, float)
    limits = np.tile([-np.inf, np.inf], (len(first), 1)) if bounds is None else np.asarray(bounds, float)

    def minus(p: Array) -> tuple[float, Array]:
        try:
            model = build(p)
            found = score(model, z, engine)
        except (EstimationError, np.linalg.LinAlgError, FloatingPointError):
            return np.inf, np.zeros(len(p))
        slope = np.array([found.along(change) for change in model_derivatives(build, p)])
        return -found.log_likelihood, -slope

    tops: list[tuple[float, Array]] = []
    for start in [first, *(np.asarray(s, float) for s in starts)]:
        at = np.clip(start, *limits.T)
        if np.isfinite(minus(at)[0]):
            top = minimize(minus, at, jac=True, method="L-BFGS-B", bounds=limits, options={"ftol": 1e-12})  # type: ignore[call-overload]
            tops.append((-float(top.fun), np.asarray(top.x, float)))
    if not tops:
        raise EstimationError(
            "is refused at every start", "the model to tune", "start from parameters that the model allows"
        )
    value, best = max(tops, key=lambda top: top[0])
    # a few units of rounding of the range
    width = np.where(np.isfinite(np.ptp(limits, axis=1)), np.ptp(limits, axis=1), 1.0)
    at_bound = (best[:, None] - limits).__abs__().min(1) <= 1e-8 * width
    covariance, flat = observed_covariance(lambda p: minus(p)[1], best, limits, at_bound)
    rival = next((p for v, p in tops if v > value - PATIENCE and maxima_differ(p - best, covariance)), None)
    return Fit(best, covariance, value, build(best), at_bound, flat, rival is not None, rival)


def model_derivatives(build: Build, theta: Array) -> list[StateSpace]:
    """Derivative of every matrix of build(theta) in each parameter, as models of changes."""
    found = []
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1.0
        found.append(by_complex_step(build, theta, step) or by_difference(build, theta, step))
    return found


def by_complex_step(build: Build, theta: Array, step: Array) -> StateSpace | None:
    """Derivative along a step, exact to rounding; None where build does not pass complex numbers on."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            moved = build(theta + 1j * COMPLEX_STEP * step)
    except (TypeError, ValueError, np.exceptions.ComplexWarning, np.linalg.LinAlgError):
        return None
    if not any(map(np.iscomplexobj, matrices_of(moved))):
        return None
    change: list[Any] = [None if a is None else np.imag(a) / COMPLEX_STEP for a in matrices_of(moved)]
    return StateSpace(*change)


def by_difference(build: Build, theta: Array, step: Array) -> StateSpace:
    """Derivative along a step, by central difference."""
    h = CENTRAL_STEP * max(1.0, float(np.abs(theta @ step)))
    ahead, behind = build(theta + h * step), build(theta - h * step)
    pairs = zip(matrices_of(ahead), matrices_of(behind), strict=True)
    change: list[Any] = [None if a is None else (a - b) / (2 * h) for a, b in pairs]
    return StateSpace(*change)


def matrices_of(model: StateSpace) -> list[Any]:
    """F, Q, H, R, x0, P0 and u of a model."""
    return [getattr(model, name) for name in NAMES]


def observed_covariance(
    slope: Callable[[Array], Array], theta: Array, limits: Array, fixed: Flags
) -> tuple[Array, bool]:
    """Covariance by the observed information, and whether some direction goes without.

    slope: gradient of the negative log-likelihood. Parameters at a bound are held there: their covariance is
    zero. No information: a standard deviation as large as the range, or a curvature of the wrong sign.
    """
    free = np.flatnonzero(~fixed)
    size = CENTRAL_STEP * np.maximum(1.0, np.abs(theta))
    information = np.zeros((len(free), len(free)))
    for row, i in enumerate(free):
        h = np.zeros(len(theta))
        h[i] = min(size[i], *np.maximum(np.abs(limits[i] - theta[i]), 1e-12))
        information[row] = ((slope(theta + h) - slope(theta - h)) / (2 * h[i]))[free]
    information = 0.5 * (information + information.T)
    covariance = np.zeros((len(theta), len(theta)))
    if not len(free):
        return covariance, False
    curved, axes = np.linalg.eigh(information)
    least = np.where(np.isfinite(limits).all(1), np.ptp(limits, axis=1), np.inf)[free]
    # along an axis the range is that of the parameters it is made of
    reach = 1 / np.sqrt((axes**2 / (0.5 * least[:, None]) ** 2).sum(0).clip(1e-300))
    flat = bool((curved <= np.maximum(1e-8 * curved[-1], 1 / reach**2)).any())
    inside = np.where(curved > 1e-8 * max(curved[-1], 0.0), curved, np.nan)
    covariance[np.ix_(free, free)] = (axes / inside) @ axes.T if np.isfinite(inside).all() else np.nan
    return covariance, flat


def maxima_differ(difference: Array, covariance: Array) -> bool:
    """Whether two maxima are further apart than chance, by the covariance of one."""
    var = np.diag(covariance)
    known = np.isfinite(var) & (var > 0)
    if not known.any():
        return bool(np.abs(difference).max() > THOUSANDTH)
    return bool((np.abs(difference[known]) > SIGMAS * np.sqrt(var[known])).any())
