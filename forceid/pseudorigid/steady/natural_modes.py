"""Hyperelastic bodies at rest and in steady spin: natural frequencies for any E, stretch of a spinning body.

At rest E delta'' = -d2W[delta]; in spin about axis 3, F = R_z(Omega t) diag(a), dW/da_i = Omega^2 E_i a_i for
i = 1, 2 and dW/da_3 = 0. Source: pseudo-rigid bodies, section 12.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh

from forceid.errors import DataError
from forceid.pseudorigid.material.material_law import check_finite
from forceid.pseudorigid.steady.spectra import Spectrum, linearized, rotating_spectrum
from forceid.pseudorigid.validation import validated_second_moment
from forceid.records import Array

CONTINUED = (1, 8, 64)  # steps of the rate from rest to the one that is asked for
NEWTON_SETTLED = 1e-14  # of the stretch, in the last step of Newton's method


@dataclass(frozen=True)
class NaturalModes:
    """squared (mode,) 1/s^2, ascending, and shape (mode, 3, 3), delta of F with tr(delta E delta^T) = 1.

    Nine modes, eight with det F = 1; three are turns with squared frequency 0. Negative: unstable.
    """

    squared: Array
    shape: Array


def natural_modes(
    material: Any, second_moment: Array, rest: Array | None = None, incompressible: bool = False
) -> NaturalModes:
    """Natural modes of a body about F = rest, the identity unless given; any E (3, 3), positive definite.

    material: with `gradient(F)` and `hessian(F, H)`, F (3, 3). DataError where it is not at rest there.
    Source: pseudo-rigid bodies, 12.6.

    >>> from forceid.pseudorigid.steady.gravity import GasCloud
    >>> cloud = GasCloud(1.0, 1.4, trap=1.0)
    >>> print(natural_modes(cloud, np.eye(3)).squared.round(9) + 0.0)
    [0.  0.  0.  2.  2.  2.  2.  2.  3.2]
    """
    still, F = np.zeros(3), np.eye(3) if rest is None else rest
    (M, _, K), free, _ = linearized(material, second_moment, F, still, still, incompressible)
    squared, shape = eigh((K + K.T) / 2, M)
    return NaturalModes(squared, np.asarray((free @ shape).T.reshape(-1, 3, 3)))


@dataclass(frozen=True)
class SpinningBody:
    """A body in steady spin F = R_z(rate t) diag(stretch): momentum about axis 3, energy, spectrum."""

    stretch: Array
    rate: float
    angular_momentum: float
    energy: float
    spectrum: Spectrum


def spinning_body(material: Any, second_moment: Array, rate: float) -> SpinningBody:
    """Steady spin of an isotropic, compressible body about axis 3, E diagonal, from F = I at rest.

    rate 1/s. By Newton's method, with the rate raised in steps where one does not do. DataError where E is
    not diagonal, or where nothing holds the body together at this rate. Source: pseudo-rigid bodies, 12.6.

    >>> from forceid.pseudorigid.steady.gravity import GasCloud
    >>> found = spinning_body(GasCloud(1.0, 5 / 3, trap=1.0), np.eye(3), 0.6)
    >>> print(f"{found.stretch[0] / found.stretch[2]:.9f}")  # 1 / sqrt(1 - rate^2)
    1.250000000
    """
    E = validated_second_moment(second_moment)
    e = np.diag(E)
    if np.abs(E - np.diag(e)).max() > 1e-12 * e.max():
        raise DataError("is not diagonal", "second_moment", "turn the body to its principal axes")
    check_finite("spinning body", rate=rate)
    for steps in CONTINUED:
        a: Array | None = np.ones(3)
        for part in np.linspace(0, 1, steps + 1):
            a = newton_stretch(material, e, (rate * part) ** 2, a) if a is not None else None
        if a is not None:
            break
    if a is None:
        raise DataError(f"is {rate:g} 1/s, and no steady spin was found there", "rate", "lower it")
    axis = np.array([0.0, 0.0, rate])
    spectrum = rotating_spectrum(material, E, np.diag(a), axis, np.zeros(3))
    momentum = rate * float((e * a**2)[:2].sum())
    return SpinningBody(a, rate, momentum, momentum * rate / 2 + float(material.energy(np.diag(a))), spectrum)


def newton_stretch(material: Any, e: Array, rate_squared: float, start: Array) -> Array | None:
    """Stretches (3,) of steady spin, by Newton's method; None where it does not arrive."""
    a = start
    outward = rate_squared * e * np.array([1.0, 1.0, 0.0])
    axes = np.eye(3)[:, :, None] * np.eye(3)[:, None]
    for _ in range(50):
        F = np.diag(a)
        left = np.diagonal(np.asarray(material.gradient(F))) - outward * a
        slope = np.stack([np.diagonal(np.asarray(material.hessian(F, H))) for H in axes]) - np.diag(outward)
        if not np.linalg.cond(slope) < 1e14:
            return None
        step = -np.linalg.solve(slope, left)
        step *= min(1.0, 0.5 / np.abs(step / a).max(initial=1e-300))
        a = a + step
        if np.abs(step).max() <= NEWTON_SETTLED * np.abs(a).max():
            return np.asarray(a)
        if not (np.isfinite(a).all() and (a > 0).all() and a.max() < 1e6 * start.max()):
            return None
    return None
