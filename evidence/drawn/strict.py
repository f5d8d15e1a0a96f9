"""The strict test of the smoother on rotations: flights drawn from the prior, error over the bound claimed.

    python -m evidence.drawn.strict [--draws 24] [--seed 21] [--jobs 2]

A rigid body of five markers under a force and a moment that are Matern 3/2 processes in world axes, as the
smoother is told they are. Averaged over the prior no estimator beats the posterior bound, so the ratio is
one for a smoother that is right, whatever the loads. Source: principal equations 4f, 5.7. The flights come
from integration of its own; no code is shared with the estimator.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from evidence.written import asked, each
from forceid.flight.channels import Start
from forceid.flight.model import Flight
from forceid.flight.priors.load import LoadPrior
from forceid.flight.smoother import smooth_flight
from forceid.flight.tuning import Tuned
from forceid.kalman import engines
from forceid.motion.pose import fit_pose

RATE, SECONDS, NOISE = 500.0, 0.6, 3e-4  # Hz, s, m
STD_F, RATE_F = np.array([1.3, 2.3, 0.9]), 20.0  # N, 1/s
STD_T, RATE_T = np.array([0.12, 0.09, 0.08]), 60.0  # N m, 1/s
SUBSTEPS = 20  # of the load's path, a sample
GRAVITY = np.array([0.0, 0.0, -9.81])
MARKED = [0, 3, 8, 9, 14]
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


def matern_path(
    std: Any, rate: float, step: float, samples: int, rng: np.random.Generator
) -> tuple[Any, Any]:
    """A Matern 3/2 load (sample, 3) and its rate, drawn exactly on a grid: stationary from the start."""
    A = np.array([[0.0, 1.0], [-(rate**2), -2 * rate]])
    stationary = np.diag([1.0, rate**2])
    F = expm(A * step)
    root = np.linalg.cholesky(stationary - F @ stationary @ F.T)
    x = np.empty((samples, 2, 3))
    x[0] = np.sqrt(stationary) @ rng.standard_normal((2, 3))
    for k in range(samples - 1):
        x[k + 1] = F @ x[k] + root @ rng.standard_normal((2, 3))
    return x[:, 0] * std, x[:, 1] * std


def drawn_flight(seed: int) -> tuple[Any, Any, Any, Any]:
    """Times, marker tracks with noise (time, marker, 3), and the true force and moment (time, 3)."""
    rng = np.random.default_rng(seed)
    m, X = shape()
    J = (m @ (X**2).sum(1)) * np.eye(3) - X.T @ (m[:, None] * X)
    samples = int(SECONDS * RATE) + 1
    fine = np.arange((samples - 1) * SUBSTEPS + 1) / RATE / SUBSTEPS
    F, dF = matern_path(STD_F, RATE_F, fine[1], len(fine), rng)
    T, dT = matern_path(STD_T, RATE_T, fine[1], len(fine), rng)
    force, moment = CubicHermiteSpline(fine, F, dF), CubicHermiteSpline(fine, T, dT)
    start = Rotation.from_rotvec([np.radians(70), 0, 0]) * Rotation.from_rotvec([0, 0, 0.3])
    H0 = start.apply(J @ [0.5, -0.3, 20 * np.pi])
    J_inv = np.linalg.inv(J)

    def rate(t: float, y: Any) -> Any:
        q = y[9:13]
        R = Rotation.from_quat(q).as_matrix()
        w = R @ J_inv @ R.T @ y[6:9]
        spun = 0.5 * np.array([*(q[3] * w + np.cross(w, q[:3])), -w @ q[:3]])
        return np.concatenate([y[3:6], force(t) / m.sum() + GRAVITY, moment(t), spun])

    y0 = np.concatenate([[0, 0, 1.8], [20, 0, 2], H0, start.as_quat()])
    time = fine[::SUBSTEPS]
    y = solve_ivp(rate, (0, time[-1]), y0, "DOP853", time, rtol=1e-10, atol=1e-11, max_step=2 / RATE).y.T
    R = Rotation.from_quat(y[:, 9:13]).as_matrix()
    x = y[:, None, :3] + np.einsum("tab,nb->tna", R, X[MARKED])
    return time, x + NOISE * rng.standard_normal(x.shape), F[::SUBSTEPS], T[::SUBSTEPS]


@dataclass(frozen=True)
class Draw:
    """Mean squared error and claimed variance (force, moment) per axis, coverage of 95 %, and NIS."""

    square: Any
    claimed: Any
    covered: Any
    nis: float


def one_draw(seed: int) -> Draw:
    """One flight, smoothed under the prior that it was drawn from; over its central three quarters."""
    time, x, F, T = drawn_flight(seed)
    m, X = shape()
    J = (m @ (X**2).sum(1)) * np.eye(3) - X.T @ (m[:, None] * X)
    pose = fit_pose(x, X[MARKED], np.ones(len(MARKED)), NOISE**2 * np.eye(3 * len(MARKED)))
    n = len(time)
    still = (np.tile(J, (n, 1, 1)), np.zeros((n, 3)))
    flight = Flight(time, pose.center, pose.rotation, pose.cov, float(m.sum()), *still, GRAVITY)

    def prior(std: Any, rate: float, start: Start) -> LoadPrior:
        return LoadPrior(Tuned(2, std, np.full(3, rate), 1.0, False, 0.0), np.eye(3), start)

    free = prior(STD_F, RATE_F, Start(1e2, 1e2, 0.0))
    turned = prior(STD_T, RATE_T, Start(1e2, 1e2, 0.0))
    found = smooth_flight(flight, free, turned, engines.engine())
    middle = slice(n // 8, n - n // 8)
    error = np.concatenate([found.force - F, found.moment - T], 1)[middle]
    var = np.diagonal(found.wrench_cov, axis1=1, axis2=2)[middle]
    covered = (error**2 < 1.959964**2 * var).mean(0)
    return Draw((error**2).mean(0), var.mean(0), covered, float(np.nanmean(found.nis[4:])))


def main() -> int:
    """Print the ratios; 1 where one of them is outside of what the strict test allows."""
    given = asked("evidence.drawn.strict", __doc__, page=False, draws=24, seed=21, jobs=2)
    seeds = [1000 * given.seed + k for k in range(given.draws)]
    draws = list(each(one_draw, seeds, given.jobs))
    square, claimed = (np.array([getattr(d, name) for d in draws]) for name in ("square", "claimed"))
    passed = True
    for name, unit, rows, published in (("F", "N", slice(3), BOUND_F), ("T", "N m", slice(3, 6), BOUND_T)):
        apart = np.sqrt(square[:, rows].mean(1) / claimed[:, rows].mean(1))
        ratio = float(np.sqrt(square[:, rows].mean() / claimed[:, rows].mean()))
        bound = float(np.sqrt(claimed[:, rows].mean()))
        cover = float(np.mean([d.covered[rows] for d in draws]))
        print(
            f"{name}: bound {bound:.5f} {unit} (published {published}), rmse over bound {ratio:.3f} "
            f"+- {apart.std() / np.sqrt(len(apart)):.3f}, 95 % intervals cover {100 * cover:.1f} %"
        )
        passed &= 0.95 <= ratio <= 1.06
    nis = float(np.mean([d.nis for d in draws]))
    print(f"NIS {nis:.4f}")
    return 0 if passed and 0.98 <= nis <= 1.02 else 1


if __name__ == "__main__":
    sys.exit(main())
