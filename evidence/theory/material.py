"""Materials of affine bodies: constants from free flights, and applied first moments where they are known.

    python -m evidence.theory.material -o FOLDER [--count 25] [--pushed 12] [--seed 0] [--jobs 1]

Bodies of eight unequal masses at the corners of a block are drawn with a shear modulus of 0.3 to 2000 J and
lam of 0.3 to 3 times that. They are let go turning and deformed by some 5 % (slightly: 0.5 %), and seen for
1 s at 500 Hz with 0.3 mm of noise. The truth is scipy's DOP853 on F'' E = N - P, with the stress P written
down in the study.

**Free flights** are identified as `forceid identify` does, the law untold. Pushed: first moments of 1e-5 to
0.1 of the shear modulus, on a logarithmic scale, act at 1.5 Hz, and nobody tells.

**Applied first moments** are estimated as `forceid estimate` does where the material is stated. Loads
are drawn from a Matern prior of order 2 at a rate of 6 to 25 1/s, nine entries of 0.01 to 0.1 of the shear
modulus. The bound is the claim under that prior, linearized about the true path. Errors are over the central
three quarters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from evidence.judged import RULE, judged_part, over_claim, rms, silent_share, silently_wrong
from evidence.vectors import EYE, GRAVITY
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.affine.applied import AppliedPrior, Elastic, flow, model_of, row_by_row
from forceid.estimation.body.material import solid_of
from forceid.estimation.identify import identify_recording
from forceid.estimation.run import estimate_recording
from forceid.kalman.building.process import discretize, matern
from forceid.kalman.engines import engine
from forceid.records import Array, Body, Motion, Recording, deviation
from forceid.significance import QUANTILE

STIFFNESS = (0.3, 2000.0)  # J, shear modulus
STRAIN, SPIN = 0.05, 6.0  # of the start; rad/s
RATE, DURATION, SIGMA = 500.0, 1.0, 3e-4  # Hz, s, m
FOLDED = 0.35  # of the size at rest: the least stretch that is looked at
SVK, NEO = "st_venant_kirchhoff", "neo_hookean"


@dataclass(frozen=True)
class Scene:
    """A body and how it is let go: second moment E, constants lam, mu (J) and damping (J s)."""

    X: Array
    mass: Array
    law: str
    constants: Array
    F0: Array
    dF0: Array

    @property
    def E(self) -> Array:
        return (self.mass * self.X.T) @ self.X


def thrown_scene(
    rng: np.random.Generator, law: str, strain: float = STRAIN, stiffness: tuple[float, float] = STIFFNESS
) -> Scene:
    size = rng.uniform(0.06, 0.2, 3)
    X = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3) * size + 0.02 * rng.standard_normal(
        (8, 3)
    )
    mass = rng.uniform(0.03, 0.15, 8)
    X -= mass @ X / mass.sum()
    mu = float(np.exp(rng.uniform(*np.log(stiffness))))
    w = np.sqrt(6 * mu / np.trace((mass * X.T) @ X))
    constants = np.array(
        [mu * rng.uniform(0.3, 3.0), mu, mu / w * np.exp(rng.uniform(*np.log([1e-3, 5e-2])))]
    )
    R = Rotation.random(rng=rng).as_matrix()
    A, B = strain * rng.standard_normal((2, 3, 3))
    W = np.cross(EYE, min(SPIN, 0.5 * w) * rng.standard_normal(3))
    F0 = R @ (EYE + (A + A.T) / 2)
    return Scene(X, mass, law, constants, F0, W @ F0 + R @ (w * (B + B.T) / 2))


def stress(law: str, constants: Array, F: Array, V: Array) -> Array:
    """First Piola-Kirchhoff stress (..., 3, 3) J."""
    lam, mu, eta = constants
    C = F.mT @ F
    if law == SVK:
        trace = np.trace(C, axis1=-2, axis2=-1)[..., None, None]
        elastic = F @ (lam * (trace - 3) / 2 * EYE + mu * (C - EYE))
    else:
        cof, J = np.linalg.inv(F).mT, np.linalg.det(F)[..., None, None]
        elastic = mu * (F - cof) + lam / 2 * (J**2 - 1) * cof
    return elastic + eta * F @ (F.mT @ V + V.mT @ F)


def drawn_moments(rng: np.random.Generator, size: float, order: int, rate: float) -> CubicSpline:
    """First moments (3, 3) J over time, drawn from a Matern prior at a millisecond."""
    step = 1e-3
    process = matern(order, size, rate)
    ahead, Q = discretize(process, step)
    root, x = np.linalg.cholesky(Q), np.linalg.cholesky(process.P0) @ rng.standard_normal((order, 9))
    path = [x]
    for _ in range(int(DURATION / step) + 2):
        path.append(ahead @ path[-1] + root @ rng.standard_normal((order, 9)))
    return CubicSpline(step * np.arange(len(path)), np.array(path)[:, 0].reshape(-1, 3, 3))


def flown(scene: Scene, time: Array, push: Any = None) -> tuple[Array, Array]:
    """F and F' (time, 3, 3) under first moments push(t) (3, 3) J, arms in the reference."""
    inverse = np.linalg.inv(scene.E)

    def rate(t: float, y: Array) -> Array:
        F, V = y.reshape(2, 3, 3)
        N = 0.0 if push is None else push(t)
        return np.concatenate([y[9:], ((N - stress(scene.law, scene.constants, F, V)) @ inverse).ravel()])

    start, ends = np.stack([scene.F0, scene.dF0]).ravel(), (time[0], time[-1])
    y = solve_ivp(rate, ends, start, "DOP853", time, rtol=1e-11, atol=1e-12).y
    return tuple(y.reshape(2, 3, 3, -1).transpose(0, 3, 1, 2))


def least_stretch(F: Array) -> float:
    """Of a path (time, 3, 3), 0 where it turns the body inside out."""
    return float(np.linalg.svd(F, compute_uv=False).min()) if np.linalg.det(F).min() > 0 else 0.0


def filmed_flight(scene: Scene, time: Array, F: Array, rng: np.random.Generator) -> Recording:
    center = np.outer(time, rng.standard_normal(3)) + 0.5 * np.outer(time**2, GRAVITY)
    x = center[:, None] + np.einsum("tab,nb->tna", F, scene.X)
    x += SIGMA * rng.standard_normal(x.shape)
    return Recording(Body(tuple("abcdefgh"), scene.X, scene.mass), Motion(time, x, gravity=GRAVITY))


def identified(seed: tuple[int, ...], law: str, strain: float, pushed: bool) -> dict[str, Any]:
    """One flight identified: relative errors, whether 95 % intervals hold, law, verdict, CPU seconds."""
    rng, time = np.random.default_rng(seed), np.arange(int(DURATION * RATE)) / RATE
    least = 0.0
    while least < FOLDED:  # a soft body that spins fast may fold
        scene, push = thrown_scene(rng, law, strain), None
        if pushed:
            size = 10 ** rng.uniform(-5, -1) * scene.constants[1]
            N, phase = size * rng.standard_normal((3, 3)), rng.uniform(0, 6, (3, 3))
            push = lambda t, N=N, phase=phase: N * np.sin(3 * np.pi * t + phase)  # noqa: E731
        F, _ = flown(scene, time, push)
        least = least_stretch(F)
    recording = filmed_flight(scene, time, F, rng)
    began = process_time()
    found = identify_recording(recording, load_settings())
    off, half = found.value - scene.constants, QUANTILE * np.sqrt(np.diag(found.cov))
    return {
        "mu": scene.constants[1], "off": np.abs(off / scene.constants), "inside": np.abs(off) <= half,
        "law": found.law == law, "verdict": found.verdict.level, "codes": found.verdict.codes,
        "seconds": process_time() - began,
    }  # fmt: skip


def identified_row(what: str, cases: list[dict[str, Any]]) -> dict[str, Any]:
    told = [c for c in cases if c["verdict"] != "refused"]
    levels = [c["verdict"] for c in cases]
    off = 100 * np.array([c["off"] for c in told]).reshape(-1, 3)
    inside = np.array([c["inside"] for c in told]).reshape(-1, 3)

    def listed(values: Array) -> str:
        return ", ".join(f"{v:.3g}" for v in values) if len(told) else ""

    return {
        "flights": what,
        "ok, degraded, refused": ", ".join(str(levels.count(k)) for k in ("ok", "degraded", "refused")),
        "lam and mu within 2 %": f"{(off[:, :2] < 2).all(1).sum()} of {len(told)}",
        "median error (%): lam, mu, damping": listed(np.median(off, 0)),
        "95 % intervals hold (%): lam, mu, damping": listed(100 * inside.mean(0)),
        "law right": f"{sum(c['law'] for c in told)} of {len(told)}",
        "`ok`, and off by over 2 %": sum(c["verdict"] == "ok" and max(c["off"][:2]) > 0.02 for c in told),
    }  # fmt: skip


def applied_case(seed: tuple[int, ...], stiffness: tuple[float, float]) -> dict[str, Any]:
    """One flight under drawn first moments: errors, claims and bound, rms; coverage, verdict, CPU seconds."""
    rng, time = np.random.default_rng(seed), np.arange(int(DURATION * RATE)) / RATE
    least = 0.0
    while least < FOLDED:  # a soft body that spins fast may fold
        scene = thrown_scene(rng, (SVK, NEO)[seed[-1] % 2], STRAIN, stiffness)
        (lam, mu, eta), rate = scene.constants, rng.uniform(6, 25)
        size = mu * 10 ** rng.uniform(-2, -1)
        push = drawn_moments(rng, size, 2, rate)
        F, V = flown(scene, time, push)
        least = least_stretch(F)
    own = {"lam": lam, "mu": mu} if scene.law == SVK else {"a": mu / 2, "c": lam / 4}
    recording = filmed_flight(scene, time, F, rng)
    body = replace(recording.body, material={"name": scene.law, **own, "damping": eta})
    recording = replace(recording, body=body)
    applied = push(time) @ F.mT
    total = applied - stress(scene.law, scene.constants, F, V) @ F.mT
    began = process_time()
    found = estimate_recording(recording, load_settings())
    spent = process_time() - began
    noise = np.tile(np.kron(EYE, SIGMA**2 * np.linalg.inv(scene.X.T @ scene.X)), (len(time), 1, 1))
    z, turn = np.zeros((len(time), 9)), np.tile(EYE, (len(time), 1, 1))
    told = Elastic(solid_of(body), scene.E, time, z, noise, turn)
    prior, x = (
        AppliedPrior(2, rate, np.full(9, size)),
        np.concatenate([F.reshape(-1, 9), V.reshape(-1, 9)], 1),
    )
    path = engine().smooth(model_of(told, flow(told, x, prior), x, prior), z)
    bound = np.einsum("tab,tbc,tac->ta", turned := row_by_row(EYE, F.mT), path.P[:, 18:27, 18:27], turned)
    untold = replace(recording, body=replace(body, material=None))
    plain = estimate_recording(untold, load_settings(model="affine")).first_moment
    assert plain is not None
    score = {
        "bound": np.sqrt(judged_part(bound).mean()),
        "stress": rms(total - applied),
        "plain": rms(plain - total),
    }
    for name, truth in (("applied_first_moment", applied), ("first_moment", total), ("F", F)):
        off = (getattr(found, name) - truth).reshape(-1, 9)
        std = deviation(getattr(found, f"{name}_cov"))
        score |= {
            name: rms(off),
            f"{name}_over": over_claim(off, std, np.full(9, np.inf), RATE),
            f"{name}_inside": judged_part(np.abs(off) < QUANTILE * std).mean(),
        }
    over = [score[f"{name}_over"] for name in ("applied_first_moment", "first_moment", "F")]
    score["silent"] = silently_wrong(found.verdict.level, over)
    return score | {"mu": mu, "verdict": found.verdict.level, "codes": found.verdict.codes, "seconds": spent}


FLIGHTS = (
    ("St. Venant-Kirchhoff", SVK, STRAIN, False, 2),
    ("neo-Hookean", NEO, STRAIN, False, 2),
    ("St. Venant-Kirchhoff, slightly", SVK, 0.1 * STRAIN, False, 1),
    ("St. Venant-Kirchhoff, pushed", SVK, STRAIN, True, 1),
)


CLASSES = ((0.3, 3.0), (3.0, 30.0), (30.0, 300.0), (300.0, 2000.0))  # J, shear modulus


def applied_row(stiffness: tuple[float, float], cases: list[dict[str, Any]]) -> dict[str, Any]:
    def ratios(above: str, below: str = "") -> str:
        each = [c[above] / c[below] if below else c[above] for c in cases]
        return f"{np.median(each):.2f} ({min(each):.2f} to {max(each):.2f})"

    def held(name: str) -> str:
        return f"{100 * np.mean([c[f'{name}_inside'] for c in cases]):.1f}"

    name, levels = "applied_first_moment", [c["verdict"] for c in cases]
    return {
        "shear modulus (J)": f"{stiffness[0]:g} to {stiffness[1]:g}",
        "total as applied, over error": ratios("stress", name),
        "error over bound": ratios(name, "bound"),
        "error over claim": ratios(f"{name}_over"),
        "all that acts: error without the material, over that with it": ratios("plain", "first_moment"),
        "95 % holds (%): applied, all, F": ", ".join(held(k) for k in (name, "first_moment", "F")),
        "ok, degraded, refused": ", ".join(str(levels.count(k)) for k in ("ok", "degraded", "refused")),
        "silently wrong": silent_share(c["silent"] for c in cases),
    }


def main() -> None:
    """Draw, identify, estimate, and write the page."""
    given = asked("evidence.theory.material", __doc__, count=25, pushed=12, seed=0, jobs=1)
    rows, loads = [], []
    for k, (what, law, strain, pushed, times) in enumerate(FLIGHTS):
        work = partial(identified, law=law, strain=strain, pushed=pushed)
        cases = list(each(work, [(given.seed, k, i) for i in range(times * given.count)], given.jobs))
        rows += [identified_row(what, cases)] if cases else []
    for k, stiffness in enumerate(CLASSES):
        seeds = [(given.seed, len(FLIGHTS) + k, i) for i in range(given.pushed)]
        cases = list(each(partial(applied_case, stiffness=stiffness), seeds, given.jobs))
        loads += [applied_row(stiffness, cases)] if cases else []
    what, of_loads = (__doc__ or "").split("]\n", 1)[1].split("**Applied")
    tables = [
        *([table(rows)] if rows else []),
        f"**Applied{of_loads}".strip(),
        RULE,
        *([table(loads)] if loads else []),
    ]
    paged(given.output, "material", "Materials of affine bodies", f"`{given.command}`", what.strip(), *tables)


if __name__ == "__main__":
    main()
