import numpy as np
import pytest

from forceid.scenes.flights import flexible_boomerang

RATE = 4000.0
EIGHTH_ORDER = (4 / 5, -1 / 5, 4 / 105, -1 / 280)


@pytest.fixture(scope="session")
def differentiate():
    """Eighth-order central differences along axis 0; four samples at either end are lost."""

    def derivative(y, step):
        n = len(y)
        pairs = zip((1, 2, 3, 4), EIGHTH_ORDER, strict=True)
        return sum(c * (y[4 + k : n - 4 + k] - y[4 - k : n - 4 - k]) for k, c in pairs) / step

    return derivative


@pytest.fixture(scope="session")
def throw():
    """The throw of principal equations 5.7 at 4 kHz, integrated once for all tests: time, x, v."""
    time = np.arange(2401) / RATE
    return time, *flexible_boomerang.trajectory(flexible_boomerang.Parameters(), time)
