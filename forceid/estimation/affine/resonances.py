"""Swings of a body at frequencies where its loads are below the noise: lines along the axes of the body.

A stiff mode of the body resonances above the frequencies that a smooth prior follows, and its inner elastic
forces would pass for noise. In the spectrum of the whitened innovations it stands out; each axis then has a
resonator beside its Matern load. Source: principal equations 4e.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from forceid.estimation.affine.powers import Axes, Resonance, powers
from forceid.flight.channels import driven, load_chain, start_of
from forceid.flight.priors.protocol import Kernel
from forceid.kalman.building.process import resonator
from forceid.kalman.engines import Engine, for_tuning
from forceid.records import Array, Indices
from forceid.rounding import ITERATIONS
from forceid.significance import OUTLIER, PATIENCE

ASIDE = np.linspace(-1.0, 1.0, 5)  # bins that a line may be off its ordinate
WIDTHS = np.array([0.3, 1.0, 3.0, 10.0])  # bandwidths tried, times the length of the record
SIZES = np.geomspace(0.1, 3.0, 7)  # std tried, of that which the ordinate asks for


def find_resonances(kernel: Kernel, seen: Axes, engine: Engine) -> tuple[Resonance, ...]:
    """Swings that stand out of the noise where the prior is below it; none is the rule."""
    found: tuple[Resonance, ...] = ()
    value = likelihoods(kernel, seen, np.arange(seen.z.shape[1]), (), engine)
    for _ in range(ITERATIONS):
        p = powers(kernel, seen, engine, found)
        over = np.where(p.prior < p.noise, p.total / (p.prior + p.noise), 1.0)
        gain = np.where(over > 1, over - 1 - np.log(over), 0.0)
        k = int(gain.sum(1).argmax())
        price = PATIENCE + np.log(len(p.w))
        if gain[k].sum() < price:
            break
        apart = float(p.w[1] - p.w[0])
        size = np.sqrt(np.maximum(p.total[k] - p.noise[k], 1e-3 * p.noise[k]) * apart / np.pi)
        w, b = (a.ravel() for a in np.meshgrid(p.w[k] + ASIDE * apart, WIDTHS * apart / (2 * np.pi)))
        each = likely_with_line(
            kernel, seen, found, w[:, None], b[:, None], SIZES[:, None, None] * size, engine
        )
        gained = np.maximum(each.max(0) - value, 0.0)  # (line, axis)
        best = int(gained.sum(1).argmax())
        if gained[best].sum() < price:
            break
        std = np.where(gained[best] > 0, SIZES[each[:, best].argmax(0)], 0.0) * size
        found, value = (*found, Resonance(float(w[best]), float(b[best]), std)), value + gained[best]
    return found


def likely_with_line(
    kernel: Kernel, seen: Axes, found: tuple[Resonance, ...], w: Array, b: Array, std: Array, engine: Engine
) -> Array:
    """Log-likelihoods (size, line, axis) with one more line at w of bandwidth b and std, which broadcast."""
    w, b, std = np.broadcast_arrays(w, b, std)
    axis = np.broadcast_to(np.arange(std.shape[-1]), std.shape).ravel()
    lines = [(s.w, s.std[axis], s.bandwidth) for s in found] + [(w.ravel(), std.ravel(), b.ravel())]
    return likelihoods(kernel, seen, axis, lines, engine).reshape(std.shape)


def likelihoods(
    kernel: Kernel,
    seen: Axes,
    axis: Indices,
    lines: Sequence[tuple[ArrayLike, Array, ArrayLike]],
    engine: Engine,
) -> Array:
    """Log-likelihoods (model,) of axes (model,) under the prior and lines: frequency, std and bandwidth."""
    beside = [resonator(np.asarray(w) / (2 * np.pi), std, b) for w, std, b in lines]
    start = start_of(seen.time, seen.z, 1.0)
    chain = load_chain(kernel.of(axis).process, start, beside)
    model = driven(chain, 1.0, seen.noise_var[:, axis], seen.drift[axis], np.diff(seen.time))
    return np.asarray(for_tuning(engine).log_likelihood(model, seen.z[:, axis, None], OUTLIER))
