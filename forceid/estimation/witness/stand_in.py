"""The plain route in place of a smoother that failed: a force is given, whatever the rotation does."""

from __future__ import annotations

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.body.deformation import Deformation, inertia_along
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.witness.plain_route import channel, plain_route
from forceid.estimation.witness.witness import low_passed, spectrum_and_cuts
from forceid.flight.smoother import FlightState
from forceid.records import Body, Motion


def stand_in(body: Body, motion: Motion, kin: Kinematics, error: EstimationError) -> Solution | None:
    """The solution that the plain route makes of a motion; None where so few frames show no force either.

    Where markers bend and show no mass center plainly, that of the pose stands for it. error: why the method
    asked for has none, for the verdict. Momenta are not given.
    """
    route, T, center = plain_route(body, motion), len(motion.time), kin.pose.center
    if route.force is None:
        whole = np.asarray(np.isfinite(center).all(1))
        route = route._replace(force=channel(motion, kin.inertia.mass, center, whole))
    if route.force is None:
        return None
    loads, var = np.full((T, 6), np.nan), np.full((T, 6), np.nan)
    for first, part in ((0, route.force), (3, route.moment)):
        if part is not None:
            _, cuts = spectrum_and_cuts(part)
            loads[:, first : first + 3], std = low_passed(motion.time, part, cuts)
            var[:, first : first + 3] = std**2
    still, none = np.zeros_like(kin.amplitude), np.full((T, 3), np.nan)
    velocity, seen = none.copy(), np.isfinite(center).all(1)
    velocity[seen] = np.gradient(center[seen], motion.time[seen], axis=0)
    state = FlightState(
        center, velocity, kin.pose.rotation, none, none, loads[:, :3],
        loads[:, 3:], var[:, :, None] * np.eye(6), kin.pose.cov, np.zeros((T, 0)), np.full(T, np.nan), np.nan,
    )  # fmt: skip
    found = note("plain-route-instead", where=error.where, what=error.what, next_step=error.next_step)
    deformation = Deformation(still, still, *inertia_along(kin, still, still))
    return Solution(kin, deformation, state, "scipy", {}, {}, (found,))
