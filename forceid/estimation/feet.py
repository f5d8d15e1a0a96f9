"""The force of the ground on each foot of a person: all of it on one that stands alone, by a rule on two.

A foot touches where it is near to its lowest level and slow; where none does and the ground pushes, the lower
one carries. Where both touch, motion tells their sum alone. Then the pressure center of the whole, that
force and moment place on the ground, lies between those of the feet: its part of the way from one to the
other is the share of that other, in all components. The place of the pressure under each foot is not known
better than half of its length, and both may push apart by friction; both are in the claim.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from forceid.config import FootSetting
from forceid.errors import ConfigError
from forceid.flight.smoother import FlightState
from forceid.records import Array, Feet, Flags, Motion
from forceid.significance import SIGMAS

FOOT_NEAR = 0.04  # m above its lowest level, at which a foot still touches: skin, and a foot that rolls
SLOW = 0.6  # m/s: a foot that lands or leaves is faster
LEVEL = 0.05  # part of the record in which a foot stands lowest: its level
STEADY = 0.06  # s over which its speed is taken
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


def split_by_foot(
    feet: tuple[FootSetting, ...], node: tuple[str, ...], motion: Motion, state: FlightState
) -> Feet | None:
    """The force on each of two feet, with covariance; None without feet, gravity or their tracks."""
    if len(feet) != 2 or motion.position is None or not motion.gravity.any():
        return None
    up = -motion.gravity / np.linalg.norm(motion.gravity)
    tracks = [filled(motion.time, motion.position[:, [node.index(n) for n in one.nodes]]) for one in feet]
    if any(track is None for track in tracks):
        return None
    points = [np.asarray(track) for track in tracks]
    lowest = np.stack([(x @ up).min(1) for x in points], 1)
    level = np.quantile(lowest, LEVEL, axis=0)
    center = np.stack([x.mean(1) for x in points], 1)
    touches = touching(motion.time, lowest - level, center)
    push, cov = state.force @ up, state.wrench_cov
    pushed = push > SIGMAS * np.sqrt(np.einsum("a,tab,b->t", up, cov[:, :3, :3], up))
    none = pushed & ~touches.any(1)
    touches[none, (lowest - level)[none].argmin(1)] = True
    both, alone = touches.all(1), touches[:, 1] & ~touches[:, 0]
    reach = np.array([one.reach for one in feet])
    second, std = lever_share(state, center, level.mean(), up, reach)
    share = np.where(both, second, alone.astype(float))
    std = np.where(both, std, 0.0)
    parts = np.stack([1 - share, share], 1)
    parts[~touches.any(1) | ~pushed] = 0.0
    std[~pushed] = 0.0
    F = state.force[:, None]
    level_axes = np.eye(3) - np.outer(up, up)
    apart = (PUSH_APART * np.minimum(parts[:, 0], parts[:, 1]) * push) ** 2
    force_cov = parts[..., None, None] ** 2 * cov[:, None, :3, :3]
    force_cov = force_cov + (std**2)[:, None, None, None] * (F[..., None] * F[..., None, :])
    force_cov = force_cov + apart[:, None, None, None] * level_axes
    return Feet(
        tuple(one.name for one in feet), parts[..., None] * F, force_cov, touches.astype(float), parts, std
    )


def touching(time: Array, height: Array, center: Array) -> Flags:
    """Whether feet touch (time, foot): height (time, foot) m above their level, center (time, foot, 3) m."""
    frames = max(1, round(STEADY / float(np.median(np.diff(time)))))
    smooth = uniform_filter1d(center, frames, axis=0, mode="nearest")
    speed = np.linalg.norm(np.gradient(smooth, time, axis=0), axis=2)
    return np.asarray((height < FOOT_NEAR) & (speed < SLOW))


def lever_share(
    state: FlightState, foot: Array, ground: float, up: Array, reach: Array
) -> tuple[Array, Array]:
    """Share of the second foot (time,) by the pressure center between both, and its standard deviation.

    foot (time, 2, 3) m; ground m along up; reach (2,) m: by which the pressure may be off the foot's middle.
    """
    F, T = state.force, state.moment
    push = np.where(np.abs(F @ up) > 0, F @ up, np.nan)
    h = state.center @ up - ground
    level = np.eye(3) - np.outer(up, up)

    def pressure(F: Array, T: Array, push: Array) -> Array:
        return np.asarray(state.center @ level + (np.cross(up, T) - h[:, None] * (F @ level)) / push[:, None])

    way = (foot[:, 1] - foot[:, 0]) @ level
    square = (way**2).sum(1)
    share = ((pressure(F, T, push) - foot[:, 0]) * way).sum(1) / square
    # slopes of the share by force and moment: the pressure center is linear in both but for the push
    at = pressure(F, T, push) - state.center @ level
    by_F = -(h[:, None] * way + (at * way).sum(1)[:, None] * up) / (push * square)[:, None]
    by_T = np.cross(way, up) / (push * square)[:, None]
    slope = np.concatenate([by_F, by_T], 1)
    var = np.einsum("ta,tab,tb->t", slope, state.wrench_cov, slope)
    held = np.clip(np.nan_to_num(share, nan=0.5), 0.0, 1.0)
    var = var + ((1 - held) ** 2 * reach[0] ** 2 + held**2 * reach[1] ** 2) / square
    return held, np.sqrt(np.minimum(np.nan_to_num(var, nan=1.0), 1 / 12))  # no wider than any share is


def filled(time: Array, x: Array) -> Array | None:
    """Tracks (time, node, 3) straight across gaps; None where one is never seen."""
    out = x.copy()
    for column in out.reshape(len(out), -1).T:
        seen = np.isfinite(column)
        if not seen.any():
            return None
        column[~seen] = np.interp(time[~seen], time[seen], column[seen])
    return out
