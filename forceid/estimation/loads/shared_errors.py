"""Errors that all markers share, as of cameras that sway: they move the mass center, and leave the shape.

No number that markers have beside the pose shows them. They show in the mass center alone, as errors that do
not average out: a walk that is held, s^2 of variance and a rate 1/s at which it forgets. A load makes a
motion that falls by w^-6 at the least, and errors by w^-2: the spectrum tells them apart, but where both are
as slow as the record is long. Source: theory of one model, 3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.flight.channels import Channel, load_axes, runs_of
from forceid.flight.color import SharedErrors
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.spectral_start import ENOUGH_SAMPLES, FIRST_ORDER, Channels, Sight, first_sight
from forceid.flight.tuning import FREE, ORDERS, search_boxes
from forceid.kalman.engines import Engine
from forceid.records import Array
from forceid.significance import NUMBER, PATIENCE

SHARES_TRIED = 6  # sizes, and rates, of the first grid
CLOSER_BY = np.array([-1.0, 0.0, 1.0])  # of a step, about the best, in a grid of half the steps
SMALLER = np.geomspace(1.0, 0.1, 9)  # shares of the likeliest size, a third of an octave apart
ROUNDS = 4  # grids: the last has steps of an eighth of the first one, in logarithm
SHARED_SIZES = (0.1, 300.0)  # variance over that of the mass center by its markers alone, from hardly seen on
RAISED = 1.02  # factor on the noise of the mass center that 1e3 samples tell from one


def may_be_shared(prior: LoadPrior) -> bool:
    """Whether the prior of a force asks for errors that markers do not show, or for a force as rough."""
    return bool(prior.tuned.noise.max() > RAISED or getattr(prior.kernel, "order", ORDERS[-1]) <= FIRST_ORDER)


def shared_errors(channel: Channel, engine: Engine) -> SharedErrors | None:
    """The least errors of the mass center, beside those of its markers, that follow themselves.

    channel: of the force, under the errors of markers alone. None where none are e^PATIENCE likelier, or
    where they come and go: then it is a load.
    """
    seen = np.isfinite(channel.z).all(1)
    axes, step = load_axes(channel.time[seen], channel.z[seen]), float(np.median(np.diff(channel.time)))
    sight = seen_alone(channel, axes, engine)
    if sight is None:
        return None
    alone: Array = sight.spectrum.noise
    without = likeliest_load(sight, alone)[0]
    sizes = float(np.median(channel.var(axes)[seen].mean(1))) * np.geomspace(*SHARED_SIZES, SHARES_TRIED)
    rates = np.geomspace(2 * np.pi / np.ptp(channel.time), 1 / step, SHARES_TRIED)
    closer = np.array([sizes[1] / sizes[0], rates[1] / rates[0]])

    def likeliest(
        tried: list[SharedErrors], sight: Sight, near: Array | None
    ) -> tuple[SharedErrors, float, Array]:
        each = [likeliest_load(sight, alone + one.density(sight.spectrum.w[0]), near) for one in tried]
        k = int(np.argmax([value for value, _ in each]))
        return tried[k], *each[k]

    load: Array | None = None  # under the errors that are best so far, from which those near to it are found
    for turn in range(ROUNDS):
        grid = [SharedErrors(float(np.sqrt(s)), float(r), step) for s in sizes for r in rates]
        best, found, load = likeliest(grid, sight, load)
        if turn == 0:
            if found < without + PATIENCE + 2 * NUMBER:
                return None
            sight = seen_alone(channel, axes, engine, best) or sight
        closer = closer**0.5
        sizes, rates = (at * by**CLOSER_BY for at, by in zip((best.std**2, best.rate), closer, strict=True))
    fast, least = best.std**2 * best.rate, best  # what is fast of them is what the record fixes
    for std in best.std * SMALLER:  # slow errors that the record does not ask for stay loads
        rates = fast / std**2 * np.geomspace(0.5, 2.0, SHARES_TRIED)
        tried = [SharedErrors(float(std), float(r), step) for r in rates]
        smaller, likely, load = likeliest(tried, sight, load)
        if likely < found - PATIENCE:
            break
        least = smaller
    return least if lasting(channel, axes, engine, least) else None


def seen_alone(
    channel: Channel, axes: Array, engine: Engine, shared: SharedErrors | None = None
) -> Sight | None:
    """The channel along axes as whitened by the likeliest load of one order; None of too few samples.

    shared: errors that the noise of that has.
    """
    z, var = channel.z @ axes, channel.var(axes)
    boxes = search_boxes(channel.time, z, channel.gain, z.shape[1])
    color = None
    if shared is not None:
        var = var + shared.std**2
        color = shared.beside(var)
    looked = Channels(runs_of(channel.time, z, var), channel.gain, np.zeros(3), (), color, boxes, engine)
    return first_sight(channel.time, z, looked, (0.0, 0.0)) if looked.even else None


def lasting(channel: Channel, axes: Array, engine: Engine, shared: SharedErrors) -> bool:
    """Whether each half of a record is likelier with the errors than without: cameras sway all the time."""
    count = len(channel.time)
    most = max(-(-count // 2), ENOUGH_SAMPLES)  # halves of a short record overlap
    for half in (slice(0, most), slice(max(count - most, 0), None)):
        time, z, cov = (a[half] for a in (channel.time, channel.z, channel.noise_cov))
        sight = seen_alone(replace(channel, time=time, z=z, noise_cov=cov), axes, engine)
        if sight is None:
            return False
        alone = sight.spectrum.noise
        noise = alone + shared.density(sight.spectrum.w[0])
        if likeliest_load(sight, noise)[0] < likeliest_load(sight, alone)[0]:
            return False
    return True


def likeliest_load(sight: Sight, noise: Array, near: Array | None = None) -> tuple[float, Array]:
    """Whittle's likelihood of the likeliest load under a noise of density (axis, group), and its points.

    Points (order, axis, 2) of a search; near: such of a noise that differs little, to go on from.
    """
    under = replace(sight, spectrum=replace(sight.spectrum, noise=noise))
    level, together = np.zeros(len(noise)), np.ones((len(noise),) * 2, bool)
    points, _, value = under.peaks((FIRST_ORDER, FREE), (level, level), together, near)
    return float(value.sum(1).max()), points
