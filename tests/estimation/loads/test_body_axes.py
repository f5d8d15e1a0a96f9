"""Loads that turn with the body, against paths integrated by a method of their own."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.loads.body_axes import body_fixed_prior, channel_likelihood
from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.hidden.order_uncertainty import growth_of
from forceid.estimation.loads.hidden.whitened import whitened
from forceid.estimation.methods.axes import with_mean_of_any_size
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Channel, Start
from forceid.flight.priors.body_fixed import Turning
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.kalman.engines import Engine, engine
from forceid.records import Array, Body, Motion, Recording
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


def force_of(turns: bool) -> tuple[Array, Array]:
    """A force of three slow waves (time, 3), in world axes, that turns with the body or not; and its path."""
    fine = np.arange(249 * 20 + 1) / RATE / 20
    waves = np.stack([np.sin(9.0 * fine + 1.0), 0.7 * np.sin(14.0 * fine), 0.4 * np.cos(5.0 * fine)], 1)
    force = np.einsum("tab,tb->ta", rotation_at(fine), waves) if turns else waves
    path = CubicSpline(fine, force / MASS).antiderivative(2)
    return force[::20], path(TIME)


def thrust(turns: bool) -> Recording:
    """A block with eight markers that turns at a steady rate about a main axis under such a force."""
    X = 0.1 * np.array(list(product((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))))
    E = MASS * X.T @ X / len(X)
    body = Body(
        tuple("abcdefgh"), X, total_mass=MASS, mass_center=np.zeros(3), inertia=np.trace(E) * np.eye(3) - E
    )
    x = force_of(turns)[1][:, None] + np.einsum("tab,nb->tna", rotation_at(TIME), X)
    x = x + NOISE * np.random.default_rng(8).standard_normal(x.shape)
    return Recording(body, Motion(TIME, x, gravity=np.zeros(3), noise_std={"position": NOISE}))


TRUTH = LoadPrior(Tuned(Matern(2, STD, np.full(3, KAPPA))), np.eye(3), Start(1e2, 1e2, 0.0), (), np.eye(3))


def smoothed(channel: Channel, prior: LoadPrior) -> tuple[Array, Array]:
    """The force (time, 3) and its variance (time, 3), world axes."""
    path = engine().smooth(channel_model(channel, prior, rotation_at(TIME)), channel.moved)
    rows = prior.rows
    return path.x @ rows.T, np.einsum("as,tsr,ar->ta", rows, path.P, rows)


def grown_by(channel: Channel, prior: LoadPrior, passes: Engine) -> float:
    """Factor on claimed deviations, rms along the axes, for orders, sizes and rates that are as likely."""
    axes = prior.axes_along(rotation_at(TIME))
    path, rows = passes.smooth(channel_model(channel, prior, rotation_at(TIME)), channel.moved), prior.rows
    along = np.einsum("tai,as,tsr,br,tbi->ti", axes, rows, path.P, rows, axes)[30:-30].mean(0)
    growth = growth_of(whitened(channel, prior, passes, rotation=rotation_at(TIME)), along)
    return float(np.sqrt((growth**2 * along).mean() / along.mean()))


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
        assert body is not None
        after, var = smoothed(channel, body)
        part = slice(30, -30)
        gained = channel_likelihood(channel, body, rotation_at(TIME), passes) - channel_likelihood(
            channel, world, rotation_at(TIME), passes
        )
        assert gained > 20.0
        worse.append(np.mean((before - force)[part] ** 2) / np.mean((after - force)[part] ** 2))
        growth = grown_by(channel, body, passes)
        assert np.mean((after - force)[part] ** 2) < 1.6 * growth**2 * np.mean(var[part])
    assert np.sqrt(np.mean(worse)) > 1.5


def test_a_carried_prior_of_equal_axes_and_no_rotation_is_the_one_in_world_axes() -> None:
    _, path = drawn(1)
    channel = channel_of(path, 1)
    still = np.tile(np.eye(3), (len(TIME), 1, 1))
    world = LoadPrior(TRUTH.tuned, np.eye(3), TRUTH.start)
    a, b = (channel_model(channel, prior, still) for prior in (TRUTH, world))
    for name in ("F", "Q", "P0", "H"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-12, atol=1e-15)


def test_noise_along_axes_that_turn_is_as_large_as_a_steady_spin_makes_it() -> None:
    # of a position that is a wave in world axes, seen along axes that turn at 60 rad/s
    rng, t = np.random.default_rng(5), np.arange(4096) / 500.0
    R = Rotation.from_rotvec(np.multiply.outer(t, SPIN)).as_matrix()
    turning = Turning.of(t, R)
    w = np.array([20.0, 60.0, 200.0])
    load = np.zeros((3, 3))
    for k, own in enumerate(w):  # (d/dt + [omega]x)^2 of a wave in body axes, direction and phase at random
        for _ in range(400):
            m = rng.standard_normal(3) + 1j * rng.standard_normal(3)
            D = 1j * own * np.eye(3) + np.cross(np.eye(3), SPIN).T
            load[:, k] += np.abs(D @ D @ m) ** 2 / 800
    np.testing.assert_allclose(load, turning.of_position(w) * w**4, rtol=0.2)


@pytest.mark.long
@pytest.mark.parametrize("turns", [False, True])
def test_the_record_says_whether_a_force_turns_with_the_body(turns: bool) -> None:
    exact = {"mass_center": 1e-9, "inertia": 1e-9}  # else a thrust may be a center told a little wrong
    found = estimate_recording(thrust(turns), load_settings(model="rigid", body_std=exact))
    assert ("force_turns" in found.tuned) == turns
    assert found.verdict.level == "ok"
    off = (found.force - force_of(turns)[0]) / found.force_std
    assert 0.3 < np.sqrt(np.mean(off[25:-25] ** 2)) < 1.5


@pytest.mark.long
@pytest.mark.parametrize("along", [None, np.eye(3)])
def test_a_mean_of_the_likeliest_size_gains_what_filters_of_all_sizes_say(along: Array | None) -> None:
    for load in (0.0, 1.0):
        channel = channel_of(load * drawn(3)[1], 3)
        prior = replace(TRUTH, start=Start(1e2, 1e2, 1e2), body_axes=along).scaled(max(load, 1e-6), 10.0)
        filtered = engine("compiled").filter(channel_model(channel, prior, rotation_at(TIME)), channel.moved)
        sizes = [replace(prior, start=replace(prior.start, mean=10.0**-k)) for k in np.arange(-2, 20, 0.25)]
        each = [channel_likelihood(channel, one, rotation_at(TIME), engine("compiled")) for one in sizes]
        gained = with_mean_of_any_size(filtered, prior.start.mean)
        assert gained == pytest.approx(max(each) - filtered.log_likelihood, abs=0.1)


@pytest.mark.filterwarnings("error")
def test_a_mean_that_is_known_or_told_to_rounding_gains_a_finite_amount() -> None:
    channel = channel_of(np.zeros((len(TIME), 3)), 0)
    for std in (0.0, 1e-150, 1e3):
        prior = TRUTH.scaled(1e-6, std)
        filtered = engine("compiled").filter(channel_model(channel, prior), channel.moved)
        assert 0.0 <= with_mean_of_any_size(filtered, prior.start.mean) < 200


def test_where_nothing_pushes_axes_that_turn_are_no_likelier() -> None:
    """The mean of a load is told a thousand times as well along axes that stand still: no evidence."""
    for seed in range(5):
        channel, R = channel_of(np.zeros((len(TIME), 3)), seed), rotation_at(TIME)
        wide = TRUTH.scaled(1e-6, 10.0)
        plain, gains = [], []
        for along in (np.eye(3), None):
            model = channel_model(channel, replace(wide, body_axes=along), R)
            filtered = engine("compiled").filter(model, channel.moved)
            plain.append(filtered.log_likelihood)
            gains.append(with_mean_of_any_size(filtered, wide.start.mean))
        assert plain[0] - plain[1] > 5
        assert abs(plain[0] + gains[0] - plain[1] - gains[1]) < 3


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
