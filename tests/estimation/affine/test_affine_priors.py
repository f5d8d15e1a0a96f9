"""Priors of the loads on an affine body: powers that a record shows, and the level of the least error."""

import numpy as np
import pytest

from evidence.subjects.flights.drawn_loads import Drawn
from forceid.estimation.affine.powers import Axes, powers, richest
from forceid.estimation.affine.priors import least_error, likeliest
from forceid.estimation.affine.resonances import find_resonances
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.kalman.building.process import matern_density
from forceid.kalman.engines import engine
from forceid.scenes.drawn_loads import draw_periodic

TIME, SIGMA, AXES = np.arange(800) / 500, 1e-4, 9
RATE = 12.0  # 1/s


def seen(second=0.0, seed=0):
    """Noisy channels whose second derivative is a load given by its second integral (time, axis)."""
    noise = SIGMA * np.random.default_rng(seed).standard_normal((len(TIME), AXES))
    return Axes(TIME, second + noise, np.full((len(TIME), AXES), SIGMA**2), np.zeros(AXES))


def drawn(seed):
    drawn = draw_periodic(np.ones(AXES), RATE, np.random.default_rng(seed))
    return Drawn(*drawn, np.zeros(AXES)).second(TIME)


def ringing(w, size):
    """Second integral of lines of w rad/s, each axis with a phase of its own."""
    return -size / w**2 * np.cos(w * TIME[:, None] + np.arange(AXES))


def over_claim(p, tuned, line, size):
    """Rms error over claim of a load of known power, with a line in it, under a prior: of all frequencies."""
    S = np.stack(
        [matern_density(tuned.order, s, r, p.w) for s, r in zip(tuned.std, tuned.rate, strict=True)], 1
    )
    true = np.tile(matern_density(2, 1.0, RATE, p.w)[:, None], (1, AXES))
    true[np.abs(p.w - line).argmin()] += 0.25 * size**2 * 2 * np.pi / (p.w[1] - p.w[0])
    G = S / (S + p.noise)
    return np.sqrt(((1 - G) ** 2 * true + G**2 * p.noise).sum() / (G * p.noise).sum())


def test_total_power_is_that_of_load_and_noise():
    chosen, record = engine(), seen(drawn(1))
    p = powers(likeliest(record, chosen), record, chosen)
    truth = matern_density(2, 1.0, RATE, p.w)[:, None] + p.noise
    band = (p.w > 2 * np.pi * 3.0) & (p.w < 2 * np.pi * 150.0)
    assert (p.total / truth)[band].mean() == pytest.approx(1.0, abs=0.05)


def test_rough_load_is_not_taken_for_a_smooth_one():
    assert likeliest(seen(drawn(2)), engine()).order == 2


def test_likelihood_overrates_a_load_beside_lines_and_the_least_error_does_not():
    w, size, chosen, ratio = 2 * np.pi * 9.0, 1.0, engine(), []
    for seed in range(3):
        record = seen(drawn(20 + seed) + ringing(w, size), seed)
        likely = likeliest(record, chosen)
        p = powers(likely, record, chosen)
        tuned = least_error(likely, record, chosen)
        ratio.append([over_claim(p, prior, w, size) for prior in (likely, tuned)])
    assert np.mean(ratio, 0)[0] < 0.85
    assert np.mean(ratio, 0)[1] == pytest.approx(1.0, abs=0.1)


def test_swing_below_the_noise_of_a_frequency_is_found_with_its_size():
    w, size = 2 * np.pi * 60.0, 6.0
    record, chosen = seen(drawn(4) + ringing(w, size)), engine()
    found = find_resonances(likeliest(record, chosen), record, chosen)
    assert len(found) == 1
    assert found[0].w == pytest.approx(w, rel=0.01)
    assert np.sqrt(np.mean(found[0].std ** 2)) == pytest.approx(size / np.sqrt(2), rel=0.3)


def test_no_swing_is_found_where_there_is_none():
    chosen = engine()
    for seed in range(5, 8):
        record = seen(drawn(seed), seed)
        assert find_resonances(likeliest(record, chosen), record, chosen) == ()


def test_of_a_long_record_the_stretch_that_shows_most_is_taken():
    z = np.zeros((10000, 2))
    z[:3000] = np.nan
    long = Axes(np.arange(10000.0), z, np.ones_like(z), np.zeros(2))
    part = richest(long)
    assert len(part.time) == CHANNEL_SAMPLES
    assert part.time[0] >= 3000.0
    assert richest(part) is part
