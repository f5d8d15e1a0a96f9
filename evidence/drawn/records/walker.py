"""Persons who walk on two feet or squat on them, with what the ground gives each foot and every joint passes.

Feet step from place to place, the legs follow by their two lengths, and the pelvis moves so that the pressure
of the ground is where it is drawn to be: under the foot that stands, from heel to toe, or on its way from one
to the other. For that its path is corrected, again and again, by what an inverted pendulum makes of the rest
(Kajita et al., IEEE ICRA (2003) 1620). Truth is of mass points on a fine clock, by Newton's law of all
that hangs behind a joint: nothing of the estimator is used.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded
from scipy.spatial.transform import Rotation

from evidence.drawn.records.person import (
    FINER,
    RATE,
    TABLE,
    Figure,
    Skin,
    captured,
    drawn_centers,
    drawn_lengths,
    resultants,
    rods,
)
from evidence.vectors import GRAVITY
from forceid.records import Array, Recording

ANKLE = 0.07  # m above the ground, of a foot that stands
PRESSES = 0.05  # m, standard deviation of where a foot presses along it beside its middle; a third across
APART = 0.04  # of the weight, by which feet push apart where both stand, standard deviation
TURNS = 7  # corrections of the path of the pelvis
SETTLED = 0.2  # s, in which a path leaves its ends alone
LOUD = 0.4  # how far the skin moves, over a run
FEET = ("left foot", "right foot")


def walker(seed: int, task: str, seconds: float = 5.0, skin: Skin | None = None) -> Recording:
    """A recording as of `person`, with truth beside: foot_wrench (time, foot, 6) about the mass center, and
    joint_force and joint_moment (time, joint, 3) about joint_point, on the second segment. task: walk, squat.
    """
    rng = np.random.default_rng(seed)
    fine = np.arange(int(seconds * RATE) * FINER) / (RATE * FINER)
    length = drawn_lengths(rng)
    off = drawn_centers(rng, length)
    leg = min(length[f"{s} thigh"] + length[f"{s} shank"] for s in ("left", "right"))
    ankle, press, share = steps(rng, fine, leg) if task == "walk" else squats(rng, fine)
    low = 0.03 * (1 - np.cos(2 * np.pi * fine * rng.uniform(1.6, 1.9)))
    if task == "squat":
        low = rng.uniform(0.10, 0.16) * (1 - np.cos(2 * np.pi * fine * rng.uniform(0.3, 0.5)))
    wanted = np.einsum("kt,kta->ta", share, press)
    root = np.concatenate([wanted, (ANKLE + 0.85 * leg - low)[:, None]], 1)
    root[:, :2] = smooth(root[:, :2])
    angles = leaning(rng, task, fine, low)
    for _ in range(TURNS):
        figure = standing(length, root, angles, ankle)
        x, m = rods(figure, off)
        found = resultants(fine, x, m)
        root = root - np.pad(pendulum(fine, pressed(found) - wanted, found["center"][:, 2]), ((0, 0), (0, 1)))
    figure = standing(length, root, angles, ankle)
    x, m = rods(figure, off)
    skin = Skin() if skin is None else skin
    recording = captured(rng, figure, fine, x, m, skin, LOUD, f"{task} on two feet {seed}")
    return with_feet_and_joints(rng, recording, figure, fine, x, m, press, share)


def steps(rng: np.random.Generator, t: Array, leg: float) -> tuple[Array, Array, Array]:
    """Ankles (2, time, 3) m, places of pressure (2, time, 2) m and shares (2, time) of feet that walk.

    leg (m): the length of one, to which a step is in proportion.
    """
    period = rng.uniform(0.5, 0.65)
    double, stride = rng.uniform(0.15, 0.25) * period, leg * rng.uniform(0.6, 0.78)
    half = rng.uniform(0.08, 0.11)
    ankle, press, share = np.zeros((2, len(t), 3)), np.zeros((2, len(t), 2)), np.zeros((2, len(t)))
    first = -rng.uniform(0, 2) * period
    for k, side in enumerate((1.0, -1.0)):
        ankle[k, :, 1], ankle[k, :, 2] = side * half, ANKLE
        across = rng.uniform(-1, 1) * PRESSES / 3
        for i in range(-4, int(t[-1] / period) + 6):
            if i % 2 != k:
                continue
            strike, lift, place = first + i * period, first + (i + 1) * period + double, 0.5 * stride * i
            u = np.clip((t - lift) / (period - double), 0, 1)
            stands = (t >= strike) & (t < strike + 2 * period)
            ankle[k, stands, 0] = (place + stride * quintic(u))[stands]
            ankle[k, stands, 2] = (ANKLE + 0.06 * 64 * u**3 * (1 - u) ** 3)[stands]
            on = (t >= strike) & (t < lift)
            rolls = -PRESSES + 2 * PRESSES * quintic(np.clip((t - strike) / (lift - strike), 0, 1))
            press[k, on, 0] = (place + 0.08 + rolls)[on]
            press[k, on, 1] = side * half + across
            up, down = (
                quintic(np.clip((t - strike) / double, 0, 1)),
                quintic(np.clip((lift - t) / double, 0, 1)),
            )
            share[k, on] = np.minimum(up, down)[on]
    return ankle, press, share


def squats(rng: np.random.Generator, t: Array) -> tuple[Array, Array, Array]:
    """The same of feet that stand, on which the weight goes to and fro."""
    ankle, press = np.zeros((2, len(t), 3)), np.zeros((2, len(t), 2))
    half = rng.uniform(0.1, 0.16)
    for k, side in enumerate((1.0, -1.0)):
        ankle[k] = [0.03 * rng.uniform(-1, 1), side * half, ANKLE]
        press[k] = ankle[k, :, :2] + [0.08, 0.0] + PRESSES * rng.uniform(-1, 1, 2) * [1.7, 0.6]
    sway = 0.12 * np.sin(2 * np.pi * rng.uniform(0.15, 0.4) * t + rng.uniform(0, 6))
    second = np.clip(rng.uniform(0.4, 0.6) + sway, 0.05, 0.95)
    return ankle, press, np.stack([1 - second, second])


def quintic(u: Array) -> Array:
    """From zero to one without a jump of the acceleration."""
    return np.asarray(u**3 * (10 - 15 * u + 6 * u**2))


def smooth(x: Array) -> Array:
    """A path (time, axis) whose corners are rounded over a third of a second, about its trend."""
    wide = int(0.3 * RATE * FINER)
    ends = np.concatenate([2 * x[0] - x[wide:0:-1], x, 2 * x[-1] - x[-2 : -wide - 2 : -1]])
    window = np.hanning(2 * wide + 1)
    window /= window.sum()
    return np.stack([np.convolve(column, window, mode="valid") for column in ends.T], 1)


def leaning(rng: np.random.Generator, task: str, t: Array, low: Array) -> dict[str, Array]:
    """How pelvis, trunk and arms stand (time, 3, 3), by name."""
    beat, found = 2 * np.pi * rng.uniform(0.8, 0.95) * t + rng.uniform(0, 6), {}
    swing = 0.35 if task == "walk" else 0.0
    for name in TABLE:
        side = np.pi * name.startswith("right")
        wave = np.sin(beat + side + rng.uniform(-0.2, 0.2)) + 0.2 * np.sin(2 * beat + rng.uniform(0, 6))
        deep = low / 0.25 if task == "squat" else 0.0 * low
        bend = {
            "pelvis": 0.03 * wave + 0.3 * deep, "trunk": 0.03 * wave + 0.6 * deep + 0.05,
            "arm": np.pi - swing * wave + deep, "forearm": np.pi - 0.3 + 0.5 * swing * wave + deep,
        }.get(name.split()[-1])  # fmt: skip
        if bend is not None:
            turn = np.stack([bend, 0.03 * np.sin(beat), 0.06 * np.sin(beat + side)], 1)
            found[name] = Rotation.from_euler("YXZ", turn).as_matrix()
    return found


def standing(length: dict[str, float], root: Array, angles: dict[str, Array], ankle: Array) -> Figure:
    """A figure whose legs reach from the pelvis at `root` to the ankles (2, time, 3) m, knees forward."""
    axes = dict(angles)
    for k, side in enumerate(("left", "right")):
        hip = root + (0.1 if k == 0 else -0.1) * axes["pelvis"][..., 1]
        one, two = length[f"{side} thigh"], length[f"{side} shank"]
        reach = ankle[k] - hip
        far = np.linalg.norm(reach, axis=1)
        if (far >= one + two).any():
            raise ValueError(f"legs of {one + two:.2f} m do not reach {far.max():.2f} m")
        u = reach / far[:, None]
        ahead = np.array([1.0, 0, 0]) - u[:, :1] * u
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        cosine = (one**2 + far**2 - two**2) / (2 * one * far)
        thigh = u * cosine[:, None] + ahead * np.sqrt(1 - cosine**2)[:, None]
        axes[f"{side} thigh"], axes[f"{side} shank"] = along(thigh), along((reach - one * thigh) / two)
        axes[f"{side} foot"] = along(np.tile([1.0, 0, 0], (len(root), 1)))
    return Figure(length, root, {name: axes[name] for name in TABLE})


def along(z: Array) -> Array:
    """Axes (time, 3, 3) whose third is z (time, 3), and whose second is to the left."""
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(z, x), z], 2)


def pressed(found: dict[str, Array]) -> Array:
    """Where the ground presses (time, 2) m, by force and moment about the mass center."""
    F, T, c = found["force"], found["moment"], found["center"]
    return np.asarray(c[:, :2] + (np.stack([-T[:, 1], T[:, 0]], 1) - c[:, 2:] * F[:, :2]) / F[:, 2:])


def pendulum(t: Array, off: Array, height: Array) -> Array:
    """The path d (time, 2) m that moves the pressure by `off`, d - h / g d'' = off, straight at its ends."""
    w = height / 9.81 / (t[1] - t[0]) ** 2
    w[[0, -1]] = 0.0
    ends = np.clip(np.minimum(t - t[0], t[-1] - t) / SETTLED, 0, 1)
    bands = np.stack([np.append(0, -w[:-1]), 1 + 2 * w, np.append(-w[1:], 0)])
    return np.asarray(solve_banded((1, 1), bands, quintic(ends)[:, None] * off))


def hung_on(first: str) -> list[str]:
    """A segment and all that hangs on it."""
    behind = [first]
    for name, (on, *_) in TABLE.items():
        behind += [name] if on in behind else []
    return behind


def with_feet_and_joints(
    rng: np.random.Generator,
    recording: Recording,
    figure: Figure,
    t: Array,
    x: Array,
    m: Array,
    press: Array,
    share: Array,
) -> Recording:
    """The recording with the truth of what feet and joints pass."""
    found = resultants(t, x, m)
    F, c = found["force"], found["center"]
    total = share.sum(0)
    push = np.einsum("kt,ta->kta", share / total, F)
    apart = (
        4 * (share[0] * share[1] / total**2 * F[:, 2])[:, None] * APART * rng.standard_normal(3) * [1, 1, 0]
    )
    push = push + np.stack([apart, -apart])
    at = np.concatenate([press, np.zeros((2, len(t), 1))], 2)
    levered = np.cross(at - c, push)
    rest = found["moment"] - levered.sum(0)  # about the vertical, and what the path does not follow
    foot = np.concatenate([push, levered + (share / total)[..., None] * rest], 2)
    pull = m[:, None] * (CubicSpline(t, x)(t, 2) - GRAVITY)
    force, moment, point = [], [], []
    for pair in recording.body.joint:
        first = pair.split(" to ")[1]
        behind = hung_on(first)
        own = [2 * list(TABLE).index(name) + half for name in behind for half in (0, 1)]
        P = figure.start[first]
        F = pull[:, own].sum(1)
        M = np.cross(x[:, own] - P[:, None], pull[:, own]).sum(1)
        for k, name in enumerate(FEET):
            if name in behind:
                F = F - foot[k, :, :3]
                M = M - foot[k, :, 3:] - np.cross(c - P, foot[k, :, :3])
        force.append(F)
        moment.append(M)
        point.append(P)
    at_frames = slice(None, None, FINER)
    truth = {
        "foot_wrench": np.moveaxis(foot, 0, 1), "joint_force": np.stack(force, 1),
        "joint_moment": np.stack(moment, 1), "joint_point": np.stack(point, 1),
    }  # fmt: skip
    told = recording.truth | {name: value[at_frames] for name, value in truth.items()}
    return Recording(recording.body, recording.motion, told, title=recording.title)
