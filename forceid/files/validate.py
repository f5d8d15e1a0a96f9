"""What the values of a recording must satisfy, whatever format they came from."""

from __future__ import annotations

from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.checks.body import check_body
from forceid.files.checks.clock import check_clock, check_steps
from forceid.files.checks.numbers import NEARLY, check_finite, check_quaternions, check_range
from forceid.files.schema import MOTION
from forceid.records import SENSED, Array, Body, KnownLoads, Motion, Recording

GRAVITY = 300.0  # m/s2, beyond that at the face of the sun: in other units than it says


def check_recording(recording: Recording, where: str = "") -> None:
    """DataError, one line with variable and next step, for the first value that no estimate could rest on.

    `where` names the file; variables are appended as in `toss.h5:/motion/time`. NaN is a gap in a measured
    variable and an error everywhere else.
    """
    body, motion = recording.body, recording.motion
    check_clock(motion.time, f"{where}:/motion/time")
    check_steps(motion.time, f"{where}:/motion/time")
    check_body(body, f"{where}:/body")
    check_motion(motion, body, f"{where}:/motion")
    if recording.known_loads is not None:
        check_known_loads(recording.known_loads, motion.time, f"{where}:/load_known")
    for name, values in recording.truth.items():
        if name == "time":
            check_clock(values, f"{where}:/truth/time")
            if values[0] > motion.time[-1] or values[-1] < motion.time[0]:
                raise DataError(
                    f"runs from {values[0]:.6g} to {values[-1]:.6g} s, expected times of the motion, "
                    f"{motion.time[0]:.6g} to {motion.time[-1]:.6g} s",
                    f"{where}:/truth/time",
                    "set both clocks to one zero",
                )
        elif len(values) != len(recording.truth.get("time", motion.time)):
            raise DataError(
                f"has {len(values)} rows, expected one per time",
                f"{where}:/truth/{name}",
                "give /truth its own variable time",
            )


def check_motion(motion: Motion, body: Body, where: str) -> None:
    """Something was measured, gravity is three numbers, noise is positive, rotations have unit norm."""
    if motion.gravity.shape != (3,) or not np.isfinite(motion.gravity).all():
        raise DataError(
            f"has gravity {motion.gravity.tolist()}, expected three finite numbers in m s-2",
            where,
            "set the attribute gravity, for example 0, 0, -9.81",
        )
    if not np.linalg.norm(motion.gravity) <= GRAVITY:
        raise DataError(
            f"has gravity {motion.gravity.tolist()}, expected at most {GRAVITY:g} m s-2",
            where,
            "give it in m s-2, for example 0, 0, -9.81",
        )
    for name, std in motion.noise_std.items():
        if not (np.isfinite(std) and std > 0):
            raise DataError(
                f"has noise_std {std:g}, expected a positive number",
                f"{where}/{name}",
                "correct the attribute, or leave it out and it is estimated",
            )
    for name in ("position", "marker_position", "center", "orientation", *SENSED):
        value = getattr(motion, name)
        if value is not None:
            check_range(value, MOTION[name].units, f"{where}/{name}")
    for name in ("position", "center"):
        value = getattr(motion, name)
        if value is not None and not (known := np.isfinite(value)).all() and not known.all(-1).any():
            lost = "nothing but NaN: every marker is lost in every frame"
            part = "no reading of all three axes: a coordinate is missing in every one"
            raise DataError(
                f"holds {lost if np.isnan(value).all() else part}",
                f"{where}/{name}",
                "check the export of the tracking system",
            )
    if (motion.center is None) != (motion.orientation is None):
        have, lack = ("center", "orientation") if motion.orientation is None else ("orientation", "center")
        raise DataError(
            f"is missing, expected beside {have}", f"{where}/{lack}", f"add {lack}: the mean motion is both"
        )
    if motion.position is not None and body.position is None:
        raise DataError(
            "is missing, expected the reference shape of the nodes",
            f"{where[:-6]}body/position",
            "add the position of every node, for example from a frame that shows all",
        )
    if motion.orientation is not None:
        check_quaternions(motion.orientation, f"{where}/orientation")
    check_sensors(motion, body, where)


def checked_series(values: dict[str, Any], where: str) -> dict[str, Any]:
    """Series of a result, by name, whose clock goes on and whose rotations are some."""
    if "time" in values:
        check_clock(values["time"], f"{where}/time")
    if "orientation" in values:
        check_quaternions(values["orientation"], f"{where}/orientation")
    return values


def check_known_loads(known: KnownLoads, time: Array, where: str) -> None:
    """Known loads have no gaps, covariances that are some, and a clock that covers that of the motion."""
    check_clock(known.time, f"{where}/time")
    first, last = known.time[0], known.time[-1]
    if first > time[0] or last < time[-1]:
        raise DataError(
            f"runs from {first:.6g} to {last:.6g} s, expected to cover the motion, {time[0]:.6g} to "
            f"{time[-1]:.6g} s",
            f"{where}/time",
            "cut the motion to where the loads are known: what is not known of a load is not zero",
        )
    check_finite(known, ("name",), where, "fill the gaps, or leave that load out and let it be found")
    if (cov := known.wrench_cov) is not None:
        low, size = np.linalg.eigvalsh(0.5 * (cov + cov.mT))[..., 0], np.abs(cov).max((-1, -2))
        if (low < -NEARLY * size).any() or (np.abs(cov - cov.mT).max((-1, -2)) > NEARLY * size).any():
            what = "is no covariance, expected symmetric matrices without a negative variance"
            raise DataError(what, f"{where}/wrench_cov", "give E[e e^T] of force, then moment")


def check_sensors(motion: Motion, body: Body, where: str) -> None:
    """Sensors stand somewhere on the body, and their axes are rotations."""
    on_body = f"{where[:-6]}body"
    if motion.specific_force is not None and body.sensor_position is None:
        raise DataError(
            "is missing, expected beside specific_force",
            f"{on_body}/sensor_position",
            "add where each sensor stands, in the axes of the reference shape",
        )
    if body.strain_shape is not None and body.position is not None:
        check_strain_shape(body.strain_shape, body.position, f"{on_body}/strain_shape")
    if body.sensor_rotation is not None:
        check_quaternions(body.sensor_rotation, f"{on_body}/sensor_rotation")


def check_strain_shape(shape: Array, position: Array, where: str) -> None:
    """No gauge reads a rigid motion: a strain is blind to it."""
    arm = position - position.mean(0)
    moved = np.concatenate([shape.sum(1), np.cross(arm, shape).sum(1)], 1)
    size = np.abs(shape).sum((1, 2))
    scale = np.repeat(np.stack([size, size * np.abs(arm).max(initial=0.0)], 1), 3, axis=1)
    off = np.abs(moved) > NEARLY * scale
    if off.any():
        k = int(np.argmax(off.any(1)))
        motion = "a translation" if off[k, :3].any() else "a rotation"
        raise DataError(
            f"lets gauge {k} read {motion} of the whole body, expected no rigid motion to strain it",
            where,
            "give the strain per displacement of every node: opposite ones where it holds on, along the line",
        )
