"""Up to which frequency gyros and accelerometers alone follow a load, from a rough look at it."""

from __future__ import annotations

import numpy as np

from forceid.estimation.loads.initial_guess import rough_priors
from forceid.flight.instruments import ACCELEROMETER, GYRO
from forceid.flight.model import Flight


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
