"""Priors of about the size of the loads that sensors show, for a search to begin with."""

from __future__ import annotations

import numpy as np

from forceid.flight.channels import Start
from forceid.flight.instruments import ACCELEROMETER
from forceid.flight.instruments.dead_reckoning import reckoned
from forceid.flight.instruments.turn_count import rate_read
from forceid.flight.model import Flight
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned
from forceid.flight.smoother import steps_of
from forceid.flight.tuning import MIDDLE
from forceid.motion import apply
from forceid.records import Array

RATE = 20.0  # 1/s: where the search for the rate begins


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
        F = flight.mass * f[np.isfinite(f).all(2)]
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
