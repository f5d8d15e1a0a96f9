"""Bodies shaken by waves whose frequencies nobody knows: found, followed, and claimed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

pytestmark = pytest.mark.long
GRAVITY = np.array([0.0, 0.0, -9.81])


def shaken(seed):
    """A thrown ball with markers, pushed by one to three waves along ways of their own: closed forms."""
    rng = np.random.default_rng([31, seed])
    rate, count = rng.choice([100.0, 200.0, 500.0]), int(rng.integers(200, 500))
    time, mass, noise = np.arange(count) / rate, rng.uniform(0.2, 3.0), 10 ** rng.uniform(-4, -3.3)
    hertz = rng.uniform(3 / time[-1], min(0.1 * rate, 25.0), rng.integers(1, 4))
    w = 2 * np.pi * np.append(hertz, 0.7 / time[-1])
    way = rng.standard_normal((len(w), 3))
    size = noise * 10 ** rng.uniform(0.0, 1.0, len(w)) * w**2 * mass / np.linalg.norm(way, axis=1)
    size[-1] = mass  # the slow one
    phase = rng.uniform(0, 2 * np.pi, len(w))
    turned = w * time[:, None] + phase
    force = np.sin(turned) * size @ way
    center = (np.sin(phase) + w * np.cos(phase) * time[:, None] - np.sin(turned)) * (size / w**2 / mass) @ way
    center += 0.5 * GRAVITY * time[:, None] ** 2 + [1.0, 0.2, 4.0] * time[:, None]
    R = Rotation.from_rotvec(time[:, None] * rng.standard_normal(3) * 3).as_matrix()
    shape = rng.uniform(-0.15, 0.15, (int(rng.integers(4, 10)), 3))
    seen = center[:, None] + np.einsum("tab,nb->tna", R, shape)
    seen += noise * rng.standard_normal(seen.shape)
    inertia = 0.4 * mass * 0.1**2 * np.eye(3)
    nodes = tuple(f"m{k}" for k in range(len(shape)))
    body = Body(nodes, shape, total_mass=mass, mass_center=np.zeros(3), inertia=inertia)
    motion = Motion(time, seen, gravity=GRAVITY, noise_std={"position": noise})
    return Recording(body, motion), force


def rms(a):
    return np.sqrt((a[len(a) // 8 : -len(a) // 8] ** 2).mean())


@pytest.fixture(scope="module")
def judged():
    """Error over claim and over the load, and the verdict, of each draw."""
    found = []
    for seed in range(12):
        recording, force = shaken(seed)
        estimate = estimate_recording(recording, load_settings())
        error = rms(estimate.force - force)
        found.append((error / rms(estimate.force_std), error / rms(force), estimate.verdict.level))
    return found


def test_no_wave_is_silently_missed(judged):
    assert all(over < 2 for over, _, level in judged if level == "ok")
    assert sum(level == "ok" for *_, level in judged) >= 10


def test_claims_are_the_size_of_the_errors(judged):
    assert 0.6 < np.sqrt(np.mean([over**2 for over, *_ in judged])) < 1.2


def test_waves_are_followed_to_a_tenth(judged):
    assert np.median([of_load for _, of_load, _ in judged]) < 0.1
