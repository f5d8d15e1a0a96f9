"""Hinged: a chain of rigid blocks in free flight, held together by joints whose loads are known.

The blocks lie in a row, and touch where the joints are. In each joint act a spring and a damper, and, if
asked for, a motor about its axis; on one block, if asked for, a push. What the joints pass follows from the
equations of motion in `jointed_blocks`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat, model_validator
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.drawn_loads import draw_periodic, waves
from forceid.scenes.jointed_blocks import Chain, ChainState, cross_matrices, solve_joints
from forceid.scenes.mechanics import KnownFlight, deforming_truth, inertia_tensor, solve_ode
from forceid.sections import Section

Size = tuple[PositiveFloat, PositiveFloat, PositiveFloat]
BLOCK_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CHAIN_TOLERANCE = 1e-13


class Parameters(Section):
    """mass kg and size m along x, y, z: of each block, its mass in equal shares on the eight corners, where
    the markers are; in the reference shape the blocks touch in a row along x. One for each joint: joint,
    its axis (of the hinge, and of the swing), stiffness N m/rad, damping N m s/rad, swing rad/s by which
    the next block turns faster at t = 0. push N: standard deviation of each component of a force at the
    center of block push_block; drive N m: that of the moment of a motor about the axis of every joint; both
    drawn from drawn_seed with the spectrum of a Matern process of order 2, flat below drawn_frequency Hz.
    gravity m/s2; at t = 0: center m and velocity m/s of all, turn rad (rotation vector), spin rad/s in the
    axes of the first block.
    """

    mass: tuple[PositiveFloat, ...] = (0.4, 0.25)
    size: tuple[Size, ...] = ((0.24, 0.12, 0.08), (0.18, 0.1, 0.06))
    joint: tuple[Literal["hinge", "ball"], ...] = ("hinge",)
    axis: tuple[Vector, ...] = ((0.0, 0.0, 1.0),)
    stiffness: tuple[float, ...] = (0.6,)
    damping: tuple[float, ...] = (0.004,)
    swing: tuple[float, ...] = (6.0,)
    push: float = Field(default=0.0, ge=0.0)
    push_block: int = Field(default=0, ge=0)
    drive: float = Field(default=0.0, ge=0.0)
    drawn_frequency: float = Field(default=3.0, gt=0.0)
    drawn_seed: int = Field(default=0, ge=0)
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.5)
    velocity: Vector = (2.0, 0.5, 4.0)
    turn: Vector = (0.3, -0.4, 0.2)
    spin: Vector = (4.0, 3.0, 7.0)

    @model_validator(mode="after")
    def fits(self) -> Parameters:
        """One mass and size a block, one of everything else a joint."""
        blocks = len(self.mass)
        if blocks < 2 or len(self.size) != blocks or self.push_block >= blocks:
            raise ValueError(f"{blocks} masses, {len(self.size)} sizes and a push on block {self.push_block}")
        for name in ("joint", "axis", "stiffness", "damping", "swing"):
            if len(getattr(self, name)) != blocks - 1:
                raise ValueError(
                    f"{blocks} blocks have {blocks - 1} joints, found {len(getattr(self, name))} {name}"
                )
        if not all(any(axis) for axis in self.axis):
            raise ValueError("an axis has no direction")
        return self


def chain_constants(parameters: Parameters) -> Chain:
    """The constants that the parameters describe."""
    p = parameters
    mass, size = np.array(p.mass), np.array(p.size)
    inertia = np.stack(
        [inertia_tensor(np.full(8, m / 8), BLOCK_CORNERS * s) for m, s in zip(mass, size, strict=True)]
    )
    arms = np.zeros((len(mass) - 1, 2, 3))
    arms[:, 0, 0], arms[:, 1, 0] = 0.5 * size[:-1, 0], -0.5 * size[1:, 0]
    axis = np.array(p.axis) / np.linalg.norm(p.axis, axis=1, keepdims=True)
    across = np.stack([np.linalg.svd(e[None])[2][1:] for e in axis])
    return Chain(
        mass, inertia, p.joint, arms, axis, across,
        np.array(p.stiffness), np.array(p.damping), np.array(p.gravity), p.push_block,
    )  # fmt: skip


def drawn(parameters: Parameters) -> Callable[[float], tuple[Array, Array]]:
    """The drawn loads as a function of time: force (3,) N on block push_block, motor moments (joint,) N m."""
    p = parameters
    std, rate = [p.push] * 3 + [p.drive] * len(p.joint), 2 * np.pi * p.drawn_frequency
    loads = draw_periodic(std, rate, np.random.default_rng(p.drawn_seed))

    def split(t: float) -> tuple[Array, Array]:
        now = waves(np.array([t]), *loads)[0]
        return now[:3], now[3:]

    return split


def straight_chain(p: Parameters, chain: Chain) -> ChainState:
    """The straight chain at t = 0, moving as its joints allow."""
    turn = Rotation.from_rotvec(p.turn).as_matrix()
    n = len(chain.mass)
    R, arms = np.tile(turn, (n, 1, 1)), chain.arms @ turn.T
    swing = np.array(p.swing)[:, None] * chain.axis @ turn.T
    omega = turn @ np.array(p.spin) + np.concatenate([np.zeros((1, 3)), np.cumsum(swing, axis=0)])
    place, drift = np.zeros((n, 3)), np.zeros((n, 3))
    for j in range(n - 1):
        place[j + 1] = place[j] + arms[j, 0] - arms[j, 1]
        drift[j + 1] = drift[j] + np.cross(omega[j], arms[j, 0]) - np.cross(omega[j + 1], arms[j, 1])
    share = chain.mass / chain.mass.sum()
    return ChainState(place - share @ place + p.center, drift - share @ drift + p.velocity, R, omega)


def chain_states(parameters: Parameters, time: Array) -> list[ChainState]:
    """The chain at each of `time` (time,) s."""
    p, chain, loads = parameters, chain_constants(parameters), drawn(parameters)
    n = len(chain.mass)

    def unpack(y: Array) -> ChainState:
        c, v, R, w = np.split(y, [3 * n, 6 * n, 15 * n])
        return ChainState(c.reshape(n, 3), v.reshape(n, 3), R.reshape(n, 3, 3), w.reshape(n, 3))

    def rate(t: float, y: Array) -> Array:
        now = unpack(y)
        a, _, _ = solve_joints(chain, now, loads(t))
        turning = cross_matrices(now.omega) @ now.R
        return np.concatenate([now.velocity.ravel(), a[:, :3].ravel(), turning.ravel(), a[:, 3:].ravel()])

    start = straight_chain(p, chain)
    y0 = np.concatenate([start.center.ravel(), start.velocity.ravel(), start.R.ravel(), start.omega.ravel()])
    return [unpack(y) for y in solve_ode(rate, y0, time, CHAIN_TOLERANCE)]


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The flying chain at `time` (time,) s; node a1 is the first corner of the first block."""
    p, chain, loads = parameters, chain_constants(parameters), [drawn(parameters)(t) for t in time]
    states = chain_states(p, time)
    size = np.array(p.size)
    ends = np.cumsum(size[:, 0])
    middle = np.zeros((len(size), 3))
    middle[:, 0] = ends - 0.5 * size[:, 0]
    own = BLOCK_CORNERS * size[:, None]
    rest, mass = (own + middle[:, None]).reshape(-1, 3), np.repeat(chain.mass / 8, 8)
    c, v, R, w = (np.array([getattr(s, k) for s in states]) for k in ("center", "velocity", "R", "omega"))
    arm = np.einsum("tiab,inb->tina", R, own)
    x = (c[:, :, None] + arm).reshape(len(time), -1, 3)
    v_nodes = (v[:, :, None] + np.cross(w[:, :, None], arm)).reshape(len(time), -1, 3)
    pushes = np.array([push for push, _ in loads])
    load = np.zeros((len(time), len(size), 8, 3))
    load[:, p.push_block] = pushes[:, None] / 8
    joints = [solve_joints(chain, s, f)[1:] for s, f in zip(states, loads, strict=True)]
    truth = deforming_truth(mass, rest, x, v_nodes, load.reshape(x.shape)) | {
        "joint_force": np.array([force for force, _ in joints]),
        "joint_moment": np.array([moment for _, moment in joints]),
        "joint_point": c[:, :-1] + np.einsum("tjab,jb->tja", R[:, :-1], chain.arms[:, 0]),
    }
    names = tuple(f"{chr(97 + i)}{k}" for i in range(len(size)) for k in range(1, 9))
    return KnownFlight(Body(node=names, position=rest, mass=mass), x, np.array(p.gravity), truth)
