"""A pose that was measured beside the markers: they are used, it is not; whether both tell the same."""

from __future__ import annotations

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.body.kinematics import Kinematics, rotations
from forceid.estimation.verdict.catalogue import note
from forceid.motion import log, noise_variance
from forceid.records import Array, Finding, Motion
from forceid.significance import WILD


def judge_measured_pose(kin: Kinematics, motion: Motion) -> list[Finding]:
    """That a pose beside markers is left out, and by how much it differs from theirs where it does."""
    if kin.markers is None or motion.center is None or motion.orientation is None:
        return []
    path = motion.center - kin.pose.center
    turn = log(rotations(motion.orientation) @ kin.pose.rotation.swapaxes(1, 2))
    off, away = beyond(kin, path, slice(0, 3)), beyond(kin, turn, slice(3, 6))
    if off == away == 0:
        return [note("pose-left-out")]
    return [note("pose-differs", off_mm=1e3 * off, turn_deg=float(np.degrees(away)))]


def beyond(kin: Kinematics, apart: Array, rows: slice) -> float:
    """Size of a difference (time, axis) in half of the frames, 0 where its own noise explains that."""
    var = np.trace(kin.pose.cov[:, rows, rows], axis1=1, axis2=2) / 3
    known = np.isfinite(apart).all(1) & np.isfinite(var)
    try:
        white = noise_variance(kin.time[known], apart[known]) + float(np.median(var[known]))
    except EstimationError:  # too few to tell
        return 0.0
    size = float(np.median(np.linalg.norm(apart[known], axis=1)))
    return size if size > WILD * np.sqrt(white) else 0.0
