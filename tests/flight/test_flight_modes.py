"""Modes beside the loads of a flight: what they do to the rotation, and errors as claimed."""

from dataclasses import replace

import numpy as np
import pytest
from flights import steps_of
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from forceid.flight.channels import Start
from forceid.flight.model import Flight
from forceid.flight.modes import FlyingModes
from forceid.flight.path.linear import flexed, linear_flight
from forceid.flight.path.reference import Reference
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import smooth_flight
from forceid.flight.vibration import ModeState, Vibration
from forceid.kalman.engines import engine
from forceid.motion.frames import Frames
from forceid.motion.pose import exp, log
from forceid.motion.products import inertia_products

STATES = len(ModeState)  # of order one
MASS = np.array([0.05, 0.03, 0.04, 0.02])
X = np.array([[0.2, 0.0, 0.02], [-0.1, 0.15, 0.0], [-0.1, -0.15, -0.02], [0.0, 0.0, 0.05]])
X = X - MASS @ X / MASS.sum()
SHAPES = np.random.default_rng(1).standard_normal((2, 4, 3))
WHOLE = inertia_products(MASS, X, SHAPES)
VIBRATION = Vibration(
    np.array([330.0, 120.0]), np.array([5.0, 40.0]), np.array([1e-3, 2e-3]), np.array([30.0, 20.0])
)


def flying(time, path, leak, rows, rng=None):
    """A flight that nobody pushes, its modes along a path; what the frames show has the errors claimed."""
    T = len(time)
    q, rate = path[:, ::STATES], path[:, 1::STATES]
    J, h = WHOLE.of(q, rate)
    R, H = np.empty((T, 3, 3)), np.array([0.02, -0.03, 0.12])
    R[0] = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    still = Flight(time, np.zeros((T, 3)), R, np.tile(np.eye(6), (T, 1, 1)), MASS.sum(), J, h, np.zeros(3))
    chain = np.zeros((T, 15))
    chain[:, 3:6] = H
    for k in range(T - 1):  # a step at a time: each begins where the last one ended
        R[k + 1] = steps_of(still, Reference(R, chain, prior()))[0][k]
    cov = np.tile(np.diag([1e-8] * 3 + [1e-6] * 3), (T, 1, 1))
    noise = np.zeros((T, 8)) if rng is None else rng.standard_normal((T, 8))
    off = noise[:, :6] * np.sqrt(np.diagonal(cov[0])) + np.einsum("tik,tk->ti", leak, q)
    told = np.einsum("tij,tj->ti", rows, q) + noise[:, 6:]
    frames = Frames(off[:, :3], exp(off[:, 3:]) @ R, cov, leak, told, rows)
    modes = FlyingModes(frames, VIBRATION, WHOLE, path)
    return replace(still, pose_cov=cov, modes=modes), R, H


def prior(order=2, std=1e-3, axes=None):
    kernel = Matern(order, np.full(3, std), np.full(3, 20.0))
    return LoadPrior(Tuned(kernel), np.eye(3), Start(1.0, 1.0, 1e-4))


def smooth_path(time):
    w = VIBRATION.frequency
    q, rate = VIBRATION.std * np.sin(w * time[:, None]), VIBRATION.std * w * np.cos(w * time[:, None])
    return np.stack([q, rate, np.zeros_like(q)], 2).reshape(len(time), -1)


def test_rotation_answers_the_modes_as_the_equations_say():
    """The column of each mode's amplitude, rate and load, against the nonlinear turn of a body moved so."""
    time = np.arange(12) * 5e-4
    path = smooth_path(time)
    leak, rows = np.zeros((12, 6, 2)), np.tile(np.eye(2), (12, 1, 1))
    flight, R, H = flying(time, path, leak, rows)
    chain = np.zeros((12, 15))
    chain[:, 3:6] = H
    reference = Reference(R, chain, prior(), modes=path)
    model, _ = linear_flight(flight, prior(), prior(), reference)
    theta, own = slice(15, 18), slice(30, 36)
    A, k = VIBRATION.process.A, 5
    for state in range(6):
        moved = []
        for sign in (1, -1):
            free = np.zeros((12, 2, 3))
            free.reshape(12, 6)[k, state] = sign * [1e-5, 1e-3, 1.0][state % 3]
            for i in range(12):  # as the mode moves by itself, to both sides of the step
                free[i] = np.einsum("mij,mj->mi", expm(A * (time[i] - time[k])), free[k])
            there = flexed(flight, replace(reference, modes=path + free.reshape(12, 6)))
            moved.append(steps_of(there, reference)[0][k])
        size = 2 * [1e-5, 1e-3, 1.0][state % 3]
        wanted = log(moved[0] @ moved[1].T) / size
        np.testing.assert_allclose(model.F[k, theta, own][:, state], wanted, atol=0.02 * np.abs(wanted).max())


@pytest.mark.parametrize("seed", range(3))
def test_amplitudes_and_pose_that_leaks_are_as_good_as_claimed(seed):
    rng, time = np.random.default_rng(seed), np.arange(300) * 1e-3
    turned = Rotation.random(random_state=seed).as_matrix()
    leak = np.tile(np.concatenate([turned[:, :2] * 0.3, turned[:, 1:] * 2.0]), (300, 1, 1))
    rows = np.tile(np.array([[1e4, 2e3], [0.0, 5e3]]), (300, 1, 1))
    rows[100:110] = 0.0  # nothing is told there but by the poses
    path = smooth_path(time)
    flight, R, H = flying(time, path, leak, rows, rng)
    start = replace(flight, rotation=flight.modes.frames.rotation)
    found = smooth_flight(
        replace(start, modes=replace(flight.modes, path=0 * path)), prior(), prior(), engine()
    )
    error = np.einsum("tij,tj->ti", np.linalg.inv(np.linalg.cholesky(found.pose_cov[:, 3:, 3:])),
                      log(found.rotation @ R.swapaxes(1, 2)))  # fmt: skip
    assert 0.3 < np.mean(error[20:-20] ** 2) < 2.0
    assert np.sqrt(np.mean((found.modes - path)[:, ::STATES] ** 2)) < 0.1 * np.sqrt(
        np.mean(path[:, ::STATES] ** 2)
    )
    assert np.abs(found.H - H).max() < 5 * 2e-3 * 0.12
    assert 0.9 < np.nanmean(found.nis) < 1.1
