"""Where all mass is seen the force is that of the mean: no model, mode or stiffness touches it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
SIGMA = 5e-4


def swinging(seed, lost=0.0):
    """A body of two segments that swing against each other while it turns, and its exact force."""
    rng = np.random.default_rng(seed)
    t = np.arange(250) / 200
    X = rng.uniform(-0.2, 0.2, (8, 3))
    mass = rng.uniform(0.1, 0.6, 8)
    slow = 2 * np.pi * rng.uniform(0.5, 2.0, 3)
    turn = Rotation.from_rotvec(np.outer(t, rng.uniform(-4, 4, 3)))
    swing = Rotation.from_rotvec(np.outer(0.5 * np.sin(slow[0] * t), [0.0, 0.6, 0.8]))
    x = np.tile(X, (len(t), 1, 1))
    x[:, 4:] = np.einsum("tab,nb->tna", swing.as_matrix(), X[4:])
    x = np.einsum("tab,tnb->tna", turn.as_matrix(), x)
    x -= np.einsum("n,tna->ta", mass, x)[:, None] / mass.sum()
    size = rng.uniform(0.05, 0.2, (2, 3))
    path = size[0] * np.sin(slow * t[:, None]) + size[1] * np.cos(1.7 * slow * t[:, None])
    second = -size[0] * slow**2 * np.sin(slow * t[:, None]) - size[1] * (1.7 * slow) ** 2 * np.cos(
        1.7 * slow * t[:, None]
    )
    force = mass.sum() * (second - GRAVITY)
    position = x + path[:, None] + SIGMA * rng.standard_normal(x.shape)
    while np.isnan(position[..., 0]).mean() < lost:
        k, a = rng.integers(8), rng.integers(len(t))
        position[a : a + rng.integers(2, 25), k] = np.nan
    body = Body(tuple("abcdefgh"), X, mass)
    return Recording(body, Motion(t, position, gravity=GRAVITY, noise_std={"position": SIGMA})), force


def springs(X):
    """Stiffness (dof, dof) of springs of 1 kN/m between all nodes."""
    K = np.zeros((len(X), 3, len(X), 3))
    for a in range(len(X)):
        for b in range(a):
            n = (X[a] - X[b]) / np.linalg.norm(X[a] - X[b])
            block = 1e3 * np.outer(n, n)
            K[a, :, a] += block
            K[b, :, b] += block
            K[a, :, b] -= block
            K[b, :, a] -= block
    return K.reshape(3 * len(X), 3 * len(X))


def estimate(recording, model="auto"):
    return estimate_recording(recording, load_settings(model=model))


@pytest.mark.long
@pytest.mark.parametrize("lost", [0.0, 0.05])
def test_no_level_mode_or_stiffness_moves_the_force(lost):
    recording, _ = swinging(1, lost)
    one = estimate(recording, "rigid")
    rng = np.random.default_rng(2)
    wrong = replace(recording, body=replace(recording.body, mode_shape=rng.standard_normal((3, 8, 3))))
    sprung = replace(recording, body=replace(recording.body, stiffness=springs(recording.body.position)))
    for other in (
        estimate(recording, "modal"),
        estimate(recording, "affine"),
        estimate(recording),
        estimate(wrong, "modal"),
        estimate(sprung, "modal"),
    ):
        assert np.abs((other.force - one.force) / one.force_std).max() < 1e-9
        assert np.abs(other.force_std / one.force_std - 1).max() < 1e-9


@pytest.mark.long
def test_the_force_of_a_swinging_body_with_lost_markers_is_within_its_claim():
    off, claimed = [], []
    for seed in range(4):
        recording, force = swinging(10 + seed, 0.05)
        found = estimate(recording, "rigid")
        inner = slice(25, -25)
        off.append(((found.force - force)[inner] ** 2).mean(0))
        claimed.append((found.force_std[inner] ** 2).mean(0))
    ratio = np.sqrt(np.mean(off) / np.mean(claimed))
    assert 0.7 < ratio < 1.3


@pytest.mark.long
def test_markers_off_the_mass_center_of_an_affine_body_bias_no_force():
    """Known by total mass and inertia, markers 47 mm off: a free flight shows no force."""
    rng = np.random.default_rng(5)
    t = np.arange(300) / 250
    X = np.stack(np.meshgrid(*[(-0.1, 0.1)] * 3), -1).reshape(-1, 3) * [1.0, 0.7, 0.5] + [0.03, -0.03, 0.02]
    strain = 0.05 * np.sin(np.outer(t, [9.0, 12.0, 15.0]))
    F = Rotation.from_rotvec(np.outer(t, [3.0, 11.0, -6.0])).as_matrix() * (1.05 + strain)[:, None]
    c = np.outer(t, [1.0, 0, 4.0]) + 0.5 * np.outer(t**2, GRAVITY)
    x = c[:, None] + np.einsum("tab,nb->tna", F, X) + 3e-4 * rng.standard_normal((len(t), 8, 3))
    inertia = np.diag([2.0, 3.0, 4.0]) * 1e-3
    body = Body(tuple("abcdefgh"), X, total_mass=0.5, mass_center=np.zeros(3), inertia=inertia)
    found = estimate(Recording(body, Motion(t, x, gravity=GRAVITY, noise_std={"position": 3e-4})), "affine")
    inner = slice(30, -30)
    assert np.sqrt((found.force[inner] ** 2).mean()) < 2 * np.sqrt((found.force_std[inner] ** 2).mean())
    assert np.abs(found.force[inner]).max() < 0.1
