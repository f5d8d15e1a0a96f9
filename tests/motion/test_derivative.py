import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_lsq_spline
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from forceid.motion.derivative import derivatives
from forceid.motion.window import Window

REGULAR = np.arange(160) * 0.01
JITTERED = np.sort(REGULAR + 0.004 * np.random.default_rng(7).random(160))
WINDOWS = [
    Window("difference", 2, 4, 0.04),
    Window("savgol", 2, 6, 0.06),
    Window("savgol", 4, 8, 0.08),
    Window("spline", 5, 9, 0.09),
]
free = settings(deadline=None, derandomize=True, max_examples=25)
any_window = pytest.mark.parametrize("window", WINDOWS, ids=lambda w: f"{w.method}{w.order}")
any_clock = pytest.mark.parametrize("time", [REGULAR, JITTERED], ids=["regular", "jittered"])


def with_gaps(z):
    """The record without a single sample, a short gap, a long gap, and a lone sample in a longer one."""
    z = z.copy()
    z[[20, 40, 41, *range(70, 95), *range(96, 115)]] = np.nan
    return z


def weights(time, window, seen=None):
    """The map itself: derivatives of unit impulses, (time, 3, sample)."""
    impulses = np.eye(len(time))
    if seen is not None:
        impulses[~seen] = np.nan
    d = derivatives(time, impulses, window)
    return np.stack([d.value, d.first, d.second], 1), d.gain[:, 0]


@any_clock
@any_window
def test_polynomials_of_the_fitted_degree_are_differentiated_exactly_up_to_the_ends(window, time):
    for power in range(window.order + 1):
        p = np.polynomial.Polynomial.basis(power, domain=[0, 2], window=[-1, 1])
        for z in (p(time)[:, None], with_gaps(p(time)[:, None])):
            d = derivatives(time, z, window)
            for found, wanted in zip((d.value, d.first, d.second), (p, p.deriv(), p.deriv(2)), strict=True):
                known = np.isfinite(found[:, 0])
                assert known[np.r_[0:70, 116:160]].all()
                scale = 1e-11 / window.seconds**2
                np.testing.assert_allclose(found[known, 0], wanted(time)[known], rtol=0, atol=scale)


@any_clock
@any_window
def test_gain_is_the_covariance_of_the_weights_at_every_sample(window, time):
    W, gain = weights(time, window)
    covariance = W @ W.mT
    size = np.sqrt(np.einsum("taa,tbb->tab", covariance, covariance))
    np.testing.assert_allclose(gain / size, covariance / size, rtol=0, atol=1e-10)


@any_window
def test_gain_around_gaps_is_the_variance_that_monte_carlo_finds(window):
    noise = with_gaps(np.random.default_rng(3).standard_normal((160, 4000)))
    d = derivatives(JITTERED, noise, window)
    known = np.isfinite(d.second[:, 0])
    gain = np.einsum("taa->ta", d.gain[known, 0])
    found = np.stack([x[known].var(axis=1) for x in (d.value, d.first, d.second)], 1)
    np.testing.assert_allclose(found / gain, 1, atol=0.1)  # four and a half of its standard errors
    assert abs((found / gain).mean() - 1) < 0.01


@pytest.mark.parametrize(("order", "half"), [(2, 5), (4, 12)])
def test_regular_record_gives_what_scipy_savgol_filter_gives(order, half):
    z = np.random.default_rng(0).standard_normal((160, 3))
    d = derivatives(REGULAR, z, Window("savgol", order, half, half * 0.01))
    for k, found in enumerate((d.value, d.first, d.second)):
        wanted = savgol_filter(z, 2 * half + 1, order, deriv=k, delta=0.01, axis=0)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * abs(wanted).max())


def test_nearly_regular_clock_gives_what_the_regular_one_gives():
    z = np.random.default_rng(0).standard_normal((160, 2))
    for window in WINDOWS:
        one = derivatives(REGULAR, z, window)
        other = derivatives(REGULAR + 1e-7 * np.sin(np.arange(160.0)), z, window)
        np.testing.assert_allclose(one.second, other.second, atol=1e-3 * abs(one.second).max())
        scale = abs(one.gain).max(axis=(0, 1))
        np.testing.assert_allclose(one.gain / scale, other.gain / scale, atol=1e-3)


def test_spline_is_the_one_scipy_fits_to_the_same_knots():
    z = np.random.default_rng(1).standard_normal((160, 2))
    breaks = np.interp(np.linspace(0, 159, 19), np.arange(160), JITTERED)
    spline = make_lsq_spline(JITTERED, z, np.r_[[breaks[0]] * 5, breaks, [breaks[-1]] * 5], k=5)
    d = derivatives(JITTERED, z, WINDOWS[3])
    np.testing.assert_allclose(d.value, spline(JITTERED), atol=1e-10)
    np.testing.assert_allclose(d.second, spline(JITTERED, 2), atol=1e-10 * abs(d.second).max())


@pytest.mark.parametrize(
    ("method", "order", "rate"), [("difference", 2, 2), ("savgol", 2, 2), ("savgol", 4, 4), ("spline", 5, 4)]
)
def test_second_derivative_converges_at_the_rate_of_its_order(method, order, rate):
    time = np.linspace(0, 2, 2001)
    error = []
    for count in (80, 40):
        d = derivatives(time, np.sin(5 * time)[:, None], Window(method, order, count, count * 1e-3))
        inner = slice(500, 1500)
        error.append(np.sqrt(np.mean((d.second[inner, 0] + 25 * np.sin(5 * time[inner])) ** 2)))
    assert abs(np.log2(error[0] / error[1]) - rate) < 0.15


@any_window
def test_short_gaps_are_bridged_and_long_ones_part_the_record(window):
    z = with_gaps(np.sin(3 * REGULAR)[:, None])
    d = derivatives(REGULAR, z, window)
    known = np.isfinite(d.second[:, 0])
    assert known[:70].all()
    assert known[115:].all()
    assert not known[70:115].any()
    alone = derivatives(REGULAR[:70], z[:70], window)
    np.testing.assert_allclose(d.second[:70], alone.second, atol=1e-12 * abs(alone.second).max())
    np.testing.assert_array_equal(np.isnan(d.gain).all((1, 2, 3)), ~known)


@any_window
def test_channels_with_their_own_gaps_do_not_touch_each_other(window):
    z = np.random.default_rng(5).standard_normal((160, 3))
    holed = np.column_stack([z[:, 0], with_gaps(z[:, 1]), z[:, 2]])
    one, other = derivatives(REGULAR, z, window), derivatives(REGULAR, holed, window)
    np.testing.assert_allclose(other.second[:, ::2], one.second[:, ::2], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(other.gain[:, ::2], one.gain[:, ::2])
    single = derivatives(REGULAR, holed[:, 1:2], window)
    np.testing.assert_array_equal(other.gain[:, 1], single.gain[:, 0])


def test_record_too_short_for_its_polynomial_is_unknown():
    z = np.full((30, 1), np.nan)
    z[10:12] = 1.0
    for window in WINDOWS:
        assert np.isnan(derivatives(REGULAR[:30], z, window).second).all()


@free
@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.floats(-50, 50), st.integers(0, 3))
def test_turned_and_shifted_record_has_turned_derivatives(turn, shift, which):
    z = with_gaps(np.random.default_rng(2).standard_normal((160, 3)))
    R = Rotation.from_rotvec(turn).as_matrix()
    d, e = (derivatives(JITTERED, x, WINDOWS[which]) for x in (z, z @ R.T + shift))
    np.testing.assert_allclose(e.value, d.value @ R.T + shift, rtol=0, atol=1e-10)
    size = np.nanmax(abs(d.second)) * (1 + abs(shift))
    np.testing.assert_allclose(e.second, d.second @ R.T, rtol=0, atol=1e-10 * size)
