"""Drawn loads: of the stated size and spectrum, whether of a record or periodic, with exact integrals."""

import numpy as np
import pytest

from evidence.subjects.flights.drawn_loads import draw_matern
from forceid.scenes.drawn_loads import PERIOD, draw_periodic, spectrum, waves


@pytest.mark.parametrize("order", [2, 3])
def test_the_spectrum_holds_unit_variance_and_falls_with_twice_its_order(order):
    w = np.linspace(0.0, 4000.0, 400_001)
    assert np.trapezoid(spectrum(w, 5.0, order), w) == pytest.approx(1.0, rel=1e-6)
    far = spectrum(np.array([1e3, 1e4]), 5.0, order)
    assert far[0] / far[1] == pytest.approx(10.0 ** (2 * order), rel=1e-3)


def test_periodic_loads_are_independent_of_the_stated_size_each():
    time = np.arange(0.0, PERIOD, PERIOD / 64)
    found = np.array(
        [waves(time, *draw_periodic([2.0, 0.3], 12.0, np.random.default_rng(k))) for k in range(60)]
    )
    np.testing.assert_allclose(found.std((0, 1)), [2.0, 0.3], rtol=0.05)
    assert abs(np.corrcoef(found.reshape(-1, 2).T)[0, 1]) < 0.1


@pytest.mark.parametrize("span", [2.0, 200.0], ids=["waves", "curve"])
def test_impulse_and_its_integral_are_those_of_the_load(span):
    load = draw_matern(2.0, 12.0, span, np.random.default_rng(0))
    step = 1e-4
    time = step * np.arange(4001)
    for value, rate in ((load.impulse, load.at), (load.second, load.impulse)):
        np.testing.assert_allclose(value(np.zeros(1)), 0.0, atol=1e-12)
        simpson = step / 3 * (rate(time[:-2:2]) + 4 * rate(time[1:-1:2]) + rate(time[2::2]))
        np.testing.assert_allclose(np.diff(value(time[::2]), axis=0), simpson, atol=1e-11)
