"""How cost grows: CPU time against samples, markers and modes, with fitted exponents.

Contestants take turns over all sizes, round by round; the exponent is the slope of log time over log size at
the larger half of the sizes, where what every run costs anyway no longer counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.chart.timing import mean_seconds, seconds_of
from evidence.journal import Journal, key
from evidence.subjects.flights.cases import Case, case_of, shipped
from evidence.subjects.flights.methods import DEFAULT, asked, ours
from evidence.subjects.flights.peers.entrants import peers
from evidence.subjects.flights.true_prior import Problem, problem_of
from forceid import kalman
from forceid.flight.smoother import settled
from forceid.kalman.engines import engine
from forceid.records import Array, Body, Motion, Recording
from forceid.scenes.recipe import load_recipe, simulate

SAMPLES = (500, 1000, 2000, 4000, 8000, 16000, 32000)
MARKERS = (3, 5, 10, 20, 50, 100)
MODES = (1, 2, 3, 4, 6, 8)
ROUNDS = 3
LIMITS = {True: 20.0, False: 2.0}  # s, of a full and of a short chart: who takes longer grows no further
HIGHEST = 3.0  # Hz, of loads
FRAMES = 1000  # of the sweep over markers
MOST_ROWS = 20  # markers whose raw rows are still worth the wait
SLOW = ("filterpy RTS", "statsmodels", "scipy GCV spline")


@dataclass(frozen=True)
class Sweep:
    """One quantity that grows, and the jobs of every contestant at a size of it."""

    name: str
    sizes: Sequence[int]
    jobs: Callable[[int], dict[str, Callable[[], Any]]]


def costs(
    journal: Journal, stamp: str, full: bool, said: Callable[[str, float], None]
) -> list[dict[str, Any]]:
    """Every sweep as plain data: sizes, median seconds of every contestant, exponents."""
    sweeps = [
        Sweep("samples", SAMPLES if full else SAMPLES[:3], partial(of_samples, full)),
        Sweep("markers", MARKERS if full else MARKERS[:4:2], of_markers),
        Sweep("modes", MODES if full else MODES[:2], of_modes),
    ]
    found = []
    for i, sweep in enumerate(sweeps):
        said(f"cost in {sweep.name}", i / len(sweeps))
        found.append(journal.once(key(stamp, sweep.name, sweep.sizes, full), partial(measured, sweep, full)))
    return found


def measured(sweep: Sweep, full: bool) -> dict[str, Any]:
    """Seconds of every contestant at every size that it reaches, and the exponents."""
    seconds: dict[str, list[float]] = {}
    out: set[str] = set()
    for size in sweep.sizes:
        jobs = {name: job for name, job in sweep.jobs(size).items() if name not in out}
        first = {name: seconds_of(job)[1] for name, job in jobs.items()}
        turns: dict[str, list[float]] = {name: [] for name in jobs}
        for k in range(ROUNDS if full else 1):
            for name in list(jobs)[:: 1 if k % 2 == 0 else -1]:
                long = first[name] > LIMITS[full]
                turns[name].append(first[name] if long else mean_seconds(jobs[name], first[name]))
        out |= {name for name, spent in first.items() if spent > LIMITS[full]}
        for name, spent in turns.items():
            seconds.setdefault(name, []).append(float(np.median(spent)))
    grown = {name: exponent(sweep.sizes[: len(s)], s) for name, s in seconds.items() if len(s) > 1}
    return {"over": sweep.name, "sizes": list(sweep.sizes), "seconds": seconds, "exponents": grown}


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float:
    """Slope of log time over log size, over the larger half of the sizes.

    >>> exponent([1, 10, 100, 1000], [5.0, 5.0, 10.0, 100.0])
    1.0
    """
    at = slice(len(sizes) // 2, None) if len(sizes) > 3 else slice(None)
    return round(float(np.polyfit(np.log(sizes[at]), np.log(seconds[at]), 1)[0]), 3)


def of_samples(full: bool, size: int) -> dict[str, Callable[[], Any]]:
    """A spinning body of six markers, for longer and longer."""
    case = case_of("spinning", spinning(6, size), False)
    plain = asked("smoother, no lines", "method", "no search for oscillating loads", lines="none")
    taken = [*ours()[:5], plain, *(p for p in peers()[0] if not p.told and (full or p.name not in SLOW))]
    return {c.name: c.prepare(case) for c in taken}


def of_markers(size: int) -> dict[str, Callable[[], Any]]:
    """A spinning body with more and more markers: whole estimates, one pass over poses and over raw rows."""
    case = case_of("spinning", spinning(size, FRAMES), False)
    whole = {c.name: c.prepare(case) for c in ours() if c.name in (DEFAULT, "savgol")}
    problem = problem_of(case)
    passes = {"one pass over poses": pass_over(case, problem, False)}
    if size <= MOST_ROWS:
        passes["one pass over marker rows"] = pass_over(case, problem, True)
    return whole | passes


def pass_over(case: Case, problem: Problem, raw: bool) -> Callable[[], Any]:
    """One smoothing pass about the settled path, over poses or over the rows of all markers."""
    force, moment = problem.priors["force"], problem.priors["moment"]
    flight = problem.flight
    model, z, about, _ = settled(flight, force, moment, engine())
    n = force.states
    if raw:
        model, z = with_marker_rows(case, model, about.rotation, n, force.axes)

    def job() -> Array:
        x = kalman.smooth(model, z).x
        end = n + about.chain.shape[1]
        F = x[:, :n] @ force.rows.T
        T = x[:, n:end] @ about.moment.rows.T
        return np.concatenate([F, T], 1)

    return job


def with_marker_rows(
    case: Case, model: kalman.StateSpace, rotation: Array, n: int, axes: Array
) -> tuple[kalman.StateSpace, Array]:
    """The model of a flight that measures every coordinate of every marker, about a path of rotations."""
    body, motion = case.blind.body, case.blind.motion
    assert body.position is not None
    assert motion.position is not None
    center = np.zeros(3) if body.mass_center is None else body.mass_center
    if body.mass is not None:
        center = body.mass @ body.position / body.mass.sum()
    arm = (body.position - center) @ rotation.swapaxes(1, 2)  # (time, node, 3)
    T, nodes = arm.shape[:2]
    H = np.zeros((T, nodes, 3, len(model.x0)))
    H[..., :3] = axes
    # theta x arm, row by row
    for row, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        H[:, :, row, n + i], H[:, :, row, n + j] = arm[..., j], -arm[..., i]
    R = motion.noise_std["position"] ** 2 * np.eye(3 * nodes)
    z = (motion.position - arm).reshape(T, -1)
    return replace(model, H=H.reshape(T, 3 * nodes, -1), R=R), z


def spinning(markers: int, frames: int) -> Recording:
    """A rigid body of 0.2 kg that spins about a principal axis under a force and a moment at random.

    In closed form: the path of the center and the angle of the spin are sums of tones of random size, as
    dense as the record tells apart, and the loads follow. Noise 0.3 mm.
    """
    rng = np.random.default_rng(markers)
    time, J, gravity = np.arange(frames) / 500.0, np.diag([4e-4, 5e-4, 7e-4]), np.array([0.0, 0.0, -9.81])
    X = rng.uniform(-0.1, 0.1, (markers, 3))
    rate = 2 * np.pi * np.arange(0.3, HIGHEST, 0.9 / time[-1])
    push = rng.standard_normal((2, len(rate), 4)) / (1 + (rate[:, None] / 8.0) ** 2) / np.sqrt(len(rate))
    phase = np.outer(time, rate)
    load = np.cos(phase) @ push[0] + np.sin(phase) @ push[1]  # N / 0.2 kg, rad/s2
    path = -(np.cos(phase) @ (push[0] / rate[:, None] ** 2) + np.sin(phase) @ (push[1] / rate[:, None] ** 2))
    center = 5 * path[:, :3] + 0.5 * np.outer(time**2, gravity)
    R = Rotation.from_rotvec(np.outer(6.0 * time + 20 * path[:, 3], [0.0, 0.0, 1.0])).as_matrix()
    x = center[:, None] + X @ R.swapaxes(1, 2) + 3e-4 * rng.standard_normal((frames, markers, 3))
    node = tuple(f"m{i}" for i in range(markers))
    body = Body(node=node, position=X, total_mass=0.2, mass_center=np.zeros(3), inertia=J)
    truth = {"force": load[:, :3], "moment": 20 * np.outer(load[:, 3], J[2])}
    return Recording(body, Motion(time, x, gravity=gravity, noise_std={"position": 3e-4}), truth)


def of_modes(size: int) -> dict[str, Callable[[], Any]]:
    """Half of the throw of the flexible boomerang with more and more modes kept."""
    case = case_of("boomerang", boomerang(), False)
    return {"smoother, modes kept": asked("modal", "modes", "", model="modal", modes=size).prepare(case)}


@cache
def boomerang() -> Recording:
    """The recording of that throw, flown once."""
    recipe = load_recipe(shipped()["flexible_boomerang"])
    return simulate(recipe.model_copy(update={"duration": 0.3}))
