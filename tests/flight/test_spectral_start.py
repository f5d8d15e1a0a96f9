import numpy as np
import pytest
from test_tuning import GAIN, STEP, driven_channel

from forceid.flight.channels import runs_of, search_box
from forceid.flight.spectral_start import Channels, first_sight
from forceid.flight.tuning import ORDERS, in_doubt, smoothest, tune_loads
from forceid.flight.whittle import ordinates
from forceid.kalman.engines import engine


def drawn(seed, jitter=0.0):
    """A record of two or three axes, of an order, rates, sizes and a noise at random; and that noise.

    jitter: of the clock, in steps: each sample is up to as much early or late.
    """
    rng = np.random.default_rng(seed)
    order, samples, axes = int(rng.choice([1, 2, 3, 4])), int(rng.choice([200, 400])), int(rng.choice([2, 3]))
    std, rate = np.exp(rng.uniform(-1, 2, axes)), np.exp(rng.uniform(2.3, 4.3, axes))
    noise = 3e-4 * float(np.exp(rng.uniform(-2, 1)))
    time = STEP * (np.arange(samples) + rng.uniform(-jitter, jitter, samples))
    each = [
        driven_channel(order, s, r, 10 * seed + i, samples, noise, np.diff(time))
        for i, (s, r) in enumerate(zip(std, rate, strict=True))
    ]
    return time, np.stack(each, 1), noise


def sighted(time, z, noise):
    edges, axes = search_box(time, z, GAIN, 0), z.shape[1]

    def box(order):
        return tuple(np.tile([level + order * rate, rate], (axes, 1)) for level, rate in edges)

    var = np.full(z.shape, noise**2)
    channels = Channels(runs_of(time, z, var), GAIN, np.zeros(axes), (), None, box, engine())
    return first_sight(time, z, channels, (0.0, 0.0))


LONG = [pytest.param(seed, marks=pytest.mark.long) for seed in (0, 1, 3, 4, 5, 6, 7)]


@pytest.mark.parametrize("jitter", [0.0, 0.4])
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("seed", [2, *LONG])
def test_a_search_from_the_spectrum_ends_where_one_from_a_full_grid_does(seed, stated, jitter, monkeypatch):
    """In the same order, and at a likelihood that is no worse by a tenth."""
    time, z, noise = drawn(seed, jitter)
    var, still = np.full(z.shape, (noise if stated else 2 * noise) ** 2), np.zeros(z.shape[1])
    limits = (1.0, 1.0) if stated else (0.02, 3.0)
    found = tune_loads(time, z, GAIN, var, still, limits)
    monkeypatch.setattr(Channels, "even", False)
    grid = tune_loads(time, z, GAIN, var, still, limits)
    assert found.kernel.order == grid.kernel.order
    assert found.log_likelihood > grid.log_likelihood - 0.1


@pytest.mark.parametrize("seed", range(4))
def test_the_spectrum_tells_the_evidence_between_orders_about_as_the_likelihood_does(seed):
    time, z, noise = drawn(seed)
    same = np.ones((z.shape[1],) * 2, bool)
    level = np.zeros(z.shape[1])
    expected = sighted(time, z, noise).peaks(ORDERS, (level, level), same)[2].sum(1)
    var, still = np.full(z.shape, noise**2), np.zeros(z.shape[1])
    first = smoothest(dict(zip(ORDERS, expected.tolist(), strict=True)))
    other = 2 if first != 2 else 3
    exact = [
        tune_loads(time, z, GAIN, var, still, orders=(order,)).log_likelihood for order in (first, other)
    ]
    told = expected[ORDERS.index(first)] - expected[ORDERS.index(other)]
    assert exact[0] - exact[1] == pytest.approx(told, abs=3.5, rel=0.2)


def test_innovations_of_the_prior_that_was_drawn_have_a_white_spectrum():
    time, z, noise = drawn(2)
    spectrum = sighted(time, z, noise).spectrum
    assert spectrum.power.sum() == pytest.approx(spectrum.count.sum() * z.shape[1], rel=0.15)


def test_slopes_of_the_spectrum_are_those_of_its_likelihood():
    spectrum = sighted(*drawn(1)).spectrum
    axes = len(spectrum.power)
    x = np.tile([3.0, 3.0, 0.1], (1, axes, 1))
    _, slope, _ = spectrum.slopes(x, np.array([3]))
    for k, h in enumerate(1e-5 * np.eye(3)):
        ahead, behind = (spectrum.slopes(x + way * h, np.array([3]))[0] for way in (1, -1))
        np.testing.assert_allclose(slope[..., k], (ahead - behind) / 2e-5, rtol=1e-4)


def test_groups_of_ordinates_hold_each_of_them_once():
    found = ordinates(600, STEP, None)
    assert found.count.sum() == 299
    assert (found.count[:16] == 1).all()
    assert len(found.count) < 60


def test_orders_that_no_doubt_about_their_evidence_makes_the_smoothest_are_not_searched():
    assert in_doubt(dict.fromkeys((1, 2, 3, 4), 0.0) | {6: -20.0}) == (4,)
    assert in_doubt({1: -50.0, 2: 0.0, 3: -8.0, 4: -30.0, 6: -60.0}) == (2, 3)
    assert 6 in in_doubt({1: -50.0, 2: -30.0, 3: -10.0, 4: -2.0, 6: 0.0})


def test_a_load_of_another_order_is_as_strong_where_it_is_slow_and_where_it_meets_the_noise():
    found = sighted(*drawn(1))
    axes = len(found.spectrum.power)
    points = np.tile([12.0, 3.0], (axes, 1))
    rougher = found.alike(points, 4, 2)
    was, load = (found.spectrum.load(p, np.array([k]))[0] for p, k in ((points, 4), (rougher, 2)))
    meets = np.abs(np.log(was / found.spectrum.noise)).argmin(1)
    for at in (0, meets):
        each = np.arange(axes), at
        np.testing.assert_allclose(load[each], was[each], rtol=0.05)
