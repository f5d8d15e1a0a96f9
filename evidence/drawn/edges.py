"""Loads that change character: steps, contacts and impacts in flights of rigid bodies, and how well told.

    python -m evidence.drawn.edges -o docs [--count 40] [--seed 77] [-j 2] [--only KIND...]

Drawn rigid bodies with 4 to 14 markers at 100 to 500 Hz, noise of 0.2 to 1 mm, stated or not, under slow
forces and moments of a few percent of the weight, and a force at a point off the mass center: a step for
good, a contact of 10 ms to 0.3 s with sharp ends or as half a sine, an impact shorter than a sample. The
flight is integrated by DOP853, edge by edge; the same flight without the event is estimated beside it.
"""

from __future__ import annotations

import sys
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.judged import LOADS, RULE, scores, silent_share, silently_wrong
from evidence.vectors import GRAVITY
from evidence.written import asked, each, paged, tabled
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Body, Motion, Recording

KINDS = ("step", "contact", "half_sine", "impact")
NEAR = 0.05  # s: what is nearer to an event counts as near
HEADS = (
    "event", "flights", "ok", "degraded", "found", "edge off, samples", "impulse over claim",
    "near: force, moment over claim", "away: force, moment over claim", "away, over without the event",
    "silently wrong",
)  # fmt: skip
ABOUT = """\
`{command}`: drawn rigid bodies with 4 to 14 markers at 100 to 500 Hz, noise of 0.2 to 1 mm, stated to
half of them. They fly under slow forces and moments, and beside these a force at a point off the mass \
center. *step*: for good, 0.3 to 3 times the weight; *contact*: 0.01 to 0.3 s, 1 to 8 times the weight, \
with sharp ends; *half_sine*: the same without; *impact*: within a sample, 0.2 to 2 m/s. Of the event the \
truth is the mean over a sample, from midpoint to midpoint.

*found*: edges of the force were found. Medians are told. *edge off*: how far the
nearest edge found is from a true one. *over claim*: of the impulse of the force, and of force and moment
within 50 ms of the event and away from it. *without the event*: error of the force away from it over that of
the same flight without it."""


def drawn_flight(seed: int, k: int, kind: str) -> dict[str, Any]:
    """A flight with an event and without, as recordings, and the truth of it."""
    rng = np.random.default_rng([seed, k])
    mass, rate, markers = rng.uniform(0.5, 5), rng.uniform(100, 500), int(rng.integers(4, 15))
    moments = np.sort(mass * rng.uniform(0.003, 0.02, 3))
    J = np.diag([*moments[:2], min(moments[2], 0.95 * moments[:2].sum())])
    noise = 10 ** rng.uniform(np.log10(2e-4), -3)
    time = np.arange(int(2.0 * rate)) / rate
    begin = rng.uniform(0.3, 0.6) * time[-1]
    length = {"step": np.inf, "impact": rng.uniform(0.1, 0.9) / rate}.get(
        kind, 10 ** rng.uniform(-2, np.log10(0.3))
    )
    weights = rng.uniform(0.3, 3) if kind == "step" else rng.uniform(1, 8)
    force = mass * (rng.uniform(0.2, 2) / length if kind == "impact" else 9.81 * weights)
    direction, lever = rng.normal(size=3), 0.05 * rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    w, phase = 2 * np.pi * rng.uniform(0.3, 2, (3, 3)), rng.uniform(0, 2 * np.pi, (3, 3))
    slow = 0.03 * 9.81 * mass * rng.normal(size=(2, 3, 3))
    slow[1] *= 0.05
    start = np.concatenate(
        [np.zeros(3), rng.normal(size=3), Rotation.random(rng=rng).as_quat(), J @ rng.normal(size=3) * 3]
    )
    place = 0.1 * rng.normal(size=(markers, 3))
    errors = noise * rng.normal(size=(len(time), markers, 3))
    stated = {"position": noise} if rng.random() < 0.5 else {}
    body = Body(
        node=tuple(f"m{i}" for i in range(markers)),
        position=place,
        total_mass=mass,
        mass_center=np.zeros(3),
        inertia=J,
    )
    found: dict[str, Any] = {"begin": begin, "end": begin + length, "time": time, "rate": rate}
    for name, size in (("with", force), ("without", 0.0)):

        def load(t: float, on: bool, size: float = size) -> tuple[Array, Array]:
            F, M = (a @ np.ones(3) for a in (slow * np.sin(w * t + phase)))
            shape = np.pi / 2 * np.sin(np.pi * (t - begin) / length) if kind == "half_sine" else 1.0
            event = size * shape * on * direction
            return F + event, M + np.cross(lever, event)

        def given(t: Array) -> Array:
            """What the event has given until times, over its size."""
            for_so_long = np.clip(t - begin, 0.0, length)
            if kind != "half_sine":
                return np.asarray(for_so_long)
            return np.asarray(length / 2 * (1 - np.cos(np.pi * for_so_long / length)))

        path = flown(time, start, mass, J, load, [begin, begin + length])
        R = Rotation.from_quat(path[:, 6:10]).as_matrix()
        position = path[:, None, :3] + np.einsum("tab,nb->tna", R, place) + errors
        over = rate * (given(time + 0.5 / rate) - given(time - 0.5 / rate))  # mean over the cell of a sample
        F, M = (np.array(a) for a in zip(*[load(t, False) for t in time], strict=True))
        event = size * np.outer(over, direction)
        motion = Motion(time=time, position=position, gravity=GRAVITY, noise_std=stated)
        found[name] = (Recording(body, motion), F + event, M + np.cross(lever, event))
    found["impulse"] = force * length * direction if np.isfinite(length) else None
    return found


def flown(time: Array, start: Array, mass: float, J: Array, load: Any, edges: list[float]) -> Array:
    """States (time, 13): center, velocity, quaternion, angular momentum, integrated from edge to edge."""
    state, out = start, np.zeros((len(time), 13))
    cuts = [time[0], *(e for e in edges if e < time[-1]), time[-1]]
    for k, (a, b) in enumerate(pairwise(cuts)):

        def rate(t: float, y: Array, on: bool = k == 1) -> Array:
            F, M = load(t, on)
            q = y[6:10] / np.linalg.norm(y[6:10])
            omega = np.linalg.solve(J, Rotation.from_quat(q).as_matrix().T @ y[10:])
            turn = 0.5 * np.append(q[3] * omega + np.cross(q[:3], omega), -q[:3] @ omega)
            return np.concatenate([y[3:6], F / mass + GRAVITY, turn, M])

        own = (time >= a) & (time <= b)
        solved = solve_ivp(rate, (a, b), state, "DOP853", np.union1d(time[own], b), rtol=1e-9, atol=1e-12)
        out[own], state = solved.y.T[: own.sum()], solved.y[:, -1]
    return out


def judged(seed: int, k: int, kinds: tuple[str, ...]) -> dict[str, Any]:
    """What came out of flight k."""
    kind = kinds[k % len(kinds)]
    case = drawn_flight(seed, k, kind)
    (recording, F, M), time = case["with"], case["time"]
    result = estimate_recording(recording, load_settings())
    beside = estimate_recording(case["without"][0], load_settings())
    end = min(case["end"], case["begin"] if kind == "step" else np.inf)
    near = (time > case["begin"] - NEAR) & (time < end + NEAR)
    away = ~near
    away[: len(time) // 16] = away[-(len(time) // 16) :] = False
    row: dict[str, Any] = {"kind": kind, "verdict": result.verdict.level, "record": k}
    for name, own in (("near", near), ("away", away)):
        for load, error, std in (
            ("force", result.force - F, result.force_std), ("moment", result.moment - M, result.moment_std)
        ):  # fmt: skip
            row[f"{name}_{load}"] = float(np.sqrt((error[own] ** 2).mean() / (std[own] ** 2).mean()))
    plain = beside.force - case["without"][1]
    row["over"] = float(np.sqrt(((result.force - F)[away] ** 2).mean() / (plain[away] ** 2).mean()))
    ratios = scores(result, (F, M))
    row |= {f"{load}_{of}": r for of in ("over", "beside") for load, r in zip(LOADS, ratios[of], strict=True)}
    row["silent"] = silently_wrong(result.verdict.level, ratios["over"], ratios["beside"])
    row["found"] = result.impulses is not None
    if result.impulses is not None:
        row |= of_edges(result.impulses, case, result.force)
    return row


def of_edges(found: Any, case: dict[str, Any], force: Array) -> dict[str, float]:
    """How far edges are from the true ones, and the impulse from the true one, over its claim."""
    true = np.array([case["begin"], case["end"]])
    off = [np.abs(found.start[1:] - t).min() * case["rate"] for t in true if t < case["time"][-1]]
    row = {"off": float(max(off))}
    if case["impulse"] is not None and len(found.start) > 2:
        which = int(np.argmin(np.abs(found.start[1:-1] - true[0]))) + 1
        time, slow = case["time"], case["without"][1]
        a, b = (
            np.searchsorted(time, found.start[which], "right") - 1,
            np.searchsorted(time, found.stop[which]),
        )
        beside = np.trapezoid(slow[a : b + 1], time[a : b + 1], axis=0)
        gone = found.impulse[which, :3] - case["impulse"] - beside
        row["impulse"] = float(np.sqrt(gone @ np.linalg.solve(found.cov[which, :3, :3], gone) / 3))
    return row


def of_kind(rows: list[dict[str, Any]], kind: str) -> list[str]:
    """A kind of event in the table."""
    own = [row for row in rows if row["kind"] == kind]

    def middle(name: str) -> str:
        values = [row[name] for row in own if name in row]
        return f"{np.median(values):.2f} (up to {max(values):.2g})" if values else ""

    verdicts = [sum(row["verdict"] == level for row in own) for level in ("ok", "degraded")]
    pairs = [
        ", ".join(middle(f"{where}_{load}") for load in ("force", "moment")) for where in ("near", "away")
    ]
    counts = map(str, (len(own), *verdicts, sum(row["found"] for row in own)))
    silent = silent_share(row["silent"] for row in own)
    return [kind, *counts, middle("off"), middle("impulse"), *pairs, middle("over"), silent]


def main() -> int:
    """Draw, estimate, judge, write the table."""
    given = asked("evidence.drawn.edges", __doc__, count=40, seed=77, jobs=1, only=KINDS)
    rows = list(each(partial(judged, given.seed, kinds=tuple(given.only)), range(given.count), given.jobs))
    silent = [
        f"- flight {row['record']}, {row['kind']}: {', '.join(f'{n} {row[n]:.2f}' for n in row if '_' in n)}"
        for row in rows
        if row["silent"]
    ]
    paged(
        given.output, "edges", "Loads that change character", ABOUT.format(command=given.command), RULE,
        tabled(HEADS, [of_kind(rows, kind) for kind in given.only]),
        *["Silently wrong, over claim (over: in the band), and beside the plain route:"] * bool(silent),
        *["\n".join(silent)] * bool(silent),
    )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
