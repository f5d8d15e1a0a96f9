"""Loads that keep to axes of the world, or turn with the body: whether evidence tells, and what it brings.

    python -m evidence.drawn.load_axes [--draws 20] [--seed 71] [--jobs 2] [-o docs]

Rigid bodies drawn with their markers, noise and spin, under a force and a moment that are smooth processes
along random axes: of the world, of the body, or one of each. Each record is estimated along the axes of the
world, of the body, and along those that the evidence chooses. The flights are integrated by Dormand and
Prince; no code is shared with the estimator.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.claims.strict import matern_path
from evidence.drawn.records.scored import (
    FORCE,
    MOMENT,
    RecordScore,
    error_over_claim,
    estimated_score,
    stacked,
    told_whole,
)
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, tabled
from forceid.records import Array, Motion, Recording

KINDS = {
    "world": (False, False),
    "body": (True, True),
    "force turns": (True, False),
    "moment turns": (False, True),
}
CHOICES = ("world", "body", "auto")
MARKERS, SAMPLES = (4, 11), (200, 600)
RATES, NOISES = (100.0, 1000.0), (1e-4, 1e-3)  # Hz, m
SPINS, TURN = (2.0, 60.0), 0.25  # rad/s; rad a frame, at most
FORGETTING_TIMES = (4.0, 30.0)  # times in a record that a load forgets itself
SHOWN = (5.0, 300.0)  # what a load moves the mass center or turns the body by, over the noise of a pose
SUBSTEPS = 10  # of a sample, in the path of a load
SIZE = 0.15  # m: of a body
HEADS = (
    "loads", "records", "load", "along world axes", "along body axes", "as chosen", "error over claim: world",
    "body", "chosen", "chosen rightly", "wrongly",
)  # fmt: skip
ABOUT = """\
Made by `{command}`. Rigid bodies of 4 to 10 markers with 0.1 to 1 mm of noise, 200 to 600 samples at 100 to \
1000 Hz, turn at 2 to 60 rad/s. Their loads are Matern 3/2 processes along random axes of the world \
or of the body: {draws} records of each kind. Errors: root mean square over records and axes of the error \
over that along the axes in which the load was drawn, of force and moment. Chosen: where the evidence takes \
the axes of the body; a load keeps those of the world unless others are e^7 times as likely."""


@dataclass(frozen=True)
class TurningRecord:
    """A drawn record, and which of force and moment turn with the body."""

    recording: Recording
    turns: tuple[bool, bool]


def log_uniform(rng: np.random.Generator, span: tuple[float, float]) -> float:
    """A number drawn evenly in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(span))))


def draw_flight(turns: tuple[bool, bool], rng: np.random.Generator) -> TurningRecord:
    """A record whose force and moment turn with the body, or do not."""
    markers, samples = int(rng.integers(*MARKERS)), int(log_uniform(rng, SAMPLES))
    rate, noise, mass = log_uniform(rng, RATES), log_uniform(rng, NOISES), log_uniform(rng, (0.1, 10.0))
    X, share = SIZE * rng.standard_normal((markers, 3)), rng.uniform(0.5, 1.5, markers)
    share = share / share.sum()
    X = X - share @ X
    body = told_whole(tuple(f"m{k}" for k in range(markers)), X, X, mass * share)
    J = np.asarray(body.inertia)
    J_inv, span = np.linalg.inv(J), (samples - 1) / rate
    fine = np.arange((samples - 1) * SUBSTEPS + 1) / rate / SUBSTEPS
    pose_std = noise / np.sqrt(markers)
    loads = []
    for moved in (mass * pose_std, float(np.trace(J)) / 3 * pose_std / SIZE):
        forgets = log_uniform(rng, FORGETTING_TIMES) / span
        size = moved * forgets**2 * log_uniform(rng, SHOWN)
        axes = Rotation.random(random_state=rng).as_matrix() * (size * np.exp(rng.uniform(-1.5, 0.0, 3)))
        loads.append((axes, matern_path(1.0, forgets, fine, rng)))
    spin = rng.standard_normal(3)
    spin *= min(log_uniform(rng, SPINS), TURN * rate) / np.linalg.norm(spin)
    start = Rotation.random(random_state=rng)

    def acting(t: Any, R: Array) -> list[Array]:
        return [
            (R if turning else np.eye(3)) @ axes @ path(t)[..., None]
            for turning, (axes, path) in zip(turns, loads, strict=True)
        ]

    def leads(t: float, y: Array) -> Array:
        q = y[9:13] / np.linalg.norm(y[9:13])
        R = Rotation.from_quat(q).as_matrix()
        F, T = (a[:, 0] for a in acting(t, R))
        w = R @ J_inv @ R.T @ y[6:9]
        spun = 0.5 * np.array([*(q[3] * w + np.cross(w, q[:3])), -w @ q[:3]])
        return np.concatenate([y[3:6], F / mass + GRAVITY, T, spun])

    y0 = np.concatenate([[0, 0, 1.5], [3, 1, 4], start.apply(J @ spin), start.as_quat()])
    time = fine[::SUBSTEPS]
    scale = np.array([1.0] * 6 + [max(float(np.linalg.norm(J @ spin)), 1e-12)] * 3 + [1.0] * 4)
    small = {"rtol": 1e-9, "atol": 1e-11 * scale, "max_step": 2 / rate}
    y = solve_ivp(leads, (0, time[-1]), y0, "DOP853", time, **small).y.T
    R = Rotation.from_quat(y[:, 9:13]).as_matrix()
    force, moment = (a[..., 0] for a in acting(time, R))
    x = y[:, None, :3] + np.einsum("tab,nb->tna", R, X)
    x = x + noise * rng.standard_normal(x.shape)
    stated = {"position": noise} if rng.random() < 0.5 else {}
    motion = Motion(time, x, gravity=GRAVITY, noise_std=stated)
    return TurningRecord(Recording(body, motion, truth={"force": force, "moment": moment}), turns)


def run_record(job: tuple[str, int, int]) -> tuple[str, dict[str, RecordScore], tuple[bool, bool]]:
    """A record estimated along each choice of axes; of the chosen ones, which loads turn."""
    kind, k, seed = job
    record = draw_flight(KINDS[kind], np.random.default_rng([seed, list(KINDS).index(kind), k]))
    scores = {axes: estimated_score(record.recording, model="rigid", load_axes=axes) for axes in CHOICES}
    chosen = scores["auto"].tuned
    return kind, scores, ("force_turns" in chosen, "moment_turns" in chosen)


def kind_rows(kind: str, of: list[tuple[str, dict[str, RecordScore], tuple[bool, bool]]]) -> list[list[str]]:
    """Force and moment of a kind in the table."""
    rows = []
    loads = zip(("force", "moment"), (FORCE, MOMENT), KINDS[kind], (0, 1), strict=True)
    for name, part, turns, which in loads:
        own = stacked([scores["body" if turns else "world"] for _, scores, _ in of], "square")[:, part]
        errors = []
        for axes in CHOICES:
            square = stacked([scores[axes] for _, scores, _ in of], "square")[:, part]
            errors.append(float(np.sqrt(np.mean(square.mean(1) / own.mean(1)))))
        over = [error_over_claim([scores[axes] for _, scores, _ in of], part) for axes in CHOICES]
        took = [chosen[which] for _, _, chosen in of]
        right, wrong = sum(took) if turns else len(took) - sum(took), 0 if turns else sum(took)
        numbers = (f"{value:.2f}" for value in (*errors, *over))
        rows.append([kind, str(len(of)), name, *numbers, str(right), str(wrong)])
    return rows


def main() -> int:
    """Write load_axes.md; 1 where the choice errs by more than a tenth beyond its claim."""
    args = asked("evidence.drawn.load_axes", __doc__, draws=20, seed=71, jobs=2)
    jobs = [(kind, k, args.seed) for kind, k in product(KINDS, range(args.draws))]
    found = list(each(run_record, jobs, args.jobs))
    rows = [row for kind in KINDS for row in kind_rows(kind, [one for one in found if one[0] == kind])]
    paged(
        args.output, "load_axes", "Axes that a load keeps to",
        ABOUT.format(command=args.command, draws=args.draws), tabled(HEADS, rows),
    )  # fmt: skip
    return int(any(float(row[8]) > 1.1 for row in rows))


if __name__ == "__main__":
    sys.exit(main())
