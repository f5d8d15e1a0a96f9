"""Readings that nothing else agrees with: markers exchanged back, spikes and frames taken out, and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from forceid.kalman.flight import FlightState
from forceid.kalman.flight_model import Flight
from forceid.kalman.robust import WILD, drop_wild, runs, unswap
from forceid.motion.spikes import spikes
from forceid.records import Array, Body, Flags, Motion

TRADED = (
    "markers traded places ({}): exchanged back {} times, first at {:.4g} s; look at the labels, and at what "
    "the exchange leaves"
)
NAMED = 4  # markers in a sentence
SPIKES = (
    "{} of {} marker readings rejected as spikes ({}), the first at {:.4g} s; look at these markers there"
)


def cleaned(body: Body, motion: Motion) -> tuple[Motion, tuple[str, ...]]:
    """The motion with markers in their places and without spikes, and what was done about it.

    >>> from forceid.records import Motion
    >>> cleaned(Body(), Motion(time=np.arange(3.0)))[1]
    ()
    """
    if motion.position is None:
        return motion, ()
    told = []
    position, traded = unswap(motion.position)
    if traded:
        names = sorted({body.node[t.channel] for t in traded})
        told.append(TRADED.format(", ".join(names), len(traded) // 2, motion.time[traded[0].sample]))
    off = spikes(position)
    if off.any():
        position = np.where(off[..., None], np.nan, position)
        worst = [f"{body.node[k]} {off[:, k].sum()}" for k in np.argsort(-off.sum(0)) if off[:, k].any()]
        several = ", ".join(worst[:NAMED]) + (" and others" if len(worst) > NAMED else "")
        seen = np.isfinite(motion.position).all(2).sum()
        told.append(SPIKES.format(off.sum(), seen, several, motion.time[off.any(1).argmax()]))
    return (replace(motion, position=position), tuple(told)) if told else (motion, ())


def wild_frames(
    flight: Flight, first: FlightState, solve: Callable[[Flight], FlightState]
) -> tuple[Flags, str]:
    """Frames (time,) that nothing else agrees with, and a sentence on them.

    A frame is dropped if its innovation is wild and, without such frames, no other one is. Where the
    wildness stays, it is not the frames but the motion: then none is dropped.
    """

    def again(dropped: Flags) -> Array:
        kept = np.where(dropped[:, 0], np.nan, 1.0)[:, None]
        center, rotation = flight.center * kept, flight.rotation * kept[..., None]
        return wildest(solve(replace(flight, center=center, rotation=rotation)))

    every = wildest(first)
    wild, ended = drop_wild(every, again)
    dropped, size = wild[:, 0], float(every.max())
    if not dropped.any():
        return dropped, ""
    when = flight.time[dropped][0]
    if not ended:
        return np.zeros_like(dropped), (
            f"innovations reach {size:.0f} sigma, first past {WILD:.0f} at {when:.4g} s: an impact "
            "faster than the prior follows, or markers that changed places; force and moment are blurred "
            "around such times"
        )
    alone = sum(length == 1 for _, length in runs(dropped))
    return dropped, (
        f"frames rejected as outliers: {dropped.sum()} ({alone} alone, {dropped.sum() - alone} in bursts), "
        f"the first at {when:.4g} s, up to {size:.0f} sigma off; look at the markers there"
    )


def wildest(state: FlightState) -> Array:
    """Largest innovation (time, 1) of every frame, in standard deviations; zero where nothing is seen."""
    return np.asarray(np.abs(np.nan_to_num(state.innovation)).max(1, keepdims=True))


def without_frames(motion: Motion, dropped: Flags) -> Motion:
    """The motion with nothing seen in some frames."""
    kept = np.where(dropped, np.nan, 1.0)
    gone = {
        name: value * kept.reshape(-1, *[1] * (value.ndim - 1))
        for name in ("position", "center", "orientation")
        if (value := getattr(motion, name)) is not None
    }
    return replace(motion, **gone)
