"""Errors with a memory, in a model and in a spectrum, against the process that they are."""

import numpy as np
from scipy.linalg import expm

from forceid.flight.color import Color, autocorrelation, root_of
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
