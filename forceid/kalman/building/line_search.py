"""Lines of a load, found in what a prior without them leaves unexplained.

A prior that falls smoothly with frequency takes them for noise. Against such a prior a coherent line is a
regression: its cosine and sine, sent through the same filter as the measurement, are its regressors, and
the evidence for it follows in closed form. Source: principal equations 4e (spin harmonics).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forceid.compiled import engine as compiled
from forceid.kalman.building.line_candidates import Candidate, highest_shown, local_level, winsorized
from forceid.kalman.building.lines import PER_CYCLE, Line
from forceid.kalman.model import Filtered, StateSpace, expand, same_at_all_times
from forceid.records import Array
from forceid.rounding import ITERATIONS, ROUNDED, SINGLE
from forceid.significance import NUMBER, PATIENCE

COHERENT = 1e-4  # bandwidth times record length of a line that keeps its phase
DECAYS, DRIFTS = (2.0, 6.0, 20.0), (0.1, 1.0, 10.0)  # the same of one that rings down, or drifts
AT_ONCE = 4  # lines that one look takes up, the tallest ones
ALONG = tuple(s for n in (1, 2, 3) for s in combinations(range(3), n))  # axes that a line may lie along
AMPLITUDES = 6  # amplitudes of a root: cosine and sine along each axis
ROOM = 40_000_000  # numbers held at a time, 320 MB


def whitened_lines(
    model: StateSpace,
    filtered: Filtered,
    time: Array,
    axes: Array,
    root: NDArray[np.complexfloating[Any, Any]],
) -> Array:
    """What unit lines from rest leave in whitened innovations: (time, channel, direction, root, 2).

    Arguments and roots as of `missed_lines`.
    """
    g = filtered.gains
    return missed_lines(model, filtered, time, axes, root, np.asarray(expand(g.W, g.start, g.time)))


def missed_lines(
    model: StateSpace,
    filtered: Filtered,
    time: Array,
    axes: Array,
    root: NDArray[np.complexfloating[Any, Any]],
    turned: Array,
) -> Array:
    """What a filter's prediction misses of unit lines from rest, turned by (time, channel, channel).

    (time, channel, direction, root, 2). model: the first three states move, the next three are the momentum
    along `axes` (columns, world), which the load changes; directions: world x, y, z; root (root,) 1/s: loads
    Re and -Im of exp(root t), the two states of a line at the first sample. In the loop that the filter
    closes: where a body turns about an axis that it leaves by itself, the motion alone would grow until
    rounding is all that is left of it.
    """
    F, H = (a[None] if a.ndim == 2 else a[:1] if same_at_all_times(a) else a for a in (model.F, model.H))
    gains, step = filtered.gains, np.diff(time)
    K = np.asarray(expand(gains.K, gains.start, gains.time))
    move, *loads = pushes(F, step, time, axes, root)
    if compiled is not None:
        missed = compiled.whitened(F, H, K, turned, move, np.ascontiguousarray(axes.T), *loads)
    else:
        missed = whitened_in_numpy((F, H, K, turned), move, axes.T, *loads)
    return np.moveaxis(np.asarray(missed).reshape(len(time), H.shape[1], len(root), 3, 2), 2, 3)


def pushes(
    F: Array, step: Array, time: Array, axes: Array, root: NDArray[np.complexfloating[Any, Any]]
) -> tuple[Array, Array, Array]:
    """How a load moves the first three states, (1 or step, 3, direction), and the integrals (step, 2 root) of
    lines that move them, and that change the momentum.
    """
    even = np.ptp(step) < SINGLE * step[0]
    turned = root * (step[:1] if even else step)[:, None]
    phase, grown = np.exp(root * (time[:-1] - time[0])[:, None]), np.expm1(turned)
    move = F[:, :3, 3:6] @ axes.T / (step[:1] if even and len(F) == 1 else step)[:, None, None]
    both = ((grown - turned) / root**2 * phase, grown / root * phase)
    moved, pushed = (np.stack([a.real, -a.imag], -1).reshape(len(step), -1) for a in both)
    return np.ascontiguousarray(move), moved, pushed


def whitened_in_numpy(
    filter_: tuple[Array, Array, Array, Array], move: Array, turn: Array, moved: Array, pushed: Array
) -> Array:
    """White errors (time, channel, root * direction * 2), as the compiled form works them out."""
    K, W = filter_[2:]
    F, H = (np.broadcast_to(a, (len(K), *a.shape[1:])) if len(a) == 1 else a for a in filter_[:2])
    move = np.broadcast_to(move, (len(moved), *move.shape[1:])) if len(move) == 1 else move
    error, d = np.empty((len(K), H.shape[1], 3 * moved.shape[1])), np.zeros((H.shape[2], 3 * moved.shape[1]))
    moved, pushed = (a.reshape(len(a), -1, 2) for a in (moved, pushed))
    for k in range(len(K)):
        error[k] = H[k] @ d
        if k < len(K) - 1:
            d = F[k] @ (d - K[k] @ error[k])
            d[:3] += np.einsum("ij,fq->ifjq", move[k], moved[k]).reshape(3, -1)
            d[3:6] += np.einsum("ij,fq->ifjq", turn, pushed[k]).reshape(3, -1)
    return np.asarray(W @ error)


def line_evidence(information: Array, vector: Array, axes: tuple[int, ...]) -> tuple[Array, Array]:
    """Log-likelihood (...) that lines on some axes gain, and the std (...) they share, that which gains most.

    information (..., axis, 2, axis, 2) and vector (..., axis, 2) of the amplitudes of cosine and sine. By
    expectation and maximization in the coordinates in which the amplitudes are known apart.
    """
    n, pick = 2 * len(axes), np.array(axes)
    among = information[..., pick, :, :, :][..., pick, :].reshape(*information.shape[:-4], n, n)
    known, turn = np.linalg.eigh(among)
    known = np.maximum(known, ROUNDED * known[..., -1:])
    some = known[..., -1] > 0
    known = np.where(some[..., None], known, 1.0)
    y = vector[..., pick, :].reshape(*vector.shape[:-2], n)
    y2 = np.where(some[..., None], (turn.swapaxes(-1, -2) @ y[..., None])[..., 0] ** 2, 0.0)
    var = (y2 / known**2).mean(-1, keepdims=True)
    some &= var[..., 0] > 0
    for _ in range(ITERATIONS):
        post = var / (1 + var * known)
        var = (post**2 * y2 + post).mean(-1, keepdims=True)
    post = var / (1 + var * known)
    gained = 0.5 * (post * y2 - np.log1p(var * known)).sum(-1)
    return np.where(some, gained, 0.0), np.where(some, np.sqrt(var[..., 0]), 0.0)


def find_line(
    model: StateSpace,
    filtered: Filtered,
    time: Array,
    axes: Array,
    candidate: Candidate,
    open_axes: tuple[int, ...] = (0, 1, 2),
) -> tuple[Line, ...]:
    """Lines near a candidate frequency along some of x, y, z, where the evidence is for them; else none.

    model: three channels, and the load without these lines; filtered: what it made of the record; open_axes:
    those that come in question. A line has to gain PATIENCE, a frequency that is not a harmonic's own as much
    again, each further axis NUMBER. Axes that would explain the record as well (a nutation shows a moment
    about either cross axis) share the line, and so does any with which it explains more.
    World axes, because supports, fields and jets that act in a line stand still in the laboratory: a free
    direction is wrong by an angle that the record fixes to some degrees only, and leaks onto axes that
    have no line.
    """
    span, center = float(np.ptp(time)), candidate.frequency
    innovation = filtered.innovation
    highest, v = highest_shown(time, innovation), winsorized(innovation)
    level = local_level(v)[round(2 * center * span)]
    sets = [along for along in ALONG if {*along} <= {*open_axes}]
    count = np.array([len(along) for along in sets])

    def gains(frequency: Array, decay: Array) -> tuple[Array, Array]:
        white = whitened_lines(model, filtered, time, axes, 2j * np.pi * frequency - decay)
        white = np.moveaxis(white, 3, 2).reshape(*v.shape, -1)
        white *= 1 / np.sqrt(level)[:, None]
        white = white.reshape(v.size, -1)
        each = (
            white[:, own : own + AMPLITUDES].T @ white[:, own : own + AMPLITUDES]
            for own in range(0, white.shape[1], AMPLITUDES)
        )
        information = np.reshape([*each], (-1, 3, 2, 3, 2))
        vector = ((v / np.sqrt(level)).ravel() @ white).reshape(-1, 3, 2)
        gained, std = np.moveaxis(np.array([line_evidence(information, vector, s) for s in sets]), 0, -1)
        return gained, std

    def best_of(frequency: Array, decay: Array) -> tuple[float, float, int, float, Array, Array]:
        frequency, decay = (a.ravel() for a in np.meshgrid(frequency, decay))
        possible = (frequency * span >= 1) & (frequency < highest)
        frequency, decay = frequency[possible], decay[possible]
        parts = np.array_split(np.arange(len(frequency)), 1 + len(frequency) * len(time) // (ROOM // 18))
        gained, std = map(np.concatenate, zip(*(gains(frequency[p], decay[p]) for p in parts), strict=True))
        price = np.where((frequency == center) & candidate.named, 0.0, PATIENCE)
        # one that does not keep its phase has a bandwidth to fit, and a kind to choose
        price += np.where(decay * span > COHERENT, 2 * NUMBER, 0.0)
        worth = gained - price[:, None] - PATIENCE - NUMBER * (count - 1)
        f, best = np.unravel_index(int(worth.argmax()), worth.shape)
        return float(frequency[f]), float(decay[f]), int(best), float(worth[f, best]), gained[f], std[f]

    off = np.arange(-PER_CYCLE, PER_CYCLE + 1) / PER_CYCLE / span
    at, decay, best, worth, gained, std = best_of(center + off, np.array([COHERENT, *DECAYS]) / span)
    if worth > 0 and (at != center or decay * span > COHERENT):
        finer = np.append(at + off / PER_CYCLE, center)
        at, decay, best, worth, gained, std = best_of(finer, decay * np.array([0.6, 0.8, 1.0, 1.25, 1.6]))
    if worth <= 0:
        return ()
    # those that explain it as well, and once there is a line, each that it is likelier with
    alike = count == count[best]
    alike &= gained > gained[best] - PATIENCE
    base = {axis for i in np.flatnonzero(alike) for axis in sets[i]}
    more = [i for i, along in enumerate(sets) if base <= {*along}]
    shared = max(more, key=lambda i: gained[i] - NUMBER * count[i])
    known = candidate.known and at == center
    size, loose = float(std[shared]), 0.0 if known or decay * span > COHERENT else 1 / PER_CYCLE / span
    each = np.eye(3)[list(sets[shared])]
    return tuple(Line(at, size, decay, along, driven=False, loose=loose) for along in each)


def let_drift(
    likelihood: Callable[[tuple[Line, ...]], float], lines: tuple[Line, ...], span: float
) -> tuple[Line, ...]:
    """Lines of one oscillation, driven and their phase free to drift, if the likelihood says so by e^2."""
    tried = [lines, *(tuple(replace(one, bandwidth=b / span, driven=True) for one in lines) for b in DRIFTS)]
    value = [likelihood(each) for each in tried]
    best = int(np.argmax(value))
    return tried[best] if value[best] > value[0] + 2 * NUMBER else lines
