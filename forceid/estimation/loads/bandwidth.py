"""Up to which frequency force and moment can be followed, from a rough look at poses, or at sensors alone."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.angular_channel import angular_channel
from forceid.estimation.loads.initial_guess import rough_priors
from forceid.flight.channels import lags, second_difference
from forceid.flight.instruments import ACCELEROMETER, GYRO
from forceid.flight.model import Flight
from forceid.records import Array

RESOLVED = 0.1  # of a load: error at which it counts as followed


def bandwidths(kin: Kinematics, gravity: Array, force: bool = True) -> tuple[float | None, float | None]:
    """Frequencies Hz up to which force and moment are followed to a tenth; None where nothing of it is seen.

    force: whether one can be identified at all, the moment where the rotation is seen.
    """
    return (
        bandwidth(*center_track(kin, gravity)) if force else None,
        bandwidth(*angular_track(kin)) if kin.attitude else None,
    )


def center_track(kin: Kinematics, gravity: Array) -> tuple[Array, Array, float]:
    """Times, mass center with the fall removed (time, 3), and its noise variance."""
    seen = np.isfinite(kin.pose.center).all(1)
    time = kin.time[seen]
    var = np.trace(kin.pose.cov[seen, :3, :3], axis1=1, axis2=2).mean() / 3
    return time, kin.pose.center[seen] - 0.5 * (time - time[0])[:, None] ** 2 * gravity, float(var)


def bandwidth(time: Array, z: Array, noise_var: float) -> float | None:
    """Frequency Hz up to which a tenth of the second derivative of z (time, 3) stands above the noise.

    White noise of density r = sigma^2 dt gives z'' an error of sqrt(2 r (2 pi)^4 f^5 / 5) in the band up
    to f; the size of z'' is what second differences show at the lag where it stands out most.
    """
    step = float(np.median(np.diff(time)))
    sizes = [0.0]
    for lag in lags(z):
        d = second_difference(time, z, lag)
        noise = 6 * noise_var / (lag * step) ** 4
        power = float((d**2).mean()) if len(d) else 0.0
        if power > noise * (1 + 4 / np.sqrt(max(len(d), 1))):
            sizes.append(power - noise)
    size = float(np.sqrt(max(sizes)))
    if size == 0.0:
        return None
    f = (5 * (RESOLVED * size) ** 2 / (2 * noise_var * step * (2 * np.pi) ** 4)) ** 0.2
    return float(min(f, 0.5 / step))


def angular_track(kin: Kinematics) -> tuple[Array, Array, float]:
    """Times, integrated angular momentum and its noise variance, for the mean shape."""
    T = len(kin.time)
    J = np.tile(kin.inertia.tensor, (T, 1, 1))
    ch = angular_channel(kin.time, kin.pose.rotation, kin.pose.cov[:, 3:, 3:], J, np.zeros((T, 3)))
    return ch.time, ch.Y, float(np.trace(ch.noise_cov, axis1=1, axis2=2).mean() / 3)


def sensed_bandwidths(flight: Flight, resolved: float) -> tuple[float | None, float | None]:
    """Frequencies Hz up to which force and moment are followed to `resolved` of their size; None for none.

    White noise of standard deviation s at steps dt, averaged over the sensors, gives a force m a an error of
    m s sqrt(2 f dt) in the band up to f, and a moment J w' one of J s sqrt(2 dt (2 pi)^2 f^3 / 3).
    """
    sensors = flight.sensors
    assert sensors is not None
    step, inertia = float(np.median(np.diff(flight.time))), float(np.trace(flight.inertia[0]) / 3)
    found: list[float | None] = []
    kinds, gains = (ACCELEROMETER, GYRO), (flight.mass, inertia)
    for one, prior, gain in zip(kinds, rough_priors(flight), gains, strict=True):
        read = sensors.of(one)
        count = 0 if read is None else int(np.isfinite(read).all(2).any(0).sum())
        if read is None or not count:
            found.append(None)
            continue
        share = np.isfinite(read).all(2).mean()  # of the samples at which one of them reads
        noise = gain * float(sensors.noise_std[sensors.instruments.index(one)].mean()) / np.sqrt(count)
        raw = noise / step if one is GYRO else noise * np.sqrt(count)  # of the rough look itself
        power = float(prior.kernel.std.max()) ** 2 - raw**2
        density = noise**2 * step / max(float(share), 1e-9)
        if power <= 0:
            found.append(None)
            continue
        level = resolved**2 * power / (2 * density)
        f = (3 * level / (2 * np.pi) ** 2) ** (1 / 3) if one is GYRO else level
        found.append(float(min(f, 0.5 / step)))
    return found[0], found[1]
