"""Motions over the ground: where a body comes near it, and pieces with one contact each.

Errors of a start grow with every bounce, and flights of several bounces have many law-like answers that are
far off. A piece that starts anew in the air keeps all that its own contact tells, for twelve numbers more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.laws.courses import FEWEST_POSES
from forceid.laws.flying import Course
from forceid.laws.ground import Ground
from forceid.records import Array, Flags
from forceid.significance import SIGMAS

REACH = 3.0  # times what a body sinks in an interval: from there it may touch, a frame early or late
THIN = 8  # samples between bounces that tell trials no more than one of them does
AIR_BESIDE = 2  # frames in the air on both sides of a cut, so that each piece sees its start


def heights(course: Course, below: Ground) -> Array:
    """Height (time,) m of the lowest place of contact along the normal of the ground, by the estimate."""
    center, _, R, _ = course.path
    return np.asarray(((center[:, None] + below.arms(R)) @ below.normal).min(1))


def pressed_height(course: Course, below: Ground) -> float:
    """Greatest height (m) of the lowest place of contact at which the ground carries half the weight or more,
    by the wrench estimated: where the ground is, at most.
    """
    normal = course.wrench[:, :3] @ below.normal
    sure = SIGMAS * np.linalg.norm(course.wrench_std[:, :3], axis=1)
    carried = normal > np.maximum(0.5 * course.mass * abs(float(course.gravity @ below.normal)), sure)
    clear = heights(course, below)
    return float(clear[carried].max() if carried.any() else clear.min())


def near(course: Course, below: Ground, height: float) -> Flags:
    """Intervals (time - 1,) in which a place of contact comes to the plane, or nearly."""
    if below.kind != "soft":
        return np.ones(len(course.time) - 1, bool)
    clear = heights(course, below) - height
    reach = REACH * np.abs(np.diff(clear))
    return np.asarray(np.minimum(clear[1:], clear[:-1]) <= reach)


def by_bounces(course: Course) -> list[Course]:
    """A course cut in the middle of its flights, in pieces that can stand alone."""
    touching = course.near
    edges = np.diff(np.concatenate([[False], ~touching, [False]]).astype(int))
    cuts, last = [0], len(course.time)
    for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        middle = int(a + b) // 2
        inside = a > 0 and b < len(touching) and b - a >= 2 * AIR_BESIDE
        if inside and min(middle - cuts[-1], last - middle) >= FEWEST_POSES:
            cuts.append(middle)
    if len(cuts) == 1:
        return [course]
    ends = enumerate(zip(cuts, [*cuts[1:], last], strict=True), 1)
    return [course.part(np.arange(a, b), f"{course.name} ({k} of {len(cuts)})") for k, (a, b) in ends]


def thinned(course: Course, below: Ground) -> Course:
    """The course with one in so many of the samples that are not of a bounce."""
    bounce = course.near & (below.kind == "soft")
    kept = np.concatenate([bounce, [True]]) | np.concatenate([[True], bounce])
    kept[::THIN] = True
    return replace(course.part(np.flatnonzero(kept), course.name), start=course.start)
