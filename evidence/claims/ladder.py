"""Scenes of known level, and how often the ladder finds the smallest one that is enough for force and moment.

    python -m evidence.claims.ladder [--seeds 20] [--jobs 2]

The scenes are motions written down: a body of twelve unequal masses spins along closed-form Euler angles
under a closed-form force, and stretches, or vibrates in modes in the mass gauge. The force is m c'' - m g,
the moment the rate of the angular momentum of the exact nodal motion. No code is shared with the estimator.
The judge of a level is its own estimate beside that of the level the scene was made with.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.drawn.records.scored import FORCE, MOMENT
from evidence.judged import judged_part
from evidence.vectors import GRAVITY
from evidence.written import asked, each, tabled
from forceid import kalman
from forceid.config import Settings, load_settings
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.loads.channels import DrivenMotion
from forceid.estimation.methods.problem import Solution
from forceid.estimation.methods.smoother import estimate_flight
from forceid.estimation.model_choice.ladder import choose_level
from forceid.estimation.model_choice.levels import Step
from forceid.flight.smoother import FlightState
from forceid.records import Body, Motion, Recording, deviation

FRAMES, RATE = 300, 500.0
NOISE = (0.03e-3, 0.1e-3, 0.3e-3, 1e-3)  # m
LEVELS = ("rigid", "affine", "modal 1", "modal 3", "modal 6")
SIZE = (2.0e-3, 1.2e-3, 0.7e-3, 0.4e-3, 0.25e-3, 0.15e-3)  # m rms of a marker, of each mode
FREQUENCY = (17.0, 23.0, 31.0, 37.0, 43.0, 53.0)  # Hz
STRAIN = (0.03, 0.02, 0.04, 0.02, 0.03, 0.025)
STENCIL = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
STEP = 2e-4  # s, of the stencil


def twelve_masses() -> Body:
    """Twelve unequal masses, 0.1 kg in all, in a body of the size of a boomerang; about its mass center."""
    rng = np.random.default_rng(7)
    mass = 0.1 * (w := rng.uniform(0.4, 1.6, 12)) / w.sum()
    position = rng.uniform(-1, 1, (12, 3)) * [0.18, 0.12, 0.06]
    return Body(tuple(f"n{i}" for i in range(12)), position - mass @ position / mass.sum(), mass)


def shapes(level: str) -> Any:
    """Shapes (mode, node, 3) of a level: strains, or modes in the mass gauge, of one meter rms."""
    X, m = twelve_masses().position, twelve_masses().mass
    if level == "affine":
        units = (np.outer(*np.eye(3)[list(k)]) for k in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)))
        return np.array([X @ (0.5 * (E + E.T)) for E in units])
    rng = np.random.default_rng(11)
    turn = np.cross(np.eye(3)[None], X[:, None]).swapaxes(1, 2)
    base = np.concatenate([np.tile(np.eye(3), (12, 1, 1)), turn], 2).reshape(36, 6)
    weight, found = np.repeat(m, 3), []
    for _ in range(0 if level == "rigid" else int(level.split()[1])):
        waves = 2 * rng.standard_normal((3, 3))
        v = (((X / 0.1) @ waves.T) ** 2 @ rng.standard_normal((3, 3))).ravel()
        v = v - base @ np.linalg.solve(base.T @ (weight[:, None] * base), base.T @ (weight * v))
        found.append(v / np.sqrt((v**2).sum() / 12))
        base = np.column_stack([base, found[-1]])
    return np.array(found).reshape(-1, 12, 3)


def center_at(t: Any) -> tuple[Any, Any]:
    """Mass center and its acceleration."""
    t = t[:, None]
    swing = np.array([0.02, 0.03, 0.015])
    rate, phase = 2 * np.pi * np.array([2.0, 3.0, 2.5]), np.array([0.3, 1.1, 2.0])
    c = np.array([8.0, 1.0, 3.0]) * t + 0.5 * GRAVITY * t**2 + swing * np.sin(rate * t + phase)
    return c, GRAVITY - swing * rate**2 * np.sin(rate * t + phase)


def arms_at(t: Any, level: str, seed: int) -> Any:
    """Nodes about the mass center (time, node, 3), world axes."""
    phi = 0.3 + 8 * np.pi * t + 0.3 * np.sin(2 * np.pi * 1.5 * t)
    angles = np.column_stack([0.4 + 1.5 * t, 0.6 + 0.2 * np.sin(9 * t), phi])
    s = np.tile(twelve_masses().position, (len(t), 1, 1))
    rng = np.random.default_rng(1000 + seed)  # a different phase in every record
    size = STRAIN if level == "affine" else SIZE
    for k, pattern in enumerate(shapes(level)):
        wave = 2 * np.pi * FREQUENCY[k] * rng.uniform(0.95, 1.05) * t + rng.uniform(0, 2 * np.pi)
        s = s + size[k] * np.sqrt(2) * np.sin(wave)[:, None, None] * pattern
    return np.einsum("tab,tnb->tna", Rotation.from_euler("ZXZ", angles).as_matrix(), s)


def scene(level: str, noise: float, seed: int) -> Recording:
    """Markers of a scene with noise, and the wrench that moved it."""
    known, t = twelve_masses(), np.arange(FRAMES) / RATE
    (c, a), rho = center_at(t), arms_at(t, level, seed)
    far = sum(w * arms_at(t + (i - 4) * STEP, level, seed) for i, w in enumerate(STENCIL)) / STEP**2
    moment = np.einsum("n,tna->ta", known.mass, np.cross(rho, far))
    x = c[:, None] + rho + noise * np.random.default_rng(seed).standard_normal(rho.shape)
    motion = Motion(t, x, gravity=GRAVITY, noise_std={"position": noise})
    return Recording(known, motion, {"force": known.mass.sum() * (a - GRAVITY), "moment": moment})


def ladder_to(level: str) -> list[tuple[str, dict[str, Any]]]:
    """Names and settings of the levels up to `level`, by their degrees of freedom."""
    steps: list[tuple[str, dict[str, Any]]] = [("rigid", {"model": "rigid"})]
    steps += [(f"modal {m}", {"model": "modal", "modes": m}) for m in range(1, 6)]
    steps += [("affine", {"model": "affine"}), ("modal 6", {"model": "modal", "modes": 6})]
    return steps[: [name for name, _ in steps].index(level) + 1]


def error_over_right(one: FlightState, other: FlightState) -> float:
    """Error of one over that claimed by the other, which is right, the larger of force and moment.

    By what both claim, and by how far they are apart beyond what chance explains.
    """
    std = deviation(other.wrench_cov)
    off = np.concatenate([one.force - other.force, one.moment - other.moment], 1)
    apart, claimed = (judged_part((a / std) ** 2) for a in (off, deviation(one.wrench_cov)))
    found = []
    for load in (FORCE, MOMENT):
        d, v = float(apart[:, load].mean()), float(claimed[:, load].mean())
        found.append(v + max(d - abs(1 - v), 0.0))
    return float(np.sqrt(max(found)))


def smallest_sufficient(recording: Recording, level: str) -> tuple[str, dict[str, float]]:
    """The first level with an error of at most 1.1 times that of the true one, and those before it."""
    (*steps, (_, own)), engine = ladder_to(level), kalman.engine("auto")

    def estimate(settings: dict[str, Any]) -> FlightState:
        chosen = load_settings(lines="none", **settings)
        return estimate_flight(recording.body, recording.motion, chosen, engine).state

    truth, off = estimate(own), {}
    for name, settings in steps:
        off[name] = error_over_right(estimate(settings), truth)
        if off[name] <= 1.1:
            return name, off
    return level, off


def taken(recording: Recording) -> tuple[str, str, float]:
    """The level that the ladder takes, the one that explains the motion best, and seconds of CPU."""
    settings, engine = load_settings(lines="none"), kalman.engine("auto")
    body, motion, began = recording.body, recording.motion, time.process_time()

    def solve(level: Settings, kin: Kinematics, shown: DrivenMotion | None) -> Solution:
        return estimate_flight(body, motion, level, engine, kin, shown)

    kin = kinematics(body, motion, settings)
    choice, _ = choose_level(kin, motion, settings, engine, solve)
    spent = time.process_time() - began
    if choice.level is None:
        return choice.model, choice.model, spent
    return level_name(choice.level), level_name(max(choice.steps, key=lambda step: step.evidence)), spent


def level_name(step: Step) -> str:
    """A step as the scenes name levels."""
    return f"modal {step.modes}" if step.model == "modal" else step.model


def case(job: tuple[str, float, int]) -> dict[str, Any]:
    """One record: what was taken, what would have been enough."""
    recording = scene(*job)
    level, most, spent = taken(recording)
    enough, off = smallest_sufficient(recording, job[0])
    return {"job": job, "taken": level, "most": most, "enough": enough, "off": off, "seconds": spent}


def main() -> None:
    """A table of the records in which the ladder took the smallest sufficient level."""
    args = asked("evidence.claims.ladder", __doc__, page=False, seeds=20, jobs=os.cpu_count() or 1)
    jobs = [(level, noise, seed) for seed, level, noise in product(range(args.seeds), LEVELS, NOISE)]
    cases = list(each(case, jobs, args.jobs))
    missed, rows = [c for c in cases if c["taken"] != c["enough"]], []
    for level in LEVELS:
        own = [c for c in cases if c["job"][0] == level]
        right = (sum(c["taken"] == c["enough"] for c in own if c["job"][1] == noise) for noise in NOISE)
        names = Counter(c["taken"] for c in own)
        said = ", ".join(f"{name} {count}" for name, count in sorted(names.items()))
        rows.append([level, *(f"{count}/{len(own) // len(NOISE)}" for count in right), said])
    print(tabled(("true level", *(f"{1e3 * noise:g} mm" for noise in NOISE), "levels taken"), rows))
    right, every = len(cases) - len(missed), len(cases)
    seconds = np.median([c["seconds"] for c in cases])
    print(f"\nsmallest sufficient level: {right} of {every} ({100 * right / every:.1f} %)")
    explained = sum(c["most"] == c["job"][0] for c in cases)
    print(f"true level of most evidence: {explained}; median {seconds:.2f} s of CPU with the flight")
    for c in missed:
        near = {name: round(value, 2) for name, value in c["off"].items()}
        print("missed:", c["job"], "took", c["taken"], "most", c["most"], "enough", c["enough"], near)


if __name__ == "__main__":
    main()
