"""The plain route in place of a smoother that failed: a force is given, whatever the rotation does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from forceid.errors import EstimationError
from forceid.estimation.body.deformation import Deformation, inertia_along
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.plain_cut import Cut
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.witness.plain_route import PlainChannel, channel, plain_route
from forceid.estimation.witness.witness import low_passed, spectrum_and_cuts
from forceid.flight.smoother import FlightState
from forceid.records import Array, Body, Motion
from forceid.significance import SIGMAS

TOLD_BY = 16  # numbers that an octave above a cut is judged by: its mean square is known to a third


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
            var[:, first : first + 3] = std**2 + missed(motion.time, part, cuts)
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


def missed(time: Array, channel: PlainChannel, cuts: list[Cut]) -> Array:
    """Mean square (time, 3) of what an octave above its cuts holds of a load, where that is more than noise.

    A cut is that of a whole record, and steps on the way go beyond it for a while.
    """
    found = np.zeros((len(time), 3))
    above = [replace(cut, frequency=2 * cut.frequency) for cut in cuts]
    (below, _), (wide, noise) = (low_passed(time, channel, each) for each in (cuts, above))
    step = float(np.median(np.diff(channel.time)))
    for axis, cut in enumerate(cuts):
        beside, expected = ((a[channel.frame, axis]) ** 2 for a in (wide - below, noise))
        samples = max(int(TOLD_BY / (2 * cut.frequency * step)), 1)
        own = uniform_filter1d(beside, samples), uniform_filter1d(expected, samples)
        chance = 1 + SIGMAS * np.sqrt(2 / TOLD_BY)
        found[channel.frame, axis] = np.where(own[0] > chance * own[1], own[0], 0.0)
    return found
