import numpy as np
import pytest
from linear_models import draw
from scipy.optimize import minimize
from scipy.stats import chi2

from forceid.flight.channels import Start, load_chain, search_box, start_of, tuning_segments
from forceid.flight.tuning import natural, smoothest, tune_loads
from forceid.kalman import StateSpace, discretize, log_likelihood, matern
from forceid.kalman.tuning.search import maximize, uphill
from forceid.significance import PATIENCE

GAIN, STEP, NOISE = 10.0, 0.004, 3e-4


def driven_channel(order, std, rate, seed, time=400, noise=NOISE, step=STEP):
    """Position of a 0.1 kg mass under a force with a Matern prior and no mean, measured with noise."""
    chain = load_chain(matern(order, std, rate), Start(second=1e-4, first=1e-2, mean=1e-12))
    F, Q = discretize(chain, step)
    start = np.zeros(F.shape[-1])
    model = StateSpace(F, Q, GAIN * chain.output[None], np.array([[noise**2]]), start, chain.P0)
    return draw(model, time, np.random.default_rng(seed))[1][:, 0]


def three_axes(order=2, seed=0, **more):
    """Three axes with their own std (N) and rate (1/s): time, z (time, axis), std, rate."""
    std, rate = np.array([1.0, 3.0, 0.5]), np.array([30.0, 20.0, 40.0])
    z = np.stack([driven_channel(order, std[i], rate[i], 10 * seed + i, **more) for i in range(3)], 1)
    return np.arange(len(z)) * STEP, z, std, rate


def evidence(time, z, order, std, rate, noise):
    """Log-likelihood of the axes by hand, one model at a time."""
    y = z - z[0]
    start, total = start_of(time, y, GAIN), 0.0
    for axis in range(z.shape[1]):
        chain = load_chain(matern(order, std[axis], rate[axis]), start)
        F, Q = discretize(chain, STEP)
        R = np.array([[noise**2]])
        model = StateSpace(F, Q, GAIN * chain.output[None], R, np.zeros(len(F)), chain.P0)
        total += float(log_likelihood(model, y[:, axis]))
    return total


def test_maximum_of_separate_problems_is_found_for_each():
    peaks = np.array([[0.31, 0.77], [0.05, 0.93], [0.5, 0.21]])
    width = np.array([1.0, 0.2])

    def bowls(points, levels):
        return -(((points - peaks[:, None]) / width) ** 2).sum(-1) - 0 * levels[..., None]

    at, level, value = maximize(bowls, np.zeros((3, 2)), np.ones((3, 2)), (2.0, 2.0))
    np.testing.assert_allclose(at, peaks, atol=1 / 256)
    assert (level == 2.0).all()
    assert -1e-2 < value.sum() <= 0


def test_maximum_of_a_shared_number_serves_all_problems_at_once():
    """Each problem alone would take its own level, 0.2 and 0.8; together they meet in the middle."""
    wish = np.array([0.2, 0.8])

    def tied(points, levels):
        return -1e4 * ((points[..., 0] - 0.4) ** 2 + (levels[..., None] - wish[:, None]) ** 2)

    at, level, value = maximize(tied, np.zeros((2, 1)), np.ones((2, 1)), (0.0, 1.0))
    assert level == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(at, 0.4, atol=1 / 256)
    assert value.sum() == pytest.approx(-1800, rel=1e-2)


def test_the_higher_of_two_hills_is_found():
    def hills(points, levels):
        low, high = (np.exp(-(((points[..., 0] - peak) / 0.1) ** 2)) for peak in (0.2, 0.85))
        return 0.9 * low + high + 0 * levels[..., None]

    at, _, value = maximize(hills, np.zeros((1, 1)), np.ones((1, 1)), (0.0, 0.0))
    assert at[0, 0] == pytest.approx(0.85, abs=1 / 256)
    assert value.sum() == pytest.approx(1.0, abs=1e-2)


def test_a_coordinate_without_a_bend_of_its_own_goes_no_farther_than_its_bounds():
    ridge = np.array([[-2.0, 1.0], [1.0, 0.0]])
    step = uphill(np.array([0.5, 0.5]), ridge, np.full(2, -3.0), np.full(2, 3.0))
    assert (np.abs(step) <= 3.0).all()
    assert np.isfinite(step).all()


def test_a_maximum_outside_the_box_is_met_at_its_edge():
    def slope(points, levels):
        return points.sum(-1) - 0 * levels[..., None]

    at, _, _ = maximize(slope, np.array([[-1.0, 2.0]]), np.array([[0.0, 5.0]]), (0.0, 0.0))
    assert np.array_equal(at, [[0.0, 5.0]])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_tuning_recovers_std_rate_and_noise_within_the_sampling_error(seed):
    """Twice the log-likelihood it gains over the truth is chi-square in seven unknowns."""
    time, z, std, rate = three_axes(seed=seed)
    stated = np.full(z.shape, (2 * NOISE) ** 2)  # the file claims twice the noise
    tuned = tune_loads(time, z, GAIN, stated, np.zeros(3), noise_range=(0.1, 10.0), orders=(2,))
    gained = 2 * (tuned.log_likelihood - evidence(time, z, 2, std, rate, NOISE))
    assert -0.5 < gained < chi2(7).ppf(0.999)
    assert tuned.noise == pytest.approx(0.5, rel=3 / np.sqrt(2 * z.size))
    np.testing.assert_allclose(np.log(tuned.kernel.std / std), 0, atol=0.7)
    np.testing.assert_allclose(np.log(tuned.kernel.rate / rate), 0, atol=0.7)
    assert not tuned.noise_at_limit


def test_tuned_likelihood_is_that_of_its_models_and_no_optimizer_finds_more():
    time, z, *_ = three_axes(seed=4, time=200)
    tuned = tune_loads(time, z, GAIN, np.full(z.shape, NOISE**2), np.zeros(3), orders=(2,))
    found = tuned.kernel
    assert tuned.log_likelihood == pytest.approx(evidence(time, z, 2, found.std, found.rate, NOISE), abs=1e-6)
    for axis in range(3):
        one = z[:, [axis]] - z[0, axis]
        start = start_of(time, z - z[0], GAIN)

        def minus(p, one=one, start=start):
            chain = load_chain(matern(2, *np.exp(p)), start)
            F, Q = discretize(chain, STEP)
            H, R = GAIN * chain.output[None], np.array([[NOISE**2]])
            return -float(log_likelihood(StateSpace(F, Q, H, R, np.zeros(5), chain.P0), one))

        at = np.log([found.std[axis], found.rate[axis]])
        best = minimize(minus, at, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
        assert minus(at) - best.fun < 0.5  # far below the sampling error of the likelihood


def test_tuning_keeps_the_meaning_of_units():
    """Centimeters for meters scale the load, milliseconds for seconds the rate, and nothing else."""
    time, z, *_ = three_axes(seed=5, time=150)
    noise, still = np.full(z.shape, NOISE**2), np.zeros(3)
    a = tune_loads(time, z, GAIN, noise, still, orders=(2,))
    b = tune_loads(1000 * time, 100 * z, GAIN, 1e4 * noise, still, orders=(2,))
    np.testing.assert_allclose(b.kernel.std, a.kernel.std * 1e-4, rtol=1e-6)
    np.testing.assert_allclose(b.kernel.rate, a.kernel.rate * 1e-3, rtol=1e-6)


def test_a_record_with_gaps_is_tuned_on_what_is_there():
    time, z, std, rate = three_axes(seed=6)
    z[50:80] = z[200] = np.nan
    tuned = tune_loads(time, z, GAIN, np.full(z.shape, NOISE**2), np.zeros(3), orders=(2,))
    np.testing.assert_allclose(np.log(tuned.kernel.std / std), 0, atol=0.8)
    np.testing.assert_allclose(np.log(tuned.kernel.rate / rate), 0, atol=0.8)


def test_noise_at_the_floor_is_reported():
    """A file that states three times the noise, and a floor that forbids less than it states."""
    time, z, *_ = three_axes(seed=7, time=200)
    stated = np.full(z.shape, (3 * NOISE) ** 2)
    tuned = tune_loads(time, z, GAIN, stated, np.zeros(3), noise_range=(1.0, 10.0), orders=(2,))
    assert tuned.noise_at_limit
    assert tuned.noise == pytest.approx(1.0, abs=0.05)


def test_a_rough_load_is_not_taken_for_a_smooth_one():
    """Of a load of order one, drawn over a long record, the evidence against order three is plain."""
    time, z, *_ = three_axes(order=1, seed=8, time=600, noise=3e-6)
    noise = np.full(z.shape, (3e-6) ** 2)
    assert tune_loads(time, z, GAIN, noise, np.zeros(3), orders=(1, 3)).kernel.order == 1


def test_the_smoothest_order_wins_until_the_evidence_is_against_it():
    assert smoothest({1: 100.0, 2: 101.0, 3: 101.0 - PATIENCE + 0.1}) == 3
    assert smoothest({1: 100.0, 2: 101.0, 3: 101.0 - PATIENCE - 0.1}) == 2


def test_an_axis_without_a_varying_load_is_given_a_constant_one():
    """Free fall on two axes, a load on the third: its leak is all that is left to them."""
    time, z, *_ = three_axes(seed=10, time=400)
    quiet = np.random.default_rng(11).standard_normal((len(time), 2)) * NOISE
    z = np.concatenate([quiet, z[:, :1]], 1)
    tuned = tune_loads(time, z, GAIN, np.full(z.shape, NOISE**2), np.zeros(3), orders=(2,))
    np.testing.assert_allclose(tuned.kernel.std[:2], 0.01 * tuned.kernel.std[2])


def test_one_wild_sample_does_not_pass_for_a_rough_load():
    time, z, *_ = three_axes(seed=12, time=400)
    noise, still = np.full(z.shape, NOISE**2), np.zeros(3)
    calm = tune_loads(time, z, GAIN, noise, still, orders=(2,))
    z[200] += 100 * NOISE
    wild = tune_loads(time, z, GAIN, noise, still, orders=(2,))
    np.testing.assert_allclose(np.log(wild.kernel.std / calm.kernel.std), 0, atol=0.7)
    np.testing.assert_allclose(np.log(wild.kernel.rate / calm.kernel.rate), 0, atol=0.7)


def test_search_points_and_natural_numbers_go_over_into_each_other():
    std, rate = natural(np.array([[np.log(2.0 * 30.0**1.5), np.log(30.0)]]), 2)
    np.testing.assert_allclose([std[0], rate[0]], [2.0, 30.0])


@pytest.mark.parametrize(("std", "rate", "noise"), [(1.0, 30.0, 3e-4), (20.0, 3.0, 1e-5), (0.05, 80.0, 1e-3)])
def test_the_search_box_holds_the_truth(std, rate, noise):
    z = driven_channel(2, std, rate, seed=9, time=800, noise=noise)[:, None]
    time = np.arange(len(z)) * STEP
    lower, upper = search_box(time, z, GAIN, 2)
    point = np.log([std * rate**1.5, rate])
    assert (lower < point).all()
    assert (point < upper).all()


def test_the_search_box_is_finite_for_a_body_at_rest():
    lower, upper = search_box(np.arange(20) * STEP, np.zeros((20, 3)), GAIN, 2)
    assert np.isfinite([lower, upper]).all()
    assert (lower <= upper).all()


def test_tuning_looks_at_a_stretch_of_each_quarter_of_a_long_record():
    z = np.zeros((10_000, 3))
    found = tuning_segments(z)
    assert len(found) == 4
    assert found[0].start == 0
    assert found[-1].stop == len(z)
    z[: found[0].stop] = np.nan
    assert tuning_segments(z) == found[1:]
    assert tuning_segments(z[:1500]) == [slice(0, 1500)]


@pytest.mark.parametrize("third", [0.0, 0.1, 10.0])
def test_an_axis_with_less_noise_or_more_has_no_say_in_that_of_the_others(third):
    """Planar video, an encoder, the depth of a camera: the load is on the first two axes."""
    for seed in (31, 32):
        time, z, *_ = three_axes(seed=seed, time=250)
        jitter = NOISE * np.random.default_rng(seed).standard_normal(len(z))
        stated, still = np.full(z.shape, (2 * NOISE) ** 2), np.zeros(3)
        equal, uneven = (
            tune_loads(
                time, np.column_stack([z[:, :2], k * jitter]), GAIN, stated, still, (0.02, 10.0), orders=(2,)
            )
            for k in (1.0, third)
        )
        assert (equal.noise == equal.noise[0]).all()
        assert uneven.noise[:2] == pytest.approx(0.5, rel=3 / np.sqrt(2 * z[:, :2].size))
        assert uneven.noise[2] == pytest.approx(max(0.5 * third, 0.02), rel=0.25)
        assert not uneven.noise_at_limit
        np.testing.assert_allclose(np.log(uneven.kernel.std / equal.kernel.std)[:2], 0, atol=0.3)


def test_frames_that_are_gone_from_a_regular_clock_change_no_likelihood():
    """As steps of two frames, and as ticks that show nothing."""
    time, z, *_ = three_axes(seed=41, time=200)
    kept = np.random.default_rng(0).uniform(size=len(z)) > 0.1
    kept[[0, -1]] = True
    gone = np.where(kept[:, None], z, np.nan)
    var, still = np.full(z.shape, NOISE**2), np.zeros(3)
    ticks, steps = (
        tune_loads(time[k], a[k], GAIN, var[k], still, orders=(2,)) for a, k in ((gone, ...), (z, kept))
    )
    np.testing.assert_allclose(steps.kernel.std, ticks.kernel.std, rtol=0.02)
    np.testing.assert_allclose(steps.kernel.rate, ticks.kernel.rate, rtol=0.02)
    at = (2, steps.kernel.std, steps.kernel.rate, NOISE)
    assert evidence(time, gone, *at) == pytest.approx(steps.log_likelihood, abs=0.05)


def test_a_search_that_begins_near_ends_where_one_from_afar_does():
    time, z, *_ = three_axes(seed=42, time=250)
    stated, still = np.full(z.shape, (2 * NOISE) ** 2), np.zeros(3)
    before = tune_loads(time, z, GAIN, stated, still, (0.02, 10.0))
    z[[40, 90, 91]] = np.nan
    found, near = (tune_loads(time, z, GAIN, stated, still, (0.02, 10.0), near=n) for n in (None, before))
    assert near.kernel.order == found.kernel.order
    assert near.log_likelihood == pytest.approx(found.log_likelihood, abs=0.1)
    np.testing.assert_allclose(near.noise, found.noise, rtol=0.02)
