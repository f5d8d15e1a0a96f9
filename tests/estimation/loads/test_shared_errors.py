"""Errors that all markers share: found where they are, by size and pace, and not where they are not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from forceid.config import load_settings
from forceid.estimation.loads.shared_errors import shared_errors
from forceid.estimation.run import estimate_recording
from forceid.flight.channels import Channel
from forceid.kalman.engines import engine
from forceid.records import Body, Motion, Recording

STEP, MASS = 0.005, 2.0


def walk(rng, samples, rate):
    """A walk (time, 3) of unit variance that forgets at a rate."""
    keeps = np.exp(-rate * STEP)
    drawn = rng.standard_normal((samples + 400, 3)) * np.sqrt(1 - keeps**2)
    return lfilter([1.0], [1.0, -keeps], drawn, axis=0)[400:]


def pushed(rng, samples):
    """Time, force (time, 3) below 3 Hz, and the path of a mass center under it, in closed form."""
    time = STEP * np.arange(samples)
    rate, size, phase = rng.uniform(4, 18, 3), rng.uniform(1, 5, 3), rng.uniform(0, 6, 3)
    force = size * np.cos(rate * time[:, None] + phase)
    return time, force, -force / MASS / rate**2


def channel(seed, std, rate, samples=600, white=2e-4):
    rng = np.random.default_rng([seed, 71])
    time, _, path = pushed(rng, samples)
    z = path + white * rng.standard_normal(path.shape) + std * walk(rng, samples, rate)
    return Channel(time, z, 1 / MASS, np.tile(white**2 * np.eye(3), (samples, 1, 1)), np.zeros((3, 3)))


def test_a_walk_of_the_mass_center_is_found_by_its_steps():
    """How strong it is at high frequency, std^2 rate, is what a record beside loads fixes."""
    off = []
    for seed in range(6):
        rng = np.random.default_rng([seed, 72])
        std, rate = (
            2e-4 * np.exp(rng.uniform(np.log(1.0), np.log(5.0))),
            np.exp(rng.uniform(np.log(8), np.log(60))),
        )
        found = shared_errors(channel(seed, std, rate), engine("auto"))
        assert found is not None
        off.append(np.log(found.std**2 * found.rate / (std**2 * rate)))
    assert abs(np.mean(off)) < 0.2
    assert np.std(off) < 0.5


def test_independent_errors_of_markers_are_shared_by_none():
    assert [shared_errors(channel(seed, 0.0, 1.0), engine("auto")) for seed in range(8)] == [None] * 8


@pytest.mark.long
def test_a_short_record_shows_them_too_and_shows_none_that_are_not():
    found = [shared_errors(channel(seed, 8e-4, 60.0, 140), engine("auto")) for seed in range(8)]
    none = [shared_errors(channel(seed, 0.0, 60.0, 140), engine("auto")) for seed in range(8)]
    assert sum(one is not None for one in found) >= 6
    assert none == [None] * 8


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_of_length_do_not_matter(scale):
    given = channel(3, 4e-4, 20.0)
    other = Channel(given.time, scale * given.z, given.gain, scale**2 * given.noise_cov, given.drift)
    one, same = (shared_errors(c, engine("auto")) for c in (given, other))
    np.testing.assert_allclose([same.std, same.rate], [scale * one.std, one.rate], rtol=1e-6)


@pytest.mark.long
def test_beside_errors_that_all_share_claims_hold_and_forces_are_better_than_by_a_low_pass():
    over, ratio = [], []
    for seed in range(8):
        rng = np.random.default_rng([seed, 73])
        time, force, path = pushed(rng, 500)
        X = rng.uniform(-0.2, 0.2, (6, 3))
        sway = 3e-4 * walk(rng, 500, np.exp(rng.uniform(np.log(8), np.log(60))))
        x = path[:, None] + X + sway[:, None] + 3e-4 * rng.standard_normal((500, 6, 3))
        body = Body(tuple("abcdef"), X, total_mass=MASS, mass_center=np.zeros(3), inertia=0.02 * np.eye(3))
        found = estimate_recording(Recording(body, Motion(time, x, gravity=np.zeros(3))), load_settings())
        error, plain = ((each.force - force)[60:-60] for each in (found, found.witness))
        over.append(np.mean(error**2) / np.mean(found.force_std[60:-60] ** 2))
        ratio.append(np.sqrt(np.mean(error**2) / np.mean(plain**2)))
    assert 0.6 < np.sqrt(np.mean(over)) < 1.4
    assert np.median(ratio) < 1.0
