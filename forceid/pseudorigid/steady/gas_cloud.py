"""Spinning clouds of a perfect gas: free, in a harmonic trap, held by their own gravity; their exact laws.

W = K J^(1 - gamma) / (gamma - 1) + mu omega_0^2 tr(F^T F) / 2 - 4 mu pi G rho R_F, for E = mu I: uniform
temperature, adiabatic flow. Source: pseudo-rigid bodies, section 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import exp, log, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from forceid.errors import DataError
from forceid.pseudorigid.material.formless import PerfectGas
from forceid.pseudorigid.material.material_law import Material, check_above
from forceid.pseudorigid.steady.gravity import SelfGravity
from forceid.pseudorigid.validation import matrices, real_values, tensors
from forceid.records import Array

MONATOMIC = 5 / 3


@dataclass(frozen=True)
class GasCloud:
    """Stored energy of a gas cloud: K and gamma of the gas, and what holds it together.

    K: pressure times volume at J = 1, an energy; gamma > 1; trap: omega_0 of the harmonic trap, 1/s;
    pi_G_rho: of its own gravity at J = 1, 1/s^2, as in `SelfGravity`; mu of E = mu I. Without trap and
    pi_G_rho, a free cloud. DataError where a constant is out of range, and of an energy where det F <= 0.
    Source: pseudo-rigid bodies, section 7.

    >>> print(f"{GasCloud(1.0, 1.5, trap=2.0).energy(np.eye(3)):.1f}")
    8.0
    """

    K: float
    gamma: float = MONATOMIC
    trap: float = 0.0
    pi_G_rho: float = 0.0
    mu: float = 1.0

    def __post_init__(self) -> None:
        for name, least in (("K", 0.0), ("gamma", 1.0), ("mu", 0.0)):
            check_above("GasCloud", name, getattr(self, name), least)
        for name in ("trap", "pi_G_rho"):
            check_above("GasCloud", name, getattr(self, name), itself=True)

    @cached_property
    def parts(self) -> tuple[Material, ...]:
        """The gas, and its own gravity where it has one."""
        gas = PerfectGas(self.K, self.gamma)
        return (gas, SelfGravity(self.pi_G_rho, self.mu)) if self.pi_G_rho else (gas,)

    def energy(self, F: Array) -> Array:
        """W(F) (...,) of F (..., 3, 3)."""
        F = tensors(F)
        held = 0.5 * self.mu * self.trap**2 * (F * F).sum((-2, -1))
        return np.asarray(held + sum(part.energy(F) for part in self.parts))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): of gas and gravity, and mu omega_0^2 F."""
        F = tensors(F)
        return np.asarray(self.mu * self.trap**2 * F + sum(part.gradient(F) for part in self.parts))

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3) along H (..., 3, 3)."""
        F, H = tensors(F), tensors(H, "H")
        return np.asarray(self.mu * self.trap**2 * H + sum(part.hessian(F, H) for part in self.parts))

    def resting_size(self) -> float:
        """The a of the cloud at rest, F = a I: K a^(1 - 3 gamma) = mu (omega_0^2 + (4/3) pi G rho / a^3).

        The larger one if there are two (gamma < 4/3; in gravity alone that one is unstable). DataError where
        there is none: a free cloud, gamma = 4/3 in gravity alone, gravity too strong for the gas.

        >>> print(f"{GasCloud(2.0, 5 / 3, trap=1.0).resting_size():.9f}")
        1.189207115
        """
        if not self.trap and not self.pi_G_rho:
            raise DataError("has no size at rest: it expands", "a free cloud", "give it a trap or pi_G_rho")
        pull = 4 / 3 * self.pi_G_rho * self.mu
        if not self.trap:
            if abs(self.gamma - 4 / 3) < 1e-12:
                raise DataError(
                    "is 4/3, where gravity alone gives a cloud no size at rest", "gamma", "raise it"
                )
            return float((pull / self.K) ** (1 / (4 - 3 * self.gamma)))
        hold = self.mu * self.trap**2
        if not pull:
            return float((self.K / hold) ** (1 / (3 * self.gamma - 1)))
        return size_at_rest(self, hold, pull)

    def small_motions(self) -> tuple[float, float]:
        """Squared frequencies (breathing, the five shears) about the cloud at rest, 1/s^2.

        Breathing: (3 gamma - 1) omega_0^2 + (3 gamma - 4) (4/3) pi G rho, rho of the cloud at rest. Shears:
        2 omega_0^2 + (16/15) pi G rho.

        >>> print("%.1f %.1f" % GasCloud(1.0, 1.4, trap=1.0).small_motions())
        3.2 2.0
        """
        g = self.pi_G_rho / self.resting_size() ** 3
        breathing = (3 * self.gamma - 1) * self.trap**2 + (3 * self.gamma - 4) * 4 / 3 * g
        return breathing, 2 * self.trap**2 + 16 / 15 * g


def size_at_rest(cloud: GasCloud, hold: float, pull: float) -> float:
    """Largest root a of hold a^(3 gamma - 1) + pull a^(3 gamma - 4) = K: at rest in trap and own gravity."""
    up, down = 3 * cloud.gamma - 1, 3 * cloud.gamma - 4

    def surplus(log_a: float) -> float:
        return hold * exp(up * log_a) + pull * exp(down * log_a) - cloud.K

    high = log(cloud.K / hold) / up
    low = log(-pull * down / (hold * up)) / 3 if down < 0 else high  # of a minimum, where there is one
    while down >= 0 and surplus(low) > 0 and low > high - 60:
        low -= 1.0
    if surplus(low) > 0:
        raise DataError(
            f"is {cloud.K:g}, too little against gravity: nothing is at rest", "K", "raise K or gamma"
        )
    return exp(float(brentq(surplus, low, max(high, low), xtol=1e-16, rtol=8.9e-16)))


def spread(cloud: GasCloud, F0: Array, dF0: Array, time: ArrayLike) -> Array:
    """tr(F^T F) (..., time) of a monatomic cloud, free or trapped, exactly: from F0 and dF0 (..., 3, 3).

    For gamma = 5/3 the size obeys r'' = 4 H / mu - 4 omega_0^2 r in every shape and spin: free, r0 + r1 t +
    2 H t^2 / mu; trapped, a harmonic of period pi / omega_0. DataError for another gamma, or with gravity.
    Source: pseudo-rigid bodies, section 7.

    >>> print(spread(GasCloud(2.0), np.eye(3), np.zeros((3, 3)), [0.0, 1.0]).round(9))
    [3. 9.]
    """
    if abs(cloud.gamma - MONATOMIC) > 1e-14:
        raise DataError(
            f"is {cloud.gamma:g}, and the law holds for 5/3 only", "gamma", "integrate the motion"
        )
    if cloud.pi_G_rho:
        raise DataError("is not zero, and the law holds without gravity", "pi_G_rho", "integrate the motion")
    t, F0, dF0 = real_values(time, "time"), matrices(F0, "F0"), matrices(dF0, "dF0")
    H = cloud.energy(F0) + 0.5 * cloud.mu * (dF0 * dF0).sum((-2, -1))
    r0, r1, k = (F0 * F0).sum((-2, -1)), 2 * (F0 * dF0).sum((-2, -1)), 2 * cloud.trap
    across = tuple(range(-t.ndim, 0))
    r0, r1, push = (np.expand_dims(np.asarray(x), across) for x in (r0, r1, 4 * H / cloud.mu))
    if not cloud.trap:
        return np.asarray(r0 + r1 * t + push / 2 * t**2)
    return np.asarray(push / k**2 + (r0 - push / k**2) * np.cos(k * t) + r1 / k * np.sin(k * t))


def free_fall_time(pi_G_rho: float) -> float:
    """Time in which a ball without pressure collapses from rest: (pi/2) sqrt(3 / (8 pi G rho)).

    >>> print(f"{free_fall_time(1.0):.9f}")
    0.961912373
    """
    check_above("free_fall_time", "pi_G_rho", pi_G_rho)
    return np.pi / 2 * sqrt(3 / (8 * pi_G_rho))
