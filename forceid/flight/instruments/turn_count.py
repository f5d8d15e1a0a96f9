"""How far a body turned between two frames, by what sensors read on the way.

Frames show a turn up to whole turns, and alone the shortest is taken. Gyros read its rate. An instrument that
reads how the body stands tells one count of turns from another, where it reads in between.
"""

from __future__ import annotations

import numpy as np

from forceid.flight.instruments.dead_reckoning import gyro_rate
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import Sensors, sensed
from forceid.motion.free_turn import SHOWN, lengthened, momentum_between
from forceid.motion.pose import exp, log
from forceid.records import Array, Flags, Indices


def turns_read(time: Array, rotation: Array, sensors: Sensors | None) -> Array | None:
    """Whole turns (frame - 1,) from each frame seen to the next, beyond the shortest turn and about its axis.

    rotation (time, 3, 3), NaN where not seen. The count, of up to half a turn a sample, by which the sensors
    read what they do, beside biases that stay. None where no instrument that reads how the body stands reads
    between frames.
    """
    seen = np.asarray(np.isfinite(rotation).all((1, 2)))
    standing = [] if sensors is None else [i for i, one in enumerate(sensors.instruments) if not one.tells]
    if sensors is None or not standing or seen.sum() < 2:
        return None
    mine = np.isin(sensors.family, standing)
    read = sensors.readings[:, sensors.used][:, mine]
    most = int(min(np.median(np.diff(np.flatnonzero(seen))) // 2, SHOWN // (2 * np.pi)))
    if not most or not np.isfinite(read[~seen]).any():
        return None
    t, R = time[seen], rotation[seen]
    last, turn = frame_before(time, seen), log(R[1:] @ R[:-1].swapaxes(1, 2))
    share = ((time - t[last]) / np.diff(t)[last])[:, None]
    steady, nothing = sensors.started(rotation), np.zeros((len(time), 3))
    still = np.tile(np.eye(3), (len(time), 1, 1))
    counts = np.array(sorted(range(-most, most + 1), key=abs))
    miss = np.empty((len(counts), len(t) - 1))
    for k, count in enumerate(counts):
        turned = exp(share * lengthened(turn, count)[last]) @ R[last]
        moved = Moved(turned, nothing, nothing, nothing, 1.0, still, 0 * still, nothing, nothing)
        off = read - sensed(sensors, moved, steady).reading[:, mine]
        off = (off - np.nanmean(off[seen], 0)) ** 2 / sensors.noise_var[mine]
        miss[k] = np.bincount(last, np.nansum(off, 1), len(t) - 1)
    return np.asarray(counts[miss.argmin(0)], float)


def momentum_read(time: Array, rotation: Array, J: Array, h: Array, sensors: Sensors | None) -> Array:
    """Angular momentum (frame - 1, 3), world axes, from each frame seen to the next, of the turn read.

    J (time, 3, 3), h (time, 3) body axes; else as `turns_read`.
    """
    seen, turns = np.isfinite(rotation).all((1, 2)), turns_read(time, rotation, sensors)
    t, R, J, h = (a[seen] for a in (time, rotation, J, h))
    return momentum_between(t, R, J, h, 0.0 if turns is None else turns)[0]


def rate_read(time: Array, rotation: Array, sensors: Sensors | None) -> Array | None:
    """Angular velocity (time, 3), body axes: of gyros, else the mean from frame to frame by `turns_read`.

    None where neither tells.
    """
    rate = gyro_rate(time, sensors)
    if rate is not None:
        return rate
    turns = turns_read(time, rotation, sensors)
    if turns is None:
        return None
    seen = np.asarray(np.isfinite(rotation).all((1, 2)))
    R, last = rotation[seen], frame_before(time, seen)
    turn = lengthened(log(R[1:] @ R[:-1].swapaxes(1, 2)), turns) / np.diff(time[seen])[:, None]
    return np.asarray(np.einsum("tba,tb->ta", R[:-1], turn)[last])


def frame_before(time: Array, seen: Flags) -> Indices:
    """Of each sample (time,), the place of the gap between frames seen that it lies in, or next to."""
    return np.clip(np.searchsorted(time[seen], time, "right") - 1, 0, int(seen.sum()) - 2)
