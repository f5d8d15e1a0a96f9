"""The channels of an affine motion that loads drive, and priors of those loads along axes of the body."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, make_smoothing_spline

from forceid.config import Settings
from forceid.errors import DataError, EstimationError
from forceid.estimation.affine_fit import fit_affine
from forceid.estimation.inertia import inertia_of
from forceid.estimation.kinematics import marker_noise
from forceid.estimation.load_channels import tune_channel
from forceid.kalman.channels import Channel, driven, load_axes, load_chain, start_of, stretch
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.prior import LoadPrior
from forceid.kalman.tuning import ORDERS, OUTLIER, Tuned, smoothest, tune_loads
from forceid.pseudorigid.decomposition import polar
from forceid.records import Array, Recording

FEWEST = 12  # frames that a load on a turning body needs
THIN = 1e-8  # of the largest: a second moment so small is none
STIFFNESSES = 14  # of a spline that are tried
GRID, REACH, REFINED = (
    9,
    8.0,
    2,
)  # values tried of a rate or std, factor on a std either way, times looked closer


@dataclass(frozen=True)
class AffineChannels:
    """Four groups of three channels, world axes: the mass center with the fall removed, and F E V by columns.

    axes V (3, 3): reference axes in which the errors of the columns are independent while all markers are
    seen; second_moment E (3, 3) kg m2; rotation (time, 3, 3): a smooth path of the body's own axes, exact by
    definition; noise (time, 12, 12): of all channels, group by group; linked: their largest correlation
    between groups.
    """

    time: Array
    groups: tuple[Channel, ...]
    axes: Array
    second_moment: Array
    rotation: Array
    noise: Array
    linked: float


def affine_channels(recording: Recording, settings: Settings) -> AffineChannels:
    """Channels of a recording of markers. DataError where they do not fix F, or the body has no breadth."""
    body, motion = recording.body, recording.motion
    if motion.position is None or body.position is None:
        raise DataError("holds no markers", "/motion/position", "an affine motion shows in markers only")
    inertia = inertia_of(body)
    E = 0.5 * np.trace(inertia.tensor) * np.eye(3) - inertia.tensor
    size = np.linalg.eigvalsh(E)
    if not size[0] > THIN * size[-1]:
        raise DataError(
            f"has second moments {', '.join(f'{s:.2g}' for s in size)} kg m2, expected three above zero",
            "/body",
            "a body without breadth has no affine load across; use --model modal or rigid",
        )
    x, time = motion.position, motion.time - motion.time[0]
    stated = motion.noise_std | settings.noise_std
    sigma = stated.get("position") or marker_noise(motion.time, x)
    fit = fit_affine(x, body.position - inertia.center, sigma**2)
    if fit.plane:
        raise DataError(
            f"holds markers that spread along {fit.span.shape[1]} directions: F is known in their plane only",
            "/body/position",
            "give a marker off the plane, or use --model modal or rigid",
        )
    known = np.asarray(np.isfinite(fit.F).all((1, 2)))
    if known.sum() < FEWEST:
        raise EstimationError(
            f"shows the affine map in {known.sum()} frames, fewer than {FEWEST}",
            "the recording",
            "restore the markers, or give a longer record",
        )
    # of the frame that sees best
    best = int(np.nanargmin(np.where(known, np.trace(fit.cov[:, 1:, 1:], axis1=1, axis2=2), np.nan)))
    V = np.linalg.eigh(E @ fit.cov[best, 1:, 1:] @ E)[1]
    turn = np.zeros((4, 4))
    turn[0, 0], turn[1:, 1:] = 1.0, E @ V
    cov = np.where(known[:, None, None], turn.T @ fit.cov @ turn, np.diag(np.diag(turn.T @ turn)))
    z = np.concatenate([fit.center[..., None], fit.F @ E @ V], 2)
    z[..., 0] -= 0.5 * time[:, None] ** 2 * motion.gravity
    gain = (1 / inertia.mass, 1.0, 1.0, 1.0)
    eye, still = np.eye(3), np.zeros((3, 3))
    groups = tuple(Channel(time, z[..., B], gain[B], cov[:, B, B, None, None] * eye, still) for B in range(4))
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    linked = np.abs(cov / std[:, None] / std[..., None] - np.eye(4))[known].max()
    noise = np.einsum("tBC,ab->tBaCb", cov, eye).reshape(len(time), 12, 12)
    return AffineChannels(time, groups, V, E, smooth_axes(time, fit.F), noise, float(linked))


def smooth_axes(time: Array, F: Array) -> Array:
    """Rotations (time, 3, 3) near to those of F (time, 3, 3), NaN = not seen, along a smooth path.

    Any smooth path does: loads are only said to be smooth along it. By smoothing splines, alike for all
    entries, as stiff as foretells every other sample of the entry that varies most from those between.
    """
    known = np.isfinite(F).all((1, 2))
    t, entries = time[known], F[known].reshape(-1, 9)
    step = np.ptp(t) / (len(t) - 1)
    most = entries[:, entries.var(0).argmax()]
    turn = 2 * np.pi * np.geomspace(0.5 / np.ptp(t), 0.2 / step, STIFFNESSES)  # where a spline lets go
    stiffness = 1 / (turn**4 * step)

    def missed(lam: float) -> float:
        return float(
            ((make_smoothing_spline(t[::2], most[::2], lam=0.5 * lam)(t[1:-1:2]) - most[1:-1:2]) ** 2).sum()
        )

    lam = min(stiffness, key=missed)
    smooth = np.stack([make_smoothing_spline(t, column, lam=lam)(time) for column in entries.T], 1)
    return polar(smooth.reshape(-1, 3, 3))[0]


def tune_channels(channels: AffineChannels, engine: Engine) -> list[LoadPrior]:
    """Priors of the force, along world axes, and of the three columns of K along axes of the body.

    The columns are one body's: one order and one rate for all nine of their entries.
    """
    force, *columns = channels.groups
    priors = [tune_channel(force, (1.0, 1.0), (), engine=engine)]
    bodily = [in_body(column, channels.rotation) for column in columns]
    seen = np.isfinite(bodily[0].z).all(1)
    axes = [load_axes(w.time[seen], w.z[seen]) for w in bodily]
    z = np.concatenate([w.moved @ a for w, a in zip(bodily, axes, strict=True)], 1)
    var = np.concatenate([w.var(a) for w, a in zip(bodily, axes, strict=True)], 1)
    drift = np.concatenate([np.diagonal(a.T @ w.drift @ a) for w, a in zip(bodily, axes, strict=True)])
    tuned = tune_loads(channels.time, z, 1.0, var, drift, engine=engine)
    tuned = one_rate(tuned, channels.time, z, var, drift, engine)
    for B, column in enumerate(columns):
        own = slice(3 * B, 3 * B + 3)
        part = replace(tuned, std=tuned.std[own], rate=tuned.rate[own])
        priors.append(on_body(LoadPrior(part, axes[B], start_of(column.time, column.moved, 1.0)), column))
    return priors


def one_rate(tuned: Tuned, time: Array, z: Array, var: Array, drift: Array, engine: Engine) -> Tuned:
    """The prior with one rate for all axes of z (time, axis), as likely as can be; its order by evidence.

    Nine rates that a short record tells apart by chance cost more error than one that is not quite right
    for each.
    """
    axes, runs, likelihood = z.shape[1], stretch(z), for_tuning(engine).log_likelihood

    def values(order: int, rate: Array, std: Array) -> Array:
        """Log-likelihoods (rate, std, axis) of rates (rate,) and std (rate, std, axis)."""
        r, _, axis = (i.ravel() for i in np.indices(std.shape))
        total = np.zeros(std.size)
        for run in runs:
            y, t = z[run] - z[run][np.isfinite(z[run]).all(1)][0], time[run]
            chain = load_chain(order, std.ravel(), rate[r], start_of(t, y, 1.0))
            model = driven(chain, 1.0, var[run][:, axis], drift[axis], np.diff(t))
            total += likelihood(model, y[:, axis, None], OUTLIER)
        return total.reshape(std.shape)

    def searched(order: int) -> Tuned:
        rates = tuned.rate * np.sqrt(order / tuned.order)  # of as much power above as before
        ends = np.log([0.5 * rates.min(), 2 * rates.max()])
        at, level, value = float(ends.mean()), np.log(tuned.std), -np.inf
        wide, reach, ridge = 0.5 * np.ptp(ends), np.log(REACH), 0.0
        for _ in range(REFINED):
            grid = np.linspace(-1, 1, GRID)
            # likely are those of one level at high frequency: the faster, the smaller
            std = level + reach * grid[:, None] - ridge * wide * grid[:, None, None]
            found = values(order, np.exp(at + wide * grid), np.exp(std))
            k = int(found.max(1).sum(1).argmax())
            at, level = at + wide * grid[k], std[k][found[k].argmax(0), np.arange(axes)]
            value = float(found[k].max(0).sum())
            wide, reach, ridge = 0.35 * wide, 0.5 * reach, 0.7 * (order - 0.5)
        return Tuned(order, np.exp(level), np.full(axes, np.exp(at)), tuned.noise, False, value)

    tried = {order: searched(order) for order in ORDERS if order > 1}
    return tried[smoothest({order: found.log_likelihood for order, found in tried.items()})]


def on_body(prior: LoadPrior, channel: Channel) -> LoadPrior:
    """A prior of a load along axes of the body, as one of a channel in world axes."""
    start = start_of(channel.time, channel.moved, channel.gain)
    return replace(prior, axes=np.eye(3), carried=prior.axes, start=start)


def in_body(channel: Channel, rotation: Array) -> Channel:
    """The channel that the same load drives along the axes of the body: w'' = R^T z'', for tuning.

    By parts, w = R^T z - 2 int R'^T z + int int R''^T z: no derivative of what was measured. The noise of z
    enters as it is, and adds up by the second term; the third adds little more.
    """
    time, path = channel.time, CubicSpline(channel.time, rotation)
    seen = np.isfinite(channel.z).all(1)
    z = channel.moved
    filled = np.stack([np.interp(time, time[seen], axis[seen]) for axis in z.T], 1) if not seen.all() else z

    def summed(y: Array) -> Array:
        steps = 0.5 * (y[1:] + y[:-1]) * np.diff(time)[:, None]
        return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])

    def turned(times: int, of: Array) -> Array:
        return np.asarray(np.einsum("tba,tb->ta", path(time, times), of))

    w = turned(0, z) - 2 * summed(turned(1, filled)) + summed(summed(turned(2, filled)))
    rate = path(time, 1)
    var = np.trace(channel.noise_cov, axis1=1, axis2=2) / 3
    step = float(np.median(np.diff(time)))
    drift = 4 * step * np.einsum("t,tba,tbc->ac", var, rate, rate) / len(time)
    return Channel(time, w, channel.gain, channel.noise_cov, drift)
