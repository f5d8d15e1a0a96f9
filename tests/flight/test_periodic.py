"""Loads that repeat: the kernel against its closed form, and channels under loads of several harmonics."""

from dataclasses import replace

import numpy as np
import pytest
from flights import drawn_flight
from flights import prior as matern_prior
from linear_models import draw
from repeating_loads import MASS, beating
from scipy.spatial.transform import Rotation

from forceid import kalman
from forceid.estimation.loads.channels import tune_channel
from forceid.flight.channels import Channel, Start
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.periodic import Periodic
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.flight.smoother import smooth_flight
from forceid.kalman.building.process import discretize, matern_density

BEAT = Periodic(np.array([1.0, 2.0, 0.5]), 3.0, 0.4, 1.2, 10)
START = Start(1e-2, 1e-2, 1e-2)
NOISE = 4e-4  # m, of a mass center


def kernel_of(beat, t):
    """The covariance in closed form (..., axis) over times t (...)."""
    t = np.asarray(t)[..., None]
    course = -2 * np.sin(np.pi * beat.frequency * t) ** 2 / beat.length**2
    return beat.std**2 * np.exp(course - beat.decay * np.abs(t))


def seen(time, path, seed):
    z = path + NOISE * np.random.default_rng(seed).standard_normal(path.shape)
    return Channel(time, z, 1 / MASS, np.tile(NOISE**2 * np.eye(3), (len(z), 1, 1)), np.zeros((3, 3)))


def smoothed(channel, prior, engine="auto"):
    """The load (time, 3) and its variance along world axes, over the middle of a record."""
    path = kalman.engine(engine).smooth(channel_model(channel, prior), channel.moved)
    inner = slice(len(path.x) // 8, -len(path.x) // 8)
    var = np.einsum("as,tsr,ar->ta", prior.rows, path.P, prior.rows)
    return (path.x @ prior.rows.T)[inner], var[inner], inner


def placed(kernel=BEAT, **more):
    return LoadPrior(Tuned(kernel), np.eye(3), START, **more)


def test_covariance_of_the_states_is_the_kernel():
    t, load = np.linspace(0.0, 2.0, 41), BEAT.process
    F, Q = discretize(replace(load, A=load.A[None], Qc=load.Qc[None]), t[:, None])
    found = np.einsum("s,tasr,arq,q->ta", load.output, F, load.P0, load.output)
    np.testing.assert_allclose(found, kernel_of(BEAT, t), atol=1e-9)
    stays = F @ load.P0 @ F.swapaxes(-1, -2) + Q
    np.testing.assert_allclose(stays, np.broadcast_to(load.P0, stays.shape), atol=1e-12)


def test_spectrum_is_the_transform_of_the_kernel():
    t = np.linspace(-40.0, 40.0, 80001)
    w = 2 * np.pi * np.array([0.0, 1.4, 2.9, 3.0, 6.1, 9.0])
    found = np.trapezoid(kernel_of(BEAT, t) * np.cos(w[:, None, None] * t[:, None]), t, axis=1)
    np.testing.assert_allclose(BEAT.density(w[:, None]), found, rtol=1e-5, atol=1e-6)


def test_a_load_that_does_not_care_for_its_phase_is_a_matern_one_of_the_first_order():
    still = replace(BEAT, length=1e6, harmonics=2)
    w = np.linspace(0.0, 60.0, 30)[:, None]
    np.testing.assert_allclose(still.density(w), matern_density(1, BEAT.std, BEAT.decay, w), rtol=1e-6)
    time, _, path, _ = beating(0, frames=120)
    rough = Matern(1, BEAT.std, np.full(3, BEAT.decay))
    here, there = (smoothed(seen(time, path, 0), placed(kernel)) for kernel in (still, rough))
    for found, expected in zip(here[:2], there[:2], strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_rate_that_is_read_is_the_rate_of_the_load_foretold():
    chain = np.random.default_rng(0).standard_normal((1, placed().states))
    load, rate = placed().read(chain)[1:]
    F = placed().chain(np.array([1e-8]))[0][0]
    ahead = placed().read(chain @ F.T)[1]
    wandering = chain[:, 9:12]  # about the mean: forgets itself, and has no rate
    np.testing.assert_allclose((ahead - load) / 1e-8 + BEAT.decay * wandering, rate, rtol=1e-4, atol=1e-3)


def test_turning_the_world_turns_the_load_found():
    time, _, path, _ = beating(1, frames=120)
    W, here = Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix(), seen(time, path, 0)
    there = replace(here, z=here.z @ W.T)
    load, turned = smoothed(here, placed())[0], smoothed(there, replace(placed(), axes=W))[0]
    np.testing.assert_allclose(turned, load @ W.T, atol=1e-7)


def test_a_load_that_turns_with_a_body_at_rest_is_one_in_the_world():
    time, _, path, _ = beating(1, frames=60)
    channel, still = seen(time, path, 0), np.tile(np.eye(3), (60, 1, 1))
    a = channel_model(channel, placed(body_axes=np.eye(3)), still)
    b = channel_model(channel, placed())
    np.testing.assert_allclose(a.F, np.broadcast_to(b.F, a.F.shape), atol=1e-14)
    np.testing.assert_allclose(a.Q, np.broadcast_to(b.Q, a.Q.shape), atol=1e-14)


def test_tuning_finds_the_beat_in_any_units():
    time, _, path, frequency = beating(2)
    channel = seen(time, path, 2)
    told = replace(channel, time=10 * channel.time, z=100 * channel.z, noise_cov=1e4 * channel.noise_cov)
    here, there = (tune_channel(c, (1.0, 1.0), (), (2,), kind="periodic").kernel for c in (channel, told))
    assert abs(here.frequency - frequency) * np.ptp(time) < 0.25
    assert here.harmonics >= 6
    assert there.frequency == pytest.approx(here.frequency / 10, rel=1e-4)
    np.testing.assert_allclose(there.std, here.std, rtol=0.02)


def test_a_load_without_a_beat_keeps_its_matern_prior():
    rng = np.random.default_rng(3)
    model = channel_model(seen(np.arange(300) / 200, np.zeros((300, 3)), 0), matern_prior(1.0, 20.0, 3))
    channel = seen(np.arange(300) / 200, draw(replace(model, R=np.zeros((3, 3))), 300, rng)[1], 3)
    found, plain = (tune_channel(channel, (1.0, 1.0), (), (3,), kind=kind) for kind in ("periodic", "matern"))
    assert found.numbers("force") == plain.numbers("force")


@pytest.mark.long
def test_a_load_that_repeats_is_told_better_than_by_a_matern_prior_and_as_well_as_claimed():
    error, claim, plain = [], [], []
    for seed in range(1, 4):
        time, force, path, _ = beating(seed, frames=240)
        channel = seen(time, path, seed)
        for kind, kept in (("periodic", error), ("matern", plain)):
            load, var, inner = smoothed(channel, tune_channel(channel, (1.0, 1.0), (), (1, 3), kind=kind))
            kept.append(((load - force[inner]) ** 2).mean())
            if kind == "periodic":
                claim.append(((load - force[inner]) ** 2 / var).mean())
    assert np.mean(error) < 0.7 * np.mean(plain)
    assert 0.8 < np.sqrt(np.mean(claim)) < 1.3


def test_engines_agree_on_a_flight_under_loads_that_repeat():
    flight, _ = drawn_flight(matern_prior(1.0, 20.0), matern_prior(0.05, 30.0), np.random.default_rng(4))
    few = replace(BEAT, length=2.0, harmonics=3)
    force, moment = placed(few), placed(few.scaled(0.05).of(np.array([2, 0, 1])))
    for causal in (False, True):
        one, other = (
            smooth_flight(flight, force, moment, kalman.engine(name), causal) for name in ("numpy", "auto")
        )
        np.testing.assert_allclose(one.force, other.force, atol=1e-6)
        np.testing.assert_allclose(one.moment, other.moment, atol=1e-7)
        np.testing.assert_allclose(one.wrench_cov, other.wrench_cov, rtol=1e-5, atol=1e-9)
