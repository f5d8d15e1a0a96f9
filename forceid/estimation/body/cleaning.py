"""Readings that nothing else agrees with: markers exchanged back, spikes and frames taken out, and named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.deformation_residual import Beyond, bases_beside, beyond_rigid, looks
from forceid.estimation.body.deforming.strains import strain_shapes
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.body.mass_center import tracked_mass_center, with_center, without_gaps
from forceid.estimation.body.segment_noise import restored, shows_segments
from forceid.estimation.body.tracks.exchanged import put_back
from forceid.estimation.body.tracks.source_filter import source_filter, undone
from forceid.estimation.body.tracks.spikes import clipped, off_the_shape, spikes, wild_rates
from forceid.flight.color import LowPassed
from forceid.flight.model import Flight
from forceid.flight.smoother import FlightState
from forceid.kalman.tuning.robust import drop_wild
from forceid.records import Array, Body, Flags, Motion, all_finite
from forceid.rounding import SINGLE
from forceid.significance import SIGMAS
from forceid.timing import stage


@dataclass(frozen=True)
class Mended:
    """What was done about the readings of a motion.

    stuck: frames, of all, in which a limit cut readings off, most of them at an edge m along an axis;
    exchanged: markers that had traded places, exchanges: how often they were put back, exchanged_s: when
    first; spikes: readings taken out, by marker, the most first, spikes_s: the first of them; readings: all;
    rates: readings of gyros taken out, where there is no marker, rates_s: when first. source: the filter that
    tracks went through, left: what is left of it; None where none was undone.
    """

    exchanged: tuple[str, ...] = ()
    exchanges: int = 0
    exchanged_s: float = np.nan
    stuck: int = 0
    frames: int = 0
    axis: str = ""
    edge: float = np.nan
    spikes: Mapping[str, int] = field(default_factory=dict)
    spikes_s: float = np.nan
    readings: int = 0
    rates: int = 0
    rates_s: float = np.nan
    source: LowPassed | None = None
    left: LowPassed | None = None


@stage("kinematics")
def prepared(body: Body, motion: Motion, kin: Kinematics | None) -> tuple[Motion, Mended]:
    """The motion as before a filter, cleaned, with lost nodes that carry mass bridged; what was done.

    kin: what the motion shows as it is, None of one that sensors alone tell.
    """
    if kin is not None:
        motion, *filtered = before_filter(motion, kin)
    else:
        motion, *filtered = restored(body, motion) if shows_segments(body, motion) else (motion, None, None)
    motion, mended = cleaned(body, motion, kin)
    return without_gaps(body, motion), replace(mended, source=filtered[0], left=filtered[1])


def before_filter(motion: Motion, kin: Kinematics) -> tuple[Motion, LowPassed | None, LowPassed | None]:
    """The motion as it was before its tracks went through a low-pass, that one, and what is left of it."""
    if motion.position is None or motion.bridged is not None or not kin.attitude:
        return motion, None, None
    shown = np.where(kin.seen[:, None], motion.position, 0.0)
    size = float(kin.shape[kin.seen].var(0).mean())
    found = source_filter(motion.time, shown, lambda time, tracks: beyond_rigid(time, tracks, kin).y, size)
    if found is None:
        return motion, None, None
    return replace(motion, position=undone(motion.position, *found)), *found


def cleaned(body: Body, motion: Motion, kin: Kinematics | None = None) -> tuple[Motion, Mended]:
    """The motion with markers in their places and without spikes, and what was done about it.

    kin: of a body that its markers show the shape of, None of others.

    >>> from forceid.records import Motion
    >>> cleaned(Body(), Motion(time=np.arange(3.0)))[1].exchanges
    0
    """
    if motion.position is None or motion.bridged is not None:
        return without_wild_rates(motion)
    cut, axis, edge = clipped(motion.position)
    mended = Mended(stuck=int(cut.any(1).sum()), frames=len(cut), axis=axis, edge=edge)
    known = np.where(cut[..., None], np.nan, motion.position) if cut.any() else motion.position
    position, traded = put_back(known, body.position)
    if traded:
        names, first = tuple(sorted({body.node[t.channel] for t in traded})), motion.time[traded[0].sample]
        mended = replace(mended, exchanged=names, exchanges=len(traded) // 2, exchanged_s=float(first))
    off = np.zeros(position.shape[:2], bool)
    for group in looks(np.ones(position.shape[1], bool) if kin is None else kin.seen):
        off[:, group] = spikes(position[:, group])
        if kin is not None and kin.attitude:
            known = np.where(off[..., None], np.nan, position) if off[:, group].any() else position
            shown = beside_strains(beyond_rigid(motion.time, known, kin, group), kin)
            off[:, shown.kept] |= off_the_shape(shown.y, shown.basis)
    if off.any():
        position = np.where(off[..., None], np.nan, position)
        by_marker = {body.node[k]: int(off[:, k].sum()) for k in np.argsort(-off.sum(0)) if off[:, k].any()}
        seen, first = int(all_finite(motion.position).sum()), motion.time[off.any(1).argmax()]
        mended = replace(mended, spikes=by_marker, spikes_s=float(first), readings=seen)
    changed = traded or mended.stuck or off.any()
    return (replace(motion, position=position), mended) if changed else (motion, mended)


def beside_strains(shown: Beyond, kin: Kinematics) -> Beyond:
    """What markers do beside strains of the whole body, where it strains faster than a spike would show."""
    strains = strain_shapes(kin.shape, np.eye(3))
    within = bases_beside(shown.of(strains).T, SINGLE)[0]
    both, strained = (float(np.nansum(np.diff(y, 2, axis=0) ** 2)) for y in (shown.y, shown.y @ within))
    count, rest = within.shape[1], len(within) - within.shape[1]
    if not count or not rest or not strained > SIGMAS**2 * count / rest * max(both - strained, 0.0):
        return shown
    return shown.without(strains)


def without_wild_rates(motion: Motion) -> tuple[Motion, Mended]:
    """A motion that sensors alone tell, without spikes of its gyros, and how many there were."""
    rate = motion.angular_velocity
    if rate is None or motion.position is not None or motion.center is not None:
        return motion, Mended()
    wild = wild_rates(rate)
    if not wild.any():
        return motion, Mended()
    rate = np.where(wild[..., None], np.nan, rate)
    first = float(motion.time[wild.any(1).argmax()])
    return replace(motion, angular_velocity=rate), Mended(rates=int(wild.sum()), rates_s=first)


@dataclass(frozen=True)
class Dropped:
    """Frames (time,) taken out: of the mass center, and of the rotation; empty where none are.

    sigma: the largest of their innovations, in standard deviations; time_s: of the first of them.
    """

    center: Flags
    rotation: Flags
    sigma: float = 0.0
    time_s: float = np.inf

    @property
    def any(self) -> bool:
        """Whether a frame is."""
        return bool(self.center.any() or self.rotation.any())

    def beside(self, more: Dropped) -> Dropped:
        """These frames and more."""
        if not self.any:
            return more
        worst, first = max(self.sigma, more.sigma), min(self.time_s, more.time_s)
        return Dropped(self.center | more.center, self.rotation | more.rotation, worst, first)

    @property
    def frames(self) -> Flags:
        """Frames (time,) of either."""
        return np.asarray(self.center | self.rotation)


@dataclass(frozen=True)
class Wild:
    """Frames (time,) with wild innovations: their largest size (sigma), the first time, and whether the
    wildness ends when these frames are taken out.
    """

    frames: Flags
    sigma: float
    time_s: float
    ended: bool


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
    kin = kinematics(body, without_frames(motion, dropped.frames), settings, noise)
    mean = tracked_mass_center(centers, kin.inertia, kin.noise.get("position", 0.0) ** 2)
    if mean is None:
        return kin
    pose, frames = with_center(kin.pose, kin.frames, mean, kin.share("position"))
    return replace(kin, pose=pose, frames=frames)


def wild_frames(
    flight: Flight,
    first: FlightState,
    solve: Callable[[Flight], FlightState],
    apart: bool,
    before: Dropped = NONE_DROPPED,
) -> tuple[Dropped, Wild | None]:
    """Frames to be taken out since nothing else agrees with them, and wild ones that this would not end.

    apart: whether mass center and rotation are smoothed by themselves, and are judged so; before: frames
    taken out already, which count among the few that may be.
    """
    none = np.zeros(len(flight.time), bool)
    before = before if before.any else Dropped(none, none)
    parts = [(slice(None), before.rotation)]
    if apart:
        parts = [(slice(0, 3), before.center), (slice(3, 6), before.rotation)]
    each = [wild_among(channels, flight, first, solve, gone) for channels, gone in parts]
    ended = [wild for wild in each if wild is not None and wild.ended]
    left = next((wild for wild in each if wild is not None and not wild.ended), None)
    frames = [none if wild is None or not wild.ended else wild.frames for wild in each]
    worst, when = max((w.sigma for w in ended), default=0.0), min((w.time_s for w in ended), default=np.inf)
    return Dropped(frames[0], frames[-1], worst, when), left


def wild_among(
    channels: slice,
    flight: Flight,
    first: FlightState,
    solve: Callable[[Flight], FlightState],
    before: Flags,
) -> Wild | None:
    """Frames that nothing else agrees with in some channels of a pose; None where there are none.

    A frame is dropped if its innovation is wild and, without such frames, no other one is. Where the
    wildness stays, it is not the frames but the motion: then none is dropped.
    """

    def again(dropped: Flags) -> Array:
        kept = np.where(dropped[:, 0], np.nan, 1.0)[:, None]
        center, rotation = flight.center * kept, flight.rotation * kept[..., None]
        return largest_innovations(solve(replace(flight, center=center, rotation=rotation)), channels)

    every = largest_innovations(first, channels)
    wild, ended = drop_wild(every, again, before[:, None])
    frames = wild[:, 0] & ~before
    if not frames.any():
        return None
    return Wild(frames, float(every.max()), float(flight.time[frames][0]), bool(ended))


def largest_innovations(state: FlightState, channels: slice = slice(None)) -> Array:
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
