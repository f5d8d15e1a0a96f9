"""First moments applied to an affine body of known material: stress is part of the motion, not of the load.

F'' E = K - P(F, F') is linearized about the smoothed path, by the flow of every step and its derivatives, and
smoothed again: so the prior has to follow what is applied alone, however stiff the body. Source: pseudo-rigid
bodies, sections 1 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from scipy.optimize import minimize_scalar

from forceid.errors import EstimationError
from forceid.estimation.body.affine_fit import fit_affine
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.material import Solid
from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.kalman.building.process import Process, discretize, matern
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array, Flags
from forceid.significance import NUMBER

PHASE_STEP = 0.3  # rad of the fastest vibration in a step of Runge and Kutta: 2e-5 of its amplitude
SMOOTH = (2, 3)  # orders of the prior that are tried
LINEARIZATIONS = 3  # each leaves the square of what the last was off
SLOWEST, FASTEST = 2.0, 0.3  # rate of the prior: of a record, and of a step
RATES_LOOKED_AT = 5  # rates of the prior, and four about the best
UNKNOWN_START = 10.0  # times what the path shows: as good as unknown


@dataclass(frozen=True)
class AppliedPrior:
    """Matern prior of the entries of K along the axes of loads: order, rate 1/s, std (9,) J."""

    order: int
    rate: float
    std: Array

    @property
    def unit(self) -> Process:
        """Of unit size."""
        return matern(self.order, 1.0, self.rate)


@dataclass(frozen=True)
class AppliedMoments:
    """F (time, 3, 3), dF 1/s; K J: first moments applied, arms in the reference; cov (time, 27, 27) of K, F
    and dF, row by row.
    """

    F: Array
    dF: Array
    K: Array
    cov: Array
    prior: AppliedPrior


@dataclass(frozen=True)
class Elastic:
    """What an elastic body makes of a load: solid, E (3, 3); z (time, 9), F as frames show it with noise
    (time, 9, 9), NaN where they do not; rotation (time, 3, 3) of the axes of loads.
    """

    solid: Solid
    E: Array
    time: Array
    z: Array
    noise: Array
    rotation: Array

    def part(self, of: slice) -> Elastic:
        """A part of the record."""
        own = {name: getattr(self, name)[of] for name in ("time", "z", "noise", "rotation")}
        return replace(self, **own)


def applied_moments(
    kin: Kinematics, E: Array, F: Array, dF: Array, solid: Solid, axes: Array, engine: Engine
) -> AppliedMoments:
    """Applied first moments, from a path F, dF (time, 3, 3) that is about right.

    E (3, 3) kg m2: second moment; axes (time, 3, 3): rotations of those along which the load is smooth, its
    arms are along the reference axes. EstimationError where the path does not smooth.
    """
    assert kin.markers is not None
    lost: Flags = np.asarray(np.isnan(kin.pose.center).any(1))
    seen = np.where(lost[:, None, None], np.nan, kin.markers.measured)
    fit = fit_affine(seen, kin.markers.X, kin.noise["position"] ** 2)
    column = np.where(np.isfinite(fit.cov).all((1, 2), keepdims=True), fit.cov, np.eye(4))[:, 1:, 1:]
    noise = np.einsum("ab,tcd->tacbd", np.eye(3), column).reshape(-1, 9, 9)
    body = Elastic(solid, E, kin.time, fit.F.reshape(-1, 9), noise, axes)
    x = np.concatenate([F.reshape(-1, 9), dF.reshape(-1, 9)], 1)
    prior = tuned_prior(body, x, engine)
    for look in range(LINEARIZATIONS):
        path = engine.smooth(model_of(body, flow(body, x, prior), x, prior), body.z)
        if not np.isfinite(path.x).all():
            raise EstimationError("does not smooth", "the motion of this material", "look at its constants")
        x = path.x
        if look < LINEARIZATIONS - 1:
            prior = resized(body, x, path.P, prior, engine)
    rows = np.zeros((len(x), 27, x.shape[1]))
    rows[:, :9, 18:27], rows[:, 9:, :18] = row_by_row(axes, np.eye(3)), np.eye(18)
    K = (rows[:, :9] @ x[..., None]).reshape(-1, 3, 3)
    path_F, path_dF = (x[:, a : a + 9].reshape(-1, 3, 3) for a in (0, 9))
    return AppliedMoments(path_F, path_dF, K, rows @ path.P @ rows.mT, prior)


def row_by_row(left: Array, right: Array) -> Array:
    """What takes X (3, 3) to left X right, row by row: (..., 9, 9)."""
    both = np.einsum("...ab,...dc->...acbd", left, right)
    return np.asarray(both.reshape(*both.shape[:-4], 9, 9))


def tuned_prior(body: Elastic, x: Array, engine: Engine) -> AppliedPrior:
    """The likeliest prior of one size and one rate, from the middle of a long record.

    x (time, 18): F and F', about which it is linearized.
    """
    middle_part = middle(len(x), FLIGHT_SAMPLES)
    own, path = body.part(middle_part), x[middle_part]
    stress = body.solid.stress(path[:, :9].reshape(-1, 3, 3), path[:, 9:18].reshape(-1, 3, 3))
    slow, fast = np.log([SLOWEST / np.ptp(own.time), FASTEST / np.median(np.diff(own.time))])
    size = float(np.log(0.1 * np.std(stress) + 1e-300))
    found: dict[tuple[int, float], tuple[float, AppliedPrior]] = {}

    def look(order: int, rate: float, size: float) -> float:
        prior = AppliedPrior(order, float(np.exp(rate)), np.ones(9))
        steps = flow(own, path, prior)

        def cost(log_size: float) -> float:
            sized = replace(prior, std=np.full(9, np.exp(log_size)))
            value = float(engine.filter(model_of(own, steps, path, sized), own.z).log_likelihood)
            return -value if np.isfinite(value) else np.inf

        best = minimize_scalar(cost, bracket=(size - 1.0, size), options={"xtol": 0.02, "maxiter": 8})
        found[order, rate] = -float(best.fun), replace(prior, std=np.full(9, np.exp(best.x)))
        return float(best.x)

    apart = (fast - slow) / (RATES_LOOKED_AT - 1)
    for rate in np.linspace(fast, slow, RATES_LOOKED_AT):
        size = look(SMOOTH[0], float(rate), size)
    for share in (0.5, 0.25):
        _, rate = max(found, key=lambda key: found[key][0])
        for side in (-share, share):
            look(SMOOTH[0], rate + side * apart, float(np.log(found[SMOOTH[0], rate][1].std[0])))
    _, rate = max(found, key=lambda key: found[key][0])
    size = float(np.log(found[SMOOTH[0], rate][1].std[0]))
    for side in (0.0, 0.5, 1.0):  # a smoother kernel has its bend at a higher rate
        look(SMOOTH[1], rate + side * apart, size)
    return max(found.values(), key=lambda one: one[0])[1]


def resized(body: Elastic, x: Array, P: Array, prior: AppliedPrior, engine: Engine) -> AppliedPrior:
    """The prior with a size for each entry of K, where a record calls for that (expectation-maximization)."""
    seen = x[:, 18:27] ** 2 + np.diagonal(P, axis1=1, axis2=2)[:, 18:27]
    own = replace(prior, std=np.sqrt(seen.mean(0)))
    steps = flow(body, x, prior)
    value, before = (
        float(engine.filter(model_of(body, steps, x, p), body.z).log_likelihood) for p in (own, prior)
    )
    return own if value > before + NUMBER * (len(own.std) - 1) else prior


def model_of(body: Elastic, steps: tuple[Array, Array], x: Array, prior: AppliedPrior) -> StateSpace:
    """The linear model of F, F' and the load, from `flow` about states x (time, 18 or more)."""
    (Phi, u), s, unit = steps, prior.order, prior.unit
    n = 18 + 9 * s
    chain = np.zeros((2 + s, 2 + s))
    chain[0, 1], chain[1, 2], chain[2:, 2:] = 1.0, 1.0, unit.A
    Qc = np.zeros_like(chain)
    Qc[2:, 2:] = unit.Qc
    step, which = np.unique(np.round(np.diff(body.time), 12), return_inverse=True)
    q = discretize(Process(chain, Qc, Qc, chain[0]), step)[1][which]
    pull = row_by_row(body.rotation[:-1], np.asarray(np.linalg.inv(body.E))) * prior.std
    wide = np.concatenate(
        [pull[:, None], pull[:, None], *s * [np.broadcast_to(np.diag(prior.std), (len(q), 1, 9, 9))]], 1
    )
    Q = np.einsum("tab,taic,tbjc->taibj", q, wide, wide, optimize=True).reshape(len(q), n, n)
    speed = UNKNOWN_START * np.sqrt(np.mean(x[:, 9:18] ** 2))
    P0 = np.zeros((n, n))
    P0[:9, :9], P0[9:18, 9:18] = UNKNOWN_START**2 * np.eye(9), speed**2 * np.eye(9)
    P0[18:, 18:] = np.kron(unit.P0, np.diag(prior.std**2))
    return StateSpace(Phi, Q, np.eye(9, n), body.noise, np.concatenate([x[0, :18], np.zeros(9 * s)]), P0, u)


def flow(body: Elastic, x: Array, prior: AppliedPrior) -> tuple[Array, Array]:
    """Steps x' = Phi x + u, Phi (step, n, n), u (step, n), about states x (time, 18 or more).

    By Runge and Kutta, in parts of a step. The load goes on by e^(A t), whose A has one eigenvalue.
    """
    s, rate, B = prior.order, prior.rate, len(x) - 1
    n = 18 + 9 * s
    about = np.zeros((B, n))
    about[:, : x.shape[1]] = x[:-1]
    h, still = np.diff(body.time), np.eye(3)[None]
    over = row_by_row(np.eye(3), np.asarray(np.linalg.inv(body.E)))
    w = np.sqrt(np.abs(np.linalg.eigvals(over @ body.solid.slopes(still, 0 * still)[0][0])).max())
    parts = max(1, int(np.ceil(w * h.max() / PHASE_STEP)))
    turn = row_by_row(body.rotation[:-1], np.eye(3))
    loads = about[:, 18:].reshape(B, s, 9)
    nilpotent = prior.unit.A + rate * np.eye(s)
    powers = [np.linalg.matrix_power(nilpotent, i) / factorial(i) for i in range(s)]

    def grown(t: Array) -> Array:
        """e^(A t) (step, s, s)."""
        each = [t[:, None, None] ** i * power for i, power in enumerate(powers)]
        return np.asarray(np.exp(-rate * t)[:, None, None] * sum(each))

    def rates(y: Array, row: Array) -> Array:
        """Of F and F' (step, 18, 1), and of their slopes by the start (step, 18, n) beside them."""
        F, V = y[:, :9, 0].reshape(B, 3, 3), y[:, 9:, 0].reshape(B, 3, 3)
        by_F, by_V = body.solid.slopes(F, V)
        push = -(by_F @ y[:, :9] + by_V @ y[:, 9:])
        push[..., 19:] += np.einsum("ts,tab->tasb", row, turn).reshape(B, 9, -1)
        pull = turn @ np.einsum("ts,tsa->ta", row, loads)[..., None]
        push[..., :1] = pull - body.solid.stress(F, V).reshape(B, 9, 1)
        return np.concatenate([y[:, 9:], over @ push], 1)

    y = np.concatenate([about[:, :18, None], np.broadcast_to(np.eye(18, n), (B, 18, n))], 2)
    d = (h / parts)[:, None, None]
    for k in range(parts):
        first, mid, last = (grown((k + share) * h / parts)[:, 0] for share in (0.0, 0.5, 1.0))
        one = rates(y, first)
        two = rates(y + 0.5 * d * one, mid)
        three = rates(y + 0.5 * d * two, mid)
        y = y + d / 6 * (one + 2 * two + 2 * three + rates(y + d * three, last))
    Phi = np.zeros((B, n, n))
    Phi[:, :18] = y[..., 1:]
    Phi[:, 18:, 18:] = np.einsum("tab,cd->tacbd", grown(h), np.eye(9)).reshape(B, 9 * s, -1)
    u = np.zeros((B, n))
    u[:, :18] = y[..., 0] - (Phi[:, :18] @ about[..., None])[..., 0]
    return Phi, u
