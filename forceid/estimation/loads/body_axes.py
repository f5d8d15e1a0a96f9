"""Loads that turn with the body: their priors along axes of the body, tuned on a flight already solved.

The load found under a prior along world axes shows the axes of the body along which it varies independently.
Along these, innovations under a prior there are as good as white, so that Whittle's likelihood finds order,
size and rate as it does along world axes; orders that it leaves in doubt are told apart by the exact one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.flight.channels import Channel, on_clock, search_box
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior, Tuned, channel_model
from forceid.flight.spectral_start import ENOUGH_SAMPLES, FIRST_ORDER, WHITENINGS
from forceid.flight.tuning import LEAK, ORDERS, in_doubt, natural, points_of, smoothest
from forceid.flight.whittle import Spectrum, is_even, ordinates
from forceid.kalman.building.lines import Line
from forceid.kalman.engines import Engine
from forceid.kalman.model import expand
from forceid.records import Array, Flags
from forceid.significance import OUTLIER, PATIENCE

FAINT = 1e-3  # of the load along the strongest axis: an axis that shows less begins the search with as much


def body_fixed_prior(
    channel: Channel,
    prior: LoadPrior,
    rotation: Array,
    load: Array,
    engine: Engine,
    orders: tuple[int, ...] = ORDERS,
    lines: tuple[Line, ...] = (),
    least: float = -np.inf,
) -> LoadPrior | None:
    """The prior of a load along axes of the body, beside lines, by the likelihood of what it drives.

    prior: of the same load along world axes; rotation (time, 3, 3) of the body and the load (time, 3) found
    under that prior, world axes, both at the channel's times; orders: that are tried. None where no prior is
    expected to be as likely as a logarithm `least`.
    """
    in_body = np.einsum("tba,tb->ta", rotation, load)
    about = in_body - in_body.mean(0)
    square, axes = np.linalg.eigh(about.T @ about / len(about))
    axes = axes * np.sign(np.linalg.det(axes))
    size = max(float(square[-1]), np.finfo(float).tiny)
    rough = np.sqrt(np.mean(np.gradient(about, channel.time, axis=0) ** 2) / max(np.mean(about**2), size / 3))
    rate = np.clip(rough, 1 / np.ptp(channel.time), 0.5 / np.median(np.diff(channel.time)))
    std = np.sqrt(np.maximum(square, FAINT**2 * size))
    fixed = replace(prior, axes=np.eye(3), body_axes=axes, lines=lines)
    search = BodySearch(channel, fixed, rotation, orders, engine)
    first = Matern(FIRST_ORDER, std, np.full(3, rate))
    return search.by_spectrum(first, least) if search.even else search.by_steps(first)


def channel_likelihood(channel: Channel, prior: LoadPrior, rotation: Array, engine: Engine) -> float:
    """Log-likelihood of a channel under a prior, whichever axes that holds along."""
    return float(engine.log_likelihood(channel_model(channel, prior, rotation), channel.moved))


@dataclass(frozen=True)
class BodySearch:
    """What the search along axes of the body looks at: a channel, and a prior whose kernel is to be found.

    rotation (time, 3, 3): of the body; orders: that are tried.
    """

    channel: Channel
    prior: LoadPrior
    rotation: Array
    orders: tuple[int, ...]
    engine: Engine

    @property
    def even(self) -> bool:
        """Whether the channel has ordinates: enough samples, on a clock that is about even."""
        enough = np.isfinite(self.channel.z).all(1).sum() >= ENOUGH_SAMPLES
        return bool(enough and is_even(on_clock(self.channel.time)[0]))

    def under(self, kernel: Matern) -> LoadPrior:
        """The prior with a kernel."""
        return replace(self.prior, tuned=Tuned(kernel))

    def value(self, kernel: Matern) -> float:
        """Log-likelihood of the channel under a kernel."""
        model = channel_model(self.channel, self.under(kernel), self.rotation)
        return float(self.engine.log_likelihood(model, self.channel.moved))

    def by_steps(self, first: Matern) -> LoadPrior:
        """The prior of a record that has no spectrum: as the load found is, but for level and rate."""
        best = bfgs_maximum(lambda by: self.value(first.moved(by)), np.zeros(2))
        return self.found(first.moved(best), self.value(first.moved(best)))

    def by_spectrum(self, first: Matern, least: float) -> LoadPrior | None:
        """The prior of the likeliest order, as Whittle's likelihood has its kernels; None below `least`."""
        edges = search_box(self.channel.time, self.channel.moved, self.channel.gain, 0)
        orders = np.array(self.orders)

        def box(side: int) -> Array:
            level, rate = edges[side]
            axis = np.stack([level + orders * rate, np.full(len(orders), rate), np.zeros(len(orders))], 1)
            return np.tile(axis[:, None], (1, 3, 1))

        low, high = box(0), box(1)
        at, kernel = self.orders.index(FIRST_ORDER), first
        for _ in range(WHITENINGS):
            spectrum, value = self.whitened(kernel)
            points, _, likely = spectrum.peaks(orders, (low, high), np.ones((3, 3), bool))
            promise = likely.sum(1) + float(spectrum.power.sum())
            if value + promise.max() < least:
                return None
            if promise[at] < PATIENCE:
                break
            kernel = Matern(FIRST_ORDER, *natural(points[at], FIRST_ORDER))
        told = dict(zip(self.orders, points, strict=True))
        kernels = {
            order: Matern(order, *natural(told[order], order))
            for order in in_doubt(dict(zip(self.orders, promise.tolist(), strict=True)))
        }
        values = {order: self.value(kernel) for order, kernel in kernels.items()}
        order = smoothest(values)
        return self.found(kernels[order], values[order])

    def found(self, kernel: Matern, value: float) -> LoadPrior:
        """The prior with a kernel, and how likely it is.

        The axes are known to about a hundredth, and by that much of it a load leaks to a still one.
        """
        strong = int(kernel.std.argmax())
        still = kernel.std < LEAK * kernel.std[strong]
        kernel = kernel.of(np.where(still, strong, np.arange(3))).scaled(np.where(still, LEAK, 1.0))
        return replace(self.prior, tuned=Tuned(kernel, log_likelihood=value))

    def whitened(self, kernel: Matern) -> tuple[Spectrum, float]:
        """Spectrum along axes of the body of what a kernel leaves of the channel, and its log-likelihood."""
        channel, clock = self.channel, self.channel.time
        along = self.under(kernel).axes_along(self.rotation)
        model = channel_model(channel, self.under(kernel), self.rotation)
        filtered = self.engine.filter(model, channel.moved)
        # the root that whitens is any; the symmetric one of the axes of the body turns with them
        W = expand(filtered.gains.W, filtered.gains.start, filtered.gains.time)
        U, _, Vt = np.linalg.svd(W @ along)
        ticks, v = on_clock(clock, np.einsum("tba,tb->ta", U @ Vt, filtered.innovation))
        seen: Flags = np.asarray(np.isfinite(v).all(1))
        v = np.where(seen[:, None], np.clip(v, -OUTLIER, OUTLIER), 0.0).T
        at = ordinates(len(ticks), float(np.ptp(ticks)) / (len(ticks) - 1), channel.color)
        power = np.add.reduceat(np.abs(np.fft.rfft(v)[:, 1:-1]) ** 2 / seen.sum(), at.first, axis=1)
        turning, w = self.prior.turning(clock, self.rotation), at.w[0]
        known = np.isfinite(channel.z).all(1)
        white = channel.var(np.eye(3))[known].mean() * len(ticks) / known.sum() * at.white
        drift = np.trace(channel.drift) / 3 * at.drift
        noise = white * turning.of_position(w) + drift * turning.of_momentum(w)
        blank = Spectrum(channel.gain, at.w, at.count, noise, power, noise)
        about = blank.about(points_of(kernel), np.array([kernel.order]), np.zeros(3))
        return about, float(filtered.log_likelihood)
