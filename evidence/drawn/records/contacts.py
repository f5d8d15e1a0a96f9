"""Balls that bounce and roll, and blocks that ring on mounts or slide, drawn at random, by Coulomb's law.

No code is shared with what fits them: a contact slips or sticks, each with equations of its own, and the
integrator (Dormand and Prince) stops where one takes the other's place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.records import Array, Body, Motion, Recording

G = 9.81  # m/s2
UP = np.array([0.0, 0.0, 1.0])
SLIPS = 1e-9  # m/s: less is a contact that sticks


@dataclass(frozen=True)
class DrawnContact:
    """A drawn motion on the ground: its recording, the ground that is told, and the coefficients by name."""

    recording: Recording
    ground: dict[str, Any]
    true: dict[str, float]


@dataclass(frozen=True)
class Ball:
    """A ball on a plane at height zero: m kg, r m, J kg m2, load by depth and rate, friction, rolling, g."""

    m: float
    r: float
    J: float
    load: Callable[[float, float], float]
    mu: float
    rolling: float
    g: Array

    def rate(self, mode: str, y: Array) -> Array:
        """Slopes of center, velocity, quaternion and angular velocity (13,)."""
        v, q, w = y[3:6], y[6:10], y[10:]
        f, moment = np.zeros(3), np.zeros(3)
        if mode != "air":
            N, drag = self.pressed(y)
            f = self.sticking(drag) if mode == "stick" else -self.mu * N * unit(self.slip(y))
            moment = drag + np.cross(-self.r * UP, f)
            f = f + N * UP
        spun = 0.5 * np.array([*(q[3] * w + np.cross(w, q[:3])), -w @ q[:3]])
        return np.concatenate([v, f / self.m + self.g, spun, moment / self.J])

    def pressed(self, y: Array) -> tuple[float, Array]:
        """The load, and the moment against rolling."""
        N = max(self.load(self.r - y[2], -y[5]), 0.0)
        turn = y[10:] - y[12] * UP
        return N, -self.rolling * self.r * N * unit(turn)

    def slip(self, y: Array) -> Array:
        """Velocity of the point of contact along the plane."""
        at = y[3:6] + np.cross(y[10:], -self.r * UP)
        return np.asarray(at - at[2] * UP)

    def sticking(self, drag: Array) -> Array:
        """The friction under which the point of contact stays where it is."""
        pull = self.g - self.g[2] * UP + np.cross(drag / self.J, -self.r * UP)
        return np.asarray(-pull / (1 / self.m + self.r**2 / self.J))

    def path(self, y: Array, time: Array) -> Array:
        """States (time, 13) from a first one."""
        out, t, mode = [], 0.0, "air" if y[2] > self.r else "slip"
        while t < time[-1]:
            first = unit(self.slip(y))

            def touches(_: float, y: Array) -> float:
                return float(y[2] - self.r)

            def stops(_: float, y: Array, first: Array = first) -> float:
                return float(self.slip(y) @ first)

            def breaks(_: float, y: Array) -> float:
                N, drag = self.pressed(y)
                return float(np.linalg.norm(self.sticking(drag)) - self.mu * N) if N > 0 else -1.0

            touches.direction = -1.0 if mode == "air" else 1.0  # type: ignore[attr-defined]
            stops.direction, breaks.direction = -1.0, 1.0  # type: ignore[attr-defined]
            events = {"air": [touches], "slip": [touches, stops], "stick": [touches, breaks]}[mode]
            for event in events:
                event.terminal = True  # type: ignore[attr-defined]
            at = time[(time >= t) & (time <= time[-1])]
            step = solve_ivp(
                lambda _, y, mode=mode: self.rate(mode, y), (t, time[-1]), y, "DOP853", dense_output=True,
                events=events, rtol=1e-9, atol=1e-11, max_step=2e-3,
            )  # fmt: skip
            end = float(step.t[-1])
            at = at[at < end] if step.status == 1 else at
            if len(at):
                out.append(step.sol(at).T)
            if step.status != 1:
                break
            t, y = end, step.y[:, -1]
            let_go = mode != "air" and len(step.t_events[0])
            if let_go:
                mode = "air"
            elif mode == "stick" and not let_go:
                mode = "slip"
            elif mode == "slip":
                mode = "stick"
            else:
                mode = "slip" if np.linalg.norm(self.slip(y)) > SLIPS else "stick"
        return np.concatenate(out)


def unit(a: Array) -> Array:
    """A vector of length one along another; none along none."""
    size = float(np.sqrt(a @ a))
    return a / size if size > 0 else 0 * a


def drawn_ball(rng: np.random.Generator, rolls: bool) -> DrawnContact:
    """A ball of 0.05 to 0.7 kg that bounces for a second, or is thrown along the ground and ends up rolling.

    Contacts last 8 to 30 ms; damped by rate, or by depth times rate in half of all bounces, or with Hertz's
    power; 100 to 250 Hz.
    """
    u = rng.uniform
    m, r = np.exp(u(np.log(0.05), np.log(0.7))), u(0.03, 0.12)
    J = u(0.4, 0.6) * m * r**2
    w, zeta, rate = np.pi / u(0.008, 0.03), u(0.03, 0.2), u(100.0, 250.0)
    k, c = m * w**2, 2 * zeta * m * w
    if rolls or rng.random() < 0.5:
        true = {"contact.depth": k, "contact.depth_rate": c}
    else:
        k = m * w**2 * (2.0 / w) ** -0.5  # as stiff as the spring at the depth of a fall at 2 m/s
        true = {"contact.depth^1.5": k, "contact.depth*depth_rate": c / (2.0 / w)}

    def load(d: float, s: float) -> float:
        of = {"depth": d, "depth_rate": s, "depth*depth_rate": d * s, "depth^1.5": max(d, 0.0) ** 1.5}
        return sum(v * of[n.removeprefix("contact.")] for n, v in true.items() if n.startswith("contact"))

    mu = u(0.1, 0.6)
    slope = u(0.0, 0.06) if rolls else 0.0
    g = G * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    forward = np.array([np.cos(a := u(-1.0, 1.0)), np.sin(a), 0.0])
    resist = u(0.005, 0.03) if rolls else 0.0
    ball = Ball(m, r, J, load, mu, resist, g)
    if rolls:
        at, v = np.array([0.0, 0.0, r - m * G / k]), u(1.5, 4.0) * forward
        spin, seconds = rng.normal(0.0, 8.0, 3), u(1.5, 2.5)
    else:
        at, v = np.array([0.0, 0.0, r + u(0.2, 1.0)]), u(0.3, 2.0) * forward + u(-1.0, 0.5) * UP
        spin, seconds = rng.normal(0.0, 20.0, 3), u(1.0, 1.8)
    true["friction.1"] = mu
    if rolls:
        true["rolling.1"] = resist
    time = np.arange(int(seconds * rate)) / rate
    y = ball.path(np.concatenate([at, v, Rotation.random(random_state=rng).as_quat(), spin]), time)
    around = rng.standard_normal((int(rng.integers(6, 12)), 3))
    X = r * around / np.sqrt((around**2).sum(1, keepdims=True))
    place, R = y[:, :3], Rotation.from_quat(y[:, 6:10]).as_matrix()
    return seen(place, R, X, time, m, J * np.eye(3), g, {"radius": r}, true, rng)


def drawn_block(rng: np.random.Generator) -> DrawnContact:
    """A block of 2 to 40 kg that rings on four mounts, each a spring and a damper along the normal."""
    u = rng.uniform
    m, sides = np.exp(u(np.log(2.0), np.log(40.0))), u([0.3, 0.2, 0.1], [0.8, 0.6, 0.3])
    J = m / 12 * np.diag((sides**2).sum() - sides**2)
    a, b, h = sides / 2
    feet = np.array([[a, b, -h], [-a, b, -h], [-a, -b, -h], [a, -b, -h]])
    w, zeta, rate = 2 * np.pi * u(2.0, 8.0), u(0.02, 0.1), u(80.0, 200.0)
    k, c = m * w**2 / 4, 2 * zeta * m * w / 4
    g = np.array([0.0, 0.0, -G])

    def slopes(_: float, y: Array) -> Array:
        q, v, omega_R = y[6:10] / np.linalg.norm(y[6:10]), y[3:6], y[10:]
        R = Rotation.from_quat(q).as_matrix()
        omega = R @ np.linalg.solve(J, R.T @ omega_R)
        arm = feet @ R.T
        depth, sinks = -(y[2] + arm[:, 2]), -(v + np.cross(omega, arm))[:, 2]
        f = np.outer(k * depth + c * sinks, UP)
        spun = 0.5 * np.array([*(q[3] * omega + np.cross(omega, q[:3])), -omega @ q[:3]])
        return np.concatenate([v, f.sum(0) / m + g, spun, np.cross(arm, f).sum(0)])

    time = np.arange(int(u(1.5, 3.0) * rate)) / rate
    tilt = Rotation.from_rotvec(rng.normal(0.0, [0.02, 0.02, 0.3]))
    rest = np.array([0.0, 0.0, h - m * G / 4 / k])
    y0 = np.concatenate(
        [rest + rng.normal(0, [0, 0, 0.01]), [0, 0, 0.1 * u(-1, 1)], tilt.as_quat(), np.zeros(3)]
    )
    y = solve_ivp(slopes, (0, time[-1]), y0, "DOP853", time, rtol=1e-9, atol=1e-11).y.T
    X = np.vstack([feet * [1, 1, -1], [[a, 0, 0], [0, b, 0]]])
    true = {"contact.depth": k, "contact.depth_rate": c}
    R = Rotation.from_quat(y[:, 6:10]).as_matrix()
    ground = {"points": feet.tolist(), "glued": True}
    return seen(y[:, :3], R, X, time, m, J, g, ground, true, rng)


def seen(
    center: Array, R: Array, X: Array, time: Array, mass: float, J: Array, g: Array, ground: dict[str, Any],
    true: dict[str, float], rng: np.random.Generator,
) -> DrawnContact:  # fmt: skip
    """What cameras see, by markers X (node, 3) m with 0.1 to 0.5 mm of noise, in a world turned at random.

    The height of the ground is told in half of the records.
    """
    world = Rotation.random(random_state=rng).as_matrix()
    lift = rng.normal(0.0, 1.0, 3)
    noise = float(np.exp(rng.uniform(np.log(1e-4), np.log(5e-4))))
    x = (center[:, None] + np.einsum("tab,nb->tna", R, X)) @ world.T + lift
    x = x + noise * rng.standard_normal(x.shape)
    normal, height = world @ UP, float(lift @ world @ UP)
    ground = ground | {"normal": normal.tolist()}
    true = dict(true)
    if rng.random() < 0.5:
        ground["height"] = height
    else:
        true["contact.height"] = height
    body = Body(tuple(f"m{k}" for k in range(len(X))), X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
    stated = {"position": noise} if rng.random() < 0.5 else {}
    return DrawnContact(Recording(body, Motion(time, x, gravity=world @ g, noise_std=stated)), ground, true)
