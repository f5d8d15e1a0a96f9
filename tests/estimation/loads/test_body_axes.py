"""Loads that turn with the body, against paths integrated by a method of their own."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.loads.body_axes import body_fixed_prior, channel_likelihood
from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Channel, Start
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.kalman.engines import engine
from forceid.records import Array
from forceid.scenes.recipe import SceneRecipe, simulate

MASS, RATE, NOISE = 0.1, 250.0, 2e-4  # kg, Hz, m
STD, KAPPA = np.array([0.5, 2.0, 0.1]), 12.0  # N along body axes, 1/s
SPIN = np.array([3.0, -2.0, 60.0])  # rad/s, world axes
TIME = np.arange(250) / RATE


def rotation_at(t: Array) -> Array:
    """A steady spin."""
    return Rotation.from_rotvec(np.multiply.outer(t, SPIN)).as_matrix()


def drawn(seed: int) -> tuple[Array, Array]:
    """A Matern 3/2 force drawn along body axes, in world axes (time, 3), and the path (time, 3) it drives."""
    rng, fine = np.random.default_rng(seed), np.arange(249 * 10 + 1) / RATE / 10
    A = np.array([[0.0, 1.0], [-(KAPPA**2), -2 * KAPPA]])
    F, still = expm(A * fine[1]), np.diag([1.0, KAPPA**2])
    root = np.linalg.cholesky(still - F @ still @ F.T)
    x = np.empty((len(fine), 2, 3))
    x[0] = np.sqrt(still) @ rng.standard_normal((2, 3))
    for k in range(len(fine) - 1):
        x[k + 1] = F @ x[k] + root @ rng.standard_normal((2, 3))
    force = np.einsum("tab,tb->ta", rotation_at(fine), x[:, 0] * STD)
    path = CubicSpline(fine, force / MASS).antiderivative(2)
    return force[::10], path(TIME)


def channel_of(path: Array, seed: int) -> Channel:
    """The path with noise."""
    z = path + NOISE * np.random.default_rng(100 + seed).standard_normal(path.shape)
    return Channel(TIME, z, 1 / MASS, np.tile(NOISE**2 * np.eye(3), (len(TIME), 1, 1)), np.zeros((3, 3)))


TRUTH = LoadPrior(Tuned(Matern(2, STD, np.full(3, KAPPA))), np.eye(3), Start(1e2, 1e2, 0.0), (), np.eye(3))


def smoothed(channel: Channel, prior: LoadPrior) -> tuple[Array, Array]:
    """The force (time, 3) and its variance (time, 3), world axes."""
    path = engine().smooth(channel_model(channel, prior, rotation_at(TIME)), channel.moved)
    rows = prior.rows
    return path.x @ rows.T, np.einsum("as,tsr,ar->ta", rows, path.P, rows)


def test_under_its_own_prior_a_carried_load_is_found_at_the_bound() -> None:
    square, claimed, inside = [], [], []
    for seed in range(24):
        force, path = drawn(seed)
        found, var = smoothed(channel_of(path, seed), TRUTH)
        part = slice(30, -30)
        square.append(np.mean((found - force)[part] ** 2))
        claimed.append(np.mean(var[part]))
        inside.append(np.mean((found - force)[part] ** 2 < 1.96**2 * var[part]))
    assert np.sqrt(np.mean(square) / np.mean(claimed)) == pytest.approx(1.0, abs=0.06)
    assert 0.92 < np.mean(inside) < 0.98


def test_tuned_on_the_record_a_carried_prior_beats_one_in_world_axes() -> None:
    passes, worse = engine(), []
    for seed in range(3):
        force, path = drawn(seed)
        channel = channel_of(path, seed)
        world = tune_channel(channel, (1.0, 1.0), (), engine=passes)
        before, _ = smoothed(channel, world)
        body = body_fixed_prior(channel, world, rotation_at(TIME), before, passes)
        after, var = smoothed(channel, body)
        part = slice(30, -30)
        gained = channel_likelihood(channel, body, rotation_at(TIME), passes) - channel_likelihood(
            channel, world, rotation_at(TIME), passes
        )
        assert gained > 20.0
        worse.append(np.mean((before - force)[part] ** 2) / np.mean((after - force)[part] ** 2))
        assert np.mean((after - force)[part] ** 2) < 1.6 * np.mean(var[part])
    assert np.sqrt(np.mean(worse)) > 1.5


def test_a_carried_prior_of_equal_axes_and_no_rotation_is_the_one_in_world_axes() -> None:
    _, path = drawn(1)
    channel = channel_of(path, 1)
    still = np.tile(np.eye(3), (len(TIME), 1, 1))
    world = LoadPrior(TRUTH.tuned, np.eye(3), TRUTH.start)
    a, b = (channel_model(channel, prior, still) for prior in (TRUTH, world))
    for name in ("F", "Q", "P0", "H"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-12, atol=1e-15)


@pytest.mark.long
def test_asked_for_body_axes_an_estimate_says_how_much_more_likely_they_are_and_stays_within_its_claim() -> (
    None
):
    recording = simulate(
        SceneRecipe(scene="flexible_boomerang", duration=0.4, sample_rate=500.0, noise_std=3e-4, seed=1)
    )
    found = estimate_recording(recording, load_settings(load_axes="body", model="rigid"))
    assert {"force_body_axes_evidence", "moment_body_axes_evidence"} <= set(found.tuned)
    part = slice(25, -25)
    off = (found.force - recording.truth["force"])[part] / found.force_std[part]
    assert np.sqrt(np.mean(off**2)) < 1.3
