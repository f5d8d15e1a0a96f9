"""Loads as functions of time and of the state of a body, smooth between the instants at which they break."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from evidence.calibration import distributions as of
from evidence.calibration.bodies import Moved
from evidence.calibration.distributions import Drawn
from forceid.records import Array

WAVES = 40  # cosines that make an axis of a smooth load
Pulse = tuple[float, float, Array]
Of = Callable[[float, "State"], Array]  # force, then moment (6,), world axes


@dataclass(frozen=True)
class State:
    """Where a body is: center m, velocity m/s, R (3, 3) body to world, w rad/s, world axes."""

    center: Array
    velocity: Array
    R: Array
    w: Array


@dataclass(frozen=True)
class Load:
    """A load `at` (t, state) as force, then moment (6,) about the mass center, N and N m, world axes.

    breaks: instants s at which it is not smooth; pulses: blows beside, (begin s, length s, impulse (6,)), of
    which, as of jumps, the mean over a sample counts as truth; constant (3,) N: a force that carries the
    weight.
    """

    at: Of
    breaks: tuple[float, ...] = ()
    pulses: tuple[Pulse, ...] = ()
    constant: Array = field(default_factory=lambda: np.zeros(3))

    def __call__(self, t: float, s: State) -> Array:
        """All of it."""
        blows = sum((rate_of(t, *pulse) for pulse in self.pulses), np.zeros(6))
        return self.steady(t, s) + blows

    def steady(self, t: float, s: State) -> Array:
        """All but the blows."""
        return self.at(t, s) + np.append(self.constant, np.zeros(3))

    def halved(self, times: int) -> Load:
        """A half of it, so many times over, but for what carries the weight."""
        part = 0.5**times
        pulses = tuple((begin, length, part * impulse) for begin, length, impulse in self.pulses)
        return replace(self, at=lambda t, s: part * self.at(t, s), pulses=pulses)


@dataclass(frozen=True)
class Scale:
    """What shows: error of a pose, m and rad, and how a body answers: mass kg and inertia (3, 3)."""

    center: float
    turn: float
    size: float
    mass: float
    inertia: Array

    def accelerations(self, rng: np.random.Generator, shows: float) -> tuple[float, float]:
        """Accelerations, m/s2 and rad/s2, that move what is drawn within a time, 1 / shows."""
        moved = min(self.center * of.log_even(rng, of.SHOWN), 0.5 * self.size)
        turned = min(self.turn * of.log_even(rng, of.SHOWN), 1.0)
        arm = 0.5 * self.size
        return min(moved * shows**2, of.STRONGEST), min(turned * shows**2, of.STRONGEST / arm)

    def load(self, push: Array, twist: Array) -> Array:
        """A load (6,) that makes about these accelerations (3,)."""
        return np.concatenate([self.mass * push, self.inertia @ twist])


def scale_of(drawn: Drawn, body: Moved) -> Scale:
    """What shows of a body as it is watched."""
    x = body.markers - body.markers.mean(0)
    turn = drawn.noise / np.sqrt(2 / 3 * np.sum(x**2))
    return Scale(drawn.noise / np.sqrt(len(x)), float(turn), body.size, body.mass, body.inertia)


def smooth_load(
    drawn: Drawn, scale: Scale, span: float, rng: np.random.Generator
) -> Callable[[float], Array]:
    """A load of time that varies as a Matern process of order 3/2, by cosines drawn from its spectrum."""
    forgets = of.log_even(rng, of.FORGETS) / span
    w = np.abs(forgets * rng.standard_t(3, (6, WAVES)) / np.sqrt(3))
    w = np.minimum(w, 2 * np.pi * 0.25 * drawn.rate)
    phase = rng.uniform(0, 2 * np.pi, w.shape)
    push, twist = scale.accelerations(rng, forgets)
    uneven = np.exp(rng.uniform(-1.5, 0, 6))  # axes differ
    level = uneven * np.repeat([push, twist], 3) * np.sqrt(2 / WAVES)
    return lambda t: scale.load(*(level * np.cos(w * t + phase).sum(1)).reshape(2, 3))


def drawn_load(drawn: Drawn, body: Moved, span: float, start: State, rng: np.random.Generator) -> Load:
    """A load of its kind, beside which a smooth one may act."""
    scale = scale_of(drawn, body)
    beside = smooth_load(drawn, scale, span, rng)
    own = MAKERS[drawn.load](drawn, scale, span, start, rng)
    if drawn.load not in ("oscillating", "steps", "impacts") or rng.random() >= of.BESIDE:
        return own
    return Load(lambda t, s: own.at(t, s) + beside(t), own.breaks, own.pulses)


def no_load(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """Nothing acts but the weight."""
    return Load(lambda t, s: np.zeros(6))


def smooth(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """Smooth along axes of the world."""
    path = smooth_load(drawn, scale, span, rng)
    return Load(lambda t, s: path(t))


def body_fixed(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """A thrust and a moment along axes of the body, constant but for a smooth part."""
    path, constant = smooth_load(drawn, scale, span, rng), rng.uniform(0, 3)
    held = constant * path(rng.uniform(0, span))

    def at(t: float, s: State) -> Array:
        return np.asarray(((held + path(t)).reshape(2, 3) @ s.R.T).ravel())

    return Load(at)


def oscillating(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """One to three sines, each along a direction of force and moment."""
    lines, parts = of.count(rng, of.LINES), []
    span_hz = of.CYCLES / span, of.FASTEST * drawn.rate
    w = 2 * np.pi * np.array([of.log_even(rng, span_hz) for _ in range(lines)])
    for each in w:
        push, twist = scale.accelerations(rng, each)
        acts = rng.integers(3)  # force and moment, force alone, moment alone
        along = push * (acts != 2) * of.direction(rng), twist * (acts != 1) * of.direction(rng)
        parts.append(scale.load(*along))
    phase = rng.uniform(0, 2 * np.pi, lines)
    return Load(lambda t, s: np.sin(w * t + phase) @ np.array(parts))


def steps(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """Levels that change at instants."""
    when = np.sort(rng.uniform(0.05, 0.95, of.count(rng, of.STEPS))) * span
    push, twist = scale.accelerations(rng, 8.0 / span)
    levels = np.array([
        scale.load(push * rng.standard_normal(3), twist * rng.standard_normal(3))
        for _ in range(len(when) + 1)
    ])  # fmt: skip
    return Load(lambda t, s: levels[np.searchsorted(when, t, side="right")], tuple(when))


def impacts(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """Blows off the mass center, each a raised cosine in time."""
    pulses = []
    for _ in range(of.count(rng, of.IMPACTS)):
        length = of.log_even(rng, of.PULSES)
        blow = scale.mass * of.log_even(rng, of.JUMPS) * of.direction(rng)
        arm = rng.uniform(0, 0.3) * scale.size * of.direction(rng)
        pulses.append((rng.uniform(0.05, 0.9) * span, length, np.concatenate([blow, np.cross(arm, blow)])))
    breaks = [edge for begin, length, _ in pulses for edge in (begin, begin + length)]
    return Load(lambda t, s: np.zeros(6), tuple(sorted(breaks)), tuple(pulses))


def rate_of(t: float, begin: float, length: float, impulse: Array) -> Array:
    """A blow at a time."""
    part = (t - begin) / length
    return impulse * (1 - np.cos(2 * np.pi * part)) / length if 0 < part < 1 else 0 * impulse


def given(t: Array, begin: float, length: float, impulse: Array) -> Array:
    """What a blow has given until times (time, 6)."""
    part = np.clip((t - begin) / length, 0, 1)
    return np.outer(part - np.sin(2 * np.pi * part) / (2 * np.pi), impulse)


def of_the_state(drawn: Drawn, scale: Scale, span: float, start: State, rng: np.random.Generator) -> Load:
    """Drag off the mass center with damping of the turn; or a tether to where it began, with damping."""
    weight, held = scale.mass * 9.81, float(rng.uniform(0.02, 1.0)) / span
    slow = held * scale.inertia
    if rng.random() >= of.TETHERED:
        speed = max(float(np.linalg.norm(start.velocity)), 1.0)
        drag = of.log_even(rng, of.DRAGS) * weight / speed**2 * rng.uniform(0.5, 1, 3)
        off = rng.uniform(0, 0.1) * scale.size * of.direction(rng)

        def at(t: float, s: State) -> Array:
            F = -s.R @ (drag * (s.R.T @ s.velocity)) * np.linalg.norm(s.velocity)
            return np.concatenate([F, np.cross(s.R @ off, F) - s.R @ slow @ s.R.T @ s.w])

        return Load(at)
    stiff = scale.mass * min((2 * np.pi * of.log_even(rng, of.SWUNG) / span) ** 2, of.STRONGEST)
    damped, end = 0.1 * np.sqrt(stiff * scale.mass), start.center + rng.uniform(-1, 1, 3)
    hook = rng.uniform(0, 0.3) * scale.size * of.direction(rng)

    def tether(t: float, s: State) -> Array:
        arm = s.R @ hook
        F = -stiff * (s.center + arm - end) - damped * s.velocity
        return np.concatenate([F, np.cross(arm, F) - s.R @ slow @ s.R.T @ s.w])

    return Load(tether)


MAKERS = {
    "none": no_load, "smooth": smooth, "oscillating": oscillating, "steps": steps, "impacts": impacts,
    "body-fixed": body_fixed, "of the state": of_the_state,
}  # fmt: skip
