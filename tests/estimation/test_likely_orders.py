"""Claims that allow for the orders of a prior that a record does not tell apart."""

from dataclasses import replace

import numpy as np
import pytest

from forceid.estimation.likely_orders import LONGEST, growth
from forceid.estimation.load_channels import tune_channel
from forceid.kalman.channels import Channel
from forceid.kalman.engines import engine
from forceid.kalman.prior import channel_model, load_rows
from forceid.kalman.process import discretize, integrate, matern

STEP, SIGMA, MASS = 2e-3, 3e-4, 0.5


def drawn(order, seed, samples=600, step=STEP, rate=30.0, mass=MASS, sigma=SIGMA):
    """A channel that a Matern load of that order drives, and the load (time, 3)."""
    rng = np.random.default_rng(seed)
    process = integrate(integrate(matern(order, 1.0, rate), 0.0), 0.0)
    F, Q = discretize(process, step)
    F, root = np.squeeze(F), np.linalg.cholesky(np.squeeze(Q) + 1e-18 * np.eye(order + 2))
    start = np.zeros((order + 2, 3))
    start[2:] = np.linalg.cholesky(np.squeeze(process.P0)[2:, 2:]) @ rng.standard_normal((order, 3))
    states = [start]
    for _ in range(samples - 1):
        states.append(F @ states[-1] + root @ rng.standard_normal((order + 2, 3)))
    states = np.array(states)
    z = states[:, 0] / mass + sigma * rng.standard_normal((samples, 3))
    cov = np.broadcast_to(sigma**2 * np.eye(3), (samples, 3, 3))
    return Channel(step * np.arange(samples), z, 1 / mass, cov, np.zeros((3, 3))), states[:, 2]


def claims(channel, prior, factor):
    model = channel_model(channel, prior)
    path = engine().smooth(model, channel.moved)
    rows = load_rows(len(model.x0), prior.axes, prior.lines)
    A = prior.axes * factor @ prior.axes.T
    return path.x @ rows.T, np.sqrt(np.diagonal(A @ (rows @ path.P @ rows.T) @ A.T, axis1=1, axis2=2))


def test_loads_of_any_order_lie_within_the_claims_that_allow_for_rougher_ones():
    alone, allowed = {}, {}
    for order in (2, 3, 4):
        inside, grown_inside = [], []
        for seed in range(8):
            channel, load = drawn(order, seed)
            prior = tune_channel(channel, (1.0, 1.0), ())
            for share, factor in ((inside, np.ones(3)), (grown_inside, growth(channel, prior, engine()))):
                found, std = claims(channel, prior, factor)
                share.append((np.abs(found - load) <= 1.959964 * std)[75:-75].mean())
        alone[order], allowed[order] = np.mean(inside), np.mean(grown_inside)
    assert alone[2] < 0.88  # the smoothest likely order is smoother than this load
    assert 0.92 <= np.mean(list(allowed.values())) <= 0.97
    assert min(allowed.values()) > 0.89


def test_an_order_without_rivals_is_believed():
    channel, _ = drawn(2, 3)
    prior = tune_channel(channel, (1.0, 1.0), ())
    alone = replace(prior, tuned=replace(prior.tuned, rivals=()))
    assert growth(channel, alone, engine()).tolist() == [1.0, 1.0, 1.0]


def test_rivals_of_no_weight_change_nothing_and_none_ever_narrows_a_claim():
    channel, _ = drawn(3, 5)
    prior = tune_channel(channel, (1.0, 1.0), ())
    assert prior.tuned.rivals
    assert (growth(channel, prior, engine()) >= 1.0).all()
    worse = tuple(replace(t, log_likelihood=t.log_likelihood - 50.0) for t in prior.tuned.rivals)
    unlikely = replace(prior, tuned=replace(prior.tuned, rivals=worse))
    assert growth(channel, unlikely, engine()).tolist() == [1.0, 1.0, 1.0]


def test_a_load_without_derivative_is_no_rival_of_a_smooth_one():
    channel, _ = drawn(3, 5)
    prior = tune_channel(channel, (1.0, 1.0), ())
    rough = replace(prior.tuned, order=1, log_likelihood=prior.tuned.log_likelihood + 5.0)
    with_rough = replace(prior, tuned=replace(prior.tuned, rivals=(rough,)))
    assert growth(channel, with_rough, engine()).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("samples", [300, LONGEST + 400])
def test_long_records_are_looked_at_in_their_middle(samples):
    channel, _ = drawn(2, 1, samples)
    prior = tune_channel(channel, (1.0, 1.0), ())
    assert np.isfinite(growth(channel, prior, engine())).all()


def test_a_search_that_misses_the_peak_of_one_order_hides_no_rougher_one():
    for seed in (0, 2, 4, 13):
        channel, _ = drawn(2, seed, samples=480, step=1 / 120, rate=20.0, mass=0.1, sigma=1.5e-4)
        assert tune_channel(channel, (1.0, 1.0), ()).tuned.order <= 3
