"""A flight as a linear model about a reference: poses in, force and moment as states, with angular momentum.

State: mass center c, momentum P, force chain; rotation error theta, angular momentum H about the mass
center, moment chain; all but theta (world) along fixed axes of the load's prior. Only the rotation is
nonlinear. It is linearized about a reference, R = exp([theta]x) R_ref (error on the left). Modes follow with
their chains; sensors add rows about the same reference, and their biases and steady numbers to the end of the
state. Source: principal equations 4b, 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.color import Color, SharedErrors, root_of
from forceid.flight.instruments.gyro import GYRO
from forceid.flight.instruments.sensors import (
    Sensors,
)
from forceid.flight.modes import FlyingModes
from forceid.kalman.model import StateSpace
from forceid.records import Array, KnownPart

CENTER, ROTATION, POSE = slice(0, 3), slice(3, 6), slice(0, 6)  # in the covariance of a pose
LOOK_AFTER = 4  # steps towards where a flight rests, until it is looked at how well they do


@dataclass(frozen=True)
class Flight:
    """What is seen of a flight, and the inertia it moves with.

    time (time,) s; center (time, 3) m and rotation (time, 3, 3) body to world, NaN where not seen; pose_cov
    (time, 6, 6), center first, world axes, rotation as a left error (rad); mass kg; inertia (time, 3, 3)
    kg m2 of the current shape and h (time, 3) kg m2/s, angular momentum of the deformation, both in
    body axes and about the mass center; gravity (3,) m/s2; sensors: those on the body;
    modes: in which it bends, None for none. With them center, rotation and pose_cov are those of the frames
    with the deformation taken out, inertia and h those along the path of the modes. known: what known loads
    bring beside those that are states; their path is no part of the center; color: of the errors of poses and
    of what frames say of the modes, None for white ones; shared: errors of the center beside those, None for
    none.
    """

    time: Array
    center: Array
    rotation: Array
    pose_cov: Array
    mass: float
    inertia: Array
    h: Array
    gravity: Array
    sensors: Sensors | None = None
    modes: FlyingModes | None = None
    known: KnownPart | None = None
    color: Color | None = None
    shared: SharedErrors | None = None

    def colored(self, model: StateSpace, errors: slice) -> StateSpace:
        """A model whose channels begin with some of (center, rotation), with the color of their errors.

        Behind the poses come channels of modes, with unit errors, and what is read otherwise.
        """
        if self.shared is not None and errors.start == 0:
            model = self.shared.colored(model, np.diff(self.time))
        if self.color is None:
            return model
        seen = np.isfinite(self.rotation).all((1, 2), keepdims=True)
        R = np.where(seen, np.nan_to_num(self.rotation), np.eye(3))
        turn, poses = np.zeros((len(R), 6, 6)), errors.stop - errors.start
        turn[:, :3, :3] = turn[:, 3:, 3:] = R
        cov = np.broadcast_to(model.R, (len(R), *model.R.shape[-2:]))[:, :poses, :poses]
        root = root_of(cov, turn[:, errors, errors])
        modes = (
            0 if self.modes is None or errors.stop < 6 or errors.start else self.modes.frames.rows.shape[1]
        )
        wide = np.zeros((len(R), model.R.shape[-1], poses + modes))
        wide[:, :poses, :poses], wide[:, poses : poses + modes, poses:] = root, np.eye(modes)
        return self.color.beside(model, wide, np.diff(self.time))

    def whole(self, H: Array) -> Array:
        """Angular momentum (time, 3), world axes, of all loads, from that of the unknown ones."""
        return H if self.known is None else H + self.known.momentum

    def part(self, s: slice) -> Flight:
        """The same over some samples, in which a kind of sensors that does not read has no bias."""
        sensors = self.sensors
        if sensors is not None:
            sensors = replace(sensors, reading=sensors.reading[s])
        return replace(
            self,
            time=self.time[s], center=self.center[s], rotation=self.rotation[s], pose_cov=self.pose_cov[s],
            inertia=self.inertia[s], h=self.h[s], sensors=sensors,
            modes=None if self.modes is None else self.modes.part(s),
            known=None if self.known is None else self.known.part(s),
        )  # fmt: skip


def unsettled(flight: Flight) -> tuple[str, str]:
    """What does not come to rest, and what to do about it."""
    step = "raise the sample rate, or state a noise_std nearer to the truth"
    if flight.sensors is None or flight.sensors.of(GYRO) is None:
        step += "; past half a turn a frame, add a gyro"
    return "the smoother on rotations", step
