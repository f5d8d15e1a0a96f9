"""Rotations by dead reckoning: from the rates that gyros read, led back to the frames that markers show."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.flight.instruments.gyro import GYRO
from forceid.flight.instruments.sensors import Sensors
from forceid.records import Array


def gyro_rate(time: Array, sensors: Sensors | None) -> Array | None:
    """Angular velocity (time, 3), body axes, that the gyros read on average; bridged between samples.

    None where no gyro reads all three axes at once.
    """
    reading = None if sensors is None else sensors.of(GYRO)
    if sensors is None or reading is None:
        return None
    body = np.einsum("sab,tsb->tsa", sensors.rotation, reading)
    whole = np.isfinite(body).all(2)
    seen = whole.any(1)
    if not seen.any():
        return None
    mean = np.where(whole[..., None], body, 0.0).sum(1)[seen] / whole.sum(1)[seen, None]
    return np.stack([np.interp(time, time[seen], axis) for axis in mean.T], 1)


def reckoned(time: Array, step: Array, rotation: Array) -> Array:
    """Rotations (time, 3, 3) by dead reckoning, led back to those that are seen.

    step (time - 1, 3, 3): turn from each sample to the next, body axes; rotation (time, 3, 3), NaN where not
    seen. The number of turns is that of the steps, so nothing is lost past half a turn a frame: what the
    reckoning drifts between two frames seen only has to stay below one half. Where none is seen, the world
    axes are those of the body at the first sample.
    """
    path = np.empty((len(time), 3, 3))
    path[0] = np.eye(3)
    for k, turn in enumerate(step):
        path[k + 1] = path[k] @ turn
    path = Rotation.from_matrix(path).as_matrix()  # rounding adds up along the products
    seen = np.isfinite(rotation).all((1, 2))
    if not seen.any():
        return path
    off = rotation[seen] @ path[seen].swapaxes(1, 2)
    if seen.sum() == 1:
        return np.asarray(off @ path)
    between = Slerp(time[seen], Rotation.from_matrix(off))
    return np.asarray(between(np.clip(time, *time[seen][[0, -1]])).as_matrix() @ path)
