"""What a load that turns with the body, and hardly varies there as far as its prior says, may do unseen.

In axes of the world it swings at the spin, where a spectrum shows it; slow along an axis of the body it makes
too few cycles in a record for one. So each candidate is weighed by the exact likelihood of the channel, and
the claim is the variance of their mixture: see `slow_load`, whose stretches stand in the world.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.loads.hidden.slow_load import MOST_CYCLES
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.tuning import LEAK
from forceid.records import Array, Flags
from forceid.significance import CHANCE, PATIENCE

TIMES = 2.0  # from one size of a load to the next: a sigma or two of what a likelihood tells of it
SIZES = 10  # of them at most: the last is five hundred times the first
CYCLES = (
    1.0,
    0.5 * MOST_CYCLES,
)  # in a record, of loads that are tried: as a trend, and as fast as is slow


def slow_turning_growth(found: Whitened, claimed: Array, slow: Flags) -> Array:
    """Factors (axis,), one at least, on the claimed deviations of loads along the axes that are `slow`.

    claimed (axis,): variances.
    """
    prior, growth, span = found.prior, np.ones(3), float(np.ptp(found.channel.time))
    edge = len(found.channel.time) // 8
    inner = slice(edge, len(found.channel.time) - edge)
    own, (load, var) = found.likelihood(prior), found.smoothed(prior)
    least = LEAK * float(prior.kernel.std.max())
    for axis in np.flatnonzero(slow):
        tried = [(0.0, prior)]
        for cycles in CYCLES:
            before = -np.inf
            for size in max(np.sqrt(claimed[axis]), least) * TIMES ** np.arange(SIZES):
                other = of_axis(prior, int(axis), size, 2 * np.pi * cycles / span)
                gain = found.likelihood(other) - own
                tried.append((gain, other))
                if gain < before and gain < -PATIENCE:
                    break
                before = gain
        gains = np.array([one for one, _ in tried])
        weight = np.exp(gains - gains.max()) / np.exp(gains - gains.max()).sum()
        mixed = 0.0
        for share, (_, other) in zip(weight, tried, strict=True):
            if share > CHANCE / len(tried):
                there, spread = found.smoothed(other)
                mixed += share * float((spread + (there - load) ** 2)[inner, axis].mean())
        ratio = mixed / float(var[inner, axis].mean())
        growth[axis] = np.sqrt(ratio) if ratio > 1 else 1.0  # also where rounding swamps a variance
    return growth


def of_axis(prior: LoadPrior, axis: int, std: float, rate: float) -> LoadPrior:
    """The prior with another size and rate along an axis."""
    kernel = prior.kernel
    assert isinstance(kernel, Matern)
    at = np.arange(3) == axis
    return prior.with_kernel(
        Matern(kernel.order, np.where(at, std, kernel.std), np.where(at, rate, kernel.rate))
    )
