"""Deformation smoothed in time, and what it does to the inertia: J and h of the current shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.kinematics import Kinematics, shape_at
from forceid.kalman.channels import driven, load_chain, start_of
from forceid.kalman.engines import Engine
from forceid.kalman.tuning import tune_loads
from forceid.principal.mass import mass_properties
from forceid.principal.wrench import momentum
from forceid.records import Array

ORDER = 3  # of the prior that drives a mode: the evidence seldom tells orders 2 to 4 apart


@dataclass(frozen=True)
class Deformation:
    """amplitude, rate (time, mode) m, m/s; inertia (time, 3, 3) and h (time, 3) of the shape, body axes."""

    amplitude: Array
    rate: Array
    inertia: Array
    h: Array


def smooth_deformation(kin: Kinematics, engine: Engine, causal: bool = False) -> Deformation:
    """Each amplitude under its own tuned prior, and the inertia that the amplitudes make.

    q'' is a Matern process: a vibration or a slow change of shape alike. Gaps are bridged.
    """
    amplitude, rate = (np.zeros_like(kin.amplitude) for _ in range(2))
    seen = np.isfinite(kin.amplitude).any(0)
    if seen.any():
        q, var = kin.amplitude[:, seen], np.nan_to_num(kin.amplitude_var[:, seen], nan=1.0)
        tuned = tune_loads(kin.time, q, 1.0, var, np.zeros(q.shape[1]), orders=(ORDER,), engine=engine)
        chain = load_chain(ORDER, tuned.std, tuned.rate, start_of(kin.time, q, 1.0))
        models = driven(chain, 1.0, var, np.zeros(q.shape[1]), np.diff(kin.time))
        for j, mode in enumerate(np.flatnonzero(seen)):
            path = engine.filter(models.one(j), q[:, j]) if causal else engine.smooth(models.one(j), q[:, j])
            amplitude[:, mode], rate[:, mode] = path.x[:, 0], path.x[:, 1]
    return Deformation(amplitude, rate, *inertia_along(kin, amplitude, rate))


def inertia_along(kin: Kinematics, amplitude: Array, rate: Array) -> tuple[Array, Array]:
    """Inertia (time, 3, 3) and angular momentum of the deformation h (time, 3) about the mass center."""
    T, nodal = len(kin.time), kin.inertia.nodal
    if nodal is None:
        return np.tile(kin.inertia.tensor, (T, 1, 1)), np.zeros((T, 3))
    shape = shape_at(kin, amplitude)
    velocity = np.einsum("tk,kna->tna", rate, kin.shapes)
    return mass_properties(nodal, shape).inertia, momentum(nodal, shape, velocity)[:, 3:]
