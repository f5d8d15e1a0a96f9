"""Drawn records of loads that keep to axes of the world or of the body: the motion obeys the force."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from evidence.drawn.load_axes import KINDS, draw_flight
from evidence.vectors import GRAVITY
from forceid.motion import fit_rotation


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_the_mass_center_moves_as_the_force_says(kind):
    record = draw_flight(KINDS[kind], np.random.default_rng([3, list(KINDS).index(kind)])).recording
    body, time, truth = record.body, record.motion.time, record.truth
    X = body.position - body.mass_center
    center, _ = fit_rotation(record.motion.position, X, np.ones(len(X)))
    rate = cumulative_simpson(truth["force"] / body.total_mass + GRAVITY, x=time, axis=0, initial=0)
    path = cumulative_simpson(rate, x=time, axis=0, initial=0)
    left = center - path
    line = np.polynomial.polynomial.polyfit(time, left, 1)
    left -= np.polynomial.polynomial.polyval(time, line).T
    # white noise of the markers is all that is left beside a start and a speed
    assert np.sqrt((left**2).mean()) < 1.5 * noise_of(record, X) / np.sqrt(len(X))
    step = np.abs(np.corrcoef(left[1:, 0], left[:-1, 0])[0, 1])
    assert step < 0.3


def noise_of(record, X):
    """Deviation of a coordinate of a marker from a rigid body, rms."""
    x = record.motion.position
    center, R = fit_rotation(x, X, np.ones(len(X)))
    left = x - center[:, None] - np.einsum("tab,nb->tna", R, X)
    return np.sqrt((left**2).sum() / (len(x) * (3 * len(X) - 6)))
