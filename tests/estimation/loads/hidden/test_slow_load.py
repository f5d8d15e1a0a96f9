"""Loads that vary more slowly than a short record shows, on tracks drawn from closed forms."""

import numpy as np
import pytest

from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.hidden.order_uncertainty import growth_of
from forceid.estimation.loads.hidden.slow_load import slow_growth
from forceid.estimation.loads.hidden.whitened import whitened
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import channel_model
from forceid.kalman.engines import engine

FRAMES, STEP, SIGMA, MASS = 60, 2e-3, 2e-4, 0.5
SPAN = FRAMES * STEP
NOISE = MASS * SIGMA * np.sqrt(720 / FRAMES) / SPAN**2  # N, of a constant load, for many frames


def drawn(seed, swing, constant=10.0):
    """A track that a constant load and a sine of less than a cycle drive, and the load: times NOISE."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(FRAMES)
    w, phase = 2 * np.pi * rng.uniform(0.1, 0.8, 3) / SPAN, rng.uniform(0, 2 * np.pi, 3)
    mean = constant * rng.standard_normal(3) * NOISE
    load = mean + swing * NOISE * np.sin(np.outer(t, w) + phase)
    track = 0.5 * t[:, None] ** 2 * mean - swing * NOISE * np.sin(np.outer(t, w) + phase) / w**2
    z = track / MASS + SIGMA * rng.standard_normal((FRAMES, 3))
    cov = np.broadcast_to(SIGMA**2 * np.eye(3), (FRAMES, 3, 3))
    return Channel(t, z, 1 / MASS, cov, np.zeros((3, 3))), load


def scored(channel, load):
    """Error over claim of the load, and over what its prior alone claims: rms over all but the ends."""
    prior = tune_channel(channel, (1.0, 1.0), ())
    path, rows = engine().smooth(channel_model(channel, prior), channel.moved), prior.rows
    along, inner = prior.axes.T @ rows, slice(FRAMES // 8, -(FRAMES // 8))
    var = np.einsum("as,tsr,ar->ta", along, path.P, along)[inner]
    error = ((path.x @ rows.T - load) @ prior.axes)[inner]
    growth = growth_of(whitened(channel, prior, engine()), var.mean(0))
    return np.sqrt([np.mean(error**2 / var / growth**2), np.mean(error**2 / var)])


@pytest.mark.long
def test_a_load_that_varies_unseen_in_a_short_record_lies_within_its_claim():
    sizes = np.geomspace(0.3, 30.0, 40)  # from what no record shows to what each does
    grown, alone = np.array([scored(*drawn(seed, swing)) for seed, swing in enumerate(sizes)]).T
    assert np.sqrt(np.mean(alone**2)) > 2  # the constant alone claims too little
    assert 0.7 < np.sqrt(np.mean(grown**2)) < 1.2


def test_where_no_load_acts_the_claim_hardly_grows():
    growth = []
    for seed in range(20):
        channel, _ = drawn(seed, 0.0, constant=0.0)
        growth.append(slow_growth(channel, tune_channel(channel, (1.0, 1.0), ()), 2.0))
    assert np.median(growth) < 1.5


def test_a_constant_load_that_acts_is_claimed_as_one_that_may_vary():
    growth = [
        slow_growth(channel, tune_channel(channel, (1.0, 1.0), ()), 2.0)
        for channel, _ in (drawn(seed, 0.0, constant=30.0) for seed in range(20))
    ]
    assert 1.5 < np.median(growth) < 4.0
