"""Loads that repeat, whose phases diffuse and whose sizes wander, as drawn by their own equations.

A harmonic loses its phase the faster the higher it is, which no prior of such a load knows.
"""

import numpy as np
from scipy.interpolate import CubicSpline

MASS = 0.2  # kg


def beating(seed, frames=400, rate=200.0, harmonics=6):
    """Times, force (time, 3) N, the path (time, 3) m of a mass that it moves from rest, and its beat, Hz."""
    rng, fine = np.random.default_rng(seed), 20
    t = np.arange((frames - 1) * fine + 1) / (rate * fine)
    step, k = t[1], np.arange(1, harmonics + 1)
    wander = np.cumsum(0.1 * np.sqrt(step) * rng.standard_normal(len(t)))  # rad
    kicks = 0.1 * np.sqrt(2 * step) * rng.standard_normal(len(t))
    grown = 1 + np.convolve(kicks, np.exp(-np.arange(0.0, 5.0, step)))[: len(t)]
    size = np.exp(0.5 * rng.standard_normal((3, 1))) * 0.6 ** (k - 1)  # N
    frequency = rng.uniform(2.5, 6.0)
    phase = (2 * np.pi * frequency * t + wander)[:, None, None] * k
    waves = np.einsum("aj,taj->ta", size, np.cos(phase + rng.uniform(0, 2 * np.pi, (3, len(k)))))
    force = rng.standard_normal(3) + grown[:, None] * waves
    path = CubicSpline(t, force / MASS).antiderivative(2)(t)
    return t[::fine], force[::fine], path[::fine], frequency
