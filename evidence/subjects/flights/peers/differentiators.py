"""Second derivatives (sample, 6) of noisy paths by numpy and scipy, as their documentation has them."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import UnivariateSpline, make_smoothing_spline
from scipy.signal import butter, savgol_filter, sosfiltfilt

from forceid.records import Array

SAVGOL_ORDER = 4  # of the polynomial of Savitzky and Golay


def numpy_gradient(z: Array, step: float) -> Array:
    """numpy.gradient, twice."""
    return np.asarray(np.gradient(np.gradient(z, step, axis=0), step, axis=0))


def savgol(z: Array, step: float, cut: float) -> Array:
    """savgol_filter with the window whose 3 dB point is at `cut` Hz. Source: Schafer (2011), equation 12."""
    half = ((SAVGOL_ORDER + 1) / (2 * cut * step) + 4.6) / 3.2
    window = 2 * int(np.clip(round(half), SAVGOL_ORDER // 2 + 1, (len(z) - 1) // 2)) + 1
    return np.asarray(savgol_filter(z, window, SAVGOL_ORDER, deriv=2, delta=step, axis=0))


def butterworth(z: Array, step: float, cut: float) -> Array:
    """A Butterworth filter of second order, forth and back, then differences."""
    sos = butter(2, min(cut, 0.45 / step), fs=1 / step, output="sos")
    pad = min(len(z) - 1, int(np.ceil(1 / (cut * step))))
    return numpy_gradient(sosfiltfilt(sos, z - z[0], axis=0, padlen=pad), step)


def quintic_spline(z: Array, step: float, noise: float) -> Array:
    """UnivariateSpline of degree 5 that leaves `noise` times the noise that high differences show."""
    time, out = step * np.arange(len(z)), np.zeros_like(z)
    for i, (track, std) in enumerate(zip(z.T, noise_std(z), strict=True)):
        if std > 0:
            fit = UnivariateSpline(time, track, np.full(len(z), 1 / std), k=5, s=len(z) * noise**2)
            out[:, i] = fit.derivative(2)(time)
    return out


def smoothing_spline(z: Array, step: float, stiffness: float | None = None) -> Array:
    """make_smoothing_spline, its penalty by generalized cross-validation or as stated (s^3)."""
    time, out = step * np.arange(len(z)), np.zeros_like(z)
    for i, track in enumerate((z - z[0]).T):
        if np.ptp(track) > 0:
            lam = None if stiffness is None else stiffness / step
            out[:, i] = make_smoothing_spline(time / step, track, lam=lam and lam / step**2).derivative(2)(
                time / step
            )
    return out / step**2


def noise_std(z: Array) -> Array:
    """White noise (channel,) that fourth differences show.

    >>> z = 1e-3 * np.random.default_rng(0).standard_normal((4000, 1)) + np.linspace(0, 1, 4000)[:, None] ** 2
    >>> bool(abs(noise_std(z)[0] / 1e-3 - 1) < 0.1)
    True
    """
    return np.asarray(np.sqrt(np.mean(np.diff(z, 4, axis=0) ** 2, axis=0) / 70.0))
