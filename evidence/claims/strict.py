"""The strict test of the smoother on rotations: flights drawn from the prior, error over the bound claimed.

    python -m evidence.claims.strict [--draws 24] [--seed 21] [--jobs 2]

A rigid body of five markers under a force and a moment that are Matern 3/2 processes in world axes, as the
smoother is told they are. Averaged over the prior no estimator beats the posterior bound, so the ratio is
one for a smoother that is right, whatever the loads. Source: principal equations 4f, 5.7. The flights come
from integration of its own; no code is shared with the estimator.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import FORCE, MOMENT, RecordScore, pooled, scored, stacked
from evidence.vectors import GRAVITY
from evidence.written import asked, each
from forceid.flight.channels import Start
from forceid.flight.model import Flight
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import smooth_flight
from forceid.kalman import engines
from forceid.motion import fit_pose

RATE, SECONDS, NOISE = 500.0, 0.6, 3e-4  # Hz, s, m
STD_F, RATE_F = np.array([1.3, 2.3, 0.9]), 20.0  # N, 1/s
STD_T, RATE_T = np.array([0.12, 0.09, 0.08]), 60.0  # N m, 1/s
SUBSTEPS = 20  # of the load's path, a sample
MARKER_AT = [0, 3, 8, 9, 14]
BOUND_F, BOUND_T = 0.05536, 0.01127  # N, N m: principal equations 5.7


def shape() -> tuple[Any, Any]:
    """Masses (node,) and places (node, 3) about the mass center of the boomerang, held rigid."""
    hub = [[-0.02, 0.0, 0.0], [0.015, 0.03, 0.012], [0.015, -0.03, -0.012]]
    arms = []
    for a in np.radians([55.0, -55.0]):
        e, n = np.array([np.cos(a), np.sin(a), 0.0]), np.array([-np.sin(a), np.cos(a), 0.0])
        for s, d in ((0.09, 0.012), (0.17, -0.012), (0.25, 0.012)):
            arms += [s * e + 0.018 * n + [0, 0, d], s * e - 0.018 * n - [0, 0, d]]
    m = np.array([0.008, 0.007, 0.007, *2 * (0.0062, 0.0058, 0.0058, 0.0054, 0.0066, 0.0062)])
    X = np.array([*hub, *arms])
    return m, X - m @ X / m.sum()


MASS, PLACE = shape()
CLUSTER_INERTIA = (MASS @ (PLACE**2).sum(1)) * np.eye(3) - PLACE.T @ (MASS[:, None] * PLACE)


def matern_path(std: Any, rate: float, time: Any, rng: np.random.Generator) -> CubicHermiteSpline:
    """A Matern 3/2 load (sample, 3), drawn exactly on a grid: stationary from the start."""
    stationary = np.diag([1.0, rate**2])
    F = expm(np.array([[0.0, 1.0], [-(rate**2), -2 * rate]]) * time[1])
    root = np.linalg.cholesky(stationary - F @ stationary @ F.T)
    x = np.empty((len(time), 2, 3))
    x[0] = np.sqrt(stationary) @ rng.standard_normal((2, 3))
    for k in range(len(time) - 1):
        x[k + 1] = F @ x[k] + root @ rng.standard_normal((2, 3))
    return CubicHermiteSpline(time, x[:, 0] * std, x[:, 1] * std)


def strict_flight(seed: int) -> tuple[Any, Any, Any, Any]:
    """Times, marker tracks with noise (time, marker, 3), and the true force and moment (time, 3)."""
    rng = np.random.default_rng(seed)
    fine = np.arange(int(SECONDS * RATE) * SUBSTEPS + 1) / RATE / SUBSTEPS
    force, moment = matern_path(STD_F, RATE_F, fine, rng), matern_path(STD_T, RATE_T, fine, rng)
    start = Rotation.from_rotvec([np.radians(70), 0, 0]) * Rotation.from_rotvec([0, 0, 0.3])
    H0, J_inv = start.apply(CLUSTER_INERTIA @ [0.5, -0.3, 20 * np.pi]), np.linalg.inv(CLUSTER_INERTIA)

    def rate(t: float, y: Any) -> Any:
        q = y[9:13]
        R = Rotation.from_quat(q).as_matrix()
        w = R @ J_inv @ R.T @ y[6:9]
        spun = 0.5 * np.array([*(q[3] * w + np.cross(w, q[:3])), -w @ q[:3]])
        return np.concatenate([y[3:6], force(t) / MASS.sum() + GRAVITY, moment(t), spun])

    y0 = np.concatenate([[0, 0, 1.8], [20, 0, 2], H0, start.as_quat()])
    time = fine[::SUBSTEPS]
    y = solve_ivp(rate, (0, time[-1]), y0, "DOP853", time, rtol=1e-10, atol=1e-11, max_step=2 / RATE).y.T
    R = Rotation.from_quat(y[:, 9:13]).as_matrix()
    x = y[:, None, :3] + np.einsum("tab,nb->tna", R, PLACE[MARKER_AT])
    return time, x + NOISE * rng.standard_normal(x.shape), force(time), moment(time)


def one_draw(seed: int) -> RecordScore:
    """One flight, smoothed under the prior that it was drawn from; over its central three quarters."""
    time, x, F, T = strict_flight(seed)
    pose = fit_pose(x, PLACE[MARKER_AT], np.ones(len(MARKER_AT)), NOISE**2 * np.eye(3 * len(MARKER_AT)))
    still = np.tile(CLUSTER_INERTIA, (len(time), 1, 1)), np.zeros((len(time), 3))
    flight = Flight(time, pose.center, pose.rotation, pose.cov, float(MASS.sum()), *still, GRAVITY)
    priors = (
        LoadPrior(Tuned(Matern(2, std, np.full(3, rate))), np.eye(3), Start(1e2, 1e2, 0.0))
        for std, rate in ((STD_F, RATE_F), (STD_T, RATE_T))
    )
    found = smooth_flight(flight, *priors, engines.engine())
    return scored(found, F, T, nis=float(np.nanmean(found.nis[4:])))


def main() -> int:
    """Print the ratios; 1 where one of them is outside of what the strict test allows."""
    given = asked("evidence.claims.strict", __doc__, page=False, draws=24, seed=21, jobs=2)
    draws = list(each(one_draw, [1000 * given.seed + k for k in range(given.draws)], given.jobs))
    passed = True
    for name, unit, of, published in (("F", "N", FORCE, BOUND_F), ("T", "N m", MOMENT, BOUND_T)):
        apart = [d.over_claim(of) for d in draws]
        bound = float(np.sqrt(stacked(draws, "claimed")[:, of].mean()))
        _, ratio, cover = pooled(draws, of)
        print(
            f"{name}: bound {bound:.5f} {unit} (published {published}), rmse over bound {ratio:.3f} "
            f"+- {np.std(apart) / np.sqrt(len(apart)):.3f}, 95 % intervals cover {100 * cover:.1f} %"
        )
        passed &= 0.95 <= ratio <= 1.06
    nis = float(np.mean([d.nis for d in draws]))
    print(f"NIS {nis:.4f}")
    return 0 if passed and 0.98 <= nis <= 1.02 else 1


if __name__ == "__main__":
    sys.exit(main())
