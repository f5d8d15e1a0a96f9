"""The force of the ground on each foot of a person: all of it on one that stands alone, by a rule on two.

A foot touches where it is near to its lowest level and slow; where none does and the ground pushes, those
near to it carry, or the lower one. How fast it is shows over a while, so that a foot may touch that long
before and behind. What motion does not tell, a rule says: the pressure under a foot is under its middle, to
half of its length, and twists it by friction within that reach; and two feet, of which motion tells the sum
alone, push along the ground as they push against it, and apart by anything between none and what points each
force at the mass center, as legs do that push along themselves. Either may carry all, most likely the one
that stands alone before or behind, for as long as a body takes to fall over. Of wrenches w_k with
mean mu_k and covariance P_k by that rule, whose sum is W to a covariance C,
w_k = mu_k + P_k (P_1 + P_2 + C)^-1 (W - mu_1 - mu_2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from forceid.config import FootSetting
from forceid.errors import ConfigError
from forceid.kalman.tuning.robust import runs
from forceid.principal import transport_matrix
from forceid.records import Array, Feet, Flags, Motion
from forceid.rounding import SINGLE
from forceid.significance import WILD

FOOT_NEAR = 0.04  # m above its lowest level, at which a foot still touches: skin, and a foot that rolls
SLOW = 0.6  # m/s: a foot that lands or leaves is faster
LEVEL = 0.05  # part of the record in which a foot stands lowest: its level
STEADY = 0.06  # s over which its speed is taken
WIDE = 0.4  # width of a foot over its length
FREE_FORCE = 10.0  # times the weight, by which a force that the rule does not tell is off: as good as free
PUSH_APART = 0.1  # of the vertical force on the lesser foot, that both may push apart by beside
FEET = ("left_foot", "right_foot")  # as tables of persons name them


def feet_of(settings: tuple[FootSetting, ...], node: tuple[str, ...]) -> tuple[FootSetting, ...]:
    """The two feet of the settings, or of the nodes that are named so; none where there are none."""
    if settings:
        if len(settings) != 2:
            raise ConfigError(
                f"are {len(settings)}, expected two", "foot", "give a [[foot]] for each of both"
            )
        for one in settings:
            if unknown := [n for n in one.nodes if n not in node]:
                raise ConfigError(f"names the unknown node '{unknown[0]}'", f"foot {one.name}", "correct it")
        return settings
    own = {foot: tuple(n for n in node if n.startswith(foot)) for foot in FEET}
    return (
        tuple(FootSetting(name=foot, nodes=nodes) for foot, nodes in own.items()) if all(own.values()) else ()
    )


@dataclass(frozen=True)
class FootLoads:
    """Wrenches (time, foot, 6) of the ground on two feet about the mass center of the body, world axes, with
    cov (time, foot, 6, 6); middle (time, foot, 3) m of the feet; feet: their forces, and when they touch;
    pushed (time,): whether the ground pushes beyond what chance does.
    """

    wrench: Array
    cov: Array
    middle: Array
    feet: Feet
    pushed: Flags


def split_by_foot(
    feet: tuple[FootSetting, ...],
    node: tuple[str, ...],
    motion: Motion,
    center: Array,
    W: Array,
    cov: Array,
) -> FootLoads | None:
    """What the ground gives each of two feet, with covariance; None without feet, gravity or their tracks.

    center (time, 3) m of the mass, W (time, 6) all that acts about it beside the weight, with cov.
    """
    if len(feet) != 2 or motion.position is None or not motion.gravity.any():
        return None
    up = -motion.gravity / np.linalg.norm(motion.gravity)
    tracks = [filled(motion.time, motion.position[:, [node.index(n) for n in one.nodes]]) for one in feet]
    if any(track is None for track in tracks):
        return None
    points = [np.asarray(track) for track in tracks]
    lowest = np.stack([(x @ up).min(1) for x in points], 1)
    level = np.quantile(lowest, LEVEL, axis=0)
    middle = np.stack([x.mean(1) for x in points], 1)
    touches = touching(motion.time, lowest - level, middle)
    push = W[:, :3] @ up
    pushed = push > WILD * np.sqrt(np.einsum("a,tab,b->t", up, cov[:, :3, :3], up))
    none = pushed & ~touches.any(1)
    touches[none] = (lowest - level)[none] <= np.maximum(FOOT_NEAR, (lowest - level)[none].min(1))[:, None]
    around = 2 * frames_in(motion.time, STEADY) + 1
    may: Flags = np.asarray(maximum_filter1d(touches, around, axis=0, mode="nearest"))
    wrench, own = np.zeros((len(W), 2, 6)), np.zeros((len(W), 2, 6, 6))
    share, std = touches.astype(float), np.zeros(len(W))
    stands = np.flatnonzero(may.any(1))
    if len(stands):
        sole = middle[stands] + up * (level.mean() - middle[stands] @ up)[..., None]
        reach = np.array([one.reach for one in feet])
        spread = reach[:, None, None] ** 2 * np.stack([pressed(x[stands], up) for x in points], 1)
        arm = sole - center[stands, None]
        falls = float(np.sqrt(np.median(np.abs(arm @ up)) / np.linalg.norm(motion.gravity)))
        rule = Rule(carrying(motion.time, may, falls)[stands], arm, up, spread)
        wrench[stands], own[stands], share[stands], std[stands] = shared(W[stands], cov[stands], rule)
    found = Feet(
        tuple(one.name for one in feet), wrench[..., :3], own[..., :3, :3], touches.astype(float), share, std
    )
    return FootLoads(wrench, own, middle, found, np.asarray(pushed))


def pressed(x: Array, up: Array) -> Array:
    """Covariance (time, 3, 3) of the moment of a unit pressure about the middle of a foot (time, node, 3) m.

    In units of the square of its reach: the pressure is off by that along the foot, and by the width of a
    foot over its length across; a foot of one node has no direction. It twists no more than it tips across.
    """
    off = (x - x.mean(1, keepdims=True)) @ (np.eye(3) - np.outer(up, up))
    _, size, axes = np.linalg.svd(off, full_matrices=False)
    across = np.where(size[:, :1, None] > FOOT_NEAR, axes[:, :1].mT @ axes[:, :1], 0.0)
    tips = np.where(size[:, :1, None] > FOOT_NEAR, WIDE**2, 1.0) * (np.eye(3) - np.outer(up, up))
    turn = np.cross(np.eye(3), up)
    lengthwise = (1 - WIDE**2) * turn.T @ across @ turn
    return np.asarray(tips + lengthwise + WIDE**2 * np.outer(up, up))


@dataclass(frozen=True)
class Rule:
    """Where two feet may push: odds (time, 2) that each carries all, arm (time, 2, 3) m of their soles from
    the mass center, up (3,), and spread (time, 2, 3, 3) m2 of the moment of a unit force on each.
    """

    odds: Array
    arm: Array
    up: Array
    spread: Array


def shared(W: Array, cov: Array, rule: Rule) -> tuple[Array, Array, Array, Array]:
    """Wrenches (time, 2, 6) of feet by the rule, one of which at least may touch, their covariances (time, 2,
    6, 6), their shares (time, 2) of what pushes against the ground, and how sure these are (time,).

    W (time, 6) about the mass center, with cov. Once to share what pushes against the ground, then once more
    for what pushes along it. Of the force on a foot that stands alone the rule tells nothing.
    """
    up, odds = rule.up, rule.odds
    known = np.sqrt(np.einsum("a,tab,b->t", up, cov[:, :3, :3], up))
    push = np.maximum(np.abs(W[:, :3] @ up), known)  # no less than is known of it
    push = np.maximum(push, SINGLE * (float(np.nan_to_num(push).max()) or 1.0))
    along = W[:, :3] - (W[:, :3] @ up)[:, None] * up
    share, std = odds, np.sqrt(odds.prod(1))  # of all, or none
    two, either = std > 0, std
    to_center = transport_matrix(rule.arm)
    slope = (rule.arm @ up)[..., None] * up - rule.arm  # from the soles to the mass center
    slope = slope / np.maximum(-rule.arm @ up, FOOT_NEAR)[..., None]
    wrench, own, found = np.zeros((len(W), 2, 6)), np.zeros((len(W), 2, 6, 6)), share
    for _ in range(2):
        lean = (share * push[:, None])[..., None] * slope
        lean = lean - share[..., None] * lean.sum(1, keepdims=True)
        mean = np.zeros((len(W), 2, 6))
        mean[..., :3] = share[..., None] * along[:, None] + (odds * push[:, None])[..., None] * up + lean / 2
        mean = np.einsum("tfij,tfj->tfi", to_center, mean)
        # from foot to foot, by what the share does
        passes = along + (share[:, 1:] - share[:, :1]) * push[:, None] * (slope[:, 0] - slope[:, 1]) / 2
        passes = np.pad(passes + push[:, None] * up, ((0, 0), (0, 3)))
        apart = PUSH_APART * np.hypot(share.min(1), std) * push
        apart = np.where(two, apart, FREE_FORCE * push)
        R = np.zeros((len(W), 2, 6, 6))
        R[..., :3, :3] = 2 * apart[:, None, None, None] ** 2 * np.eye(3)
        R[..., :3, :3] += 2 * lean[..., :, None] * lean[..., None, :] / 12  # uniform from none to all of it
        R[..., 3:, 3:] = (np.hypot(share, std[:, None]) * push[:, None])[..., None, None] ** 2 * rule.spread
        R = R + 2 * (either**2)[:, None, None, None] * (passes[:, :, None] * passes[:, None])[:, None]
        P = (odds > 0)[..., None, None] * (to_center @ R @ to_center.mT)
        gain = np.linalg.solve((P.sum(1) + cov)[:, None], P).mT  # P_k (P_1 + P_2 + C)^-1
        wrench = mean + np.einsum("tfij,tj->tfi", gain, W - mean.sum(1))
        own = gain @ (P[:, ::-1] + cov[:, None])
        told = np.sqrt(np.einsum("a,tab,b->t", up, own[:, 0, :3, :3], up)) / push
        found = np.where(two[:, None], wrench[..., :3] @ up / push[:, None], odds)
        share, std = np.clip(found, 0.0, 1.0), np.where(two, told, 0.0)
    return wrench, own, found, std


def carrying(time: Array, may: Flags, falls: float) -> Array:
    """Odds (time, foot) that a foot carries all: even on two that may touch, but near to one that is alone.

    falls: s that a body takes to fall over; half of the while at most, if both may touch for less than twice
    that.

    >>> may = np.array([[1, 0], [1, 1], [1, 1], [1, 1], [0, 1]], bool)
    >>> carrying(np.arange(5.0), may, 9.0).tolist()
    [[1.0, 0.0], [0.75, 0.25], [0.5, 0.5], [0.25, 0.75], [0.0, 1.0]]
    """
    odds = may / np.maximum(may.sum(1, keepdims=True), 1)
    for first, length in runs(np.asarray(may.all(1))):
        ends = [k for k in (first - 1, first + length) if 0 <= k < len(time) and may[k].any()]
        inside = slice(first, first + length)
        half = min(falls, float(time[min(first + length, len(time) - 1)] - time[max(first - 1, 0)]) / 2)
        for k in ends:
            near = 1 - np.clip(np.abs(time[inside] - time[k]) / half, 0.0, 1.0)
            odds[inside] += near[:, None] * (odds[k] - 0.5)
    return np.asarray(odds)


def frames_in(time: Array, seconds: float) -> int:
    """How many frames a while takes, one at least."""
    return max(1, round(seconds / float(np.median(np.diff(time)))))


def touching(time: Array, height: Array, center: Array) -> Flags:
    """Whether feet touch (time, foot): height (time, foot) m above their level, center (time, foot, 3) m."""
    smooth = uniform_filter1d(center, frames_in(time, STEADY), axis=0, mode="nearest")
    speed = np.linalg.norm(np.gradient(smooth, time, axis=0), axis=2)
    return np.asarray((height < FOOT_NEAR) & (speed < SLOW))


def filled(time: Array, x: Array) -> Array | None:
    """Tracks (time, node, 3) straight across gaps; None where one is never seen."""
    out = x.copy()
    for column in out.reshape(len(out), -1).T:
        seen = np.isfinite(column)
        if not seen.any():
            return None
        column[~seen] = np.interp(time[~seen], time[seen], column[seen])
    return out
