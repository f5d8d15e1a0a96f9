"""What a recording shows of a load: the channels that force and moment drive, and priors tuned on them.

The moment drives the angular momentum, integrated, as the force drives m c: Y'' = T, of a body by its
rotations, and of points about their mass center as they are: Y = integral of sum m u x u' dt is twice the
area that arms u sweep, whatever bends; from a frame to the next an arm goes straight to v, and sweeps u x v.
Source: principal equations 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.body.deformation import Deformation, products_of, undeformed
from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.channels import Channel, load_axes, start_of
from forceid.flight.model import Flight
from forceid.flight.modes import FlyingModes
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.priors.stated import Stated
from forceid.flight.priors.table import PRIORS
from forceid.flight.tuning import ORDERS
from forceid.kalman.building.lines import Line
from forceid.kalman.engines import Engine
from forceid.motion import momentum_between
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
    return Channel(time[new], z[new], 1 / kin.inertia.mass, cov[new], np.zeros((3, 3)), kin.of_center)


def check_turns(kin: Kinematics) -> None:
    """An EstimationError where too few frames show the rotation for a moment."""
    turns = int(np.isfinite(kin.pose.rotation).all((1, 2)).sum())
    if turns < LEAST_FRAMES:
        raise EstimationError(
            f"shows the rotation in {turns} frames, fewer than the {LEAST_FRAMES} that a moment needs",
            "the recording",
            "restore the markers, or give a longer record",
        )


def moment_channel(kin: Kinematics, deformation: Deformation) -> Channel:
    """The integrated angular momentum of the measured rotations: a channel that the moment drives."""
    check_turns(kin)
    pose = kin.pose
    new, cov = slice(None, None, kin.every), kin.counted_cov[:, 3:, 3:]
    ch = angular_channel(
        kin.time[new], pose.rotation[new], cov[new], deformation.inertia[new], deformation.h[new],
        None if kin.known is None else kin.known.turned[new],
    )  # fmt: skip
    adds_up = 1.0 if kin.memory is None else kin.memory.slow
    return replace(ch, drift=adds_up * ch.drift, color=kin.memory)


@dataclass(frozen=True)
class DrivenMotion:
    """Kinematics with a deformation taken out, and the channels that force and moment drive, by these.

    looked: the kinematics as they were before. A channel is worked out once, when it is first asked for, and
    so is the prior tuned on it.
    """

    kin: Kinematics
    deformation: Deformation
    gravity: Array
    looked: Kinematics
    tuned: dict[str, LoadPrior] = field(default_factory=dict, init=False)

    @cached_property
    def force(self) -> Channel:
        """What the force drives."""
        return force_channel(self.kin, self.gravity)

    @cached_property
    def moment(self) -> Channel:
        """What the moment drives."""
        return moment_channel(self.kin, self.deformation)

    def prior(self, load: str, engine: Engine) -> LoadPrior:
        """The prior tuned on the channel of a load, without lines, the noise as it is, and of any order."""
        if load not in self.tuned:
            self.tuned[load] = tune_channel(getattr(self, load), (1.0, 1.0), (), engine=engine)
        return self.tuned[load]


def driven_motion(kin: Kinematics, gravity: Array, engine: Engine, causal: bool = False) -> DrivenMotion:
    """Kinematics with their deformation, smoothed, taken out of the poses."""
    return DrivenMotion(*undeformed(kin, engine, causal), gravity, kin)


def tune_channel(
    channel: Channel,
    limits: tuple[float, float],
    lines: tuple[Line, ...],
    orders: tuple[int, ...] = ORDERS,
    engine: Engine | None = None,
    near: LoadPrior | None = None,
    kind: str = "matern",
    pieces: Pieces | None = None,
    stated: Stated | None = None,
) -> LoadPrior:
    """Prior of the load that drives a channel, and the factor on its noise, beside the lines it holds.

    near: of a channel hardly different, where the search begins if it holds the same lines; kind: of prior;
    stated: what is known of it, None for nothing.
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
    more = {} if stated is None else {"stated": stated}
    tuned = PRIORS[kind](*shown, limits, orders, along, engine, first, channel.color, pieces, **more)
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
        shared=kin.shared,
    )


def angular_channel(
    time: Array, rotation: Array, cov: Array, inertia: Array, h: Array, known: Array | None = None
) -> Channel:
    """Y, Y'' = T, of measured rotations (time, 3, 3), with cov (time, 3, 3) of left errors, at those seen.

    inertia (time, 3, 3) and h (time, 3) of the deforming body, body axes; known (time, 3): the part of Y
    that known moments make, which is left out. Y integrates the angular momentum H about the mass center,
    world axes, that takes a free body from frame to frame. An error theta of the rotation makes H wrong by
    J theta' - H x theta, so Y by J theta plus the integral of (-J' - [H]x) theta; across a step of some size,
    by what that step makes of theta.
    Good for tuning a prior; the flight smoother makes no use of it. Source: principal equations 2.4, 4f.
    """
    seen = np.isfinite(rotation).all((1, 2))
    t, R, C, J_body = time[seen], rotation[seen], cov[seen], inertia[seen]
    step = np.diff(t)[:, None, None]
    H, by_R, by_H = momentum_between(t, R, J_body, h[seen])
    Y = np.concatenate([np.zeros((1, 3)), np.cumsum(H * step[..., 0], axis=0)])
    Y -= 0.0 if known is None else known[seen]
    # theta_2 = by_R theta_1 + by_H dH: a frame moves Y by the step that ends in it, against the one it begins
    ends = step * np.linalg.inv(by_H)
    adds_up = ends[:-1] - ends[1:] @ by_R[1:]
    drift = (
        (adds_up @ C[1:-1] @ adds_up.swapaxes(1, 2) / step[1:]).mean(0) if len(step) > 1 else np.zeros((3, 3))
    )
    moved = np.concatenate([ends[:1], ends])
    return Channel(t, Y, 1.0, moved @ C @ moved.swapaxes(1, 2), drift)


def swept_momentum(position: Array, mass: Array, known: Array | None = None) -> tuple[Array, Array]:
    """Y (time, 3) kg m2, NaN where a mass is not seen, and the arms u (time, node, 3) m.

    position (time, node, 3) m, world axes; mass (node,) kg; known (time, 3): the part of Y that known moments
    make, which is left out.
    """
    seen = np.asarray(np.isfinite(position[:, mass > 0]).all((1, 2)))
    center = np.einsum("n,tna->ta", mass / mass.sum(), np.where(mass[:, None] > 0, position, 0.0))
    arm = np.where(mass[:, None] > 0, position - center[:, None], 0.0)
    u = arm[seen]
    swept = np.einsum("n,tna->ta", mass, np.cross(u[:-1], u[1:]))
    Y = np.full((len(position), 3), np.nan)
    Y[seen] = np.concatenate([np.zeros((1, 3)), np.cumsum(swept, axis=0)])[: len(u)]
    return Y if known is None else Y - known, arm
