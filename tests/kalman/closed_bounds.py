"""What integrated white noise and a constant acceleration can be known to, in closed form."""

import numpy as np


def integrated_wiener_bound(n, k, density, r):
    """Smoother variance of derivative k of n-fold integrated white noise, of density `density`."""
    w, power = (density / r) ** (1 / (2 * n)), 2 * k + 1
    return r * w**power / (2 * n * np.sin(np.pi * power / (2 * n)))


def constant_acceleration_bound(sigma, N, T):
    """Standard deviation of a constant acceleration from a parabola through N even positions over T."""
    return sigma * (N - 1) ** 2 / T**2 * np.sqrt(720 / (N * (N**2 - 1.0) * (N**2 - 4.0)))
