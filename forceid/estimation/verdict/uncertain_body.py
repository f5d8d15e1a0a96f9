"""Claims that count how uncertain the body is that was stated: its mass, its mass center, its inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import BodyStdSetting
from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.body_errors import SYMMETRIC, columns, turning_of, wrong_mass
from forceid.flight.smoother import FlightState
from forceid.records import Array


def with_uncertain_body(
    state: FlightState, kin: Kinematics, deformation: Deformation, std: BodyStdSetting
) -> FlightState:
    """A state whose wrench claims what errors of the body would make of it, to first order along the motion.

    The moment is about the mass center as stated: an error of its place is a lever of the force. Each error
    is independent of all others, and the same at all times in the axes of the body. Source: principal
    equations 2.4, 2.6.
    """
    if not (std.mass or std.mass_center or std.inertia):
        return state
    motion = turning_of(kin, deformation, state, np.zeros_like(state.force))
    force, moment = columns(motion)
    errors: list[tuple[Array, Array]] = [wrong_mass(motion, std.mass)]
    errors += [(std.mass_center * force[:, :, k], std.mass_center * moment[:, :, k]) for k in range(3)]
    values, axes = np.linalg.eigh(kin.inertia.tensor)
    for value, axis in zip(values, axes.T, strict=True):
        entries = np.array([value * axis[i] * axis[j] for i, j in SYMMETRIC])
        errors.append((np.zeros_like(state.force), std.inertia * moment[:, :, 3:] @ entries))
    wrench = np.stack([np.concatenate(pair, 1) for pair in errors], 2)
    # where no rotation is known, the mass alone counts, and the weight of its force
    known = np.where(np.isfinite(wrench), wrench, 0.0)
    return replace(state, wrench_cov=state.wrench_cov + known @ known.mT)
