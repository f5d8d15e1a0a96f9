"""Errors that are larger in some frames than in others, as what no motion makes shows frame by frame.

The variance of a frame is drawn from an inverse gamma distribution, so its numbers are those of Student's t
(Lange, Little and Taylor, J. Am. Stat. Assoc. 84 (1989) 881).
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln

from forceid.records import Array
from forceid.rounding import SINGLE
from forceid.significance import PATIENCE

FREEDOMS = np.geomspace(1.0, 64.0, 13)  # of Student's t that are tried: beyond, it is as good as normal
SCALE_ROUNDS = 100  # of the fixed point of the scale at most: it gains a digit in some ten


def loudness(y: Array) -> Array | None:
    """Variance (time,) of the errors of every frame, from numbers y (time, number), NaN in frames not whole.

    There it is the mean. None unless frames of which some are louder are e^PATIENCE times as likely.

    >>> rng = np.random.default_rng(0)
    >>> y = rng.standard_normal((300, 12))
    >>> loudness(y) is None
    True
    >>> y[::10] *= 4
    >>> found = loudness(y)
    >>> (found[::10] > 3 * found[1::10]).all()
    np.True_
    """
    whole = np.asarray(np.isfinite(y).all(1))
    square, d = (y[whole] ** 2).sum(1), y.shape[1]
    if not len(square) or not square.all():
        return None
    mean = float(square.mean()) / d
    best = -0.5 * d * len(square) * (np.log(2 * np.pi * mean) + 1) + PATIENCE
    found = None
    for nu in FREEDOMS:
        scale = mean
        for _ in range(SCALE_ROUNDS):
            before, scale = scale, float(((nu + d) / (nu + square / scale) * square).mean()) / d
            if abs(scale - before) < SINGLE * scale:
                break
        each = -0.5 * (nu + d) * np.log1p(square / (nu * scale)) - 0.5 * d * np.log(np.pi * nu * scale)
        value = float(each.sum()) + len(square) * float(gammaln(0.5 * (nu + d)) - gammaln(0.5 * nu))
        if value > best:
            best, found = value, (scale * nu + square) / (nu + d - 2)
    if found is None:
        return None
    out = np.full(len(y), found.mean())
    out[whole] = found
    return out
