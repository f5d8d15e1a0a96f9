"""What a flying body does, as its sensors meet it: in body axes, with the slopes by the states of the flight.

With H, F, T turned into body axes, of a body that may deform,

    omega  = J^-1 (H - h)
    omega' = J^-1 (T - omega x H - J' omega - h')

Exact, and linear in T; about a reference linear in H and in the rotation error, which stands on the left:
R^T v gains R^T [v]x theta. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.motion import apply, exp
from forceid.principal import cross_matrix as skew
from forceid.records import Array

MOVERS = ("theta", "H", "T", "F")  # what a reading depends on: rotation error, momentum, moment, force
Slopes = dict[str, Array]  # by each of these, (time, 3, 3)


@dataclass(frozen=True)
class Moved:
    """A flight at the samples of its clock, for its sensors: rotation, momentum and loads in world axes.

    rotation (time, 3, 3); H, T, F (time, 3); mass kg; inertia, inertia_rate (time, 3, 3), h, h_rate (time, 3)
    of the shape, body axes; T_rate, F_rate (time, 3) of the loads.
    """

    rotation: Array
    H: Array
    T: Array
    F: Array
    mass: float
    inertia: Array
    inertia_rate: Array
    h: Array
    h_rate: Array
    T_rate: Array | float = 0.0
    F_rate: Array | float = 0.0

    @property
    def omega(self) -> Array:
        """Angular velocity (time, 3), world axes."""
        Rt = np.asarray(self.rotation.swapaxes(1, 2))
        H = apply(Rt, self.H) - self.h
        return apply(self.rotation, np.asarray(np.linalg.solve(self.inertia, H[..., None])[..., 0]))

    def later(self, s: float) -> Moved:
        """The flight a little later, by s seconds, as its own rates say."""
        if s == 0:
            return self
        H = self.H + s * self.T + 0.5 * s**2 * self.T_rate
        inertia, h = self.inertia + s * self.inertia_rate, self.h + s * self.h_rate
        now = replace(self, H=H, T=self.T + s * self.T_rate, F=self.F + s * self.F_rate, inertia=inertia, h=h)
        ahead = replace(now, rotation=exp(s * self.omega) @ self.rotation).omega
        return replace(now, rotation=exp(0.5 * s * (self.omega + ahead)) @ self.rotation)


@dataclass(frozen=True)
class InBody:
    """The same in body axes: omega rad/s and alpha = omega' rad/s2 (time, 3), the force F (time, 3) N over a
    mass kg, H and T; Rt (time, 3, 3) world to body. d_omega, d_alpha, d_F: slopes by MOVERS, in world axes.
    J_inv (time, 3, 3); lags = [omega]x; turned (time, 3, 3), by which omega moves J alpha.
    """

    mass: float
    Rt: Array
    J_inv: Array
    H: Array
    T: Array
    F: Array
    omega: Array
    alpha: Array
    turned: Array
    lags: Array
    d_omega: Slopes
    d_alpha: Slopes
    d_F: Slopes


def in_body(moved: Moved) -> InBody:
    """A flight in body axes."""
    Rt = moved.rotation.swapaxes(1, 2)
    J_inv = np.asarray(np.linalg.inv(moved.inertia))
    H, T, F = (apply(Rt, v) for v in (moved.H, moved.T, moved.F))
    omega = apply(J_inv, H - moved.h)
    by_H = J_inv @ Rt  # of omega; theta moves H by [H]x theta, and so T and F
    d_omega = {"theta": by_H @ skew(moved.H), "H": by_H, "T": 0 * by_H, "F": 0 * by_H}
    d_H = {"theta": Rt @ skew(moved.H), "H": Rt, "T": 0 * Rt, "F": 0 * Rt}
    d_T = {"theta": Rt @ skew(moved.T), "H": 0 * Rt, "T": Rt, "F": 0 * Rt}
    d_F = {"theta": Rt @ skew(moved.F), "H": 0 * Rt, "T": 0 * Rt, "F": Rt}
    alpha = apply(J_inv, T - np.cross(omega, H) - apply(moved.inertia_rate, omega) - moved.h_rate)
    turned, lags = skew(H) - moved.inertia_rate, skew(omega)
    d_alpha = {v: J_inv @ (d_T[v] + turned @ d_omega[v] - lags @ d_H[v]) for v in MOVERS}
    return InBody(moved.mass, Rt, J_inv, H, T, F, omega, alpha, turned, lags, d_omega, d_alpha, d_F)
