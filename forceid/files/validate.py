"""What the values of a recording must satisfy, whatever format they came from."""

from __future__ import annotations

from collections import Counter

import numpy as np

from forceid.errors import DataError
from forceid.records import SENSED, Array, Body, KnownLoads, Motion, Recording

_SYMMETRY = 1e-6  # of the largest entry: float32 matrices pass


def check_recording(recording: Recording, where: str = "") -> None:
    """DataError, one line with variable and next step, for the first value that no estimate could rest on.

    `where` names the file; variables are appended as in `toss.h5:/motion/time`. NaN is a gap in a measured
    variable and an error everywhere else.
    """
    body, motion = recording.body, recording.motion
    check_clock(motion.time, f"{where}:/motion/time")
    check_body(body, f"{where}:/body")
    check_motion(motion, body, f"{where}:/motion")
    if recording.known_loads is not None:
        check_known_loads(recording.known_loads, motion.time, f"{where}:/load_known")
    for name, values in recording.truth.items():
        if name == "time":
            check_clock(values, f"{where}:/truth/time")
        elif len(values) != len(recording.truth.get("time", motion.time)):
            raise DataError(
                f"has {len(values)} rows, expected one per time",
                f"{where}:/truth/{name}",
                "give /truth its own variable time",
            )


def check_clock(time: Array, where: str) -> None:
    """Times are finite, at least three, and strictly increasing."""
    if len(time) < 3:
        raise DataError(
            f"has {len(time)} samples, expected at least 3", where, "an acceleration needs three times"
        )
    if not np.isfinite(time).all():
        bad = np.flatnonzero(~np.isfinite(time))
        raise DataError(
            f"holds {len(bad)} times that are not finite, first at index {bad[0]}, expected none",
            where,
            "restore the clock or drop those rows",
        )
    step = np.diff(time)
    if (step <= 0).any():
        k = int(np.argmax(step <= 0))
        raise DataError(
            f"goes from {time[k]:.9g} to {time[k + 1]:.9g} s at index {k + 1}, expected strictly "
            "increasing times",
            where,
            "sort the rows and drop repeated ones",
        )


def check_body(body: Body, where: str) -> None:
    """Finite body data, mass that is positive, symmetric matrices."""
    check_finite(
        body, ("node", "marker", "joint", "material"), where, "body data has no gaps: give every value"
    )
    if repeated := [name for name, count in Counter(body.node).items() if count > 1]:
        raise DataError(
            f"names {repeated[0]!r} more than once", f"{where}/node", "give every node its own name"
        )
    if body.mass is not None:
        if (body.mass < 0).any():
            k = int(np.argmin(body.mass))
            node = repr(body.node[k]) if body.node else k
            raise DataError(
                f"is {body.mass[k]:g} kg at node {node}, expected zero or more",
                f"{where}/mass",
                "correct it; a marker that carries no mass has 0",
            )
        _check_positive(float(body.mass.sum()), f"{where}/mass", "total mass")
    if body.mass_matrix is not None:
        check_symmetric(body.mass_matrix, f"{where}/mass_matrix")
        numbers = len(body.mass_matrix) // max(len(body.node), 1) or 3  # of a node: six with rotations
        total = float(body.mass_matrix[::numbers, ::numbers].sum())
        _check_positive(total, f"{where}/mass_matrix", "total mass along x")
    if body.stiffness is not None:
        check_symmetric(body.stiffness, f"{where}/stiffness")
    if body.total_mass is not None:
        _check_positive(body.total_mass, f"{where}/total_mass", "total mass")
    if body.inertia is not None:
        check_symmetric(body.inertia, f"{where}/inertia")
        low, *_, high = np.linalg.eigvalsh(body.inertia)
        if low < -_SYMMETRY * max(high, 0.0):
            raise DataError(
                f"has principal moment {low:.3g} kg m2, expected none below zero",
                f"{where}/inertia",
                "give the tensor, its products of inertia with the minus sign",
            )
    check_mass_known(body, where)
    check_segments(body, where)
    if body.mode_frequency is not None and (body.mode_frequency < 0).any():
        raise DataError(
            f"is {body.mode_frequency.min():g} Hz, expected zero or more",
            f"{where}/mode_frequency",
            "correct the frequency",
        )


def check_finite(record: Body | KnownLoads, words: tuple[str, ...], where: str, next_step: str) -> None:
    """No number of a record, but for its words, is a gap."""
    for name, value in vars(record).items():
        if name not in words and value is not None and not np.isfinite(value).all():
            what = f"holds {np.sum(~np.isfinite(value))} values that are not finite, expected none"
            raise DataError(what, f"{where}/{name}", next_step)


def check_mass_known(body: Body, where: str) -> None:
    """The mass is given node by node, as a matrix, or as a rigid whole."""
    if body.mass is not None or body.mass_matrix is not None:
        return
    missing = [name for name in ("total_mass", "mass_center", "inertia") if getattr(body, name) is None]
    if len(missing) == 3:
        raise DataError(
            "holds no mass, expected `mass`, `mass_matrix`, or `total_mass` with `mass_center` and `inertia`",
            where,
            "add one of them",
        )
    if missing:
        raise DataError(
            f"lacks {' and '.join(missing)}, expected with the rest of the rigid body",
            where,
            f"add {missing[0]}, or give the mass of every node",
        )


def check_segments(body: Body, where: str) -> None:
    """Markers and joints of a body of segments come whole, on nodes that there are."""
    names = ("marker_weight", "marker_segment", "marker_shape", "joint_segment", "joint_shape")
    given = [name for name in names if getattr(body, name) is not None]
    if given and len(given) < len(names):
        lacking = next(name for name in names if name not in given)
        raise DataError(
            f"is missing, expected beside {given[0]}", f"{where}/{lacking}", "import the capture again"
        )
    for name in ("marker_segment", "joint_segment"):
        at = getattr(body, name)
        if at is not None and not np.isin(at, np.arange(-1 if at.ndim == 1 else 0, len(body.node))).all():
            raise DataError(
                f"names a node that is none of {len(body.node)}", f"{where}/{name}", "give indices of nodes"
            )


def check_motion(motion: Motion, body: Body, where: str) -> None:
    """Something was measured, gravity is three numbers, noise is positive, rotations have unit norm."""
    if motion.gravity.shape != (3,) or not np.isfinite(motion.gravity).all():
        raise DataError(
            f"has gravity {motion.gravity.tolist()}, expected three finite numbers in m s-2",
            where,
            "set the attribute gravity, for example 0, 0, -9.81",
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
        if value is not None and np.isinf(value).any():
            raise DataError(
                f"holds {np.isinf(value).sum()} infinite values, expected finite ones or NaN",
                f"{where}/{name}",
                "write NaN where nothing was measured",
            )
    for name in ("position", "center"):
        value = getattr(motion, name)
        if value is not None and np.isnan(value).all():
            raise DataError(
                "holds nothing but NaN: every marker is lost in every frame",
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
        if (low < -_SYMMETRY * size).any() or (np.abs(cov - cov.mT).max((-1, -2)) > _SYMMETRY * size).any():
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
    off = np.abs(moved) > _SYMMETRY * scale
    if off.any():
        k = int(np.argmax(off.any(1)))
        motion = "a translation" if off[k, :3].any() else "a rotation"
        raise DataError(
            f"lets gauge {k} read {motion} of the whole body, expected no rigid motion to strain it",
            where,
            "give the strain per displacement of every node: opposite ones where it holds on, along the line",
        )


def check_quaternions(q: Array, where: str) -> None:
    """Norms within 1 % of one; NaN is a gap."""
    norm = np.linalg.norm(q, axis=-1)
    far = np.abs(norm - 1) > 0.01
    if far.any():
        k = int(np.argmax(far))
        raise DataError(
            f"has {far.sum()} quaternions off unit norm, the first at index {k} with norm {norm[k]:.4g}, "
            "expected 1",
            where,
            "write unit quaternions x, y, z, w, and NaN for gaps",
        )


def check_symmetric(matrix: Array, where: str) -> None:
    """Symmetric to 1e-6 of the largest entry."""
    error, scale = np.abs(matrix - matrix.T).max(initial=0.0), np.abs(matrix).max(initial=0.0)
    if error > _SYMMETRY * scale:
        raise DataError(
            f"is not symmetric: entries differ by {error:.3g} across the diagonal, expected equal",
            where,
            "give the symmetric matrix",
        )


def _check_positive(mass: float, where: str, what: str) -> None:
    if mass <= 0:
        raise DataError(f"has {what} {mass:g} kg, expected more than zero", where, "give the masses in kg")
