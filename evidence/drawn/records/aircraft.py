"""Gliders and frisbees drawn at random, flown by Dormand and Prince under laws of their own, seen by markers.

No code is shared with what fits them: axes, angles and coefficients are written out anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY
from forceid.config import AeroSetting
from forceid.records import Array, Body, Motion, Recording

Law = Callable[[Array, Array, Array], tuple[Array, Array]]  # air, R, omega to force and moment, world axes


@dataclass(frozen=True)
class Drawn:
    """A drawn flight: its recording, the air that goes with it, its coefficients by name, where it began
    (center, velocity, rotation, angular velocity) and how it went: center (time, 3), rotation (time, 3, 3).
    """

    recording: Recording
    aero: AeroSetting
    true: dict[str, float]
    start: tuple[Array, Array, Rotation, Array]
    center: Array
    rotation: Array


def glider(rng: np.random.Generator) -> Drawn:
    """A model glider, 0.2 to 0.5 kg, span about a meter, for two seconds at 100 Hz.

    Two of its derivatives, of lift by pitching and of yaw by rolling, are there in half of all gliders.
    """
    u = rng.uniform
    mass, span, chord = u(0.2, 0.5), u(0.8, 1.2), u(0.10, 0.15)
    area, density = span * chord, u(1.0, 1.25)
    J = mass * np.diag([(0.16 * span) ** 2, (0.13 * span) ** 2, (0.20 * span) ** 2])
    true = {
        "lift.1": u(0.2, 0.4), "lift.alpha": u(4.2, 5.6), "drag.1": u(0.03, 0.06),
        "drag.alpha": u(0.15, 0.35),
        "drag.alpha^2": u(1.2, 2.0), "side.beta": -u(0.3, 0.6), "roll.beta": -u(0.05, 0.12),
        "roll.p": -u(0.35, 0.55), "roll.r": u(0.08, 0.2), "pitch.1": u(0.02, 0.06),
        "pitch.alpha": -u(0.5, 1.0),
        "pitch.q": -u(5.0, 9.0), "yaw.beta": u(0.05, 0.10), "yaw.r": -u(0.08, 0.15),
    }  # fmt: skip
    true |= {n: v for n, v in {"lift.q": u(5.0, 9.0), "yaw.p": -u(0.04, 0.10)}.items() if rng.random() < 0.5}
    wind = tuple(map(float, [*rng.normal(0.0, 1.5, 2), 0.0]))

    def law(air: Array, R: Array, omega: Array) -> tuple[Array, Array]:
        ahead, left, up = R.T
        V = np.sqrt(air @ air)
        alpha, beta = np.arctan2(-(air @ up), air @ ahead), np.arcsin(-(air @ left) / V)
        p, q, r = omega @ ahead * span / 2 / V, -(omega @ left) * chord / 2 / V, -(omega @ up) * span / 2 / V
        of = {"1": 1.0, "alpha": alpha, "alpha^2": alpha**2, "beta": beta, "p": p, "q": q, "r": r}
        C = summed_derivatives(true, of)
        v = air / V
        # wind axes: lift is across the air in the plane of symmetry, side across both
        plane = air - (air @ left) * left
        lift = np.cross(-left, plane) / np.sqrt(plane @ plane)
        side = np.cross(v, lift)
        qA = 0.5 * density * V * V * area
        force = qA * (C["lift"] * lift - C["drag"] * v + C["side"] * side)
        moment = qA * (span * C["roll"] * ahead - chord * C["pitch"] * left - span * C["yaw"] * up)
        return force, moment

    speed, turn = u(8.0, 11.0), Rotation.from_euler("ZYX", rng.normal(0.0, [1.0, 0.12, 0.2]))
    fly_at = turn.apply([speed, *rng.normal(0.0, [0.1 * speed, 0.25 * speed])]) + np.array(wind)
    omega = turn.apply(rng.normal(0.0, [2.0, 4.0, 1.0]))
    X = np.array([[0.25, 0, 0.01], [-0.45, 0, 0.05], [0.0, 0.45 * span, 0.04], [0.0, -0.45 * span, 0.04],
                  [-0.45, 0.12, 0.0], [-0.45, -0.12, 0.0]])  # fmt: skip
    aero = AeroSetting(area=area, chord=chord, span=span, density=density, wind=wind)
    start = np.array([0.0, 0.0, 2.0]), fly_at, turn, omega
    return seen_flight(mass, J, law, start, X, np.arange(200) / 100.0, np.array(wind), aero, true, rng)


def frisbee(rng: np.random.Generator) -> Drawn:
    """A disc, thrown at 8 to 14 m/s and 40 to 65 rad/s, for 1.2 s at 100 Hz; Hummel's law, drawn about hers.

    The pitch moment by pitching and the roll moment by rolling are there in half of all discs.
    """
    u = rng.uniform
    mass, radius, density = u(0.16, 0.18), u(0.13, 0.14), u(1.0, 1.25)
    area, D = np.pi * radius**2, 2 * radius
    J = mass * radius**2 * np.diag([0.36, 0.36, 0.70])
    true = {
        "lift.1": u(0.2, 0.4), "lift.alpha": u(1.6, 2.6), "drag.1": u(0.15, 0.22),
        "drag.alpha": -u(0.05, 0.15),
        "drag.alpha^2": u(0.8, 1.6), "roll.spin_rate": -u(0.0008, 0.002), "pitch.1": -u(0.05, 0.1),
        "pitch.alpha": u(0.3, 0.5), "yaw.spin_rate": u(3e-5, 6e-5),
    }  # fmt: skip
    both = {"pitch.pitch_rate": -u(0.012, 0.025), "roll.roll_rate": -u(0.012, 0.025)}
    true |= {n: v for n, v in both.items() if rng.random() < 0.5}
    wind = tuple(map(float, [*rng.normal(0.0, 1.0, 2), 0.0]))

    def law(air: Array, R: Array, omega: Array) -> tuple[Array, Array]:
        up = R[:, 2]
        along = air - (air @ up) * up
        ahead = along / np.sqrt(along @ along)
        right, V = np.cross(ahead, up), np.sqrt(air @ air)
        alpha = -np.arctan2(air @ up, np.sqrt(along @ along))
        rates = {"roll_rate": omega @ ahead, "pitch_rate": omega @ right, "spin_rate": omega @ up}
        C = summed_derivatives(true, {"1": 1.0, "alpha": alpha, "alpha^2": alpha**2, **rates})
        qA = 0.5 * density * V * V * area
        lift = np.cross(right, air) / V
        force = qA * (C["lift"] * lift - C["drag"] * air / V)
        moment = qA * D * (C["roll"] * ahead + C["pitch"] * right - C["yaw"] * up)
        return force, moment

    turn = Rotation.from_euler("ZYX", [u(-3, 3), -u(0.05, 0.2), rng.normal(0.0, 0.2)])
    fly_at = np.array([np.cos(a := turn.as_euler("ZYX")[0]), np.sin(a), rng.normal(0.0, 0.05)]) * u(8.0, 14.0)
    omega = turn.apply([*rng.normal(0.0, 3.0, 2), u(40.0, 65.0)])
    at = 2 * np.pi * np.arange(6) / 6
    rim = np.column_stack([radius * np.cos(at), radius * np.sin(at), np.full(6, -0.01)])
    X = np.vstack([rim, [[0.05, 0.01, 0.02], [-0.02, 0.05, 0.02], [0.01, -0.04, 0.02]]])
    aero = AeroSetting(area=area, chord=D, density=density, wind=wind, axes="disc")
    start = np.array([0.0, 0.0, 1.3]), fly_at + np.array(wind), turn, omega
    return seen_flight(mass, J, law, start, X, np.arange(120) / 100.0, np.array(wind), aero, true, rng)


def thrown_ball(rng: np.random.Generator) -> Drawn:
    """A baseball, thrown at 30 to 45 m/s and 100 to 200 rad/s, for half a second at 240 Hz."""
    u = rng.uniform
    mass, radius, density = u(0.14, 0.15), u(0.036, 0.038), u(1.0, 1.25)
    area, J = np.pi * radius**2, 0.4 * mass * radius**2 * np.eye(3)
    true = {"drag.1": u(0.3, 0.45), "lift.spin": u(0.8, 1.2)}

    def law(air: Array, R: Array, omega: Array) -> tuple[Array, Array]:
        V = np.sqrt(air @ air)
        magnus = np.cross(omega, air)
        magnus /= np.sqrt(magnus @ magnus)
        spin = np.sqrt(omega @ omega) * radius / V
        qA = 0.5 * density * V * V * area
        return qA * (true["lift.spin"] * spin * magnus - true["drag.1"] * air / V), np.zeros(3)

    at = rng.standard_normal((8, 3))
    X = radius * at / np.sqrt((at**2).sum(1, keepdims=True))
    spin = np.array([rng.normal(0.0, 0.3), -1.0, rng.normal(0.0, 0.3)]) * u(100.0, 200.0)
    start = np.array([0.0, 0.0, 2.0]), np.array([u(30.0, 45.0), 0.0, 1.0]), Rotation.identity(), spin
    aero = AeroSetting(area=area, span=2 * radius, density=density, axes="ball")
    return seen_flight(mass, J, law, start, X, np.arange(120) / 240.0, np.zeros(3), aero, true, rng)


def summed_derivatives(true: dict[str, float], of: dict[str, float]) -> dict[str, float]:
    """Coefficients of lift, drag, side, roll, pitch and yaw from derivatives by name."""
    total = dict.fromkeys(("lift", "drag", "side", "roll", "pitch", "yaw"), 0.0)
    for name, value in true.items():
        component, term = name.split(".")
        total[component] += value * of[term]
    return total


def seen_flight(
    mass: float, J: Array, law: Law, start: tuple[Array, Array, Rotation, Array], X: Array, time: Array,
    wind: Array, aero: AeroSetting, true: dict[str, float], rng: np.random.Generator,
) -> Drawn:  # fmt: skip
    """The flight at `time`, by markers X (node, 3) m from the mass center with noise, and its truth."""
    J_inv = np.linalg.inv(J)

    def rate(t: float, y: Array) -> Array:
        q = y[6:10] / np.sqrt(y[6:10] @ y[6:10])
        R = Rotation.from_quat(q).as_matrix()
        omega = R @ J_inv @ R.T @ y[10:]
        force, moment = law(y[3:6] - wind, R, omega)
        spun = 0.5 * np.array([*(q[3] * omega + np.cross(omega, q[:3])), -omega @ q[:3]])
        return np.concatenate([y[3:6], force / mass + GRAVITY, spun, moment])

    c, v, turn, omega = start
    R0 = turn.as_matrix()
    y0 = np.concatenate([c, v, turn.as_quat(), R0 @ J @ R0.T @ omega])
    y = solve_ivp(rate, (0.0, time[-1]), y0, "DOP853", time, rtol=1e-9, atol=1e-11).y.T
    R = Rotation.from_quat(y[:, 6:10]).as_matrix()
    noise = float(np.exp(rng.uniform(np.log(1e-4), np.log(4e-4))))
    x = y[:, None, :3] + np.einsum("tab,nb->tna", R, X) + noise * rng.standard_normal((len(time), len(X), 3))
    names = tuple(f"m{k}" for k in range(len(X)))
    body = Body(node=names, position=X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
    stated = {"position": noise} if rng.random() < 0.5 else {}
    motion = Motion(time, x, gravity=GRAVITY, noise_std=stated)
    return Drawn(Recording(body, motion), aero, true, start, y[:, :3], R)
