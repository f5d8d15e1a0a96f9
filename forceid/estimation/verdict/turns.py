"""Turns from frame to frame that may be longer, or the other way: which of them takes least moment."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.flight.path.reference import COARSE
from forceid.motion import exp, largest_turn, log
from forceid.records import Array, Finding
from forceid.significance import PATIENCE

KICK = 0.05  # part of its angular momentum that a moment may add to such a spin in each frame
MOMENT_VALUES = 6  # independent values that a moment along three axes has at the least: two along each
OTHERWISE = (-1, 1)  # whole turns that are read too many or too few


def judge_momentum(kin: Kinematics, H: Array, moment: Array) -> list[Finding]:
    """Turns that a moment as large as no other would have to make: what an aliased spin reads as."""
    turn = largest_turn(kin.time, kin.pose.rotation)
    if turn < COARSE:
        return []
    step = float(np.median(np.diff(kin.time)))
    size, kick = (np.linalg.norm(v, axis=1) for v in (H, moment * step))
    known = np.isfinite(size) & np.isfinite(kick)
    if not known.any() or np.median(kick[known]) < KICK * np.median(size[known]) or told_by_moment(kin):
        return []
    part = np.median(kick[known]) / np.median(size[known])
    return [note("turn-by-moment", degrees=np.degrees(turn), part=part)]


def told_by_moment(kin: Kinematics) -> bool:
    """Whether any turn but the shortest would take so much more moment that the record denies it.

    Of a moment of which nothing but its size is open, k independent values are (m'/m)^k times as likely under
    the reading that takes m as under one that takes m' (the size scale-free, so it is integrated out).
    """
    times = moment_of_others(kin)
    return times is not None and bool(MOMENT_VALUES * np.log(max(times, 1.0)) > PATIENCE)


def moment_of_others(kin: Kinematics) -> float | None:
    """Least rms moment that turns by a whole one more or less would take, over that of the turns as read.

    None where the inertia is not known, or too few frames show a rotation.
    """
    seen, J = np.isfinite(kin.pose.rotation).all((1, 2)), kin.inertia.tensor
    if not kin.attitude or not np.isfinite(J).all() or seen.sum() < MOMENT_VALUES:
        return None
    R, time = kin.pose.rotation[seen], kin.time[seen]
    read = log(R[1:] @ R[:-1].mT)
    size = np.linalg.norm(read, axis=1, keepdims=True)
    about = read / np.maximum(size, np.finfo(float).tiny)
    taken = [kicks(read + 2 * np.pi * k * about, R, time, J) for k in (0, *OTHERWISE)]
    return min(taken[1:]) / max(taken[0], np.finfo(float).tiny)


def kicks(turn: Array, R: Array, time: Array, J: Array) -> float:
    """Rms change of angular momentum from step to step, of rotations R (time, 3, 3) with turns between them.

    turn (time - 1, 3) rad, world axes; J kg m2 of the body in its own.
    """
    half = exp(turn / 2) @ R[:-1]
    omega = turn / np.diff(time)[:, None]
    H = np.einsum("tab,bc,tdc,td->ta", half, J, half, omega)
    return float(np.sqrt(np.mean(np.diff(H, axis=0) ** 2)))
