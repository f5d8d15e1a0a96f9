"""`forceid.live`: what stands before a stream, the body and the settings, and what these must not ask for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from forceid.config import Settings, load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.live.stream import LIVE_FIRST, LIVE_LAG, LIVE_RETUNE, Pace, Tell, wrenches
from forceid.records import Frame, LiveWrench, Recording

if TYPE_CHECKING:
    import xarray

LONGEST_LAG = 10.0  # s: a longer lag is no live estimate, and what is pending costs time with every frame


def live(
    frames: Iterable[tuple[float, Any]],
    tree: xarray.DataTree,
    config: Any = None,
    *,
    lag: float = LIVE_LAG,
    first: float = LIVE_FIRST,
    retune: float = LIVE_RETUNE,
    tuned_on_file: bool = False,
    tell: Tell | None = None,
    **settings: Any,
) -> Iterator[LiveWrench]:
    """Force and moment while the motion goes on: one frame in, one wrench out, `lag` seconds behind.

    frames: pairs of time (s) and marker positions (node, 3) m, world axes, NaN where not seen, in the order
    of /body/node. tree: a motion file of the body, from `open_motion`: its body, gravity and noise_std count,
    its motion only if tuned_on_file, in place of a first stretch of the frames. first: seconds that are tuned
    on at the start, 256 frames at least; their wrenches come at once when they are over. retune: seconds from
    one tuning to the next at most, on the last 1024 frames, and sooner where frames have doubled up to these;
    math.inf for none. config, settings: as of
    `forceid.estimate`. tell: called with a line of text where there is something to say. Yields `LiveWrench`
    records: time s, force N and moment N m about the mass center, world axes, weight excluded, standard
    deviations, and the reasons where one is `degraded`. Raises ConfigError, DataError, EstimationError.

    >>> import forceid
    >>> from forceid.files.tree import tree_from_recording
    >>> from forceid.records import Body, Motion
    >>> tip = np.array([[0.1, 0, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0], [0.1, 0, 0.1]])
    >>> body = Body(("a", "b", "c", "d"), tip, np.full(4, 0.02))
    >>> t, noise = np.arange(300) / 100, 2e-4 * np.random.default_rng(0).standard_normal((300, 4, 3))
    >>> motion = Motion(t, tip + noise, noise_std={"position": 2e-4}, gravity=np.array([0.0, 0.0, -9.81]))
    >>> tree = tree_from_recording(Recording(body, motion))
    >>> last = list(forceid.live(zip(t, motion.position), tree))[-100]
    >>> last.flag, round(float(last.force[2]), 1)  # it hangs: a force as large as its weight holds it
    ('ok', 0.8)
    """
    from forceid.files import recording_from_tree

    merged = load_settings(config, **settings)
    recording = recording_from_tree(tree, merged.gravity)
    pace = Pace(lag, first, retune)
    return followed_live(frames, recording, merged, pace, tuned_on_file, tell or (lambda _: None))


def followed_live(
    frames: Iterable[tuple[float, Any]],
    recording: Recording,
    settings: Settings,
    pace: Pace,
    tuned_on_file: bool,
    tell: Tell,
) -> Iterator[LiveWrench]:
    """The same of a recording and settings that are validated; what does not go is said at once."""
    check_settings(settings)
    check_pace(pace)
    body, motion = recording.body, recording.motion
    if body.position is None:
        raise DataError("holds no positions of nodes", "/body", "give /body/position: markers are read by it")
    before = []
    if tuned_on_file:
        if motion.position is None:
            raise DataError(
                "holds no positions, which are tuned on",
                "/motion",
                "leave out the option to tune on the file",
            )
        before = [Frame(float(t), p) for t, p in zip(motion.time, motion.position, strict=True)]
    shown = (motion.gravity, motion.noise_std)
    return wrenches(as_frames(frames, len(body.node)), body, shown, settings, pace, tell, before)


def live_pace(lag: float | None, first: float | None, retune: float | None) -> Pace:
    """A pace from what is given, else as it is by default."""
    usual = (LIVE_LAG, LIVE_FIRST, LIVE_RETUNE)
    return Pace(*(u if g is None else g for u, g in zip(usual, (lag, first, retune), strict=True)))


def as_frames(frames: Iterable[tuple[float, Any]], nodes: int) -> Iterator[Frame]:
    """Frames of a body of so many nodes. DataError where one is of another shape."""
    for k, (time, position) in enumerate(frames, 1):
        x = np.ascontiguousarray(position, float)
        if x.shape != (nodes, 3):
            raise DataError(f"has the shape {x.shape}, expected ({nodes}, 3)", f"frame {k}", "see /body/node")
        yield Frame(float(time), x)


def check_pace(pace: Pace) -> None:
    """ConfigError where a lag or a stretch cannot be."""
    for name, value, high in (
        ("lag", pace.lag, LONGEST_LAG),
        ("first", pace.first, np.inf),
        ("retune", pace.retune, np.inf),
    ):
        if not 0.0 < value <= high:
            raise ConfigError(f"is {value:g} s, expected more than 0 and at most {high:g} s", name)


def check_settings(settings: Settings) -> None:
    """ConfigError where settings ask for what a live estimate does not do."""
    plain = Settings()
    alone = ("method", "load", "known_load", "part", "joint", "load_prior", "moment_about")
    for name in (*alone, "material", "gauge", "prior"):
        if getattr(settings, name) != getattr(plain, name):
            raise ConfigError(
                f"is {getattr(settings, name)!r}, which a live estimate does not do",
                f"settings: {name}",
                "leave it out, or run forceid estimate on the recording",
            )
