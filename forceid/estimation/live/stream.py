"""Frames in, wrenches out: tuned on a first stretch, a lag behind from there on, tuned anew as it goes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError, ForceIdError
from forceid.estimation.live.flight import MISFIT, LiveFlight, begun, behind, lost, told
from forceid.estimation.live.model import LiveModel, tuned_on
from forceid.flight.priors.protocol import MOMENTUM
from forceid.records import Array, Body, Frame, LiveWrench

LIVE_LAG = 0.05  # s: longer, the boomerang errs no less; at 10 ms 1.4 times as much (evidence.live)
LIVE_FIRST = 0.5  # s that are tuned on at least: they tell the size of a load of 20 Hz to a sixth
LIVE_RETUNE = 60.0  # s from tuning to tuning: one costs seconds, so that is some percent of a core
STRETCH_FRAMES = 256  # a first stretch has at least so many: its noise is known to 5 %, its band to 10 %
MOST_FRAMES = 1024  # a stretch has at most so many: tuning takes seconds, and no number gets better
TUNING_TIME = 5.0  # s of frames from which a stretch is tuned on to where that counts: it takes less
FOREVER = float("inf")

Tell = Callable[[str], None]
Tuning = Callable[[list[Frame]], LiveModel]


@dataclass(frozen=True)
class Pace:
    """How a stream is followed: lag s; first s of frames that are tuned on at the start, and 256 at least;
    retune s from one tuning to the next at most, infinite for none.
    """

    lag: float
    first: float
    retune: float

    def after(self, kept: deque[Frame]) -> float:
        """Seconds from a tuning on the frames kept to the next: it has twice as many, up to the most, and
        what the last one found has counted.
        """
        if len(kept) == kept.maxlen or self.retune == FOREVER:
            return self.retune
        return min(self.retune, max(kept[-1].time - kept[0].time, TUNING_TIME))


def wrenches(
    frames: Iterable[Frame],
    body: Body,
    motion: tuple[Array, dict[str, float]],
    settings: Settings,
    pace: Pace,
    tell: Tell,
    before: list[Frame],
) -> Iterator[LiveWrench]:
    """The wrench at every frame, in their order, each when the frame a lag behind it has come.

    motion: gravity (3,) m/s2 and the noise stated; before: frames of the same body that are tuned on in
    place of a first stretch, empty for none; tell: what is to be said. Those of the first stretch come at
    once when it is over, from all frames in it. Nothing that is kept grows with the number of frames.
    """
    tuning = partial(tuned_on, body=body, gravity=motion[0], noise_std=motion[1], settings=settings)
    rest = in_order(frames, tell)
    kept: deque[Frame] = deque(maxlen=MOST_FRAMES)
    if before:
        model = tuning(before[-MOST_FRAMES:])
        tell(words(model, before))
    else:
        found = first_stretch(rest, pace.first, tuning, kept, tell)
        if found is None:
            return
        model = found
    flight, out = flown(model, list(kept), pace.lag, model.momentum)
    yield from map(allowed, out, model.at_first)
    yield from followed(rest, model, flight, pace, tuning, kept, tell)


def followed(
    rest: Iterator[Frame],
    model: LiveModel,
    flight: LiveFlight | None,
    pace: Pace,
    tuning: Tuning,
    kept: deque[Frame],
    tell: Tell,
) -> Iterator[LiveWrench]:
    """The wrenches of a flight that goes on, tuned anew on the frames kept beside what comes in meanwhile.

    What a tuning finds counts `TUNING_TIME` of frames later, whenever it is done: the same frames make the
    same wrenches. One that does not fit is not waited for: the next begins at once, that long after it at
    the earliest.
    """
    job: Future[LiveModel] | None = None
    stretch: list[Frame] = []
    tuned_at = kept[-1].time if kept else FOREVER
    due = kept[-1].time + pace.after(kept) if kept else -FOREVER
    with ThreadPoolExecutor(1) as tuner:
        for frame in rest:
            if due == -FOREVER:
                due, tuned_at = frame.time + pace.retune, frame.time
            kept.append(frame)
            flight, out = onward(model, flight, frame, pace.lag, model.momentum)
            yield from out
            if flight is not None:
                flight, out = told(model, flight, frame.time - pace.lag)
                yield from out
            if flight is not None and flight.misfit > MISFIT and job is None:
                due = min(due, tuned_at + TUNING_TIME)
            if frame.time < due:
                continue
            if job is None:
                stretch = list(kept)
                job, due = tuner.submit(tuning, stretch), frame.time + TUNING_TIME
                continue
            try:
                tuned = said(job.result(), stretch, tell)
            except (ForceIdError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
                tell(f"not tuned anew up to {frame.time:g} s, goes on as before: {error}")
            else:
                again, _ = flown(tuned, list(kept), pace.lag, momentum_of(model, flight))
                if again is not None and flight is not None:
                    model, flight = tuned, told(tuned, again, flight.pending[0][0] - model.step / 2)[0]
            job, due, tuned_at = None, frame.time + pace.after(kept), frame.time
    if flight is not None:
        yield from told(model, flight, FOREVER)[1]


def momentum_of(model: LiveModel, flight: LiveFlight | None) -> Array:
    """The angular momentum (3,) of a flight, world axes: a guess for one that begins anew."""
    if flight is None or flight.moment is None or model.moment is None:
        return model.momentum
    return np.asarray(model.moment.axes @ flight.moment.x[MOMENTUM])


def allowed(wrench: LiveWrench, extra: Array) -> LiveWrench:
    """A wrench of the first stretch, with what its variances (6,) are to allow for there besides."""
    force, moment = np.sqrt(wrench.force_std**2 + extra[:3]), np.sqrt(wrench.moment_std**2 + extra[3:])
    return replace(wrench, force_std=force, moment_std=moment)


def in_order(frames: Iterable[Frame], tell: Tell) -> Iterator[Frame]:
    """The frames whose time goes on; what is said of the others."""
    last = -FOREVER
    for frame in frames:
        if frame.time > last:
            last = frame.time
            yield frame
        else:
            tell(f"the frame at {frame.time:g} s is left out: the one before is at {last:g} s")


def first_stretch(
    rest: Iterator[Frame], first: float, tuning: Tuning, kept: deque[Frame], tell: Tell
) -> LiveModel | None:
    """The model of the first stretch, filled into kept; None of no frames at all.

    A stretch that shows no force is made longer. EstimationError where all frames show none.
    """
    count = STRETCH_FRAMES
    for frame in rest:
        if len(kept) == MOST_FRAMES:
            tell(f"the frame at {kept[0].time:g} s has no wrench: nothing could be tuned on so far")
        kept.append(frame)
        if len(kept) >= min(count, MOST_FRAMES) and (
            frame.time - kept[0].time >= first or len(kept) == MOST_FRAMES
        ):
            try:
                return said(tuning(list(kept)), kept, tell)
            except EstimationError as error:
                count *= 2
                tell(f"{error}; the stretch is made longer")
    if not kept:
        return None
    return said(tuning(list(kept)), kept, tell)


def said(model: LiveModel, frames: Iterable[Frame], tell: Tell) -> LiveModel:
    """The model, of which is said what it is."""
    tell(words(model, list(frames)))
    return model


def words(model: LiveModel, frames: list[Frame]) -> str:
    """What a model was tuned on, and what its verdict would be."""
    shapes = 0 if model.swings is None else len(model.swings.shapes)
    codes = ", ".join(dict.fromkeys(finding.code for finding in model.findings))
    text = f"tuned on {len(frames)} frames, {frames[0].time:g} to {frames[-1].time:g} s: model {model.level}"
    text += f", {shapes} shapes" if shapes else ""
    text += "" if model.moment is not None else "; the markers show no moment"
    return text + (f"; to be known: {codes}" if codes else "")


def flown(
    model: LiveModel, frames: list[Frame], lag: float, momentum: Array
) -> tuple[LiveFlight | None, tuple[LiveWrench, ...]]:
    """The flight behind frames, None where none shows a pose, with the wrenches due when they are over."""
    flight: LiveFlight | None = None
    found: tuple[LiveWrench, ...] = ()
    for frame in frames:
        flight, out = onward(model, flight, frame, lag, momentum)
        found += out
    if flight is None:
        return None, found
    flight, out = told(model, flight, flight.time - lag)
    return flight, found + out


def onward(
    model: LiveModel, flight: LiveFlight | None, frame: Frame, lag: float, momentum: Array
) -> tuple[LiveFlight | None, tuple[LiveWrench, ...]]:
    """The flight behind one more frame, and what that ends before too long a gap; momentum (3,): a guess for
    the first.
    """
    out: tuple[LiveWrench, ...] = ()
    why = ""
    if flight is not None:
        later = behind(model, flight, frame, lag)
        if later is not None:
            return later, ()
        why = f"lost at {frame.time:g} s and begun anew"
        ended = flight._replace(pending=lost(flight, frame.time, lag, why)[0])
        out, momentum = told(model, ended, FOREVER)[1], momentum_of(model, flight)
    new = begun(model, frame, lag, momentum, why)
    nothing = np.full(3, np.nan)
    unseen = LiveWrench(frame.time, nothing, nothing, nothing, nothing, ("no pose so far",))
    return new, out if new is not None else (*out, unseen)
