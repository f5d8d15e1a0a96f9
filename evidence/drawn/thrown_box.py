"""Thrown boxes that a gyro and an accelerometer alone watch: does it end, does the truth lie in the claims?

    OPENBLAS_NUM_THREADS=1 python -m evidence.drawn.thrown_box -o FOLDER [--count 100] [--seed 0]

Draws boxes, throws, sensors and loads, integrates them with DOP853 by the equations of Euler, writes files by
the contract that hold no marker and no pose, estimates each, and writes thrown_box.md. Errors are those of
the central three quarters of a record, in the axes of the body at its first sample, as results state them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import RecordScore, estimated_score
from evidence.judged import LOADS, RULE, silent_share
from evidence.vectors import GRAVITY, hat
from evidence.written import asked, each, paged, tabled
from forceid.files.stored.hdf5 import read_motion
from forceid.records import Array

SAMPLE_RATES = (10.0, 30.0, 100.0, 300.0, 600.0)  # Hz, sample rates
NOISE = 2e-3, 0.03  # rad/s and m/s2: of a reading, about what parts for a telephone have at 100 Hz
BIAS = 0.01, 0.1  # rad/s and m/s2: of such a part at one temperature
SENSORS = ("angular_velocity", "specific_force")


@dataclass(frozen=True)
class Thrown:
    """A throw: what the sensors read (time, 3), the truth in the axes of the body at the first sample.

    time (time,) s; force, moment (time, 3) N, N m; mass kg; inertia (3, 3) kg m2; place (3,) m from the mass
    center; mounting: sensor to body; noise: deviations of gyro and accelerometer; known: whether they
    and the biases are stated; kind: of the load, none, or slow in fixed or in body axes; R (time, 3, 3): body
    to those axes.
    """

    time: Array
    omega: Array
    pulled: Array
    force: Array
    moment: Array
    mass: float
    inertia: Array
    place: Array
    mounting: Rotation
    noise: tuple[float, float]
    known: bool
    kind: str
    R: Array


def draw_throw(rng: np.random.Generator) -> Thrown:
    """One throw of a rigid box."""
    edge = np.exp(rng.uniform(np.log(0.05), np.log(0.4), 3))
    mass = float(np.prod(edge) * rng.uniform(100, 1000))
    turn = Rotation.random(random_state=rng).as_matrix()  # of the axes of the reference shape
    inertia = turn @ np.diag(mass / 12 * (np.sum(edge**2) - edge**2)) @ turn.T
    rate = float(np.exp(rng.uniform(np.log(10), np.log(600))))
    count = int(np.clip(rate * rng.uniform(0.5, 2.5), 30, 300))
    time = np.arange(count) / rate
    way = rng.standard_normal(3)
    spin = 2 * np.pi * rng.uniform(0, 10) * way / np.linalg.norm(way)
    kind = str(rng.choice(["none", "world", "body"]))
    slow = float(rng.uniform(0.2, min(5.0, rate / 20)))  # Hz: how fast loads change
    strong = 0.0 if kind == "none" else float(np.exp(rng.uniform(np.log(0.03), 0)))
    push = three_sines(rng, slow, strong * mass * -GRAVITY[2])
    twist = three_sines(rng, slow, strong * float(np.linalg.eigvalsh(inertia)[0]) * 20.0)

    def in_body(load: Callable[[Array], Array], t: Array, R: Array) -> Array:
        return np.einsum("tba,tb->ta", R, load(t)) if kind == "world" else load(t)

    def rates(t: float, y: Array) -> Array:
        R, w = y[:9].reshape(3, 3), y[9:]
        T = in_body(twist, np.array([t]), R[None])[0]
        return np.concatenate([(R @ hat(w)).ravel(), np.linalg.solve(inertia, T - np.cross(w, inertia @ w))])

    y0 = np.concatenate([np.eye(3).ravel(), spin])
    path = solve_ivp(rates, (0, time[-1]), y0, "DOP853", time, rtol=1e-10, atol=1e-10).y.T
    R, omega = path[:, :9].reshape(-1, 3, 3), path[:, 9:]
    F, T = (in_body(load, time, R) for load in (push, twist))
    alpha = np.linalg.solve(inertia, (T - np.cross(omega, omega @ inertia))[..., None])[..., 0]
    place = rng.uniform(-0.5, 0.5, 3) * edge.min()
    mounting = Rotation.random(random_state=rng)
    pulled = F / mass + np.cross(alpha, place) + np.cross(omega, np.cross(omega, place))
    noise = (NOISE[0] * float(np.exp(rng.uniform(-1, 1))), NOISE[1] * float(np.exp(rng.uniform(-1, 1))))

    def read(v: Array, i: int) -> Array:
        error = BIAS[i] * rng.standard_normal(3) + noise[i] * rng.standard_normal(v.shape)
        return mounting.inv().apply(v) + error

    to_start = (np.einsum("tab,tb->ta", R, a) for a in (F, T))
    return Thrown(
        time, read(omega, 0), read(pulled, 1), *to_start, mass, inertia, place, mounting, noise,
        bool(rng.random() < 0.5), kind, R,
    )  # fmt: skip


def three_sines(rng: np.random.Generator, slow: float, size: float) -> Callable[[Array], Array]:
    """A smooth load of time: three sines an axis and a mean, of that size."""
    level, phase = rng.standard_normal((4, 3)), rng.uniform(0, 2 * np.pi, (3, 3))
    pace = 2 * np.pi * slow * rng.uniform(0.2, 1, (3, 3))

    def load(t: Array) -> Array:
        sines = np.sin(t[:, None, None] * pace + phase)
        return np.asarray(0.5 * size * (level[3] + np.einsum("ka,tka->ta", level[:3], sines)))

    return load


def write_throw(path: Path, thrown: Thrown) -> None:
    """The file of a throw, by the contract: a body known as a whole, two sensors, nothing else."""
    with h5py.File(path, "w") as f:
        f.attrs["forceid_schema"] = "1"
        f["body/total_mass"] = thrown.mass
        f["body/mass_center"] = np.zeros(3)
        f["body/inertia"] = thrown.inertia
        f["body/sensor_position"] = thrown.place[None]
        f["body/sensor_rotation"] = thrown.mounting.as_quat()[None]
        f["motion/time"] = thrown.time
        f["motion/angular_velocity"] = thrown.omega[:, None]
        f["motion/specific_force"] = thrown.pulled[:, None]
        f["motion"].attrs["gravity"] = GRAVITY


def stated_settings(thrown: Thrown) -> dict[str, Any]:
    """What the user states of the sensors: noise and bias, or nothing."""
    if not thrown.known:
        return {}
    stated = dict(zip(SENSORS, thrown.noise, strict=True))
    return {"noise_std": stated | {f"{k}_bias": b for k, b in zip(SENSORS, BIAS, strict=True)}}


def run_throw(k: int, seed: int) -> tuple[float, RecordScore]:
    """A throw by its number, estimated from its file: sample rate, Hz, and what the judge says."""
    thrown = draw_throw(np.random.default_rng([seed, k]))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "thrown_box.h5"
        write_throw(path, thrown)
        truth = {"force": thrown.force, "moment": thrown.moment}
        scored = estimated_score(replace(read_motion(path), truth=truth), **stated_settings(thrown))
    return 1 / float(np.diff(thrown.time)[0]), scored


ABOUT = """\
`{command}` draws boxes of 5 to 40 cm, spins up to 10 rev/s, sample rates from 10 to 600 Hz, and 30 to 300
samples. One sensor sits at a drawn place and attitude, with noise and constant biases of parts for a
telephone, stated or not. Loads are none, or slow ones in fixed or in body axes. The truth is integrated
by DOP853; the files hold no marker and no pose. Errors are those in the axes of the body at the first
sample, within the band."""
READING = """\
The slowest throw took {slowest:.0f} s of CPU."""


def bands(outcomes: Sequence[tuple[float, RecordScore]]) -> str:
    """A table by bands of the sample rate."""
    heads, rows = ["sample rate (Hz)", "throws", "verdicts", "silently wrong"], []
    for name in LOADS:
        heads += [f"{name}: error over claim, median and 90 %", "within two claims"]
    for low, high in [*pairwise(SAMPLE_RATES), (SAMPLE_RATES[0], SAMPLE_RATES[-1])]:
        mine = [score for rate, score in outcomes if low <= rate < high]
        ended = np.array([score.over for score in mine if score.verdict != "refused"])
        if not len(ended):
            continue
        said = Counter(score.verdict for score in mine)
        cells = [f"{low:.0f} to {high:.0f}", f"{len(mine)}", ", ".join(f"{n} {v}" for v, n in said.items())]
        cells += [silent_share(score.silent for score in mine)]
        for off in ended.T:
            median, most = np.quantile(off, [0.5, 0.9])
            cells += [f"{median:.2f}, {most:.2f}", f"{100 * np.mean(off < 2):.0f} %"]
        rows.append(cells)
    return tabled(heads, rows)


def main() -> None:
    """Draw, write, estimate, compare, and say what came of it."""
    args = asked("evidence.drawn.thrown_box", __doc__, count=100, seed=0)
    outcomes = list(each(partial(run_throw, seed=args.seed), range(args.count), 1))
    about = ABOUT.format(command=f"OPENBLAS_NUM_THREADS=1 {args.command}")
    reading = READING.format(slowest=max(score.seconds for _, score in outcomes))
    title = "Boxes in flight, seen by a gyro and an accelerometer alone"
    paged(args.output, "thrown_box", title, about, RULE, bands(outcomes), reading)


if __name__ == "__main__":
    main()
