"""Loads that a record may hide: whether a result that calls itself ok is wrong and does not say so.

    python -m evidence.drawn.hidden_loads -o docs [--count 250] [--seed 18] [-j 2] [--only KIND...]

Drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, noise of 0.1 to 2 mm, stated or not. Beside a smooth
load, or none: oscillating loads at 5 to 45 % of the sample rate, steps, events that last a hundredth of the
record, a wheel inside the body that turns at a constant rate or spins up, nothing. Their sizes are 0.1 to 10
times what just shows (a wheel to 100): seven standard deviations of the noise, beside the start and a
constant load, which are unknown. The torque that spins a wheel up is a moment like any other.

A result is silently wrong where its verdict is ok and the error of a load within its band is more than twice
what it claims, rms over the axes of the load and the central three quarters of the record; or where an
oscillating load beyond the band, larger than `hidden_load` there, was not found.
"""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import interp1d
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from evidence.written import asked, each, tabled, written
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Body, Estimate, Motion, Recording

KINDS = ("oscillation", "step", "event", "wheel", "nothing")
SHOWS = 7.0  # standard deviations of the noise
SUBSTEPS = 8  # of a sample, in which the rotation is integrated
WRONG = 2.0  # times the claim


@dataclass(frozen=True)
class Term:
    """A load direction * pattern(t), known with its first two integrals from zero: at(times integrated,
    time)."""

    direction: Array
    at: Callable[[int, Array], Array]

    def scaled(self, size: float) -> Term:
        """The same, larger."""
        return Term(size * self.direction, self.at)


def wave(frequency: float, phase: float) -> Callable[[int, Array], Array]:
    """A sine."""
    w = 2 * np.pi * frequency

    def at(times: int, t: Array) -> Array:
        if times == 0:
            return np.asarray(np.sin(w * t + phase))
        if times == 1:
            return np.asarray((np.cos(phase) - np.cos(w * t + phase)) / w)
        return np.asarray(t * np.cos(phase) / w - (np.sin(w * t + phase) - np.sin(phase)) / w**2)

    return at


def box(begin: float, end: float) -> Callable[[int, Array], Array]:
    """A load of one between two times."""

    def ramp(times: int, t: Array) -> Array:
        return np.asarray(np.where(t > 0, 1.0, 0.0) * t**times / max(times, 1))

    return lambda times, t: ramp(times, t - begin) - ramp(times, t - end)


@dataclass(frozen=True)
class Case:
    """A drawn record: what acts, and what of it is looked for; motor (time, 3) N m: what spins a wheel up."""

    kind: str
    recording: Recording
    force: list[Term]
    moment: list[Term]
    facts: dict[str, float | str]
    motor: Array | None = None

    def load(self, name: str) -> Array:
        """The true load (time, 3), with the torque of what spins a wheel up: a moment like any other."""
        t = self.recording.motion.time
        acts = total(getattr(self, name), 0, t)
        return acts if self.motor is None or name == "force" else acts + self.motor


def total(terms: list[Term], times: int, t: Array) -> Array:
    """The sum of loads, integrated so many times (time, 3)."""
    return sum(
        (np.multiply.outer(term.at(times, t), term.direction) for term in terms), np.zeros((len(t), 3))
    )


def beside_parabola(response: Array) -> float:
    """Length of a response (time, 3) that a parabola does not explain."""
    t = np.linspace(-1, 1, len(response))
    known = np.linalg.qr(np.vander(t, 3))[0]
    return float(np.linalg.norm(response - known @ (known.T @ response)))


def turned(t: Array, start: Rotation, H: Array, J: Array, h: Array) -> Array:
    """Rotations (time, 3, 3) of a body with angular momentum H (2 * steps + 1, 3) and wheel h, by Runge and
    Kutta."""
    inverse, R = np.linalg.inv(J), start.as_matrix()
    found = [R]

    def rate(Q: Array, k: int) -> Array:
        omega = inverse @ (Q.T @ H[k] - h[k])
        a, b, c = omega
        return Q @ np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])

    d = 2 * (t[1] - t[0])
    for k in range(0, len(t) - 2, 2):
        k1 = rate(R, k)
        k2 = rate(R + 0.5 * d * k1, k + 1)
        k3 = rate(R + 0.5 * d * k2, k + 1)
        k4 = rate(R + d * k3, k + 2)
        R = R + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        R = 1.5 * R - 0.5 * R @ R.T @ R  # back to a rotation
        if (k + 2) % (2 * SUBSTEPS) == 0:
            found.append(R)
    return np.array(found)


def draw(kind: str, rng: np.random.Generator) -> Case:
    """A record of a kind."""
    markers, rate = int(rng.integers(3, 11)), float(np.exp(rng.uniform(np.log(50), np.log(1000))))
    samples = int(np.exp(rng.uniform(np.log(150), np.log(700))))
    noise, mass = float(np.exp(rng.uniform(np.log(1e-4), np.log(2e-3)))), float(np.exp(rng.uniform(-2, 2)))
    X = 0.15 * rng.standard_normal((markers, 3))
    principal = rng.uniform(0.6, 1.0, 3)
    axes = Rotation.random(random_state=rng).as_matrix()
    J = mass * 0.15**2 * axes @ np.diag(principal) @ axes.T
    body = Body(
        node=tuple(f"m{k}" for k in range(markers)), position=X, total_mass=mass, mass_center=np.zeros(3),
        inertia=J,
    )  # fmt: skip
    t = np.arange(samples) / rate
    fine = np.arange(2 * SUBSTEPS * (samples - 1) + 1) / (2 * SUBSTEPS * rate)
    span = t[-1]
    center_std = noise / np.sqrt(markers)
    spread = X - X.mean(0)
    turn_std = noise / np.sqrt(np.trace(spread.T @ spread) * 2 / 3)
    size = {"force": mass * center_std, "moment": float(np.trace(J)) / 3 * turn_std}
    loads: dict[str, list[Term]] = {"force": [], "moment": []}
    smooth = bool(rng.random() < 0.5)
    facts: dict[str, float | str] = {
        "rate": rate, "samples": samples, "markers": markers, "noise": noise, "smooth": str(smooth),
    }  # fmt: skip

    def shown(term: Term, name: str) -> float:
        return SHOWS * size[name] / beside_parabola(total([term], 2, t))

    if smooth:
        for name, terms in loads.items():
            for _ in range(6):
                slow = Term(rng.standard_normal(3), wave(rng.uniform(0.3, 3.0) / span, rng.uniform(0, 6.28)))
                terms.append(slow.scaled(shown(slow, name) * rng.uniform(2, 20)))
    h = np.zeros((len(fine), 3))
    spin = rng.standard_normal(3)
    spin *= min(rng.uniform(2, 15), 0.3 * rate) / np.linalg.norm(spin)
    if kind in ("oscillation", "step", "event"):
        name = "force" if rng.random() < 0.5 else "moment"
        direction = rng.standard_normal(3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
        direction = direction / np.linalg.norm(direction)
        if kind == "oscillation":
            frequency = rng.uniform(0.05, 0.45) * rate
            pattern, facts["frequency"] = wave(frequency, rng.uniform(0, 6.28)), frequency
        else:
            begin = rng.uniform(0.15, 0.85) * span
            pattern = box(begin, np.inf if kind == "step" else begin + 0.01 * span)
            pattern = box(begin, 2 * span if kind == "step" else begin + 0.01 * span)
            facts["begin"] = begin / span
        times = float(np.exp(rng.uniform(np.log(0.1), np.log(10))))
        term = Term(direction, pattern)
        term = term.scaled(times * shown(term, name))
        loads[name].append(term)
        facts |= {"load": name, "times": times, "size": float(np.linalg.norm(term.direction))}
    elif kind == "wheel":
        axis, up = rng.standard_normal(3), bool(rng.random() < 0.5)
        path = np.ones(len(fine))
        if up:
            path = np.clip(fine / span * rng.uniform(1, 3) - rng.uniform(0, 0.5), 0, 1)
        times = float(np.exp(rng.uniform(np.log(0.1), np.log(100))))
        about = np.linalg.norm(np.cross(spin, axis)) * span**2 * np.sqrt(samples) / 50  # of its Y, roughly
        h = np.multiply.outer(path, axis * times * SHOWS * size["moment"] / about)
        limit = min(1.0, 0.5 * float(np.linalg.norm(J @ spin)) / float(np.abs(h).max()))
        h = h * limit
        facts |= {"times": times * limit, "up": str(up), "h": float(np.linalg.norm(h[-1]))}
    start = Rotation.random(random_state=rng)
    H = start.as_matrix() @ (J @ spin + h[0]) + total(loads["moment"], 1, fine)
    R = turned(fine, start, H, J, h)
    velocity, gravity = np.array([1.0, 0.5, 3.0]), np.array([0, 0, -9.81])
    center = np.outer(t, velocity) + 0.5 * np.outer(t**2, gravity) + total(loads["force"], 2, t) / mass
    x = center[:, None] + np.einsum("tab,nb->tna", R, X)
    x = x + noise * rng.standard_normal(x.shape)
    stated = bool(rng.random() < 0.5)
    facts["stated"] = str(stated)
    motion = Motion(t, x, gravity=gravity, noise_std={"position": noise} if stated else {})
    speeds_up = np.gradient(h, fine, axis=0)[:: 2 * SUBSTEPS]
    motor = -np.einsum("tab,tb->ta", R, speeds_up) if kind == "wheel" else None
    return Case(kind, Recording(body, motion), loads["force"], loads["moment"], facts, motor)


def slow_part(error: Array, band: float, rate: float) -> Array:
    """What of an error (time,) lies below a frequency, in the central three quarters.

    Of less than three cycles: its mean, weighed so that no faster part of it leaks in.
    """
    edge = len(error) // 8
    if band * len(error) / rate < 3.0:
        weight = np.sin(np.pi * np.linspace(0, 1, len(error))) ** 4
        return np.full(1, weight @ error / weight.sum())
    if band < 0.45 * rate:
        error = sosfiltfilt(butter(4, 2 * band / rate, output="sos"), error)
    return error[edge : len(error) - edge]


def amplitude_of(error: Array, frequency: float, t: Array) -> float:
    """Amplitude of the wave of a frequency in an error (time,), the rest of which is slow or noise."""
    weight = np.sin(np.pi * (t - t[0]) / np.ptp(t)) ** 4
    return float(2 * np.abs(weight @ (error * np.exp(-2j * np.pi * frequency * t))) / weight.sum())


def without_wave(error: Array, case: Case, t: Array) -> Array:
    """An error (time, 3) without the wave that is beyond the band, which is judged by its amplitude."""
    w = 2 * np.pi * float(case.facts["frequency"])
    A = np.stack([np.cos(w * t), np.sin(w * t)], 1)
    return np.asarray(error - A @ np.linalg.lstsq(A, error, rcond=None)[0])


def judge(case: Case, found: Estimate) -> dict[str, float]:
    """Error over claim within the band, and the amplitude of an unseen wave beyond it over hidden_load."""
    t, hidden = case.recording.motion.time, found.hidden
    assert hidden is not None
    edge, rate, scores = len(t) // 8, 1 / float(np.median(np.diff(t))), {}
    for first, name in enumerate(("force", "moment")):
        error = getattr(found, name) - case.load(name)
        std = getattr(found, f"{name}_std")[edge : len(t) - edge]
        band = hidden.band[3 * first : 3 * first + 3]
        slow = error
        if case.kind == "oscillation" and case.facts["load"] == name:
            slow = np.where(float(case.facts["frequency"]) > band, without_wave(error, case, t), error)
        parts = [np.mean(slow_part(e, b, rate) ** 2) for e, b in zip(slow.T, band, strict=True)]
        claims = (std**2).mean(0)
        scores[name] = float(np.sqrt(np.mean(np.array(parts) / claims)))
        scores[f"{name}_plain"] = float(np.sqrt(np.mean((error[edge : len(t) - edge] / std) ** 2)))
        if case.kind == "oscillation" and case.facts["load"] == name:
            frequency, scores["unseen"] = float(case.facts["frequency"]), 0.0
            for axis, beyond in enumerate(frequency > band):
                curve = interp1d(np.log(hidden.frequency), np.log(hidden.amplitude[:, 3 * first + axis]))
                least = float(np.exp(curve(np.log(frequency))))
                if beyond:
                    left = amplitude_of(error[:, axis], frequency, t)
                    scores["unseen"] = max(scores["unseen"], left / least)
    return scores


def run(case: Case) -> dict[str, Any]:
    """What came out of a record, and whether it is silently wrong."""
    began = clock.perf_counter()
    try:
        found = estimate_recording(case.recording, load_settings(model="rigid"))
    except EstimationError as e:
        return {"verdict": "refused", "reasons": [str(e)], "wrong": False, "kind": case.kind} | case.facts
    row: dict[str, Any] = {"verdict": found.verdict.level, "reasons": list(found.verdict.reasons)}
    row |= judge(case, found)
    row["orders"] = [found.tuned[f"{name}_order"] for name in ("force", "moment")]
    row["band"] = found.hidden.band.round(2).tolist() if found.hidden else []
    off = max(row["force"], row["moment"]) > WRONG or row.get("unseen", 0.0) > 1.0
    row["wrong"] = bool(row["verdict"] == "ok" and off)
    return row | {"kind": case.kind, "seconds": clock.perf_counter() - began} | case.facts


COLUMNS = (
    "force", "moment", "force_plain", "moment_plain", "unseen", "load", "times", "stated", "smooth",
    "samples", "seconds", "orders", "band",
)  # fmt: skip


def told(row: dict[str, Any]) -> str:
    """A row on one line."""
    values = (
        f"{n}={row[n]:.3g}" if isinstance(row[n], float) else f"{n}={row[n]}" for n in COLUMNS if n in row
    )
    return f"{row['kind']:12} {row['verdict']:9} {'WRONG' if row['wrong'] else '     '} {' '.join(values)}"


def case_of(seed: int, k: int, kinds: list[str]) -> dict[str, Any]:
    """What came out of record k."""
    return run(draw(kinds[k % len(kinds)], np.random.default_rng([seed, k]))) | {"record": k}


def page(rows: list[dict[str, Any]], kinds: list[str], command: str) -> str:
    """The table by kind of load, as a page."""
    lines = [
        "# Loads that a record may hide",
        "",
        f"`{command}`: drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, 150 to 700 samples, noise "
        "of 0.1 to 2 mm, stated to half of them. Half of them are under smooth forces and moments beside. "
        "*oscillation*: at 5 to 45 % of the sample rate; *step*: for good, anywhere in the record; *event*: "
        "a hundredth of the record long; *wheel*: an angular momentum inside the body of which nothing is "
        "stated, at a constant rate or spinning up, up to half of what the body has (the torque that spins "
        "it up is a moment like any other, and counts as one); *nothing*: the smooth loads alone. Sizes from "
        "0.1 to 10 times what just shows, of wheels to 100 times.",
        "",
        "*silently wrong*: the verdict is `ok`, and within the band (up to `band` Hz, central three quarters "
        "of the record, rms over the axes) the error of a force or moment is more than twice its claim, or a "
        "wave beyond the band is larger than `hidden_load` and was not found. That is what half of all "
        "records would not show, so that one little larger may go unseen too. Error over claim: of force and "
        "moment within the band, the median, and the largest of all that call themselves `ok`.",
        "",
    ]
    heads = (
        "kind",
        "records",
        "ok",
        "degraded",
        "refused",
        "silently wrong",
        "error over claim",
        "largest while ok",
    )
    counted = []
    for kind in (*kinds, "all"):
        of = [r for r in rows if kind in (r["kind"], "all")]
        level = [r["verdict"] for r in of]
        scores = [r[name] for r in of if "force" in r for name in ("force", "moment")]
        ok = [r[name] for r in of if r["verdict"] == "ok" for name in ("force", "moment")]
        numbers = len(of), *map(level.count, ("ok", "degraded", "refused")), sum(r["wrong"] for r in of)
        counted.append(
            [kind, *map(str, numbers), f"{np.median(scores):.2f}", f"{max(ok, default=np.nan):.2f}"]
        )
    lines.append(tabled(heads, counted))
    if wrongs := [r for r in rows if r["wrong"]]:
        lines += ["", "Silently wrong:", ""]
        lines += [f"- record {r['record']}: `{told(r)}`" for r in wrongs]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Draw, estimate, judge, write the table."""
    given = asked(
        "evidence.drawn.hidden_loads", __doc__, count=250, first=0, seed=18, jobs=1, only=tuple(KINDS)
    )
    which = range(given.first, given.first + given.count)
    rows = list(each(partial(case_of, given.seed, kinds=given.only), which, given.jobs))
    text = page(rows, given.only, given.command)
    written(given.output, "hidden_loads.md", text)
    print(text)
    return int(any(r["wrong"] for r in rows))


if __name__ == "__main__":
    sys.exit(main())
