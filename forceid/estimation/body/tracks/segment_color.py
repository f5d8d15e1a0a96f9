"""The color of the errors of segments, and the filter that their tracks went through at the source."""

from __future__ import annotations

from itertools import product

import numpy as np

from forceid.estimation.body.tracks.marker_errors import COLORS, MEMORIES, SPECTRAL
from forceid.estimation.body.tracks.source_filter import (
    BUTTERWORTH,
    CUTS_TRIED,
    OVER_LATER,
    RESTORED,
    spectrum,
)
from forceid.flight.color import Color, LowPassed
from forceid.records import Array
from forceid.significance import MEDIAN, PATIENCE, TENTH

NEARLY_NONE = np.geomspace(TENTH**4, 1.0, 17)  # white shares of the variance: smoothed tracks have none
OF_AN_OCTAVE = 16  # of its parts: the steepest filter means over one what it is in its middle, to a fiftieth
HIGHEST = 0.4  # cycles a sample up to which a filter is looked for: nearer to one half numbers are rounded


def color_of(gaps: Array, step: float) -> Color:
    """The color of gaps (time, joint, 3), each counted as if of one size, and every octave alike.

    No process of few numbers has the spectrum of the skin, and of all frequencies most are above those of any
    load: each octave has its say, so that it is right in all of them to about as much. By the likelihood of
    Whittle (1953).
    """
    n = len(gaps)
    flat = gaps.reshape(n, -1) / np.maximum(gaps.reshape(n, -1).std(0), np.finfo(float).tiny)
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    waves = np.fft.rfft((flat - taper @ flat / taper.sum()) * taper[:, None], axis=0)[2:-1]
    w: Array = np.asarray(2 * np.pi * np.fft.rfftfreq(n, step)[2:-1])
    power, weight = (np.abs(waves) ** 2).mean(1), 1 / w / (1 / w).sum()
    best, found = -np.inf, Color(COLORS[0], 1 / step, 0.0, step)
    for order in COLORS:
        for rate in np.geomspace(1 / (n * step), np.pi / step, 4 * MEMORIES):
            colored = Color(order, float(rate), 1.0, step).density(w)
            for white in NEARLY_NONE:
                shape = white + (1 - white) * colored
                value = -(weight @ np.log(shape)) - np.log(weight @ (power / shape))
                if value > best:
                    best, found = float(value), Color(order, float(rate), float(1 - white), step)
    return found


def source_of(gaps: Array, step: float, doubt: float) -> tuple[LowPassed, LowPassed] | None:
    """The filter that tracks went through, as the spectrum of gaps (time, joint, 3) shows it, and what
    undoing it leaves; None for none.

    Skin falls off by itself, but not as steeply. doubt: variance of the logarithm of errors in an octave,
    which is worth so many numbers; beyond e^PATIENCE a filter is likelier.
    """
    flat = gaps.reshape(len(gaps), -1)
    f, power = spectrum(flat / np.maximum(flat.std(0), np.finfo(float).tiny))
    behind = float(np.median(power[-SPECTRAL:]))
    hidden = np.flatnonzero(power <= OVER_LATER * behind)
    upto = min(float(f[hidden[0]]) if len(hidden) else HIGHEST, HIGHEST)
    clear = f < upto
    if clear.sum() < SPECTRAL:
        return None
    seen = f < HIGHEST
    f, power, clear = f[seen] / step, power[seen], clear[seen]
    which = np.unique((OF_AN_OCTAVE * np.log2(f / f[0])).astype(int), return_inverse=True)[1]
    each, octaves = 1 / f / (1 / f).sum(), np.log2(f[-1] / f[0])
    weight, among = np.bincount(which, each), np.bincount(which, each * clear) / each[clear].sum()
    f, power = (np.bincount(which, each * a) / weight for a in (f, power))
    w: Array = 2 * np.pi * f
    rates = np.geomspace(w[0], np.pi / step, 2 * MEMORIES)
    colored = np.array([Color(k, float(r), 1.0, step).density(w) for k, r in product(COLORS, rates)])
    white = NEARLY_NONE[:, None, None]
    shape = (white + (1 - white) * colored).reshape(-1, len(w))

    def likely(passed: Array) -> float:
        """With what came behind the filter; errors as large as they are where they stand out of that."""
        total = shape * passed
        total = total * ((power / total) @ among)[:, None] + behind
        return float((-(np.log(total) + power / total) @ weight).max())

    cuts = np.geomspace(f[0], upto / step, 2 * CUTS_TRIED)[1:-1]
    tried = [LowPassed(order, float(cut), step) for order in BUTTERWORTH for cut in cuts]
    value = [likely(one.power(f)) for one in tried]
    gain = (max(value) - likely(np.ones(len(f)))) * octaves / max(doubt, TENTH**2)
    if not gain > PATIENCE:
        return None
    return tried[int(np.argmax(value))], LowPassed(BUTTERWORTH[-1], min(upto, RESTORED) / step, step)


def scatter(var: Array) -> float:
    """Variance of the logarithm of variances (joint,), as half of them scatter: bad joints do not rule.

    >>> round(scatter(np.array([1.0, 2.0, 4.0, 0.0])), 2)
    1.06
    """
    logs = np.log(var[var > 0])
    return float((np.median(np.abs(logs - np.median(logs))) / MEDIAN) ** 2) if len(logs) else 0.0


def new_in(source: LowPassed | None) -> int:
    """Samples from one to the next that tells anything new after a filter: of its tail a tenth folds back."""
    if source is None:
        return 1
    highest = source.cut * (TENTH**-0.5 - 1) ** (0.5 / source.order)
    return max(int(0.5 / (highest * source.step)), 1)
