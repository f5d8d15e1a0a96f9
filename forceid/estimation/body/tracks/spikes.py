"""Readings that the markers beside them show to be wrong, and those that a limit cut off.

A spike is a single reading that nothing beside it agrees with; a reading is cut off where one extreme value
comes again and again and is never passed.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.tracks.noise_axes import at_rest
from forceid.estimation.body.tracks.rounding import grid_step
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.records import Array, Flags, all_finite
from forceid.rounding import SOLVED
from forceid.significance import WHOLE

PARTNERS = 8  # markers whose distance is looked at, of each
AROUND = (-3, -2, -1, 1, 2, 3)  # frames beside: a burst of up to two leaves their median alone
SEVERAL = 2  # distances that must agree on it: to a marker that is right, one other may be off
FAR = 6.0  # standard deviations by which a distance leaves that median
NORMAL = 1.4826  # standard deviations of a normal in its median absolute deviation
DROPS = 8  # readings of one frame that may be dropped one after the other
FEWEST = 4  # markers that tell which one is off
WILD_RATE = 100.0  # typical steps by which a rate leaves both the readings before it and those behind it
RATES_OFF = 0.01  # part of the readings of a gyro that may be: more are what the body does
FRAME_OFF, READINGS_OFF = 0.5, 0.2  # parts of a frame, and of all readings, that may be off
STUCK, STUCK_PART = 5, 0.002  # samples, and part of them, at one edge that chance does not bring there


def spikes(position: Array) -> Flags:
    """Readings (time, node) of marker tracks (time, node, 3) that are spikes, where four markers tell.

    Distances between markers do not feel how a body flies and turns, however fast. A reading is a spike if
    two of its distances leave the median of the frames beside by six standard deviations, of what the
    distance does from frame to frame on the whole and just there. A frame with more than half of its
    markers off is one in which the body deforms, and a record with more than a fifth of its readings off is
    none of spikes: there none is named.
    """
    seen = all_finite(position)
    found = np.zeros_like(seen)
    for _ in range(DROPS):  # of a frame the worst first: without it, those beside it are right
        more = spikes_once(np.where(found[..., None], np.nan, position))
        found |= more
        if not more.any():
            break
    found &= (found.sum(1) <= FRAME_OFF * seen.sum(1))[:, None]
    return found if found.sum() <= READINGS_OFF * seen.sum() else np.zeros_like(found)


def spikes_once(position: Array) -> Flags:
    """The worst of each frame's spikes (time, node) that marker tracks (time, node, 3) show."""
    seen = all_finite(position)
    found = np.zeros_like(seen)
    ever = np.flatnonzero(seen.any(0))
    position, T, n = position[:, ever], len(position), len(ever)
    partners = np.arange(1, min(n - 1, PARTNERS) + 1)
    if n < FEWEST or len(AROUND) >= T:
        return found
    apart = position[:, :, None] - position[:, (np.arange(n)[:, None] + partners) % n]
    d = np.sqrt(np.einsum("tnka,tnka->tnk", apart, apart))
    jump, wide = (np.abs(d[k:-k] - 0.5 * (d[2 * k :] + d[: -2 * k])) for k in (1, 2))  # alike if white
    usual = NORMAL * np.maximum(median(jump[None])[0], median(wide[None])[0])
    scale = np.maximum(usual, SOLVED * np.nan_to_num(d).max(initial=0.0))
    leaps = np.pad(jump > 0.5 * FAR * scale, ((1, 1), (0, 0), (0, 0)))
    around = leaps.copy()
    around[1:] |= leaps[:-1]
    around[:-1] |= leaps[1:]
    at, marker, other = np.nonzero(around)
    beside = at[:, None] + AROUND
    near = d[beside.clip(0, T - 1), marker[:, None], other[:, None]]
    near[(beside < 0) | (beside >= T)] = np.nan
    middle = median(near)
    local = NORMAL * median(np.abs(near - middle[:, None]))
    off = np.abs(d[at, marker, other] - middle) > FAR * np.fmax(local, scale[marker, other])
    count = np.zeros((T, n), int)
    np.add.at(count, (at[off], marker[off]), 1)
    found[:, ever] = (count >= SEVERAL) & (count == count.max(1, keepdims=True))
    return found & seen


def off_the_shape(y: Array, basis: Array) -> Flags:
    """Readings (time, marker) of which what no rigid motion makes leaves that of the frames beside.

    y (time, freedom) m, NaN in frames not whole; basis (3 marker, freedom) of it. Smaller spikes show
    here than in two distances. A spike of one marker that would be as good a spike of another takes both
    readings. Else as of `spikes`.
    """
    found = np.zeros((len(y), len(basis) // 3), bool)
    whole = np.asarray(np.isfinite(y).all(1))
    if len(AROUND) >= len(y) or not y.shape[1] or not whole.any():
        return found
    _, size, along = np.linalg.svd(basis.reshape(-1, 3, basis.shape[1]), full_matrices=False)
    each = (size > SOLVED * size[:, :1])[..., None] * along

    def gains(left: Array) -> Array:
        along = left @ each.reshape(-1, each.shape[2]).T
        return np.asarray((along.reshape(len(left), *each.shape[:2]) ** 2).sum(2))

    jump, wide = (y[k:-k] - 0.5 * (y[2 * k :] + y[: -2 * k]) for k in (1, 2))  # alike if white
    some = slice(None, None, max(1, len(y) // CHANNEL_SAMPLES))
    sizes = [np.abs(one[some][np.isfinite(one[some])]) for one in (jump, wide)]
    usual = NORMAL * max(float(np.median(one)) if len(one) else 0.0 for one in sizes)
    usual = max(usual, SOLVED * float(np.nan_to_num(np.abs(y)).max()))
    at = np.flatnonzero((gains(np.nan_to_num(jump)) > 0.5 * (FAR * usual) ** 2).any(1)) + 1
    beside = at[:, None] + AROUND
    known = (beside >= 0) & (beside < len(y)) & whole[beside.clip(0, len(y) - 1)]
    # what moves leaves a median of one side
    between = whole[at] & (known.reshape(len(at), 2, len(AROUND) // 2).sum(2) >= SEVERAL).all(1)
    at, beside, known = at[between], beside[between], known[between]
    if not len(at):
        return found
    near = np.where(known[..., None], y[beside.clip(0, len(y) - 1)], np.nan)
    middle = median(near)
    local = NORMAL * median(np.abs(near - middle[:, None]).reshape(len(at), -1, 1))
    left, drops = (y[at] - middle) / np.maximum(local, usual), np.zeros(len(at))
    for _ in range(min(DROPS, len(each))):
        gain = gains(left)
        worst = gain.argmax(1)
        off = gain[np.arange(len(at)), worst] > FAR**2
        if not off.any():
            break
        found[at[off]] |= gain[off] >= WHOLE * gain[off].max(1, keepdims=True)
        drops += off
        own = each[worst[off]]
        left[off] -= np.einsum("tif,tig,tg->tf", own, own, left[off])
    # where those that are left are off too, it is the frame
    frame = (left**2).sum(1) > FAR**2 + np.maximum(y.shape[1] - 3 * drops, 0.0)
    found[at[frame | (drops > max(FRAME_OFF * len(each), 1.0))]] = False
    return found if found.sum() <= READINGS_OFF * whole.sum() * len(each) else np.zeros_like(found)


def wild_rates(rate: Array) -> Flags:
    """Readings (time, sensor) of gyros (time, sensor, 3) that are spikes: far from all beside them.

    A body turns on after a blow, so its rate steps; to go up and come back within a sample or two takes two
    blows that cancel. One is a spike if it leaves the median of five by a hundred steps of a typical sample.

    >>> w = np.random.default_rng(0).standard_normal((90, 1, 3)).cumsum(0)
    >>> w[40, 0, 1] += 500
    >>> np.flatnonzero(wild_rates(w))
    array([40])
    """
    found = np.zeros(rate.shape[:2], bool)
    if len(rate) <= len(AROUND):
        return found
    wide = np.pad(rate, ((2, 2), (0, 0), (0, 0)), constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(wide, 5, 0).transpose(0, 3, 1, 2)
    off = np.linalg.norm(rate - median(around), axis=2)
    step = median(np.linalg.norm(np.diff(rate, axis=0), axis=2)[None])[0]
    found = np.nan_to_num(off) > WILD_RATE * np.maximum(
        step, SOLVED * np.abs(np.nan_to_num(rate)).max(initial=0.0)
    )
    return np.asarray(found & (found.mean(0) <= max(RATES_OFF, 1 / len(rate))))


def median(a: Array) -> Array:
    """Median over the second axis, without NaN; zero where all are."""
    ordered, most = np.sort(np.ascontiguousarray(np.moveaxis(a, 1, -1))), a.shape[1]  # NaN last
    seen = np.isfinite(ordered)
    if most and seen.all():
        return np.asarray(0.5 * (ordered[..., (most - 1) // 2] + ordered[..., most // 2]))
    count = seen.sum(-1)
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(np.maximum(count, 1) // 2, most - 1)
    pick = [np.take_along_axis(ordered, k[..., None], -1)[..., 0] for k in (low, high)]
    return np.asarray(np.where(count > 0, 0.5 * (pick[0] + pick[1]), 0.0))


def clipped(position: Array) -> tuple[Flags, str, float]:
    """Readings (time, node) of tracks (time, node, 3) that stick to an edge; axis and edge of the worst.

    Where a limit, of the volume or of a sensor, cut them off, the markers were elsewhere.

    >>> x = np.random.default_rng(0).standard_normal((90, 4, 3)).cumsum(0)
    >>> flags, axis, edge = clipped(np.minimum(x, [2.5, np.inf, np.inf]))
    >>> bool((flags == (x[..., 0] >= 2.5)).all()), axis, edge
    (True, 'x', 2.5)
    """
    found, most, where, at = np.zeros(position.shape[:2], bool), 0, "", np.nan
    if grid_step(position):
        return found, where, at
    rest = at_rest(position)
    for axis, name in enumerate("xyz"):
        values = position[..., axis]
        seen = np.isfinite(values)
        edges = np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)
        each = [(values == edge) & ~rest[:, axis] for edge in edges]
        if max(stuck.sum() for stuck in each) < 2:
            continue
        inner = values[seen & ~np.isin(values, edges)]
        # of readings of which no other two are alike, no two meet at an edge either
        few = 1 if len(np.unique(inner)) == len(inner) else max(STUCK, STUCK_PART * seen.sum())
        for edge, stuck in zip(edges, each, strict=True):
            if stuck.sum() > few:
                found |= stuck
                if stuck.sum() > most:
                    most, where, at = int(stuck.sum()), name, float(edge)
    return found, where, at
