"""The cut of the plain route: how near to the best one chosen on the truth, and what it says of the noise."""

import numpy as np
from scipy.signal import lfilter

from evidence.subjects.flights.drawn_loads import draw_matern
from forceid.estimation.loads.plain_cut import plain_cuts, spectrum_of
from forceid.motion.smoothing_spline import SmoothingSpline


def drawn(seed):
    """A record of a unit mass under a drawn load: time, path and acceleration (time, 3), noise."""
    rng = np.random.default_rng(seed)
    frames, rate = int(rng.choice([200, 500, 1000, 2000])), float(rng.choice([50, 100, 250, 1000]))
    t = np.arange(frames) / rate
    load = draw_matern(10 ** rng.uniform(0, 2), 2 * np.pi * rng.uniform(2, 0.04 * frames) / t[-1], t[-1], rng)
    return t, load.second(t), load.at(t), 10 ** rng.uniform(-4, np.log10(3e-3)), rng


def central(values):
    return values[len(values) // 8 : -(len(values) // 8)]


def rms(values):
    return np.sqrt(np.mean(central(values) ** 2, axis=0))


def scored(t, z, truth):
    """Error over that of the best cut, and over the claimed noise, of each axis."""
    steps = np.arange(-1, np.log2(0.3 * len(t)), 0.5)
    best = np.min([rms(SmoothingSpline(t, f).second(z) - truth) for f in 2**steps / t[-1]], axis=0)
    ratio, claim = [], []
    for k, cut in enumerate(plain_cuts(spectrum_of(t, z))):
        spline = SmoothingSpline(t, cut.frequency)
        error = rms(spline.second(z[:, [k]])[:, 0] - truth[:, k])
        ratio.append(error / best[k])
        claim.append(error / np.sqrt(2 * cut.noise * spline.gain()[len(t) // 2]))
    return ratio, claim


def test_error_is_near_that_of_the_best_cut_chosen_on_the_truth_and_known():
    ratio, claim = [], []
    for seed in range(25):
        t, path, truth, noise, rng = drawn(seed)
        more = scored(t, path + noise * rng.standard_normal(path.shape), truth)
        ratio += more[0]
        claim += more[1]
    assert np.median(ratio) < 1.3
    assert np.quantile(ratio, 0.8) < 2.0
    assert 0.5 < np.median(claim) < 2.0
    assert np.mean((np.array(claim) > 0.5) & (np.array(claim) < 2.0)) > 0.75


def test_errors_that_follow_each_other_do_not_pass_for_motion():
    ratio = []
    for seed in range(25):
        t, path, truth, noise, rng = drawn(seed)
        white = rng.standard_normal(path.shape)
        slow = np.exp(-2 * np.pi * 0.02)  # correlated over eight frames
        errors = 0.7 * white + 0.7 * lfilter([np.sqrt(1 - slow**2)], [1, -slow], white, axis=0)
        ratio += scored(t, path + noise * errors, truth)[0]
    assert np.median(ratio) < 1.4


def test_errors_smoothed_at_the_source_do_not_raise_the_cut():
    rng = np.random.default_rng(4)
    t = np.arange(1000) / 100
    path = 0.05 * np.sin(2 * np.pi * 1.0 * t + np.arange(3)[:, None]).T
    jitter = lfilter(*([0.02, 0.04, 0.02], [1, -1.56, 0.64]), rng.standard_normal((1000, 3)), axis=0)
    for cut in plain_cuts(spectrum_of(t, path + 3e-4 * jitter)):
        assert 1.0 < cut.frequency < 6.0


def test_a_weight_moves_no_cut():
    for seed in range(10):
        t, path, _, noise, rng = drawn(seed)
        z = path + noise * rng.standard_normal(path.shape)
        with_weight = z + 0.5 * np.outer(t**2, [0.0, -9.81, 1e3])
        for cut, other in zip(
            plain_cuts(spectrum_of(t, z)), plain_cuts(spectrum_of(t, with_weight)), strict=True
        ):
            assert other.frequency == cut.frequency
            assert abs(other.noise / cut.noise - 1) < 1e-3
