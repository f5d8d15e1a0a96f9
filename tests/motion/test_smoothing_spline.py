"""The quintic smoothing spline as a low-pass: its gain, its noise, what it keeps."""

import numpy as np
import pytest

from forceid.motion.smoothing_spline import SmoothingSpline


@pytest.mark.parametrize("cutoff", [2.0, 5.0, 12.0])
def test_gain_at_any_frequency_is_that_of_its_formula(cutoff):
    t = np.arange(400) / 100
    for f in (0.5 * cutoff, cutoff, 1.5 * cutoff):
        wave = np.cos(2 * np.pi * f * t)
        middle = slice(150, 250)
        found = SmoothingSpline(t, cutoff).second(wave[:, None])[middle, 0]
        expected = -((2 * np.pi * f) ** 2) * wave[middle] / (1 + (f / cutoff) ** 6)
        assert np.abs(found - expected).max() < 0.01 * (2 * np.pi * f) ** 2


def test_parabola_is_kept_on_an_irregular_clock_with_samples_missing():
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0, 3, 300))
    t = np.concatenate([t[:120], t[150:]])
    z = np.column_stack([1.0 + t - 2 * t**2, 3 * t**2])
    found = SmoothingSpline(t, 3.0).second(z)
    np.testing.assert_allclose(found, np.tile([-4.0, 6.0], (270, 1)), atol=1e-6)


@pytest.mark.parametrize("cutoff", [0.3, 4.0, 30.0])
def test_claimed_noise_gain_is_that_of_the_weights(cutoff):
    t = np.arange(300) / 100
    spline = SmoothingSpline(t, cutoff)
    weights = spline.second(np.eye(300))
    np.testing.assert_allclose(spline.gain(), (weights**2).sum(1), rtol=0.01)


def test_result_is_linear_in_the_record():
    rng = np.random.default_rng(1)
    t, a, b = np.arange(200) / 50, *rng.standard_normal((2, 200, 3))
    spline = SmoothingSpline(t, 4.0)
    whole = spline.second(2 * a - 3 * b)
    np.testing.assert_allclose(
        whole, 2 * spline.second(a) - 3 * spline.second(b), atol=1e-9 * np.abs(whole).max()
    )
