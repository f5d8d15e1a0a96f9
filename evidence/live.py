"""Force and moment while the motion goes on, beside the smoother that has seen all of it.

    python -m evidence.live -o docs [--repeats 5] [--frames 360000]

The shipped flights, frame by frame through `forceid.live` with nothing but the lag set, and the same by
`forceid estimate`. Errors are rms over a whole record, as the length of the vector, each over that of the
smoother; the frames of the first stretch are told when it is over, from all of it. `behind it`: the frames
behind the first stretch alone. Over claim: rms of error over
claimed deviation, all frames and axes. CPU times are measured beside other work.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import forceid
from evidence.written import asked, paged, pictured, table
from forceid.config import load_settings
from forceid.estimation.live.run import followed_live, live_pace
from forceid.records import Body, LiveWrench, Motion, Recording

SCENES = ("flexible_boomerang", "frisbee", "top")
LIVE_LAGS = (0.01, 0.02, 0.05, 0.1, 0.2)
SHOWN = 0.05  # s: the lag of the first table
RATE, MINUTE = 1000.0, 60_000
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
LoadHistory = dict[str, np.ndarray]


def opened_scene(scene: str) -> Any:
    """The motion file of a scene."""
    return forceid.open_motion(Path(__file__).parents[1] / "data" / "synthetic" / f"{scene}.h5")


def gathered(found: list[LiveWrench]) -> LoadHistory:
    """Arrays (time, 3) of wrenches."""
    names = ("force", "moment", "force_std", "moment_std")
    return {name: np.array([getattr(w, name) for w in found]) for name in names}


def followed(tree: Any, lag: float, **more: Any) -> tuple[LoadHistory, float, int]:
    """What is told of a record, CPU time a frame in us behind the first stretch, and how long that is."""
    motion = tree["motion"]
    clock: list[float] = []

    def fed() -> Iterator[tuple[float, np.ndarray]]:
        for t, x in zip(motion.time.values, motion.position.values, strict=True):
            clock.append(process_time())
            yield float(t), x

    found, first = [], 0
    for wrench in forceid.live(fed(), tree, lag=lag, **more):
        first = first or len(clock)
        found.append(wrench)
    behind = np.diff(clock[first:])
    return gathered(found), 1e6 * float(behind.mean()) if len(behind) else np.nan, first


def rms(error: np.ndarray) -> float:
    """Of vectors (time, 3)."""
    return float(np.sqrt((error**2).sum(1).mean()))


def scores(scene: str, tree: Any, smooth: LoadHistory, lag: float) -> dict[str, float]:
    """Errors of a lag over those of the smoother, and over what is claimed."""
    found, cpu, first = followed(tree, lag)
    numbers: dict[str, float] = {"cpu": cpu, "first": first}
    for name in ("force", "moment"):
        truth = tree[f"truth/{name}"].values
        error, best = (a[name] - truth for a in (found, smooth))
        own = smooth[f"{name}_std"]
        late = slice(first, None)
        numbers |= {
            f"{name}": rms(error) / rms(best),
            f"{name} behind": rms(error[late]) / rms(best[late]),
            f"{name} claim": float(np.sqrt(((error / found[f"{name}_std"]) ** 2).mean())),
            f"{name} smoother claim": float(np.sqrt(((best / own) ** 2).mean())),
        }
    return numbers


def smoothed(tree: Any) -> LoadHistory:
    """Force and moment of the whole record by the default estimate."""
    estimate = forceid.estimate(tree)["estimate"]
    return {name: estimate[name].values for name in ("force", "moment", "force_std", "moment_std")}


def two(force: float, moment: float, digits: int = 2) -> str:
    """A number of the force and one of the moment."""
    return f"{force:.{digits}f}, {moment:.{digits}f}"


def long_flight(frames: int) -> Iterator[tuple[float, np.ndarray]]:
    """Frames of a tumbling body that is shaken for ever."""
    rng, t0 = np.random.default_rng(3), 0
    while t0 < frames:
        t = np.arange(t0, min(t0 + 4096, frames)) / RATE
        noise = 2e-4 * rng.standard_normal((len(t), *TIPS.shape))
        x = np.einsum("tab,nb->tna", turn(t), TIPS) + path(t)[:, None] + noise
        yield from zip(t.tolist(), x, strict=True)
        t0 += 4096


TIPS = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.0, 0.1]])
MASS, WEIGHT = 0.08, np.array([0.0, 0.0, -9.81])
SHAKE, SPEED = np.array([0.05, 0.03, 0.02]), 2 * np.pi * np.array([1.0, 1.7, 2.3])


def path(t: np.ndarray) -> np.ndarray:
    """Mass center of that body."""
    return SHAKE * np.sin(SPEED * t[:, None])


def turn(t: np.ndarray) -> np.ndarray:
    """Rotation of that body."""
    spin = Rotation.from_rotvec(np.outer(6.0 * t, [0.0, 0.0, 1.0]))
    return np.asarray(
        (spin * Rotation.from_rotvec(np.outer(0.2 * np.sin(3 * t), [1.0, 0.0, 0.0]))).as_matrix()
    )


def memory() -> float:
    """What this process holds, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def by_minute(frames: int) -> list[dict[str, str]]:
    """A long flight, minute by minute: memory, error of the force, time."""
    tips = TIPS - TIPS.mean(0)
    few = Motion(np.arange(4) / RATE, np.tile(tips, (4, 1, 1)), gravity=WEIGHT, noise_std={"position": 2e-4})
    recording = Recording(Body(("a", "b", "c", "d"), TIPS, np.full(4, MASS / 4)), few)
    rows, error, began = [], [], process_time()
    pace = live_pace(None, None, None)
    said: list[str] = []
    center = TIPS.mean(0)
    for k, wrench in enumerate(
        followed_live(long_flight(frames), recording, load_settings(None), pace, False, said.append), 1
    ):
        error.append((wrench.time, *wrench.force, *wrench.force_std))
        if k % MINUTE == 0 or k == frames:
            numbers, spent = np.array(error), process_time() - began
            t = numbers[:, 0]
            h = 1e-4
            arm = [np.einsum("tab,b->ta", turn(t + d), center) + path(t + d) for d in (-h, 0.0, h)]
            truth = MASS * ((arm[0] - 2 * arm[1] + arm[2]) / h**2 - WEIGHT)
            off = numbers[:, 1:4] - truth
            rows.append(
                {
                    "frames": f"{k}",
                    "memory (MB)": f"{memory():.1f}",
                    "force error (N)": f"{rms(off):.4f}",
                    "over claim": f"{np.sqrt(((off / numbers[:, 4:]) ** 2).mean()):.2f}",
                    "tunings so far": str(sum("tuned on" in text for text in said)),
                    "CPU a frame, tuning in it (us)": f"{1e6 * spent / len(error):.0f}",
                }
            )
            error, began = [], process_time()
    return rows


def drawn(output: Path, found: dict[str, dict[float, dict[str, float]]]) -> None:
    """The picture: lag against error."""
    figure = Figure(figsize=(8, 3.4), layout="constrained", dpi=120)
    for axes, load in zip(figure.subplots(1, 2, sharey=True), ("force", "moment"), strict=True):
        for scene, color in zip(SCENES, (BLUE, ORANGE, GREEN), strict=True):
            lags = 1e3 * np.array(list(found[scene]))
            for part, style in (("", "o-"), (" behind", "o:")):
                ratio = [n[load + part] for n in found[scene].values()]
                named = "" if part else scene.replace("_", " ")
                axes.plot(lags, ratio, style, color=color, ms=4, label=named or "_")
        axes.axhline(1.2, color="#222222", lw=0.8, ls="--")
        axes.set(xscale="log", yscale="log", xlabel="lag (ms)", title=load)
        axes.set_xticks(1e3 * np.array(LIVE_LAGS), [f"{1e3 * lag:g}" for lag in LIVE_LAGS])
        axes.set_xticks([], minor=True)
        axes.set_yticks([1, 1.2, 1.5, 2, 3], ["1", "1.2", "1.5", "2", "3"])
        axes.set_yticks([], minor=True)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("error over that of the smoother")
    figure.axes[1].legend(frameon=False, fontsize=9, loc="upper right")
    pictured(output, "live", figure, dpi=120)


def main() -> None:
    """Follow, compare, and write the page."""
    given = asked("evidence.live", __doc__, repeats=5, frames=360_000)
    found: dict[str, dict[float, dict[str, float]]] = {}
    cpu: dict[str, float] = {}
    for scene in SCENES:
        tree = opened_scene(scene)
        smooth = smoothed(tree)
        found[scene] = {lag: scores(scene, tree, smooth, lag) for lag in LIVE_LAGS}
        cpu[scene] = min(followed(tree, SHOWN)[1] for _ in range(given.repeats))
    first = [
        {
            "scene": scene,
            "error over smoother, force, moment": two(n["force"], n["moment"]),
            "behind it": two(n["force behind"], n["moment behind"]),
            "over claim": two(n["force claim"], n["moment claim"]),
            "over claim, smoother": two(n["force smoother claim"], n["moment smoother claim"]),
            "CPU a frame (us)": f"{cpu[scene]:.0f}",
        }
        for scene in SCENES
        for n in (found[scene][SHOWN],)
    ]
    by_lag = [
        {"scene": scene, "load": load}
        | {f"{1e3 * lag:g} ms": f"{n[load]:.2f}" for lag, n in found[scene].items()}
        for scene in SCENES
        for load in ("force", "moment")
    ]
    drawn(given.output, found)
    what = (__doc__ or "").split("]", 2)[2].strip()
    minutes = by_minute(given.frames)
    parts = [
        "## A lag of 50 ms", table(first),
        FREE, "## Lag against error", BY_LAG, table(by_lag),
        "![Lag against error](live.png)",
        "## For hours", HOURS_TEXT.format(frames=given.frames), table(minutes[:: max(len(minutes) - 1, 1)]),
    ]  # fmt: skip
    paged(given.output, "live", "While the motion goes on", f"`{given.command}`", what, *parts)


FREE = (
    "Nothing pushes the top. What is not known of a force that may be constant falls with the time watched, "
    "to the power 5/2: its first stretch is 1.02 s of 1.5 s, which makes 2.6. Behind that of the "
    "boomerang is 0.1 s."
)
BY_LAG = (
    "Error over that of the smoother, of whole records; in the picture also behind the first stretch, dotted."
)
HOURS_TEXT = (
    "A rigid body of four markers at 1000 Hz tumbles and is shaken, {frames} frames. It is tuned anew after "
    "5 s and then every 60 s on the last 1024 frames, in the same process. The first minute and the last:"
)

if __name__ == "__main__":
    main()
