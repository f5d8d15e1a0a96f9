"""Errors with a memory, in a model and in a spectrum, against the process that they are."""

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from forceid.flight.channels import driven, load_chain, start_of
from forceid.flight.color import Color, SharedErrors, autocorrelation, root_of
from forceid.flight.tuning import tune_loads
from forceid.kalman.building.process import matern
from forceid.kalman.building.sensors import colored
from forceid.kalman.engines import engine
from forceid.kalman.model import StateSpace


def test_correlation_is_that_of_the_process():
    for order in (1, 2, 4):
        one, lag = matern(order, 1.0, 7.0), 0.3
        r = (expm(one.A * lag) @ one.P0)[0, 0]
        assert np.isclose(autocorrelation(order, np.array(7.0), np.array(lag)), r)


def test_density_adds_up_to_the_variance():
    color = Color(2, 20.0, 0.7, 0.01)
    w = np.linspace(-3e4, 3e4, 600001)
    memory = color.density(w) - 0.3
    assert np.isclose(memory.mean() * 6e4 / (2 * np.pi) * 0.01, 0.7, rtol=1e-3)


def test_a_model_with_colored_errors_is_the_one_of_linear_models():
    rng = np.random.default_rng(1)
    step = np.full(39, 0.02)
    F = np.array([[1.0, 0.02], [0.0, 1.0]])
    own = StateSpace(
        F, 1e-3 * np.eye(2), np.eye(2), np.tile(0.04 * np.eye(2), (40, 1, 1)), np.zeros(2), np.eye(2)
    )
    z, color = rng.standard_normal((40, 2)), Color(2, 9.0, 0.6, 0.02)
    ours = color.beside(own, root_of(own.R), step)
    told = StateSpace(F, own.Q, np.eye(2), 0.4 * 0.04 * np.eye(2), own.x0, own.P0)
    peer = colored(told, matern(2, 0.2 * np.sqrt(0.6), 9.0), 0.02)
    a, b = (engine().smooth(model, z) for model in (ours, peer))
    np.testing.assert_allclose(a.x[:, :2], b.x[:, :2], atol=1e-10)
    assert np.isclose(a.filtered.log_likelihood, b.filtered.log_likelihood)


def test_errors_that_all_share_are_as_large_however_those_of_the_markers_change():
    """As the mass center of markers near a line, which turns: against the whole covariance of the record."""
    rng = np.random.default_rng(2)
    shared, time = SharedErrors(0.3, 6.0, 0.02), 0.02 * np.arange(60)
    white = 0.1 + np.abs(np.sin(3 * time))[:, None] * [0.1, 2.0]
    still = np.zeros((2, 2))
    own = StateSpace(
        np.eye(2), still, np.eye(2), np.stack([np.diag(v) for v in white + 0.09]), np.zeros(2), 4 * np.eye(2)
    )
    z, color = rng.standard_normal((60, 2)), shared.beside(white + 0.09)
    ours = color.beside(own, root_of(own.R), np.diff(time))
    memory = 0.09 * np.exp(-6.0 * np.abs(time[:, None] - time))
    whole = [multivariate_normal.logpdf(z[:, k], cov=4 + memory + np.diag(white[:, k])) for k in (0, 1)]
    assert np.isclose(engine().filter(ours, z).log_likelihood, sum(whole))


def test_a_channel_by_itself_has_the_same_errors_beside_its_load():
    rng = np.random.default_rng(3)
    time, color = 0.02 * np.arange(60), SharedErrors(0.3, 6.0, 0.02).beside(np.full(60, 0.5))
    z, var = rng.standard_normal((60, 2)), 0.1 + np.abs(np.sin(3 * time))[:, None] * [0.1, 2.0]
    chain = load_chain(matern(2, np.array([1.0, 3.0]), np.array([4.0, 9.0])), start_of(time, z, 0.5))
    colored_, plain = (driven(chain, 0.5, var + 0.09, np.zeros(2), np.diff(time), c) for c in (color, None))
    both = engine().log_likelihood(colored_, z[..., None])
    for k in (0, 1):
        F, Q, H = (
            np.broadcast_to(a, (59, *a.shape[-3:]))[:, k % a.shape[-3]] for a in (plain.F, plain.Q, plain.H)
        )
        alone = StateSpace(F, Q, H[0], plain.R[:, k], plain.x0[k], plain.P0[k])
        held = color.beside(alone, np.ones((60, 1, 1)), np.diff(time))
        assert np.isclose(engine().log_likelihood(held, z[:, k : k + 1]), both[k])


def test_errors_with_a_memory_of_markers_that_turn_pass_for_no_load():
    """Their variance along an axis comes and goes with the turn."""
    time, color = 0.01 * np.arange(400), Color(1, 15.0, 0.8, 0.01)
    var = 1e-6 * (0.05 + np.sin(4 * time[:, None] + [0.0, 1.0, 2.0]) ** 2)
    keeps = np.exp(-0.15)
    for seed in range(10):
        rng = np.random.default_rng([seed, 5])
        memory = lfilter([np.sqrt(1 - keeps**2)], [1.0, -keeps], rng.standard_normal((600, 3)), axis=0)[200:]
        z = np.sqrt(var) * (np.sqrt(0.8) * memory + np.sqrt(0.2) * rng.standard_normal((400, 3)))
        found = tune_loads(time, z, 1.0, var, np.zeros(3), orders=(2, 4), color=color)
        assert found.kernel.std.max() < 1e-5  # m/s2; taken for loads, the errors are of 1e-2
