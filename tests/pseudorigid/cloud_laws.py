"""Exact laws of gas clouds, written down: size at rest, small motions, spread, free fall."""

import numpy as np
from scipy.optimize import brentq


def resting_size(cloud):
    """The largest a of F = a I at rest: K a^(1 - 3 gamma) = mu (omega_0^2 + (4/3) pi G rho / a^3)."""

    def surplus(log_a):
        a = np.exp(log_a)
        return cloud.mu * (cloud.trap**2 + 4 / 3 * cloud.pi_G_rho / a**3) - cloud.K * a ** (
            1 - 3 * cloud.gamma
        )

    tried = np.linspace(5.0, -5.0, 401)
    signs = np.sign(surplus(tried))
    i = np.flatnonzero(signs[:-1] != signs[1:])[0]
    return np.exp(brentq(surplus, tried[i + 1], tried[i], xtol=1e-16, rtol=8.9e-16))


def small_motions(cloud):
    """Squared frequencies (breathing, the five shears) about the cloud at rest."""
    g = cloud.pi_G_rho / resting_size(cloud) ** 3
    breathing = (3 * cloud.gamma - 1) * cloud.trap**2 + (3 * cloud.gamma - 4) * 4 / 3 * g
    return breathing, 2 * cloud.trap**2 + 16 / 15 * g


def spread(cloud, F0, dF0, t):
    """tr(F^T F) (time,) of a monatomic cloud without gravity, in every shape and spin."""
    H = cloud.energy(F0) + 0.5 * cloud.mu * (dF0 * dF0).sum()
    r0, r1, k, push = (F0 * F0).sum(), 2 * (F0 * dF0).sum(), 2 * cloud.trap, 4 * H / cloud.mu
    if not k:
        return r0 + r1 * t + push / 2 * t**2
    return push / k**2 + (r0 - push / k**2) * np.cos(k * t) + r1 / k * np.sin(k * t)
