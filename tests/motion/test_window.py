import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.errors import EstimationError
from forceid.motion.derivative import derivatives
from forceid.motion.window import choose_window, noise_variance, windows

METHODS = ["difference", "savgol", "spline"]
TIME = np.arange(600) * 1e-3
RATES = np.array([25.0, 32.0, 40.0])
PATH = np.sin(TIME[:, None] * RATES + np.arange(3)) / RATES**2
ACCELERATION = -np.sin(TIME[:, None] * RATES + np.arange(3))
NOISE = 1e-6
INNER = slice(75, 525)


def estimator(time, z, var):
    def estimate(window):
        d = derivatives(time, z, window)
        return d.second, var * d.gain[:, :, 2, 2]

    return estimate


def rms(x):
    return np.sqrt(np.nanmean(x**2))


def noisy(seed):
    return PATH + NOISE * np.random.default_rng(seed).standard_normal(PATH.shape)


@pytest.mark.parametrize("method", METHODS)
def test_candidates_smooth_more_and_more(method):
    candidates = windows(method, TIME)
    gain = np.array([np.median(derivatives(TIME, PATH[:, :1], w).gain[:, 0, 2, 2]) for w in candidates])
    assert (gain[3:] < gain[:-3]).all()
    assert gain[-1] < 1e-6 * gain[0]


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS)
def test_chosen_window_is_near_the_best_in_hindsight_and_its_band_is_honest(method):
    candidates, ratio, inside = windows(method, TIME), [], []
    for seed in range(4):
        z = noisy(seed)
        estimate = estimator(TIME, z, noise_variance(TIME, z))
        error = [rms((estimate(w)[0] - ACCELERATION)[INNER]) for w in candidates]
        choice = choose_window(candidates, estimate)
        off = (choice.target - ACCELERATION)[INNER]
        ratio.append(rms(off) / min(error))
        inside.append(np.mean(abs(off) < 2 * np.sqrt(choice.variance[INNER])))
    assert np.mean(ratio) < 1.25
    assert 0.9 < np.mean(inside) <= 1


@pytest.mark.parametrize("method", METHODS)
def test_choice_survives_gaps_and_jitter(method):
    rng = np.random.default_rng(8)
    time = np.sort(TIME + 3e-4 * rng.random(len(TIME)))
    truth = -np.sin(time[:, None] * RATES + np.arange(3))
    z = -truth / RATES**2 + NOISE * rng.standard_normal(truth.shape)
    z[rng.choice(600, 60, replace=False)] = np.nan
    z[250:330] = np.nan
    candidates = windows(method, time)
    estimate = estimator(time, z, noise_variance(time, z))
    inner = np.r_[75:230, 350:525]
    choice = choose_window(candidates, estimate)
    found = rms((choice.target - truth)[inner])
    assert found < 1.4 * min(rms((estimate(w)[0] - truth)[inner]) for w in candidates)
    off = (choice.target - truth)[inner] / np.sqrt(choice.variance[inner])
    assert np.nanmean(abs(off) < 2) > 0.9


def test_less_noise_calls_for_a_shorter_window():
    lengths = []
    for noise in (1e-7, 1e-6, 1e-5):
        z = PATH + noise * np.random.default_rng(0).standard_normal(PATH.shape)
        lengths.append(choose_window(windows("spline", TIME), estimator(TIME, z, noise**2)).window.seconds)
    assert lengths[0] < lengths[1] < lengths[2]


def test_constant_acceleration_calls_for_long_windows():
    z = 0.5 * TIME[:, None] ** 2 + NOISE * np.random.default_rng(4).standard_normal((600, 3))
    choice = choose_window(windows("savgol", TIME), estimator(TIME, z, NOISE**2))
    assert choice.window.seconds > 0.1
    assert rms((choice.target - 1)[INNER]) < 0.01


@pytest.mark.parametrize("method", METHODS)
def test_turning_the_axes_turns_the_result_only(method):
    z, R = noisy(1), Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()
    one, other = (
        choose_window(windows(method, TIME), estimator(TIME, x, noise_variance(TIME, x)))
        for x in (z, z @ R.T)
    )
    assert one.window == other.window
    np.testing.assert_allclose(other.target, one.target @ R.T, atol=1e-10 * abs(one.target).max())
    np.testing.assert_allclose(other.variance, one.variance, rtol=1e-8)


def test_record_too_short_for_any_window_is_refused():
    time = np.arange(4.0)
    with pytest.raises(EstimationError, match="too short"):
        choose_window(windows("spline", np.arange(30.0)), estimator(time, np.zeros((4, 1)), 1.0))


def test_noise_level_is_found_under_motion_gaps_jitter_and_outliers():
    rng = np.random.default_rng(11)
    time = np.sort(np.arange(4000) * 1e-3 + 4e-4 * rng.random(4000))
    z = np.sin(20 * time)[:, None] * [1.0, 2.0, 3.0] + 1e-4 * rng.standard_normal((4000, 3))
    z[rng.choice(4000, 300, replace=False)] = np.nan
    z[1000:1400] = np.nan
    z[rng.choice(4000, 20, replace=False)] += 0.1
    assert abs(noise_variance(time, z) / 1e-8 - 1) < 0.15


def test_noise_level_is_an_upper_bound_of_a_coarse_record():
    time = np.arange(200) * 0.02
    z = np.sin(60 * time)[:, None] + 1e-4 * np.random.default_rng(0).standard_normal((200, 1))
    assert noise_variance(time, z) > 1e-8


def test_noise_of_too_few_samples_is_refused():
    with pytest.raises(EstimationError, match="expected at least 12"):
        noise_variance(np.arange(8.0), np.zeros((8, 3)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("samples", [8, 12, 20])
def test_the_bias_of_the_shortest_window_is_claimed_or_said(method, samples):
    """Without noise the shortest window is best, and none shorter shows what it takes away."""
    step = 2 * np.pi / RATES[1] / samples
    time = step * np.arange(200)
    z = np.sin(RATES[1] * time[:, None] + np.arange(3)) / RATES[1] ** 2
    choice = choose_window(windows(method, time), estimator(time, z, 1e-20))
    inner = slice(25, 175)
    off = rms((choice.target + np.sin(RATES[1] * time[:, None] + np.arange(3)))[inner])
    assert not choice.resolved or off < 2 * rms(np.sqrt(choice.variance[inner]))


@pytest.mark.parametrize("method", METHODS)
def test_a_wave_of_few_samples_is_said_to_change_within_the_shortest_window(method):
    for samples, resolved in ((60, True), (4, False)):
        step = 2 * np.pi / RATES[1] / samples
        time = step * np.arange(200)
        z = np.sin(RATES[1] * time[:, None] + np.arange(3)) / RATES[1] ** 2
        assert choose_window(windows(method, time), estimator(time, z, 1e-20)).resolved is resolved
