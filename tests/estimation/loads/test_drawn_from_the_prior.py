"""Loads drawn from the prior, on bodies told nothing: error beside that of a smoother told all, coverage."""

import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Start, driven, load_chain
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import matern
from forceid.kalman.engines import engine
from forceid.records import Body, Motion, Recording

STEP, FRAMES = 0.005, 300


def drawn(seed):
    """A body that does not turn under a drawn load: recording, load, and its std when all is told."""
    rng = np.random.default_rng([77, seed])
    order, mass = int(rng.choice([1, 2, 3, 4])), 2.0
    rate, std, noise = np.exp(rng.uniform(np.log([3, 0.5, 1e-4]), np.log([30, 20, 1e-3])))
    chain = load_chain(matern(order, np.full(3, std), np.full(3, rate)), Start(1e-4, 1e-2, 1e-12))
    (F,), (Q,) = discretize_steps(chain, np.array([STEP]))
    x = np.zeros((FRAMES, 3, F.shape[-1]))
    for a in range(3):
        x[0, a] = np.sqrt(np.diagonal(chain.P0[a])) * rng.standard_normal(F.shape[-1])
        size, axes = np.linalg.eigh(Q[a])
        root = axes * np.sqrt(np.maximum(size, 0.0))
        for k in range(1, FRAMES):
            x[k, a] = F[a] @ x[k - 1, a] + root @ rng.standard_normal(F.shape[-1])
    X = rng.uniform(-0.2, 0.2, (8, 3))
    X -= X.mean(0)
    tracks = x[:, None, :, 0] / mass + X + noise * rng.standard_normal((FRAMES, 8, 3))
    body = Body(tuple("abcdefgh"), X, total_mass=mass, mass_center=np.zeros(3), inertia=0.03 * np.eye(3))
    motion = Motion(STEP * np.arange(FRAMES), tracks, gravity=np.zeros(3))
    told = driven(chain, 1 / mass, np.full((FRAMES, 3), noise**2 / 8), np.zeros(3), np.full(FRAMES - 1, STEP))
    own = engine("auto").smooth(told.one(0), tracks.mean(1)[:, 0]).P
    row = np.eye(F.shape[-1])[2] + np.eye(F.shape[-1])[3]
    return Recording(body, motion), x[..., 2] + x[..., 3], np.sqrt(np.einsum("i,tij,j->t", row, own, row))


@pytest.mark.long
def test_told_nothing_errors_are_near_the_bound_and_intervals_hold():
    over, inside, claimed = [], [], []
    for seed in range(60):
        recording, load, bound = drawn(seed)
        found, inner = estimate_recording(recording, load_settings()), slice(40, -40)
        off, std = (found.force - load)[inner], found.force_std[inner]
        over.append(np.sqrt(np.mean(off**2) / np.mean(bound[inner] ** 2)))
        inside.append(np.mean(np.abs(off) < 1.96 * std))
        claimed.append(np.sqrt(np.mean(off**2) / np.mean(std**2)))
    assert np.sqrt(np.mean(np.square(over))) < 1.05
    assert 0.93 < np.mean(inside) < 0.97
    assert np.max(claimed) < 2.0
