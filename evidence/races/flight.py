"""A spinning rigid body of 15 markers: smoothed force and moment, beside an EKF loop on filterpy.

State (c, v, R, H, F, T), 18 numbers, Matern 1/2 loads in world axes, priors given. Ours takes raw markers to
the smoothed wrench with its covariance: poses of all frames, then Gauss-Newton on SO(3) until at rest. The
rival is one pass of filterpy's ExtendedKalmanFilter over the 45 marker rows with the rotation error on the
left, reset after every update, and the smoother of Rauch, Tung and Striebel on the manifold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, sin, sqrt
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from evidence.claims.strict import shape
from evidence.races.paired import Goal, Race, RaceAnswer, Racer
from forceid import kalman
from forceid.flight.channels import Start
from forceid.flight.model import Flight
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import smooth_flight
from forceid.motion import fit_pose

STEP, NOISE = 1e-3, 3e-4  # s, m
STD_F, RATE_F = 0.3, 20.0  # N, 1/s
STD_T, RATE_T = 0.004, 60.0  # N m, 1/s: the spin stays near ten turns a second through 100 s
START = Start(1e-2, 1e-2, 0.0)  # variances of m c (kg2 m2) and m v, and of what stands for them in rotation
RIVAL = "filterpy EKF loop"
HEAD = 200  # frames that the rival, which does not iterate, needs to forget where it was linearized first
WITHIN = 2e-3  # agreement: linearized about what was known so far, and about the smoothed path


@dataclass(frozen=True)
class RaceScene:
    """Marker tracks (frame, marker, 3) m of a body: mass kg, inertia (3, 3) kg m2, shape (marker, 3) m."""

    position: np.ndarray
    mass: float
    inertia: np.ndarray
    shape: np.ndarray


def races(quick: bool) -> Iterator[Race]:
    frames = 10_000 if quick else 100_000
    for markers in (15,) if quick else (15, 3, 100):
        scene = drawn_scene(frames if markers == 15 else frames // 5, markers)

        def read(found: Any) -> RaceAnswer:
            """Of the frames behind the start."""
            parts = {"force": slice(3), "moment": slice(3, 6)}
            both = zip(("", "_std"), found, strict=True)
            return {name + kind: a[HEAD:, part] for kind, a in both for name, part in parts.items()}

        def on(
            job: Callable[[RaceScene], Any], scene: RaceScene = scene
        ) -> Callable[[int], Callable[[], Any]]:
            return lambda size: lambda: job(replace(scene, position=scene.position[:size]))

        contestants = [Racer("forceid", on(smoothed), read, whole=True)]
        if markers == 15:
            contestants += [
                Racer("forceid, no compiler", on(smoothed_in_numpy), read),
                Racer(RIVAL, on(smoothed_by_rival), read),
            ]
        yield Race(
            title=f"Flight smoother, {markers} markers, 18 states, {len(scene.position):,} frames",
            contestants=contestants,
            base=RIVAL if markers == 15 else "forceid",
            size=len(scene.position),
            check=1500,
            goals=[Goal("forceid", RIVAL, 50)] if markers == 15 else [],
            unit="frame",
            clock="us",
            tolerance=WITHIN,
        )


def smoothed(scene: RaceScene, engine: str = "auto") -> tuple[np.ndarray, np.ndarray]:
    """Wrench (frame, 6) and its standard deviations."""
    found = our_flight(scene, engine)
    var = np.diagonal(found.wrench_cov, axis1=1, axis2=2)
    return np.concatenate([found.force, found.moment], 1), np.sqrt(var)


def smoothed_in_numpy(scene: RaceScene) -> tuple[np.ndarray, np.ndarray]:
    return smoothed(scene, "numpy")


def smoothed_by_rival(scene: RaceScene) -> tuple[np.ndarray, np.ndarray]:
    x, _, P = rival(scene)
    loads = [6, 7, 8, 15, 16, 17]
    return x[:, loads], np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, loads])


def drawn_scene(frames: int, markers: int = 15) -> RaceScene:
    """The boomerang held rigid, weightless, under loads drawn from the prior; markers beyond 15 at random."""
    rng = np.random.default_rng(markers)
    m, X = shape()
    J = (m @ (X**2).sum(1)) * np.eye(3) - X.T @ (m[:, None] * X)
    F, T = (ornstein_uhlenbeck(*p, frames, rng) for p in ((STD_F, RATE_F), (STD_T, RATE_T)))
    start = Rotation.from_euler("xz", [1.2, 0.3])
    H = start.apply(J @ [0.5, -0.3, 20 * np.pi]) + np.cumsum(STEP * T, 0)
    R = rotations_under_momenta(start.as_matrix(), H, J)
    c = np.cumsum(STEP * np.cumsum(STEP * F / m.sum(), 0), 0)
    X = X[:markers] if markers <= len(X) else np.concatenate([X, rng.uniform(-0.2, 0.2, (markers - 15, 3))])
    x = c[:, None] + X @ R.swapaxes(1, 2)
    return RaceScene(x + NOISE * rng.standard_normal(x.shape), float(m.sum()), J, X)


def ornstein_uhlenbeck(std: float, rate: float, frames: int, rng: np.random.Generator) -> np.ndarray:
    """A Matern 1/2 load (frame, 3)."""
    keep = np.exp(-rate * STEP)
    white = std * np.sqrt(1 - keep**2) * rng.standard_normal((frames, 3))
    return lfilter([1.0], [1.0, -keep], white, axis=0)


def rotations_under_momenta(R: np.ndarray, H: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Rotations (frame, 3, 3) under angular momenta H (frame, 3), world axes, by midpoints."""
    J_inv, path = np.linalg.inv(J), [R]
    for now, then in pairwise(H):
        half = R @ (J_inv @ (now @ R))
        mid = rotated(0.5 * STEP * half) @ R
        R = rotated(STEP * (mid @ (J_inv @ (0.5 * (now + then) @ mid)))) @ R
        path.append(R)
    return np.array(path)


def rotated(phi: np.ndarray) -> np.ndarray:
    """Rotation matrix of one rotation vector, by Rodrigues."""
    a, b, c = phi.tolist()
    square = a * a + b * b + c * c
    angle = sqrt(square)
    s, v = (sin(angle) / angle, (1 - cos(angle)) / square) if angle > 1e-6 else (1.0, 0.5)
    return np.array([
        [1 - v * (b * b + c * c), v * a * b - s * c, v * a * c + s * b],
        [v * a * b + s * c, 1 - v * (a * a + c * c), v * b * c - s * a],
        [v * a * c - s * b, v * b * c + s * a, 1 - v * (a * a + b * b)],
    ])  # fmt: skip


def small_turn(R: np.ndarray) -> np.ndarray:
    """Rotation vector of a small rotation, to third order of its sine."""
    s = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return s * (1 + (s @ s) / 6)


def cross_product_matrix(v: np.ndarray) -> np.ndarray:
    a, b, c = v.tolist()
    return np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])


def our_flight(scene: RaceScene, engine: str) -> Any:
    """Raw markers to the smoothed flight."""
    x, X = scene.position, scene.shape
    n = len(x)
    pose = fit_pose(x, X, np.ones(len(X)), NOISE**2 * np.eye(3 * len(X)))
    J, h, weightless = np.tile(scene.inertia, (n, 1, 1)), np.zeros((n, 3)), np.zeros(3)
    flight = Flight(STEP * np.arange(n), pose.center, pose.rotation, pose.cov, scene.mass, J, h, weightless)
    priors = (
        LoadPrior(Tuned(Matern(1, np.full(3, std), np.full(3, rate))), np.eye(3), START)
        for std, rate in ((STD_F, RATE_F), (STD_T, RATE_T))
    )
    return smooth_flight(flight, *priors, kalman.engine(engine))


def process(std: float, rate: float, gain: float) -> tuple[np.ndarray, np.ndarray]:
    """F, Q (9, 9) of one step of three chains y'' = gain * load, exactly, by Van Loan."""
    A, Qc = np.zeros((2, 3, 3))
    A[0, 1], A[1, 2], A[2, 2], Qc[2, 2] = 1.0, gain, -rate, 2 * std**2 * rate
    joint = expm(STEP * np.block([[-A, Qc], [np.zeros((3, 3)), A.T]]))
    F = joint[3:, 3:].T
    return np.kron(F, np.eye(3)), np.kron(F @ joint[:3, 3:], np.eye(3))


def rival(scene: RaceScene) -> Any:
    """State x (frame, 18) with theta = 0, R (frame, 3, 3) and P (frame, 18, 18), smoothed."""
    from filterpy.kalman import ExtendedKalmanFilter

    z, X, J_inv = scene.position.reshape(len(scene.position), -1), scene.shape, np.linalg.inv(scene.inertia)
    ekf = ExtendedKalmanFilter(dim_x=18, dim_z=z.shape[1])
    ekf.x = np.zeros(18)
    F, Q = np.eye(18), np.zeros((18, 18))
    F[:9, :9], Q[:9, :9] = process(STD_F, RATE_F, 1 / scene.mass)
    chain_F, chain_Q = process(STD_T, RATE_T, 1.0)
    F[9:, 9:], A, spread = chain_F, np.zeros((9, 9)), np.eye(9)
    A[3:6, 6:], A[6:, 6:] = STEP * np.eye(3), -STEP * RATE_T * np.eye(3)
    jacobian = np.zeros((len(X), 3, 18))
    jacobian[:, :, :3] = np.eye(3)
    R = fit_pose(scene.position[:2], X, np.ones(len(X)), NOISE**2 * np.eye(z.shape[1])).rotation
    H = R[0] @ scene.inertia @ R[0].T @ small_turn(R[1] @ R[0].T) / STEP
    R, moment_of_mass = R[0], scene.mass**2
    ekf.x[:3], ekf.x[12:15] = scene.position[0].mean(0) - (X @ R.T).mean(0), H
    var = (START.second / moment_of_mass, START.first / moment_of_mass, STD_F**2, 1.0, START.first, STD_T**2)
    ekf.P, ekf.R = np.diag(np.repeat(var, 3)), NOISE**2 * np.eye(z.shape[1])

    def markers(x: np.ndarray) -> np.ndarray:
        return (x[:3] + X @ R.T).ravel()

    def rows(x: np.ndarray) -> np.ndarray:
        r = X @ R.T
        jacobian[:, 0, 10], jacobian[:, 0, 11], jacobian[:, 1, 11] = r[:, 2], -r[:, 1], r[:, 0]
        jacobian[:, 1, 9], jacobian[:, 2, 9], jacobian[:, 2, 10] = -r[:, 2], r[:, 1], -r[:, 0]
        return jacobian.reshape(-1, 18)

    path: list[tuple[np.ndarray, ...]] = []
    for k in range(len(z)):
        if k:
            R_mid, R_next = runge_kutta(R, ekf.x[12:15], ekf.x[15:], J_inv)
            J_mid = R_mid @ J_inv @ R_mid.T
            A[:3, :3] = STEP * J_mid @ cross_product_matrix(ekf.x[12:15] + 0.5 * STEP * ekf.x[15:])
            A[:3, 3:6] = STEP * J_mid
            square = A @ A
            F[9:12, 9:] = (np.eye(9) + A + square / 2 + square @ A / 6)[:3]
            spread[:3, :3] = J_mid
            Q[9:, 9:] = spread @ chain_Q @ spread.T
            x = F @ ekf.x
            ekf.P, R = F @ ekf.P @ F.T + Q, R_next
            x[9:12] = 0.0
            ekf.x = x
            before = ekf.x, R, ekf.P, F.copy()
        ekf.update(z[k], rows, markers)
        R = rotated(ekf.x[9:12]) @ R
        ekf.x[9:12] = 0.0
        path.append((*before, ekf.x, R, ekf.P) if k else (*(ekf.x, R, ekf.P, F), ekf.x, R, ekf.P))
    return rauch_tung_striebel(path)


def runge_kutta(
    R: np.ndarray, H: np.ndarray, T: np.ndarray, J_inv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rotation half a step and a whole step on, by Runge, Kutta and Munthe-Kaas."""

    def rate(phi: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        turned = rotated(phi) @ R
        w = turned @ (J_inv @ ((H + s * T) @ turned))
        bent = cross_product_matrix(phi)
        return w - 0.5 * bent @ w + bent @ (bent @ w) / 12, turned

    k1, _ = rate(np.zeros(3), 0.0)
    k2, _ = rate(0.5 * STEP * k1, 0.5 * STEP)
    k3, mid = rate(0.5 * STEP * k2, 0.5 * STEP)
    k4, _ = rate(STEP * k3, STEP)
    return mid, rotated(STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) @ R


def rauch_tung_striebel(path: list[tuple[np.ndarray, ...]]) -> Any:
    """The smoother back over (x, R, P before; F; x, R, P after) of every frame, error on the left."""
    _, _, _, _, x, R, P = path[-1]
    smoothed = [(x, R, P)]
    for (x_pred, R_pred, P_pred, F, *_), (*_, x_now, R_now, P_now) in zip(
        path[:0:-1], path[-2::-1], strict=True
    ):
        gain = np.linalg.solve(P_pred, F @ P_now).T
        e = x - x_pred
        e[9:12] = small_turn(R @ R_pred.T)
        d = gain @ e
        x, R = x_now + d, rotated(d[9:12]) @ R_now
        x[9:12] = 0.0
        P = P_now + gain @ (P - P_pred) @ gain.T
        smoothed.append((x, R, P))
    x, R, P = (np.array(a)[::-1] for a in zip(*smoothed, strict=True))
    return x, R, P
