"""A rough look at a load, by poses or by sensors: about how large it is, and up to which frequency seen."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.channels import angular_channel
from forceid.flight.channels import Start, lags, second_difference
from forceid.flight.instruments import ACCELEROMETER, GYRO
from forceid.flight.instruments.dead_reckoning import rate_read, reckoned
from forceid.flight.model import Flight
from forceid.flight.path.settling import steps_of
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.tuning import MIDDLE
from forceid.motion import apply
from forceid.records import Array, all_finite

RESOLVED = 0.1  # of a load: error at which it counts as followed
RATE = 20.0  # 1/s: where the search for the rate begins


def bandwidths(kin: Kinematics, gravity: Array, force: bool = True) -> tuple[float | None, float | None]:
    """Frequencies Hz up to which force and moment are followed to a tenth; None where nothing of it is seen.

    force: whether one can be identified at all, the moment where the rotation is seen.
    """
    reach: list[float | None] = [None, None]
    if force:
        seen = np.isfinite(kin.pose.center).all(1)
        time = kin.time[seen]
        path = kin.pose.center[seen] - 0.5 * (time - time[0])[:, None] ** 2 * gravity
        var = np.trace(kin.pose.cov[seen, :3, :3], axis1=1, axis2=2).mean() / 3
        reach[0] = bandwidth(time, path, float(var))
    if kin.attitude:  # for the mean shape
        T = len(kin.time)
        J, still = np.tile(kin.inertia.tensor, (T, 1, 1)), np.zeros((T, 3))
        ch = angular_channel(kin.time, kin.pose.rotation, kin.pose.cov[:, 3:, 3:], J, still)
        reach[1] = bandwidth(ch.time, ch.z, float(np.trace(ch.noise_cov, axis1=1, axis2=2).mean() / 3))
    return reach[0], reach[1]


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
        count = 0 if read is None else int(all_finite(read).any(0).sum())
        if read is None or not count:
            found.append(None)
            continue
        share = all_finite(read).mean()  # of the samples at which one of them reads
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


def rough_priors(flight: Flight, slow: bool = False) -> tuple[LoadPrior, LoadPrior]:
    """Priors of force and moment of about the size that the sensors show, for a search to begin with.

    slow: loads that change once over the record; by default as fast as hands and gusts make them.
    """
    sensors, time = flight.sensors, flight.time
    omega = rate_read(time, flight.rotation, sensors)
    assert sensors is not None
    assert omega is not None
    span, H = float(np.ptp(time)), np.einsum("tij,tj->ti", flight.inertia, omega) + flight.h
    R = reckoned(time, steps_of(flight, H), flight.rotation)  # a free body keeps R H, however far it turns
    T = apply(R.swapaxes(1, 2), np.gradient(apply(R, H), time, axis=0))
    alpha = np.linalg.solve(flight.inertia, (T - np.cross(omega, H))[..., None])[..., 0]
    F, specific = np.zeros((0, 3)), sensors.of(ACCELEROMETER)
    if specific is not None:
        pulled = np.einsum("sab,tsb->tsa", sensors.rotation, specific)
        swept = np.cross(alpha[:, None], sensors.position)
        swept = swept + np.cross(omega[:, None], np.cross(omega[:, None], sensors.position))
        f = pulled - swept
        F = flight.mass * f[all_finite(f)]
    once = np.pi / span
    rate = once if slow else max(RATE, once)
    return prior(F, 0.0, span, rate), prior(T, float(np.abs(H).max()), span, rate)


def prior(load: Array, momentum: float, span: float, rate: float) -> LoadPrior:
    """A prior of loads of the size of `load` (sample, 3), with momentum of about that size at the start."""
    size = float(np.sqrt(np.mean(load**2))) if load.size else 1.0
    size = size or 1.0
    first = (10 * max(momentum, size * span)) ** 2
    kernel = Matern(MIDDLE, np.full(3, size), np.full(3, rate))
    return LoadPrior(Tuned(kernel), np.eye(3), Start(1.0, first, (10 * size) ** 2))
