"""Flights with a known wrench, written down: steady force, spin about a principal axis, a breathing shape."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.flight.channels import Start
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.records import Body, Motion, Recording

GRAVITY = np.array([0.0, 0.0, -9.81])
FORCE = np.array([0.6, -0.4, 0.8])  # N
MASS, REACH = 0.2, np.array([0.10, 0.16, 0.05])  # kg, m: from the center to the nodes
NAMES = ("front", "left", "top", "rear", "right", "bottom")
START = Rotation.from_rotvec([0.5, -0.3, 0.8])  # of the body at time zero
SPIN = (6.0, 4.0)  # rad/s, rad/s2, about the third principal axis
NOISE = 3e-4  # m
AXIS = START.as_matrix()[:, 2]  # of the spin, world axes
INERTIA = MASS / 3 * np.diag(np.sum(REACH**2) - REACH**2)  # of `star`


def star(**known):
    """Six nodes in pairs along the principal axes, each pair a third of the mass, unless told otherwise."""
    position = np.concatenate([np.diag(REACH), -np.diag(REACH)])
    return Body(node=NAMES, position=position, **(known or {"mass": np.full(6, MASS / 6)}))


def load_prior(order, std=1.0, rate=1.0):
    """A Matern load, alike along world axes."""
    return LoadPrior(Tuned(Matern(order, np.full(3, std), np.full(3, rate))), np.eye(3), Start(1.0, 1.0, 1.0))


def points(*nodes):
    """A body of (x, y, z, mass) nodes."""
    table = np.array(nodes, float)
    return Body(node=tuple(f"n{k}" for k in range(len(table))), position=table[:, :3], mass=table[:, 3])


def whole(*places):
    """A body known as a whole, its mass spread in space, with markers at (x, y, z)."""
    names = tuple(f"n{k}" for k in range(len(places)))
    return Body(names, np.array(places, float), total_mass=MASS, mass_center=np.zeros(3), inertia=INERTIA)


def clock(frames=120, rate=200.0):
    return np.arange(frames) / rate


def size_at(time, breath):
    """Size of a body that breathes at 30 rad/s."""
    return 1 + breath * np.sin(30 * time)


def spring(*ends):
    """Stiffness of `star` with one spring of 1 N/m between two of its nodes."""
    a, b = (NAMES.index(end) for end in ends)
    position = star().position
    pull = np.zeros((6, 3))
    pull[b] = (position[b] - position[a]) / np.linalg.norm(position[b] - position[a])
    pull[a] = -pull[b]
    return np.outer(pull, pull)


def toss(time=None, body=None, seed=0, noise=NOISE, spin=SPIN, stated=True, breath=0.0):
    """Markers of a body under FORCE and weight, spun up about its third axis, and its true wrench.

    breath: the part by which the body grows and shrinks, see `size_at`, and then the moment is the rate of
    J s^2 omega; nodes of `body` are about its mass center, and the moment is that of `star`.
    """
    time = clock() if time is None else time
    body = star() if body is None else body
    angle = spin[0] * time + spin[1] * time**2 / 2
    R = (START * Rotation.from_rotvec(np.outer(angle, [0, 0, 1]))).as_matrix()
    omega = spin[0] + spin[1] * time
    s, ds = size_at(time, breath), 30 * breath * np.cos(30 * time)
    t = time[:, None]
    center = np.array([1.0, -2.0, 1.5]) + t * [2.0, 0.5, 3.0] + 0.5 * t**2 * (FORCE / MASS + GRAVITY)
    x = center[:, None] + s[:, None, None] * np.einsum("tab,nb->tna", R, body.position)
    truth = {
        "force": np.tile(FORCE, (len(time), 1)),
        "moment": INERTIA[2, 2] * np.outer(s**2 * spin[1] + 2 * s * ds * omega, AXIS),
        "center": center,
        "orientation": Rotation.from_matrix(R).as_quat(canonical=True),
    }
    x = x + noise * np.random.default_rng(seed).standard_normal(x.shape)
    return Recording(
        body, Motion(time, x, gravity=GRAVITY, noise_std={"position": noise} if stated else {}), truth
    )


def waved(recording, tip="left", size=0.01, rate=30.0):
    """The same with one node that waves along the first body axis."""
    t = recording.motion.time
    R = Rotation.from_quat(recording.truth["orientation"]).as_matrix()
    x = recording.motion.position.copy()
    x[:, recording.body.node.index(tip)] += size * np.sin(rate * t)[:, None] * R[..., 0]
    return seen_as(recording, x)


def seen_as(recording, position):
    """The recording with other marker positions."""
    return replace(recording, motion=replace(recording.motion, position=position))


def mean_motion(seed=0, center_std=1e-4, turn_std=1e-3, stated=False):
    """The same flight as center and orientation of a body known as a whole."""
    flown, rng = toss(), np.random.default_rng(seed)
    n = len(flown.motion.time)
    turn = Rotation.from_rotvec(turn_std * rng.standard_normal((n, 3)))
    turned = (turn * Rotation.from_quat(flown.truth["orientation"])).as_quat(canonical=True)
    center = flown.truth["center"] + center_std * rng.standard_normal((n, 3))
    body = Body(total_mass=MASS, mass_center=np.array([0.1, 0.2, 0.3]), inertia=INERTIA)
    noise = {"center": center_std, "orientation": turn_std} if stated else {}
    motion = Motion(flown.motion.time, center=center, orientation=turned, gravity=GRAVITY, noise_std=noise)
    return replace(flown, body=body, motion=motion)


def rms(error):
    return float(np.sqrt(np.nanmean(np.square(error))))
