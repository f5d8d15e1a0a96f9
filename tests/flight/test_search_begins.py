"""Where the search for the prior of a load begins decides which of its peaks it ends on."""

import numpy as np
import pytest

from forceid.flight.priors.stated import Stated
from forceid.flight.tuning import tune_loads
from forceid.kalman.building.process import discretize, integrate, matern
from forceid.significance import NUMBER

AXES = 3


def drawn_channel(seed):
    """Time, z, noise variance and gain of channels under loads of any rate, most slower than the record.

    A load that decays or grows beside a constant one is slower still: a drag, a spring.
    """
    rng = np.random.default_rng([seed, 20261125])
    samples, rate = int(rng.integers(150, 600)), float(np.exp(rng.uniform(np.log(50), np.log(800))))
    time, gain = np.arange(samples) / rate, float(np.exp(rng.uniform(-2, 3)))
    slowest, fastest = 0.3 / time[-1], 0.1 * rate
    z = np.zeros((samples, AXES))
    for axis in range(AXES):
        order, haste = int(rng.integers(1, 5)), np.exp(rng.uniform(np.log(slowest), np.log(fastest)))
        load = integrate(integrate(matern(order, 1.0, haste), 0.0), 0.0)
        F, Q = discretize(load, 1 / rate)
        root = np.linalg.cholesky(load.P0 + 1e-14 * np.trace(load.P0) * np.eye(len(F)))
        wander = np.linalg.cholesky(Q + 1e-14 * np.trace(Q) * np.eye(len(F)))
        x = root @ rng.standard_normal(len(F))
        for k in range(samples):
            z[k, axis] = gain * x[0]
            x = F @ x + wander @ rng.standard_normal(len(F))
        z[:, axis] += gain * rng.normal() * time**2 * np.exp(-rng.uniform(0, 2) * time / time[-1])
    noise = np.ptp(z, axis=0).max() / np.exp(rng.uniform(np.log(30), np.log(3000)))
    z += noise * rng.standard_normal(z.shape)
    return time, z - z[0], np.full(z.shape, noise**2), gain


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 60, 10))
def test_no_rate_is_likelier_than_the_one_found(first):
    """Against searches that are held at rates from one a record to one a sample."""
    for seed in range(first, first + 10):
        time, z, var, gain = drawn_channel(seed)
        found = tune_loads(time, z, gain, var, np.zeros(AXES))
        rates = np.geomspace(1 / time[-1], 0.5 / time[1], 7)
        order = (found.kernel.order,)
        held = [
            tune_loads(time, z, gain, var, np.zeros(AXES), orders=order, stated=Stated(rate=rate))
            for rate in rates
        ]
        # what is held alike on all axes may be less likely, and never more by a number
        assert found.log_likelihood > max(one.log_likelihood for one in held) - NUMBER, seed
