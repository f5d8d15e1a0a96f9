"""What slow errors of a measurement do to an estimate whose model takes them for white.

Errors of stated size but unstated correlation: the likelihood cannot tell slow ones from motion, and white
ones are the kindest guess. The smoother is linear, so its answer to one displaced sample tells what errors
of any correlation make of it. Source: the error covariance of a suboptimal linear smoother, Gelb (1974) 7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from forceid.kalman.model import Smoothed, StateSpace
from forceid.records import Array

RATES = np.geomspace(0.3, 300.0, 31)  # 1/s, of the correlation of errors that are tried


def slow_noise_cov(
    model: StateSpace, rows: Array, time: Array, std: float, smoother: Callable[[StateSpace, Array], Smoothed]
) -> Array:
    """Covariance (load, load) that errors of the channels add to smoothed rows @ x, at their worst speed.

    time (time,) s of the model's samples; rows (load, state); std: of an error that is alike from sample to
    sample over 1/rate seconds (Matern 1/2), independent over channels, at the rate that does most harm. In
    the interior of a record: from the middle of it.
    """
    middle, channels = len(time) // 2, model.H.shape[-2]
    kernel = np.empty((channels, len(rows), len(time)))
    still = replace(model, x0=np.zeros(len(model.x0)), u=None)
    for c in range(channels):
        z = np.zeros((len(time), channels))
        z[middle, c] = 1.0
        kernel[c] = rows @ smoother(still, z).x.T
    apart = np.abs(time[:, None] - time)
    found = [np.einsum("cat,ts,cbs->ab", kernel, np.exp(-rate * apart), kernel) for rate in RATES]
    return np.asarray(std**2 * max(found, key=np.trace))
