"""Persons that walk, run, squat and jump: chains of rigid rods, skin that moves on them, and their truth.

Eleven segments turn about joints by closed forms of the time; the pelvis bounces and drifts, or leaves the
ground and lands. Mass lies along each rod as its radius of gyration says, so that segments have a spin of
their own, about a center that is not where the table has it. Markers stay on segments that the skin carries
off: together, by errors that are slow, grow with the acceleration, and are in part those of the neighbor, and
each by itself. Truth is of the true masses, by splines on a clock ten times as fine; the moment is about the
mass center of the mass points, as force plates give it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY
from forceid.records import Array, Body, Motion, Recording

RATE, FINER = 100.0, 10  # Hz of the markers, and how many times as fine the truth is
TABLE = {  # segment: what it hangs on and where (parts of its length), part of the mass, center, gyration
    "pelvis": ("", 0.0, 0.142, 0.45, 0.25), "trunk": ("pelvis", 0.9, 0.436, 0.55, 0.30),
    "left arm": ("trunk", 0.8, 0.028, 0.436, 0.322), "left forearm": ("left arm", 1.0, 0.022, 0.682, 0.30),
    "right arm": ("trunk", 0.8, 0.028, 0.436, 0.322), "right forearm": ("right arm", 1.0, 0.022, 0.682, 0.30),
    "left thigh": ("pelvis", 0.0, 0.10, 0.433, 0.323),
    "left shank": ("left thigh", 1.0, 0.0465, 0.433, 0.302),
    "left foot": ("left shank", 1.0, 0.0145, 0.5, 0.30),
    "right thigh": ("pelvis", 0.0, 0.10, 0.433, 0.323),
    "right shank": ("right thigh", 1.0, 0.0465, 0.433, 0.302),
    "right foot": ("right shank", 1.0, 0.0145, 0.5, 0.30),
}  # fmt: skip
SEGMENT_LENGTH = {
    "pelvis": 0.15,
    "trunk": 0.5,
    "arm": 0.3,
    "forearm": 0.27,
    "thigh": 0.42,
    "shank": 0.41,
    "foot": 0.16,
}
HANGS = {"pelvis": 0.1, "trunk": 0.18}  # m, by which limbs are to the side of what they hang on
MASS = 65.0  # kg
CENTER_OFF = 0.04  # of a segment's length, by which its mass center is off the table, each axis
UNEVEN = 0.15  # rad, by which steps come early or late
SWAY = (1.5, 0.06)  # m/s2 and s: what balance adds without a beat, in a run, and about how long it lasts
QUIET = {"walk": 0.4, "run": 1.0, "squat": 0.25, "jump": 1.0}  # how far the task moves the skin, over a run
JOINT_OFF = 0.015  # m, each axis, by which a joint is not where it is said to be
ON_SKIN = 3  # markers of a segment beside that on its far joint


@dataclass(frozen=True)
class Skin:
    """How the skin carries markers off: standard deviations of a coordinate, and their memory.

    shared m: of all markers of a segment, times one to three by segment; own m: of a marker; rate 1/s: of
    both, Matern of order 2; slow: how many times as large what is a quarter as fast is beside; neighbor:
    share of the variance that a segment has from its neighbors; burst: share of the variance that goes with
    the square of the acceleration; white m: of the cameras; cut Hz: of the filter that the tracks have been
    through, 0 for none.
    """

    shared: float = 2e-3
    own: float = 1e-3
    rate: float = 20.0
    slow: float = 1.0
    neighbor: float = 0.2
    burst: float = 0.7
    white: float = 2e-4
    cut: float = 0.0


def person(seed: int, task: str, seconds: float = 5.0, skin: Skin | None = None) -> Recording:
    """A recording of 12 segments, their markers and joints, with its true force and moment.

    task: walk, run, squat or jump.
    """
    rng = np.random.default_rng(seed)
    fine = np.arange(int(seconds * RATE) * FINER) / (RATE * FINER)
    root, angles = moved(rng, task, fine)
    figure = Figure(drawn_lengths(rng), root, {name: angles[name].as_matrix() for name in TABLE})
    x, m = rods(figure, drawn_centers(rng, figure.length))
    skin = Skin() if skin is None else skin
    return captured(rng, figure, fine, x, m, skin, QUIET[task], f"{task} {seed}")


def drawn_lengths(rng: np.random.Generator) -> dict[str, float]:
    """The length of every segment, m."""
    return {name: SEGMENT_LENGTH[name.split()[-1]] * rng.uniform(0.9, 1.1) for name in TABLE}


class Figure:
    """Rods as they stand: length m, axes (time, 3, 3) and start (time, 3) m of each, and the root."""

    def __init__(self, length: dict[str, float], root: Array, axes: dict[str, Array]) -> None:
        self.length, self.root, self.axes = length, root, axes
        self.start = {"": root}
        for name, (on, at, *_) in TABLE.items():
            self.start[name] = (
                self.start[on] + at * length[on] * axes[on][..., 2] if on else root
            ) + hanging(name, on, axes)

    def placed(self, name: str, X: Array) -> Array:
        """Points (node, 3) of a rod in the world (time, node, 3) m."""
        return np.asarray(self.start[name][:, None] + np.einsum("tab,nb->tna", self.axes[name], X))


def hanging(name: str, on: str, axes: dict[str, Array]) -> Array:
    """How far to its side a rod hangs on another (time, 3) m, or is put there."""
    side = 1.0 if name.startswith("left") else -1.0 if name.startswith("right") else 0.0
    return np.asarray(side * HANGS.get(on, 0.0) * axes[on or name][..., 1])


def drawn_centers(rng: np.random.Generator, length: dict[str, float]) -> dict[str, Array]:
    """By how much the mass center of every segment is off the table (3,) m."""
    return {name: CENTER_OFF * length[name] * rng.standard_normal(3) for name in TABLE}


def rods(figure: Figure, off: dict[str, Array]) -> tuple[Array, Array]:
    """Mass points (time, point, 3) m of a figure, two a segment in the order of TABLE, and masses kg."""
    x, mass = [], []
    for name, (*_, part, center, gyration) in TABLE.items():
        for end in (center - gyration, center + gyration):
            x.append(figure.placed(name, np.array([[0.0, 0.0, end * figure.length[name]]]) + off[name]))
            mass.append(0.5 * part * MASS)
    return np.concatenate(x, 1), np.array(mass)


def captured(
    rng: np.random.Generator,
    figure: Figure,
    fine: Array,
    x: Array,
    m: Array,
    skin: Skin,
    loud: float,
    title: str,
) -> Recording:
    """What cameras see of a figure of mass points x (time, point, 3), m (point,), with its true resultants.

    loud: how far the skin moves, over how far it may.
    """
    length, root, placed = figure.length, figure.root, figure.placed
    truth = resultants(fine, x, m)
    at = slice(None, None, FINER)
    markers, owner, shape, labels = [], [], [], []
    far: dict[str, int] = {}
    for k, name in enumerate(TABLE):
        beside = rng.uniform(-1, 1, (ON_SKIN, 3)) * [0.07, 0.07, 0.4 * length[name]] + [
            0,
            0,
            0.5 * length[name],
        ]
        X = np.concatenate([[[0.0, 0.0, length[name]]], beside])
        if name == "pelvis":
            X = np.concatenate([X, [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]])
        elif name == "trunk":
            reach = TABLE["left arm"][1] * length[name]
            X = np.concatenate([X, [[0.0, 0.18, reach], [0.0, -0.18, reach]]])
        far[name] = len(labels)
        labels += [f"{name} {i}" for i in range(len(X))]
        markers.append(placed(name, X)[at])
        owner += [k] * len(X)
    seen = np.concatenate(markers, 1)
    near = {"left thigh": far["pelvis"] + 4, "right thigh": far["pelvis"] + 5,
            "left arm": far["trunk"] + 4, "right arm": far["trunk"] + 5}  # fmt: skip
    meets = [(TABLE[name][0], name) for name in TABLE if TABLE[name][0]]
    joints = [
        (on, name) for on, name in meets if name.split()[-1] not in ("trunk", "arm")
    ]  # as a capture has
    shape = seen[0]
    weight, names, lumps = np.zeros((2 * len(TABLE), len(labels))), [], []
    where = []
    for k, (name, (on, _, part, center, gyration)) in enumerate(TABLE.items()):
        low = near.get(name, far[on] if on else -1)
        for half, end in enumerate((center - gyration, center + gyration)):
            row = weight[2 * k + half]
            if on == "pelvis" and name == "trunk":
                row[far["pelvis"]] += 1 - end
            elif low < 0:
                row[[far["pelvis"] + 4, far["pelvis"] + 5]] += 0.5 * (1 - end)
            else:
                row[low] += 1 - end
            row[far[name]] += end
            names.append(f"{name} {'near' if half == 0 else 'far'}")
            lumps.append(0.5 * part * MASS)
    for on, name in joints:
        where.append(shape[near.get(name, far[on])] + JOINT_OFF * rng.standard_normal(3))
    noisy = seen + loud * carried_errors(rng, skin, fine[at], root, np.array(owner), meets)
    if skin.cut:
        noisy = sosfiltfilt(butter(2, skin.cut / 0.802, fs=RATE, output="sos"), noisy, axis=0)
    position = np.einsum("nm,tma->tna", weight, noisy)
    nodes = list(TABLE)
    body = Body(
        tuple(names), position[0], np.array(lumps), marker=tuple(labels), marker_weight=weight,
        marker_segment=2.0 * np.array(owner), marker_shape=shape,
        joint=tuple(f"{on} to {name}" for on, name in joints),
        joint_segment=np.array([[2.0 * nodes.index(on), 2.0 * nodes.index(name)] for on, name in joints]),
        joint_shape=np.array(where),
    )  # fmt: skip
    motion = Motion(fine[at], position, noisy, gravity=GRAVITY)
    stated = np.einsum("n,tna->ta", body.mass / MASS, position)  # as forces of plates are taken to a body
    moment = truth["moment"][at] + np.cross(truth["center"][at] - stated, truth["force"][at])
    told = {"force": truth["force"][at], "moment": moment, "center": truth["center"][at]}
    return Recording(body, motion, told, title=title)


def resultants(time: Array, x: Array, m: Array) -> dict[str, Array]:
    """Force, moment about the mass center and that itself (time, 3) of point masses x (time, node, 3)."""
    c = np.einsum("n,tna->ta", m / m.sum(), x)
    v = CubicSpline(time, x)(time, 1)
    H = np.einsum("n,tna->ta", m, np.cross(x - c[:, None], v))
    force = m.sum() * (CubicSpline(time, c)(time, 2) - GRAVITY)
    return {"force": force, "moment": CubicSpline(time, H)(time, 1), "center": c}


def moved(rng: np.random.Generator, task: str, t: Array) -> tuple[Array, dict[str, Rotation]]:
    """The path of the pelvis (time, 3) m, and how every segment stands; limbs hang down, the trunk up."""
    speed, beat, bounce, size = {
        "walk": (1.3, 0.9, 0.02, 0.5), "run": (3.0, 1.4, 0.045, 1.0),
        "squat": (0.0, 0.4, 0.0, 0.8), "jump": (0.3, 0.5, 0.0, 0.8),
    }[task]  # fmt: skip
    wander = gaussian_filter1d(rng.standard_normal(len(t)), 0.4 * RATE * FINER, mode="nearest", truncate=8.0)
    phase = (
        2 * np.pi * beat * rng.uniform(0.9, 1.1) * t
        + rng.uniform(0, 2 * np.pi)
        + UNEVEN * wander / wander.std()
    )
    up = np.zeros_like(t)
    deep = np.zeros_like(t)
    if task in ("walk", "run"):
        up = bounce * (np.sin(2 * phase) + 0.3 * np.sin(4 * phase + 1.0) + 0.05 * np.sin(8 * phase))
    elif task == "squat":
        deep = 0.5 * (1 - np.cos(phase)) * rng.uniform(0.8, 1.2)
        up = -0.35 * deep
    else:  # in flight between a push and a landing, again and again
        push, land = rng.uniform(0.8, 1.2), rng.uniform(0.05, 0.08)
        acc = np.zeros_like(t)
        for off in np.arange(0.8, t[-1] - 1.0, 2.2):
            flight = rng.uniform(0.35, 0.5)
            air = 0.5 * (np.tanh((t - off) / 0.02) - np.tanh((t - off - flight) / 0.02))
            acc -= 9.81 * air
            for middle, width in ((off - 0.2, 0.09), (off + flight + 0.06, land), (off + flight + 0.3, 0.12)):
                share = 0.5 * 9.81 * flight * (1.0 if middle < off else 0.6 if width == land else 0.4)
                acc += share * np.exp(-0.5 * ((t - middle) / width) ** 2) / (width * np.sqrt(2 * np.pi))
            deep += push * 0.8 * (np.exp(-0.5 * ((t - off + 0.25) / 0.15) ** 2))
            deep += push * np.exp(-0.5 * ((t - off - flight - 0.25) / 0.15) ** 2)
        velocity = CubicSpline(t, acc).antiderivative()(t)
        up = CubicSpline(t, velocity - velocity.mean()).antiderivative()(t)
    root = np.stack([speed * t + 0.02 * np.sin(2 * phase), 0.025 * np.sin(phase), up], 1)
    sway = gaussian_filter1d(
        rng.standard_normal((len(t), 3)), SWAY[1] * RATE * FINER, axis=0, mode="nearest", truncate=8.0
    )
    root += SWAY[0] * QUIET[task] * sway / CubicSpline(t, sway)(t, 2).std(0)
    angles: dict[str, Rotation] = {}
    swing = size * rng.uniform(0.8, 1.2)
    for name in TABLE:
        kind, side = name.split()[-1], np.pi * name.startswith("right")
        lag = rng.uniform(-0.3, 0.3)
        turn = phase + side + lag
        wave = np.sin(turn) + sum(
            rng.uniform(0.3, 1) * 0.5 / k**2 * np.sin(k * turn + rng.uniform(0, 6)) for k in range(2, 8)
        )
        knee = 0.5 * (1 + np.sin(phase + side + lag + 1.5))
        bend = {
            "pelvis": 0.1 * wave, "trunk": 0.08 * wave + 0.6 * deep,
            "arm": np.pi - 0.6 * swing * wave + 0.8 * deep,
            "forearm": np.pi + 0.5 * swing * (wave + 1.2) + 0.5 * deep,
            "thigh": np.pi - 0.6 * swing * wave + 1.1 * deep,
            "shank": np.pi - 0.6 * swing * wave - 1.1 * swing * knee - 0.7 * deep,
            "foot": np.pi / 2 + 0.3 * swing * wave,
        }[kind] if task in ("walk", "run") else {
            "pelvis": 0.3 * deep, "trunk": 0.7 * deep, "arm": np.pi + 0.7 * deep * rng.uniform(0.5, 1.0),
            "forearm": np.pi + 0.9 * deep, "thigh": np.pi + 1.1 * deep,
            "shank": np.pi - 0.6 * deep, "foot": np.pi / 2 + 0 * deep,
        }[kind]  # fmt: skip
        twist = 0.08 * np.sin(phase + side + lag)
        lean = 0.05 * np.sin(phase + lag) + 0.02 * np.sin(2 * phase)
        angles[name] = Rotation.from_euler("YXZ", np.stack([bend, lean, twist], 1))
    return root, angles


def carried_errors(
    rng: np.random.Generator,
    skin: Skin,
    time: Array,
    root: Array,
    owner: Array,
    joints: list[tuple[str, str]],
) -> Array:
    """Errors (time, marker, 3) m of the markers of segments `owner` (marker,)."""
    names, n = list(TABLE), len(time)
    fine = np.linspace(time[0], time[-1], len(root))
    acc = np.linalg.norm(CubicSpline(fine, root)(time, 2), axis=1)
    acc = np.sqrt(gaussian_filter1d(acc**2, 3.0))
    loud = np.sqrt(1 - skin.burst + skin.burst * acc**2 / np.mean(acc**2))[:, None]

    def drawn(count: int) -> Array:
        """Processes (time, count, 3), slow ones beside fast ones of deviation one, by their spectrum."""
        pad = 4 * n
        w = 2 * np.pi * np.fft.rfftfreq(pad, 1 / RATE)
        total = np.zeros((n, count * 3))
        for rate, size in ((skin.rate, 1.0), (skin.rate / 4, skin.slow)):
            shape = 1 / (1 + (w / rate) ** 2)
            white = np.fft.rfft(rng.standard_normal((pad, count * 3)), axis=0)
            x = np.fft.irfft(white * shape[:, None], pad, axis=0)[:n]
            total += size * x / np.sqrt(np.fft.irfft(shape**2)[0])
        return total.reshape(n, count, 3)

    alone, between = drawn(len(names)), drawn(len(joints))
    size = skin.shared * rng.uniform(1, 3, len(names))[:, None] * rng.uniform(0.7, 1.3, (len(names), 3))
    out = np.zeros((n, len(owner), 3))
    for k, name in enumerate(names):
        own = [j for j, pair in enumerate(joints) if name in pair]
        near = between[:, own].sum(1) / np.sqrt(len(own))
        together = np.sqrt(1 - skin.neighbor) * alone[:, k] + np.sqrt(skin.neighbor) * near
        out[:, owner == k] = (loud * together * size[k])[:, None]
    out += loud[..., None] * skin.own * drawn(len(owner))
    return np.asarray(out + skin.white * rng.standard_normal(out.shape))
