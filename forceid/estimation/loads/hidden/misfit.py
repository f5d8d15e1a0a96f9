"""By how much the innovations say that the claimed errors of force and moment are too small.

With spectral densities S of the load and N of the noise as a load, a smoother errs by S N / (S + N) at each
frequency. Whitened innovations of density E, one where the model is right, say that load and noise are E
times as strong there: the error is E times as large. So each frequency counts as much as it makes of the
error; the color of innovations where neither load nor claim is does not count. Source: principal equations
4e.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import chdtri

from forceid.estimation.loads.hidden.left_out import densities
from forceid.estimation.verdict.finding import FEW
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior
from forceid.records import Array
from forceid.significance import CHANCE, MEDIAN, OUTLIER


def shown_misfit(
    channels: Mapping[str, Channel],
    priors: Mapping[str, LoadPrior],
    time: Array,
    innovation: Array,
    turned: Mapping[str, Array | None],
) -> Array:
    """Variance (6,) of force and moment over that of their priors, at least; NaN where no innovations tell.

    time (time,) s; innovation (time, channel): whitened, of the pose first; turned: rotation (sample, 3, 3)
    of the body at the samples of a channel. At least: what chance makes in one record of a hundred is off.
    """
    found = np.full(6, np.nan)
    for first, name in ((0, "force"), (3, "moment")):
        own = innovation[:, first : first + 3]
        seen = np.isfinite(own).all(1) if own.shape[1] == 3 else np.zeros(len(time), bool)
        if name in channels and seen.sum() >= FEW:
            most, clock = OUTLIER * np.maximum(np.median(np.abs(own[seen]), axis=0) / MEDIAN, 1.0), time[seen]
            white = np.clip(own[seen], -most, most)
            frequency: Array = np.fft.rfftfreq(len(clock), float(np.median(np.diff(clock))))[1:].astype(float)
            power = np.abs(np.fft.rfft(white, axis=0)[1:]) ** 2 / len(clock)
            noise, smooth, axes = densities(channels[name], priors[name], frequency, turned.get(name))
            error = noise * smooth / (noise + smooth) @ (axes**2).T
            weight = error / np.maximum(error.sum(0), np.finfo(float).tiny)
            freedoms = 2 / np.maximum((weight**2).sum(0), np.finfo(float).tiny)
            found[first : first + 3] = (weight * power).sum(0) * freedoms / chdtri(freedoms, CHANCE)
    return found


def typical_variance(cov: Array) -> Array:
    """Variances (6,) of a covariance (time, 6, 6): what half of the samples have less of; NaN where none."""
    var = np.diagonal(cov, axis1=1, axis2=2)
    known = np.isfinite(var).any(0)
    return np.asarray(np.where(known, np.nanmedian(np.where(known, var, 0.0), axis=0), np.nan))
