"""What turns inside a body: rotors and wheels of known inertia and speed, and the angular momentum they hold.

A body with rotors is a gyrostat: its angular momentum about the mass center is R (J omega + h), h = sum of
axis * inertia * speed. J is of the whole with the rotors held, and their speeds are against the body. What
spins a rotor up comes from inside: it turns the body as the rotor is turned, and is no moment from outside.
Source: principal equations 2.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from forceid.config import RotorSetting
from forceid.errors import ConfigError, DataError
from forceid.records import Array, Body, Motion


def momentum_inside(body: Body, motion: Motion) -> Array:
    """Angular momentum ([time,] 3) kg m2/s of what turns inside, reference axes: without time where constant.

    Zero where nothing is stated; straight across gaps of a speed. DataError: rotors that are not whole.

    >>> wheel = Body(rotor_axis=np.array([[0.0, 0.0, 2.0]]), rotor_inertia=np.array([0.01]))
    >>> speed = np.array([[10.0], [np.nan], [30.0]])
    >>> momentum_inside(wheel, Motion(np.arange(3.0), rotor_speed=speed))[:, 2].round(9).tolist()
    [0.1, 0.2, 0.3]
    """
    h = np.zeros(3) if body.internal_momentum is None else body.internal_momentum
    axis, inertia, speed = body.rotor_axis, body.rotor_inertia, motion.rotor_speed
    if axis is None and inertia is None and speed is None:
        return h
    if axis is None or inertia is None or speed is None:
        what = "knows rotors in part, expected rotor_axis and rotor_inertia, and their speeds in /motion"
        raise DataError(what, "/body", "add rotor_axis, rotor_inertia and rotor_speed, or state [[rotor]]")
    length = np.linalg.norm(axis, axis=1)
    for name, wrong in (("rotor_axis", ~(length > 0)), ("rotor_inertia", ~(inertia > 0))):
        if wrong.any():
            what = f"is not over zero for rotor {int(np.argmax(wrong))}"
            raise DataError(what, f"/body/{name}", "correct it")
    seen = np.isfinite(speed)
    if not seen.any(0).all():
        what = "is never known of a rotor"
        raise DataError(what, "/motion/rotor_speed", "give it, or state [[rotor]] speed")
    columns = zip(speed.T, seen.T, strict=True)
    filled = np.stack([np.interp(motion.time, motion.time[s], v[s]) for v, s in columns], 1)
    return np.asarray(h + filled @ (axis / length[:, None] * inertia[:, None]))


def with_rotors(body: Body, motion: Motion, rotors: Sequence[RotorSetting]) -> tuple[Body, Motion]:
    """Body and motion with the rotors of the settings beside those of the file, or in place of them by name.

    ConfigError: a rotor without a speed that the file does not know either.
    """
    if not rotors:
        return body, motion
    T, known = len(motion.time), body.rotor
    speeds = np.zeros((T, len(known))) if motion.rotor_speed is None else motion.rotor_speed
    axes, inertias = body.rotor_axis, body.rotor_inertia
    table: dict[str, tuple[Array, float, Array]] = {}
    if axes is not None and inertias is not None:
        table = {name: (axes[k], float(inertias[k]), speeds[:, k]) for k, name in enumerate(known)}
    for one in rotors:
        if one.speed is None and one.name not in table:
            what = (
                f"has no speed, expected one in rad/s, or a rotor of the file ({', '.join(known) or 'none'})"
            )
            raise ConfigError(what, f"rotor {one.name}", "add speed, or import rotor_speed")
        speed = table[one.name][2] if one.speed is None else np.full(T, one.speed)
        table[one.name] = np.array(one.axis, float), one.inertia, speed
    told = [*table.values()]
    body = replace(
        body, rotor=tuple(table), rotor_axis=np.array([axis for axis, *_ in told]),
        rotor_inertia=np.array([inertia for _, inertia, _ in told]),
    )  # fmt: skip
    return body, replace(motion, rotor_speed=np.stack([speed for *_, speed in told], 1))
