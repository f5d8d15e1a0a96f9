"""Blocks that are left out tell a noise that follows itself from motion, where the likelihood cannot."""

import numpy as np
from linear_models import draw
from scipy.signal import lfilter

from forceid.kalman import StateSpace, discretize, log_likelihood, smooth
from forceid.kalman.cross_validation import blocks, left_out_error
from forceid.kalman.process import integrate, matern

STEP, COUNT, NOISE = 0.01, 600, 1e-3
SIZES = 1e-3 * 4.0 ** np.arange(-4, 3)


def tracked(noise=NOISE, std=30.0, rate=15.0):
    chain = integrate(integrate(matern(2, std, rate), 1.0), 1.0)
    F, Q = discretize(chain, STEP)
    return StateSpace(F, Q, np.eye(1, 4), noise**2 * np.eye(1), np.zeros(4), chain.P0)


def test_every_inner_sample_is_left_out_once():
    out = np.sum(blocks(100, 7), axis=0)
    assert out.max() == 1
    assert (out[7:93] == 1).all()
    assert out[:7].sum() == out[-7:].sum() == 0


def test_error_is_that_of_predicting_the_gaps():
    _, z = draw(tracked(), 60, np.random.default_rng(0))
    total = []
    for out in blocks(60, 6):
        path = smooth(tracked(), np.where(out[:, None], np.nan, z))
        for first in np.flatnonzero(out)[::6]:
            inside = slice(first, first + 6)
            total.append(np.log(np.mean((z[inside, 0] - path.x[inside, 0]) ** 2)))
    assert np.isclose(left_out_error(tracked(), z, 6, smooth), np.mean(total))


def test_noise_that_follows_itself_is_found_by_blocks_and_missed_by_the_likelihood():
    """A track that was smoothed at its source: errors of 1 mm that last three samples."""
    rng, by_blocks, by_likelihood = np.random.default_rng(1), [], []
    for _ in range(4):
        x, _ = draw(tracked(), COUNT, rng)
        errors = lfilter(np.ones(5) / np.sqrt(5), [1.0], NOISE * rng.standard_normal(COUNT))
        z = x[:, :1] + errors[:, None]
        by_blocks.append(
            SIZES[np.argmin([left_out_error(tracked(s, 300.0, 30.0), z, 20, smooth) for s in SIZES])]
        )
        likely = [float(log_likelihood(tracked(s, 300.0, 30.0), z)) for s in SIZES]
        by_likelihood.append(SIZES[np.argmax(likely)])
    assert np.median(by_likelihood) < 0.3 * NOISE
    assert np.median(by_blocks) > 2 * np.median(by_likelihood)
