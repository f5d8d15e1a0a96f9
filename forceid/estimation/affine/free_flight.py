"""Free flights of elastic affine bodies, F'' E = -P, and how they change with start and constants.

P is the stress of an isotropic law, linear in its two Lame constants, with Kelvin-Voigt damping. Source:
pseudo-rigid bodies, sections 1 and 3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853, OdeSolver

from forceid.errors import DataError
from forceid.pseudorigid import Material, NeoHookean, StVenantKirchhoff, viscous
from forceid.records import Array

CONSTANTS = ("lam", "mu", "damping")
UNKNOWN = 18 + len(CONSTANTS)  # F and F' at the start, row by row, and the constants
STEP_ACCURACY = 1e-8  # of a step in F: over a record a fiftieth of what 0.3 mm of noise leaves of a constant
SLOPE_ACCURACY = 1e-4  # of a step in its slopes by the unknown: Newton's steps need no more
FIRST_STEP = 0.01  # rad of the fastest vibration: a first step
LAWS: dict[str, Callable[[float, float], Material]] = {  # by the constants of Lame, J
    "st_venant_kirchhoff": StVenantKirchhoff,
    "neo_hookean": lambda lam, mu: NeoHookean.natural(mu / 2, lam / 4),
}


@dataclass(frozen=True)
class FreeBody:
    """Second moment E (3, 3) kg m2 and the name of the law."""

    E: Array
    law: str

    def fly(self, p: Array, time: Array) -> tuple[Array, Array]:
        """F (time, 9) and its change (time, 9, UNKNOWN) by p: F, F' at time[0], and the constants.

        p (UNKNOWN,); time (time,) s. NaN from a collapse on, and for constants out of range, or so
        large that the samples show no swing.
        """
        F, by_p = np.full((len(time), 9), np.nan), np.full((len(time), 9, UNKNOWN), np.nan)
        lam, mu, eta = np.abs(p[18:]) * 3 / np.trace(self.E)
        if not max(np.sqrt(lam + 2 * mu), eta) * np.median(np.diff(time)) < np.pi:
            return F, by_p  # it swings or settles between two samples, which then tell nothing of that
        try:
            solver, at = self.solver(p, time), 1
        except DataError:  # constants out of range
            return F, by_p
        F[:1], by_p[:1] = split(solver.y[:, None])
        while at < len(time):
            with np.errstate(all="ignore"):
                solver.step()
            if solver.status == "failed":  # det F = 0: the law ends there
                break
            last = int(np.searchsorted(time, solver.t, "right"))
            if last > at:
                F[at:last], by_p[at:last] = split(solver.dense_output()(time[at:last]))
            at = last
        return F, by_p

    def solver(self, p: Array, time: Array) -> OdeSolver:
        """The equations of motion and their changes, ready to step."""
        lam, mu, eta = p[18:]
        law, one, other = (LAWS[self.law](*c) for c in ((lam, mu), (1.0, 1.0), (2.0, 1.0)))
        inverse = np.linalg.inv(self.E)

        def rate(_: float, y: Array) -> Array:
            F, V, dF, dV = parts(y)
            if not np.linalg.det(F) > 0:
                return np.full_like(y, np.nan)  # a step that goes too far is rejected
            unit, more = one.gradient(F), other.gradient(F)
            by_lam, by_mu, by_eta = more - unit, 2 * unit - more, viscous(F, V)
            push = law.hessian(F, dF)
            push = push + eta * (viscous(dF, V, F) + viscous(F, V, dF) + viscous(F, dV))
            push[18:] += np.stack([by_lam, by_mu, by_eta])
            total = np.concatenate([(lam * by_lam + mu * by_mu + eta * by_eta)[None], push])
            return np.concatenate([V.ravel(), dV.ravel(), -(total @ inverse).ravel()])

        start = np.zeros((2, 1 + UNKNOWN, 9))
        start[:, 0] = p[:18].reshape(2, 9)
        start[0, 1:10], start[1, 10:19] = np.eye(9), np.eye(9)
        w = np.sqrt((lam + 2 * mu) * 3 / np.trace(self.E))
        size = np.repeat([1.0, 1.0, 1 / w, 1 / mu, 1 / mu, w / mu], [1, 9, 9, 1, 1, 1]) * [[1.0], [w]]
        wanted = size * np.where(np.arange(1 + UNKNOWN) == 0, STEP_ACCURACY, SLOPE_ACCURACY)
        options: dict[str, Any] = {
            "rtol": STEP_ACCURACY,
            "atol": np.repeat(wanted, 9),
            "first_step": FIRST_STEP / w,
        }
        return DOP853(rate, float(time[0]), start.ravel(), float(time[-1]), **options)


def parts(y: Array) -> tuple[Array, Array, Array, Array]:
    """F, F' (3, 3) and their changes (UNKNOWN, 3, 3)."""
    (F, *dF), (V, *dV) = y.reshape(2, 1 + UNKNOWN, 3, 3)
    return F, V, np.array(dF), np.array(dV)


def split(y: Array) -> tuple[Array, Array]:
    """F (time, 9) and its changes (time, 9, UNKNOWN) out of states (state, time)."""
    both = y.reshape(2, 1 + UNKNOWN, 9, -1)[0]
    return both[0].T, both[1:].transpose(2, 1, 0)
