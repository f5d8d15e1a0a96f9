"""How far a recording of one's own is from breaking: its twins, under faults that grow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evidence.judged import LOADS, WRONG, scores, silently_wrong
from evidence.subjects.flights.twin import twin
from forceid.config import Settings
from forceid.errors import ForceIdError
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.files.stored.hdf5 import read_motion
from forceid.records import Array, Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OF_FORCE, OF_MOMENT = "force error over claim", "moment error over claim"  # columns
COLOR = {"right": "#1f7a43", "degraded": "#b06f10", "refused": "#6b7177", "silently wrong": "#b3281c"}

Make = Callable[[Recording, float, np.random.Generator], Recording]


@dataclass(frozen=True)
class Fault:
    """What goes wrong with markers, at levels from next to nothing on; make: a recording with it."""

    name: str
    level: str
    levels: tuple[float, ...]
    make: Make


@dataclass(frozen=True)
class Met:
    """A twin with a fault at a level: the verdict, and error over claim of force and moment in the band.

    beside: over the error of the witness there.
    """

    fault: str
    level: float
    verdict: str
    force: float
    moment: float
    beside: tuple[float, ...] = ()

    @property
    def outcome(self) -> str:
        """Right, degraded, refused, or silently wrong."""
        if silently_wrong(self.verdict, (self.force, self.moment), self.beside):
            return "silently wrong"
        return "right" if self.verdict == "ok" else self.verdict


def tracks(recording: Recording, position: Array) -> Recording:
    """The recording with other tracks (time, node, 3) m."""
    return replace(recording, motion=replace(recording.motion, position=position))


def noisier(recording: Recording, times: float, rng: np.random.Generator) -> Recording:
    """White noise beside that of the recording, so that all of it is `times` as large."""
    x = recording.motion.position
    assert x is not None
    bent = np.diff(x, 3, axis=0) / np.sqrt(20)  # as large as white noise; of smooth motion next to none
    size = float(np.sqrt(np.nanmean(bent**2)))
    return tracks(recording, x + size * np.sqrt(times**2 - 1) * rng.standard_normal(x.shape))


def with_gaps(recording: Recording, share: float, rng: np.random.Generator) -> Recording:
    """A share of the readings missing, in runs of a twentieth of the record."""
    x = np.array(recording.motion.position)
    run = max(len(x) // 20, 1)
    while np.isnan(x[..., 0]).mean() < share:
        first, marker = rng.integers(len(x) - run), rng.integers(x.shape[1])
        x[first : first + run, marker] = np.nan
    return tracks(recording, x)


def with_outliers(recording: Recording, share: float, rng: np.random.Generator) -> Recording:
    """A share of the readings off by a twentieth of what the body spans."""
    x = np.array(recording.motion.position)
    far = 0.05 * float(np.nanmean(np.nanmax(x, 1) - np.nanmin(x, 1)))
    hit = rng.random(x.shape[:2]) < share
    x[hit] += far * rng.standard_normal((int(hit.sum()), 3))
    return tracks(recording, x)


def with_fewer_frames(recording: Recording, every: float, rng: np.random.Generator) -> Recording:
    """One frame of so many."""
    motion, keep = recording.motion, slice(None, None, int(every))
    assert motion.position is not None
    truth = {name: values[keep] for name, values in recording.truth.items()}
    fewer = replace(motion, time=motion.time[keep], position=motion.position[keep])
    return replace(recording, motion=fewer, truth=truth)


def with_late_frames(recording: Recording, share: float, rng: np.random.Generator) -> Recording:
    """Instants off by a share of a sample, which nobody is told."""
    motion = recording.motion
    assert motion.position is not None
    t, x = motion.time, motion.position
    when = t + share * np.median(np.diff(t)) * rng.uniform(-1, 1, len(t))
    speed = np.gradient(x, t, axis=0)
    return tracks(recording, x + speed * (when - t)[:, None, None])


def with_wrong_masses(recording: Recording, share: float, rng: np.random.Generator) -> Recording:
    """Masses of nodes, or of the whole, stated wrong by a share."""
    body = recording.body
    if body.mass is None:
        whole = None if body.total_mass is None else body.total_mass * (1 + share)
        return replace(recording, body=replace(body, total_mass=whole))
    wrong = np.maximum(body.mass * (1 + share * rng.standard_normal(len(body.mass))), 0.0)
    return replace(recording, body=replace(body, mass=wrong))


FAULTS = (
    Fault("noise", "times as large", (1.5, 3.0, 6.0, 12.0, 25.0), noisier),
    Fault("gaps", "share of readings", (0.02, 0.05, 0.1, 0.2, 0.4), with_gaps),
    Fault("outliers", "share of readings", (0.002, 0.01, 0.03, 0.1, 0.3), with_outliers),
    Fault("fewer frames", "one of so many", (2.0, 3.0, 5.0, 8.0, 12.0), with_fewer_frames),
    Fault("late frames", "share of a sample", (0.02, 0.05, 0.1, 0.3, 1.0), with_late_frames),
    Fault("wrong masses", "share of each", (0.01, 0.03, 0.1, 0.2, 0.4), with_wrong_masses),
)


def met(recording: Recording, fault: Fault | None, level: float, rng: np.random.Generator) -> Met:
    """What the default settings make of a twin with a fault, or of the twin as it is."""
    name = "none" if fault is None else fault.name
    try:
        faulty = recording if fault is None else fault.make(recording, level, rng)
        found = estimate_of_any_length(replace(faulty, truth={}), Settings())
    except ForceIdError:
        return Met(name, level, "refused", float("nan"), float("nan"))
    off = scores(found, [faulty.truth[load] for load in LOADS])
    force, moment = off["over"]
    return Met(name, level, found.verdict.level, force, moment, off["beside"])


def met_by(path: Path, seeds: int, short: bool) -> Iterator[Met]:
    """Every fault at every level, on twins of a motion file, one a seed; first the twins as they are."""
    recording = read_motion(path)
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 1])
        one = twin(recording, np.random.default_rng(seed), str(path))
        yield met(one, None, 0.0, rng)
        for fault in FAULTS:
            for level in fault.levels[:: 2 if short else 1]:
                yield met(one, fault, level, rng)


def judged(found: Sequence[Met]) -> list[dict[str, Any]]:
    """A row a fault and level: the worst outcome over the seeds, and the largest error over claim."""
    order = list(COLOR)
    rows = []
    for fault, level in dict.fromkeys((one.fault, one.level) for one in found):
        same = [one for one in found if (one.fault, one.level) == (fault, level)]
        rows.append({
            "fault": fault, "level": level, "outcome": max((one.outcome for one in same), key=order.index),
            OF_FORCE: float(np.nanmax([0.0, *(one.force for one in same)])),
            OF_MOMENT: float(np.nanmax([0.0, *(one.moment for one in same)])),
        })  # fmt: skip
    return rows


def sentences(rows: Sequence[dict[str, Any]]) -> list[str]:
    """One line a fault: up to where the recording bears it, and what is said beyond."""
    found = []
    for fault in FAULTS:
        own = [row for row in rows if row["fault"] == fault.name]
        bad = next((k for k, row in enumerate(own) if row["outcome"] != "right"), len(own))
        borne = f"borne up to {own[bad - 1]['level']:g}" if bad else "not borne at all"
        then = f"; at {own[bad]['level']:g} {own[bad]['outcome']}" if bad < len(own) else ", the most tried"
        found.append(f"{fault.name} ({fault.level}): {borne}{then}")
    return found


def told(path: Path, folder: Path, seeds: int, short: bool, command: str) -> str:
    """The page stress_NAME.md with its picture, in a folder; returns what it says, a line a fault."""
    from evidence.written import pictured, table, written
    from forceid.cli.crew.progress import progress

    levels = [level for fault in FAULTS for level in fault.levels[:: 2 if short else 1]]
    found = []
    with progress(seeds * (1 + len(levels)), "twins") as advance:
        for one in met_by(path, seeds, short):
            found.append(one)
            advance()
    rows, picture = judged(found), f"stress_{path.stem}"
    lines, (plain, *rest) = sentences(rows), rows
    about = (
        f"`{command}`: default settings on twins of the recording ({seeds}), whose load is known, under "
        f"faults that grow. Without a fault: {plain['outcome']}, error over claim {plain[OF_FORCE]:.2g} "
        f"(force), {plain[OF_MOMENT]:.2g} (moment). *Silently "
        f"wrong*: `ok`, and one is above {WRONG:g}, or twice that of the plain route."
    )
    listed = "\n".join(f"- {line}" for line in lines)
    pictured(folder, picture, drawn(rest, path.stem))
    page = [f"# {path.stem} under faults", about, f"![levels of faults]({picture}.png)", listed, table(rest)]
    written(folder, f"{picture}.md", "\n\n".join(page) + "\n")
    return "\n".join([*lines, f"page {folder / picture}.md"])


def drawn(rows: Sequence[dict[str, Any]], name: str) -> Figure:
    """Faults and levels as cells, colored by what came of them, with the larger error over claim."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    for i, fault in enumerate(FAULTS):
        for k, row in enumerate(row for row in rows if row["fault"] == fault.name):
            axes.barh(i, 0.96, left=k, height=0.9, color=COLOR[row["outcome"]])
            worst = max(row[OF_FORCE], row[OF_MOMENT])
            said = f"{row['level']:g}\n{worst:.2g}" if worst else f"{row['level']:g}"
            axes.text(k + 0.48, i, said, ha="center", va="center", fontsize=8, color="white")
    axes.set_yticks(range(len(FAULTS)), [f"{fault.name}\n({fault.level})" for fault in FAULTS], fontsize=8)
    axes.invert_yaxis()
    axes.set_xticks([])
    axes.set_title(f"{name}: level of a fault, and below it the larger error over its claim", fontsize=10)
    axes.spines[:].set_visible(False)
    axes.legend(
        handles=[Patch(color=color, label=outcome) for outcome, color in COLOR.items()],
        ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.02), frameon=False, fontsize=8,
    )  # fmt: skip
    return figure
