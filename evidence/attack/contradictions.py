"""Sixty ways in which a motion file can contradict itself, or physics; each is refused, or said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.attack.bodies import AS_RIGID, LUMPS, MASS, BodyEdit, flight, modes, put, whole

N = len(LUMPS)
X, Y = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])


@dataclass(frozen=True)
class Clash:
    """A contradiction: what it is, the description it is done to, and how."""

    name: str
    base: str
    edit: BodyEdit


def add(name: str, value: Any, **attrs: Any) -> BodyEdit:
    """A variable beside, or in place of, what is there."""
    return lambda f: put(f, name, value, **attrs)


def change(name: str, work: Callable[[np.ndarray], Any]) -> BodyEdit:
    """The values of a variable after some work; its attributes stay."""

    def edit(f: Any) -> None:
        attrs = dict(f[name].attrs)
        put(f, name, work(f[name][()]), **attrs)

    return edit


def said(name: str, key: str, value: Any) -> BodyEdit:
    """An attribute of a group or a variable."""
    return lambda f: f[name].attrs.__setitem__(key, value)


def all_of(*edits: BodyEdit) -> BodyEdit:
    """One after the other."""

    def edit(f: Any) -> None:
        for one in edits:
            one(f)

    return edit


def turned(q: np.ndarray, by: Rotation) -> np.ndarray:
    """Orientations after a further rotation."""
    return np.asarray((Rotation.from_quat(q) * by).as_quat(canonical=True))


def moved(values: np.ndarray, index: Any, to: float) -> np.ndarray:
    """A copy with something else at an index."""
    values = values.copy()
    values[index] = to
    return values


def consistent(mass: float) -> np.ndarray:
    """The mass matrix of the lumped body, scaled."""
    return mass * np.kron(np.diag(MASS), np.eye(3))


def skewed() -> np.ndarray:
    """A mass matrix with more mass along x than along y and z."""
    return consistent(1.0) @ np.diag(np.tile([1.5, 1, 1], N))


def indefinite() -> np.ndarray:
    """A mass matrix with the right total, and a negative eigenvalue."""
    u = np.zeros((3 * N, 1))
    u[0], u[3] = 1, -1
    return consistent(1.0) - 0.1 * u @ u.T


def pinned(K: np.ndarray) -> np.ndarray:
    """A stiffness that holds a node to the ground."""
    return K + 500.0 * np.diag((np.arange(3 * N) < 3) * 1.0)


def rigid_shapes() -> np.ndarray:
    """Mode shapes that are translations."""
    return np.tile(np.stack([X, Y])[:, None], (1, N, 1))


TIME = "motion/time"
MASSES = [
    Clash("total mass 25 times that of the nodes", "markers", add("body/total_mass", 25 * MASS.sum())),
    Clash("total mass 10 % above that of the nodes", "markers", add("body/total_mass", 1.1 * MASS.sum())),
    Clash(
        "mass center 0.28 m from that of the nodes", "markers", add("body/mass_center", whole()[1] + 0.28 * X)
    ),
    Clash(
        "mass center 5 mm from that of the nodes", "markers", add("body/mass_center", whole()[1] + 0.005 * X)
    ),
    Clash("inertia four times that of the nodes", "markers", add("body/inertia", 4 * whole()[2])),
    Clash(
        "inertia of other axes than that of the nodes", "markers", add("body/inertia", whole()[2][::-1, ::-1])
    ),
    Clash("masses beside a matrix of another total", "markers", add("body/mass_matrix", consistent(3.0))),
    Clash("matrix beside another total mass", "matrix", add("body/total_mass", 2 * MASS.sum())),
    Clash("matrix beside another mass center", "matrix", add("body/mass_center", whole()[1] + 0.1 * Y)),
    Clash("matrix beside another inertia", "matrix", add("body/inertia", 9 * whole()[2])),
    Clash("matrix with other totals along x and y", "matrix", add("body/mass_matrix", skewed())),
    Clash("indefinite mass matrix", "matrix", add("body/mass_matrix", indefinite())),
    Clash(
        "mass matrix that is not symmetric", "matrix", change("body/mass_matrix", lambda M: np.triu(M + 0.01))
    ),
    Clash("a node of negative mass", "markers", change("body/mass", lambda m: moved(m, 1, -0.02))),
    Clash("mass of 5e-324 kg", "markers", change("body/mass", lambda m: 0 * m + 5e-324)),
    Clash("mass of 1e300 kg", "markers", change("body/mass", lambda m: 0 * m + 1e300)),
    Clash("grams said to be kg, for meters", "markers", change("body/mass", lambda m: m * 1e-9)),
    Clash("inertia that breaks the triangle rule", "pose", add("body/inertia", np.diag([1.0, 1, 5]) * 1e-4)),
    Clash("inertia of zero", "pose", add("body/inertia", np.zeros((3, 3)))),
    Clash("inertia with a negative moment", "pose", add("body/inertia", np.diag([1.0, 1, -1]) * 1e-4)),
    Clash(
        "inertia that is not symmetric",
        "pose",
        add("body/inertia", whole()[2] + np.triu(1e-4 * np.ones((3, 3)), 1)),
    ),
    Clash(
        "inertia of kg mm2 said to be kg m2",
        "both",
        all_of(
            lambda f: f.__delitem__("body/mass"),
            *(
                add(f"body/{name}", value * 1e6 if name == "inertia" else value)
                for name, value in AS_RIGID.items()
            ),
        ),
    ),
    Clash(
        "whole mass center far from the nodes",
        "both",
        all_of(
            lambda f: f.__delitem__("body/mass"),
            *(
                add(f"body/{name}", value + 40 * X if name == "mass_center" else value)
                for name, value in AS_RIGID.items()
            ),
        ),
    ),
    Clash("total mass of zero", "pose", add("body/total_mass", 0.0)),
]
SPRINGS = [
    Clash("damping of -5", "modes", add("body/mode_damping", np.array([0.01, -5.0]))),
    Clash("damping of 50", "modes", add("body/mode_damping", np.array([0.01, 50.0]))),
    Clash("frequency below zero", "modes", add("body/mode_frequency", np.array([12.0, -19.0]))),
    Clash("frequency of 1e30 Hz", "modes", add("body/mode_frequency", np.array([12.0, 1e30]))),
    Clash(
        "mode shape of zero",
        "modes",
        change("body/mode_shape", lambda s: s * np.array([1, 0])[:, None, None]),
    ),
    Clash("mode shapes that are rigid", "modes", add("body/mode_shape", rigid_shapes())),
    Clash("two mode shapes that are the same", "modes", change("body/mode_shape", lambda s: s[[0, 0]])),
    Clash("indefinite stiffness", "matrix", change("body/stiffness", lambda K: -K)),
    Clash("stiffness held to the ground", "matrix", change("body/stiffness", pinned)),
    Clash("stiffness that is not symmetric", "matrix", change("body/stiffness", np.triu)),
    Clash("stiffness of zero", "matrix", change("body/stiffness", np.zeros_like)),
    Clash(
        "frequencies beside a stiffness of others",
        "matrix",
        all_of(
            add("body/mode_shape", modes()["mode_shape"]), add("body/mode_frequency", np.array([1.0, 2.0]))
        ),
    ),
]
OF_MOTIONS = [
    Clash(
        "markers and pose 45 m/s2 apart",
        "both",
        change("motion/center", lambda c: c + 22.5 * (flight()["time"] ** 2)[:, None] * X),
    ),
    Clash(
        "markers and pose that turn apart",
        "both",
        change(
            "motion/orientation",
            lambda q: turned(q, Rotation.from_rotvec(3.0 * flight()["time"][:, None] * X)),
        ),
    ),
    Clash("center 1 m beside the markers", "both", change("motion/center", lambda c: c + Y)),
    Clash("center 2 cm beside the markers", "both", change("motion/center", lambda c: c + 0.02 * Y)),
    Clash(
        "orientation a quarter turn from the markers",
        "both",
        change("motion/orientation", lambda q: turned(q, Rotation.from_rotvec(np.pi / 2 * X))),
    ),
    Clash(
        "orientation of the world in the body",
        "both",
        change("motion/orientation", lambda q: q * [-1, -1, -1, 1]),
    ),
    Clash(
        "orientation with the scalar first",
        "both",
        change("motion/orientation", lambda q: q[:, [3, 0, 1, 2]]),
    ),
    Clash("pose 0.1 s late beside the markers", "both", change("motion/center", lambda c: np.roll(c, 10, 0))),
    Clash("gyro in degrees a second", "sensors", change("motion/angular_velocity", lambda w: np.degrees(w))),
    Clash("gyro of the other sense", "sensors", change("motion/angular_velocity", lambda w: -w)),
    Clash("accelerometer in g", "sensors", change("motion/specific_force", lambda a: a / 9.81)),
    Clash(
        "accelerometer that reads gravity too",
        "sensors",
        change("motion/specific_force", lambda a: a + np.array([0, 0, 9.81])),
    ),
    Clash(
        "two gyros, one twice the other",
        "sensors",
        all_of(
            change("motion/angular_velocity", lambda w: np.concatenate([w, 2 * w], 1)),
            change("motion/specific_force", lambda a: np.concatenate([a, a], 1)),
            change("body/sensor_position", lambda p: np.tile(p, (2, 1))),
            change("body/sensor_rotation", lambda q: np.tile(q, (2, 1))),
        ),
    ),
    Clash("mirrored markers", "markers", change("motion/position", lambda x: x * [1, 1, -1])),
    Clash("millimeters said to be meters", "markers", change("motion/position", lambda x: 1e3 * x)),
    Clash("reference shape twice as large", "markers", change("body/position", lambda x: 2 * x)),
    Clash("two markers swapped", "markers", change("motion/position", lambda x: x[:, [1, 0, 2, 3, 4]])),
    Clash("noise stated a hundredth of what it is", "markers", said("motion/position", "noise_std", 1e-6)),
    Clash("noise stated as 1 km", "markers", said("motion/position", "noise_std", 1e3)),
    Clash("gravity of 9810 m/s2", "markers", said("motion", "gravity", [0.0, 0, -9810])),
    Clash("nodes in another order", "markers", add("motion/node", [f"n{k}" for k in (1, 0, 2, 3, 4)])),
    Clash("quaternions of norm 2", "pose", change("motion/orientation", lambda q: 2 * q)),
    Clash("sensor 40 m off the body", "sensors", change("body/sensor_position", lambda p: p + 40 * X)),
    Clash(
        "one reading of 1e300 m", "markers", change("motion/position", lambda x: moved(x, (20, 1, 0), 1e300))
    ),
    Clash("an axis never seen", "markers", change("motion/position", lambda x: moved(x, (..., 2), np.nan))),
    Clash(
        "truth on another clock than the motion",
        "markers",
        all_of(add("truth/time", flight()["time"] + 1e4), add("truth/force", np.zeros((60, 3)))),
    ),
]
CLOCKS = [
    Clash("one step of 1e-9 s", "markers", change(TIME, lambda t: moved(t, 30, t[29] + 1e-9))),
    Clash("one gap of 1e6 s", "markers", change(TIME, lambda t: t + 1e6 * (np.arange(len(t)) > 30))),
    Clash("steps of 1e-300 s", "markers", change(TIME, lambda t: np.arange(len(t)) * 1e-300)),
    Clash("steps of 1e300 s", "markers", change(TIME, lambda t: np.arange(len(t)) * 1e300)),
    Clash("Unix nanoseconds as seconds", "markers", change(TIME, lambda t: np.round(1.7e18 + 1e9 * t))),
    Clash("milliseconds as seconds beside a gyro", "sensors", change(TIME, lambda t: 1e3 * t)),
]
KINDS = [*MASSES, *SPRINGS, *OF_MOTIONS, *CLOCKS]
