"""Readings that nothing else agrees with: markers exchanged back, spikes and frames taken out, and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.body.mass_center import mass_center, with_center, without_gaps
from forceid.flight.model import Flight
from forceid.flight.smoother import FlightState
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


def prepared(body: Body, motion: Motion) -> tuple[Motion, tuple[str, ...]]:
    """The motion cleaned, with lost nodes that carry mass bridged, and what was done about it."""
    motion, told = cleaned(body, motion)
    return without_gaps(body, motion), told


def cleaned(body: Body, motion: Motion) -> tuple[Motion, tuple[str, ...]]:
    """The motion with markers in their places and without spikes, and what was done about it.

    >>> from forceid.records import Motion
    >>> cleaned(Body(), Motion(time=np.arange(3.0)))[1]
    ()
    """
    if motion.position is None or motion.bridged is not None:
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


@dataclass(frozen=True)
class Dropped:
    """Frames (time,) taken out: of the mass center, and of the rotation; empty where none are."""

    center: Flags
    rotation: Flags

    @property
    def any(self) -> bool:
        """Whether a frame is."""
        return bool(self.center.any() or self.rotation.any())

    def beside(self, more: Dropped) -> Dropped:
        """These frames and more."""
        return more if not self.any else Dropped(self.center | more.center, self.rotation | more.rotation)


NONE_DROPPED = Dropped(np.zeros(0, bool), np.zeros(0, bool))


def kinematics_without(
    dropped: Dropped, body: Body, motion: Motion, settings: Settings, noise: dict[str, Array] | None = None
) -> Kinematics:
    """Kinematics of a recording without frames; a mass center that is a mean loses its own only."""
    if not dropped.any:
        return kinematics(body, motion, settings, noise)
    centers = without_frames(motion, dropped.center)
    if noise is None and motion.position is not None:
        noise = kinematics(body, centers, settings.model_copy(update={"model": "rigid"})).noise_root
    kin = kinematics(body, without_frames(motion, dropped.center | dropped.rotation), settings, noise)
    mean = mass_center(centers, kin.inertia, kin.noise.get("position", 0.0) ** 2)
    if mean is None:
        return kin
    pose, frames = with_center(kin.pose, kin.frames, mean, kin.share("position"))
    return replace(kin, pose=pose, frames=frames)


def wild_frames(
    flight: Flight, first: FlightState, solve: Callable[[Flight], FlightState], apart: bool
) -> tuple[Dropped, str]:
    """Frames that nothing else agrees with, and a sentence on them.

    apart: whether mass center and rotation are smoothed by themselves, and are judged so.
    """
    if not apart:
        dropped, sentence = wild_among(slice(None), flight, first, solve)
        return Dropped(dropped, dropped), sentence
    center, of_center = wild_among(slice(0, 3), flight, first, solve)
    rotation, of_rotation = wild_among(slice(3, 6), flight, first, solve)
    return Dropped(center, rotation), of_center or of_rotation


def wild_among(
    channels: slice, flight: Flight, first: FlightState, solve: Callable[[Flight], FlightState]
) -> tuple[Flags, str]:
    """Frames (time,) that nothing else agrees with in some channels of a pose, and a sentence on them.

    A frame is dropped if its innovation is wild and, without such frames, no other one is. Where the
    wildness stays, it is not the frames but the motion: then none is dropped.
    """

    def again(dropped: Flags) -> Array:
        kept = np.where(dropped[:, 0], np.nan, 1.0)[:, None]
        center, rotation = flight.center * kept, flight.rotation * kept[..., None]
        return wildest(solve(replace(flight, center=center, rotation=rotation)), channels)

    every = wildest(first, channels)
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


def wildest(state: FlightState, channels: slice = slice(None)) -> Array:
    """Largest innovation (time, 1) of every frame, in standard deviations; zero where nothing is seen."""
    seen = np.abs(np.nan_to_num(state.innovation[:, channels]))
    return np.asarray(seen.max(1, keepdims=True, initial=0.0))


def without_frames(motion: Motion, dropped: Flags) -> Motion:
    """The motion with nothing seen in some frames."""
    kept = np.where(dropped, np.nan, 1.0)
    gone = {
        name: value * kept.reshape(-1, *[1] * (value.ndim - 1))
        for name in ("position", "center", "orientation")
        if (value := getattr(motion, name)) is not None
    }
    return replace(motion, **gone)
