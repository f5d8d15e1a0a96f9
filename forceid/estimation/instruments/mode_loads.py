"""Loads on modes from accelerations of their amplitudes: oscillators of known frequency under Matern loads.

q'' is what accelerometers show, q'' + 2 b q' + w^2 q = f what is asked for. Both integrals of q'' drift, so f
has a prior: size and rate of a load of order one, mode by mode, by likelihood. What stays of f accelerates
nothing and is not told. Source: principal equations 4e.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from forceid.flight.channels import CHANNEL_SAMPLES, middle
from forceid.flight.elastic_spectra import DAMPING, FIRST_RATES
from forceid.flight.modes import chains
from forceid.flight.vibration import ModeState, Vibration
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.significance import TENTH


def loads_on_modes(
    time: Array, a: Array, cov: Array, frequency: Array, damping: Array | None, engine: Engine
) -> tuple[Array, Array]:
    """Loads f (time, mode) m/s2 on modes of unit modal mass and their covariance (time, mode, mode).

    a (time, mode) m/s2, NaN where not told, with noise of cov (time, mode, mode); frequency (mode,) rad/s;
    damping (mode,) over the critical one, None where it is not known.
    """
    a = a - np.nanmean(a, 0)
    part, modes = middle(len(time), CHANNEL_SAMPLES), len(frequency)
    each = [
        tuned(
            time[part], a[part, k], cov[part, k, k], float(frequency[k]),
            None if damping is None else float(damping[k]), for_tuning(engine),
        )
        for k in range(modes)
    ]  # fmt: skip
    damped, std, rate = (
        np.concatenate(a) for a in zip(*((p.damping, p.std, p.rate) for p in each), strict=True)
    )
    prior = Vibration(frequency, damped, std, rate)
    path = engine.smooth(model_of(time, cov, prior), a)
    at = slice(ModeState.LOAD, None, prior.states)
    return path.x[:, at], path.P[:, at, at]


def model_of(time: Array, cov: Array, prior: Vibration) -> StateSpace:
    """Accelerations of modes as a linear model: cov (time, mode, mode) of their noise."""
    F, Q, P0 = chains(prior, np.diff(time))
    modes = len(prior.rate)
    H = np.zeros((modes, modes, prior.states))
    H[np.arange(modes), np.arange(modes), :3] = prior.motion[:, 2]
    return StateSpace(F, Q, H.reshape(modes, -1), cov, np.zeros(len(P0)), P0)


def tuned(
    time: Array, a: Array, var: Array, frequency: float, ratio: float | None, engine: Engine
) -> Vibration:
    """The likeliest prior of one mode, of known damping ratio or none."""

    def prior(p: Array) -> Vibration:
        size, rate, damped = np.exp(p)
        own = damped if ratio is None else max(ratio, TENTH * DAMPING)
        one = np.ones(1)
        unit = Vibration(frequency * one, own * frequency * one, one, rate * frequency * one)
        return replace(unit, std=size / unit.load)

    def off(p: Array) -> float:
        value = engine.log_likelihood(model_of(time, var[:, None, None], prior(p)), a[:, None])
        return -float(value) if np.isfinite(value) else np.inf

    size = float(np.sqrt(max(np.nanmean(a**2), np.nanmean(var))))
    starts = [np.log([size, rate, DAMPING]) for rate in FIRST_RATES]
    first = min(starts, key=off)
    return prior(minimize(off, first, method="Nelder-Mead", options={"xatol": TENTH, "fatol": TENTH}).x)
