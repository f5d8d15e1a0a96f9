"""Bodies under loads that a record may hide, drawn: oscillations, steps, events, wheels inside.

Force and moment are known with their first two integrals; the rotation is integrated from the angular
momentum by Runge and Kutta, in steps far finer than the record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY, hat
from forceid.records import Array, Body, Motion, Recording

KINDS = ("oscillation", "step", "event", "wheel", "nothing")
SHOWS = 7.0  # standard deviations of the noise
SUBSTEPS = 8  # of a sample, in which the rotation is integrated


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
class DrawnRecord:
    """A drawn record: what acts, and what of it is looked for; motor (time, 3) N m: what spins a wheel up."""

    kind: str
    recording: Recording
    force: list[Term]
    moment: list[Term]
    facts: dict[str, float | str]
    motor: Array | None = None

    def load(self, name: str) -> Array:
        """The true load (time, 3), with the torque of what spins a wheel up: a moment like any other.

        Of steps and events the mean over a sample, from midpoint to midpoint: all that samples show of them.
        """
        t, terms = self.recording.motion.time, getattr(self, name)
        if self.kind in ("step", "event") and self.facts["load"] == name:
            half, sudden = 0.5 * (t[1] - t[0]), terms[-1:]
            gained = sum_terms(sudden, 1, t + half) - sum_terms(sudden, 1, t - half)
            return sum_terms(terms[:-1], 0, t) + gained / (2 * half)
        acts = sum_terms(terms, 0, t)
        return acts if self.motor is None or name == "force" else acts + self.motor


def sum_terms(terms: list[Term], times: int, t: Array) -> Array:
    """The sum of loads, integrated so many times (time, 3)."""
    return sum(
        (np.multiply.outer(term.at(times, t), term.direction) for term in terms), np.zeros((len(t), 3))
    )


def length_beside_parabola(response: Array) -> float:
    """Length of a response (time, 3) that a parabola does not explain."""
    t = np.linspace(-1, 1, len(response))
    known = np.linalg.qr(np.vander(t, 3))[0]
    return float(np.linalg.norm(response - known @ (known.T @ response)))


def rotations_under(t: Array, start: Rotation, H: Array, J: Array, h: Array) -> Array:
    """Rotations (time, 3, 3) of a body with angular momentum H (2 * steps + 1, 3) and wheel h, by Runge and
    Kutta."""
    inverse, R = np.linalg.inv(J), start.as_matrix()
    found = [R]

    def rate(Q: Array, k: int) -> Array:
        return Q @ hat(inverse @ (Q.T @ H[k] - h[k]))

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


def draw_record(kind: str, rng: np.random.Generator) -> DrawnRecord:
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
        return SHOWS * size[name] / length_beside_parabola(sum_terms([term], 2, t))

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
    H = start.as_matrix() @ (J @ spin + h[0]) + sum_terms(loads["moment"], 1, fine)
    R = rotations_under(fine, start, H, J, h)
    center = (
        np.outer(t, [1.0, 0.5, 3.0]) + 0.5 * np.outer(t**2, GRAVITY) + sum_terms(loads["force"], 2, t) / mass
    )
    x = center[:, None] + np.einsum("tab,nb->tna", R, X)
    x = x + noise * rng.standard_normal(x.shape)
    stated = bool(rng.random() < 0.5)
    facts["stated"] = str(stated)
    motion = Motion(t, x, gravity=GRAVITY, noise_std={"position": noise} if stated else {})
    speeds_up = np.gradient(h, fine, axis=0)[:: 2 * SUBSTEPS]
    motor = -np.einsum("tab,tb->ta", R, speeds_up) if kind == "wheel" else None
    return DrawnRecord(kind, Recording(body, motion), loads["force"], loads["moment"], facts, motor)
