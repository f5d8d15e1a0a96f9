"""What a recording shows of a load: the channels that force and moment drive, and priors tuned on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.body.deformation import Deformation, products_of
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.angular_channel import angular_channel
from forceid.flight.channels import Channel, load_axes, start_of
from forceid.flight.model import Flight
from forceid.flight.modes import FlyingModes
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.priors.table import PRIORS
from forceid.flight.tuning import ORDERS
from forceid.kalman.building.lines import Line
from forceid.kalman.engines import Engine
from forceid.records import Array

LEAST_FRAMES = 5  # frames: start, speed and a constant load take three of them, its noise another


def force_channel(kin: Kinematics, gravity: Array) -> Channel:
    """The mass center with the fall removed: a channel that the force drives."""
    center, time = kin.pose.center, kin.time
    seen = np.isfinite(center).all(1)
    if seen.sum() < LEAST_FRAMES:
        raise EstimationError(
            f"shows the mass center in {seen.sum()} frames, fewer than the {LEAST_FRAMES} that a force needs",
            "the recording",
            "restore the markers, or give the center of a longer record",
        )
    z = center - 0.5 * (time - time[0])[:, None] ** 2 * gravity
    cov = np.where(np.isfinite(kin.counted_cov[:, :3, :3]), kin.counted_cov[:, :3, :3], np.eye(3))
    new = slice(None, None, kin.every)
    return Channel(time[new], z[new], 1 / kin.inertia.mass, cov[new], np.zeros((3, 3)), kin.memory)


def moment_channel(kin: Kinematics, deformation: Deformation) -> Channel:
    """The integrated angular momentum of the measured rotations: a channel that the moment drives."""
    pose = kin.pose
    turns = int(np.isfinite(pose.rotation).all((1, 2)).sum())
    if turns < LEAST_FRAMES:
        raise EstimationError(
            f"shows the rotation in {turns} frames, fewer than the {LEAST_FRAMES} that a moment needs",
            "the recording",
            "restore the markers, or give a longer record",
        )
    new, cov = slice(None, None, kin.every), kin.counted_cov[:, 3:, 3:]
    ch = angular_channel(
        kin.time[new], pose.rotation[new], cov[new], deformation.inertia[new], deformation.h[new],
        None if kin.known is None else kin.known.turned[new],
    )  # fmt: skip
    adds_up = 1.0 if kin.memory is None else kin.memory.slow
    return Channel(ch.time, ch.Y, 1.0, ch.noise_cov, adds_up * ch.drift, kin.memory)


@dataclass(frozen=True)
class DrivenMotion:
    """Kinematics, a deformation along them, and the channels that force and moment drive as these show them.

    A channel is worked out once, when it is first asked for.
    """

    kin: Kinematics
    deformation: Deformation
    gravity: Array

    @cached_property
    def force(self) -> Channel:
        """What the force drives."""
        return force_channel(self.kin, self.gravity)

    @cached_property
    def moment(self) -> Channel:
        """What the moment drives."""
        return moment_channel(self.kin, self.deformation)


def tune_channel(
    channel: Channel,
    limits: tuple[float, float],
    lines: tuple[Line, ...],
    orders: tuple[int, ...] = ORDERS,
    engine: Engine | None = None,
    near: LoadPrior | None = None,
    kind: str = "matern",
    pieces: Pieces | None = None,
) -> LoadPrior:
    """Prior of the load that drives a channel, and the factor on its noise, beside the lines it holds.

    near: of a channel hardly different, where the search begins if it holds the same lines; kind: of prior.
    """
    time, z, gain = channel.time, channel.z, channel.gain
    seen = np.isfinite(z).all(1)
    if near is not None and list(map(id, near.lines)) != list(map(id, lines)):
        near = None
    axes = load_axes(time[seen], z[seen]) if near is None else near.axes
    drift = np.einsum("ai,ab,bi->i", axes, channel.drift, axes)
    along = tuple(line.along(axes) for line in lines)
    first = None if near is None else near.tuned
    shown = time, z @ axes, gain, channel.var(axes), drift
    tuned = PRIORS[kind](*shown, limits, orders, along, engine, first, channel.color, pieces)
    return LoadPrior(tuned, axes, start_of(time, channel.moved @ axes, gain), lines)


def flight_of(kin: Kinematics, deformation: Deformation, gravity: Array, measured: bool = False) -> Flight:
    """The poses and the inertia that the flight smoother works on.

    measured: whether sensors or strain gauges read the modes as well. Without them, modes of a body whose
    mass center is known by itself are as well smoothed by themselves.
    """
    cov = np.where(np.isfinite(kin.counted_cov), kin.counted_cov, np.eye(6))
    new = np.where(np.arange(len(kin.time)) % kin.every == 0, 1.0, np.nan)
    inertia, h, modes = deformation.inertia, deformation.h, None
    joint = measured or not kin.apart
    if joint and kin.frames is not None and deformation.prior is not None and deformation.path is not None:
        products, path, followers = products_of(kin), deformation.path, None
        if kin.hidden is not None:
            followers = kin.hidden.followers(deformation.prior)
            path = np.pad(path, ((0, 0), (0, followers.states)))
        modes = FlyingModes(kin.frames, deformation.prior, products, path, followers, inside=kin.inside)
    return Flight(
        kin.time,
        new[:, None] * kin.pose.center,
        new[:, None, None] * kin.pose.rotation,
        cov,
        kin.inertia.mass,
        inertia,
        h,
        gravity,
        modes=modes,
        known=kin.known,
        color=kin.memory,
    )
