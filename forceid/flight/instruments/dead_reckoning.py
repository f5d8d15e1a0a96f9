"""How a body turned by what sensors read: dead reckoning by gyros, and whole turns between two frames.

Frames show a turn up to whole turns, and alone the shortest is taken. Gyros read its rate. An instrument that
reads how the body stands tells one count of turns from another, where it reads in between.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.flight.instruments.gyro import GYRO
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import Sensors, sensed
from forceid.motion import SHOWN_TURN, exp, log
from forceid.records import Array, all_finite


def gyro_rate(time: Array, sensors: Sensors | None) -> Array | None:
    """Angular velocity (time, 3), body axes, that the gyros read on average; bridged between samples.

    None where no gyro reads all three axes at once.
    """
    reading = None if sensors is None else sensors.of(GYRO)
    if sensors is None or reading is None:
        return None
    body = np.einsum("sab,tsb->tsa", sensors.rotation, reading)
    whole = all_finite(body)
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


def path_read(time: Array, rotation: Array, sensors: Sensors | None) -> tuple[Array, Array] | None:
    """A path (time, 3, 3) through the frames seen and its rate (time, 3), body axes, as sensors read it.

    rotation (time, 3, 3), NaN where not seen. From frame to frame about the axis of the shortest turn, by it
    and as many whole turns, up to half a turn a sample, as make the sensors read what they do beside biases
    that stay. None where no instrument that reads how the body stands reads between frames.
    """
    seen = np.asarray(np.isfinite(rotation).all((1, 2)))
    standing = [] if sensors is None else [i for i, one in enumerate(sensors.instruments) if not one.tells]
    if sensors is None or not standing or seen.sum() < 2:
        return None
    mine = np.isin(sensors.kind, standing)
    read = sensors.readings[:, sensors.used][:, mine]
    most = int(min(np.median(np.diff(np.flatnonzero(seen))) // 2, SHOWN_TURN // (2 * np.pi)))
    if not most or not np.isfinite(read[~seen]).any():
        return None
    t, R = time[seen], rotation[seen]
    last = np.clip(np.searchsorted(t, time, "right") - 1, 0, len(t) - 2)
    share = ((time - t[last]) / np.diff(t)[last])[:, None]
    turn = log(R[1:] @ R[:-1].swapaxes(1, 2))
    axis = turn / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), np.finfo(float).tiny)
    steady, nothing = sensors.started(rotation), np.zeros((len(time), 3))
    still = np.tile(np.eye(3), (len(time), 1, 1))
    tried = [turn + 2 * np.pi * count * axis for count in sorted(range(-most, most + 1), key=abs)]
    miss = np.empty((len(tried), len(turn)))
    for k, longer in enumerate(tried):
        along = exp(share * longer[last]) @ R[last]
        moved = Moved(along, nothing, nothing, nothing, 1.0, still, 0 * still, nothing, nothing)
        off = read - sensed(sensors, moved, steady).reading[:, mine]
        off = (off - np.nanmean(off[seen], 0)) ** 2 / sensors.noise_var[mine]
        miss[k] = np.bincount(last, np.nansum(off, 1), len(turn))
    best = np.stack(tried)[miss.argmin(0), np.arange(len(turn))]
    rate = np.einsum("tba,tb->ta", R[:-1], best / np.diff(t)[:, None])
    return exp(share * best[last]) @ R[last], np.asarray(rate[last])


def rate_read(time: Array, rotation: Array, sensors: Sensors | None) -> Array | None:
    """Angular velocity (time, 3), body axes: of gyros, else that of `path_read`; None where neither tells."""
    rate = gyro_rate(time, sensors)
    if rate is None and (path := path_read(time, rotation, sensors)) is not None:
        return path[1]
    return rate
