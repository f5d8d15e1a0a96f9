"""Sixty ways in which a motion file can contradict itself, or physics; each is refused, or said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.attack.bodies import MASS, RIGID, SHAPE, Edit, flight, modes, put, whole

N = len(SHAPE)
X, Y = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])


@dataclass(frozen=True)
class Kind:
    """A contradiction: what it is, the description it is done to, and how."""

    name: str
    base: str
    edit: Edit


def add(name: str, value: Any, **attrs: Any) -> Edit:
    """A variable beside, or in place of, what is there."""
    return lambda f: put(f, name, value, **attrs)


def change(name: str, work: Callable[[np.ndarray], Any]) -> Edit:
    """The values of a variable after some work; its attributes stay."""

    def edit(f: Any) -> None:
        attrs = dict(f[name].attrs)
        put(f, name, work(f[name][()]), **attrs)

    return edit


def said(name: str, key: str, value: Any) -> Edit:
    """An attribute of a group or a variable."""
    return lambda f: f[name].attrs.__setitem__(key, value)


def all_of(*edits: Edit) -> Edit:
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
    Kind("total mass 25 times that of the nodes", "markers", add("body/total_mass", 25 * MASS.sum())),
    Kind("total mass 10 % above that of the nodes", "markers", add("body/total_mass", 1.1 * MASS.sum())),
    Kind(
        "mass center 0.28 m from that of the nodes", "markers", add("body/mass_center", whole()[1] + 0.28 * X)
    ),
    Kind(
        "mass center 5 mm from that of the nodes", "markers", add("body/mass_center", whole()[1] + 0.005 * X)
    ),
    Kind("inertia four times that of the nodes", "markers", add("body/inertia", 4 * whole()[2])),
    Kind(
        "inertia of other axes than that of the nodes", "markers", add("body/inertia", whole()[2][::-1, ::-1])
    ),
    Kind("masses beside a matrix of another total", "markers", add("body/mass_matrix", consistent(3.0))),
    Kind("matrix beside another total mass", "matrix", add("body/total_mass", 2 * MASS.sum())),
    Kind("matrix beside another mass center", "matrix", add("body/mass_center", whole()[1] + 0.1 * Y)),
    Kind("matrix beside another inertia", "matrix", add("body/inertia", 9 * whole()[2])),
    Kind("matrix with other totals along x and y", "matrix", add("body/mass_matrix", skewed())),
    Kind("indefinite mass matrix", "matrix", add("body/mass_matrix", indefinite())),
    Kind(
        "mass matrix that is not symmetric", "matrix", change("body/mass_matrix", lambda M: np.triu(M + 0.01))
    ),
    Kind("a node of negative mass", "markers", change("body/mass", lambda m: moved(m, 1, -0.02))),
    Kind("mass of 5e-324 kg", "markers", change("body/mass", lambda m: 0 * m + 5e-324)),
    Kind("mass of 1e300 kg", "markers", change("body/mass", lambda m: 0 * m + 1e300)),
    Kind("grams said to be kg, for meters", "markers", change("body/mass", lambda m: m * 1e-9)),
    Kind("inertia that breaks the triangle rule", "pose", add("body/inertia", np.diag([1.0, 1, 5]) * 1e-4)),
    Kind("inertia of zero", "pose", add("body/inertia", np.zeros((3, 3)))),
    Kind("inertia with a negative moment", "pose", add("body/inertia", np.diag([1.0, 1, -1]) * 1e-4)),
    Kind(
        "inertia that is not symmetric",
        "pose",
        add("body/inertia", whole()[2] + np.triu(1e-4 * np.ones((3, 3)), 1)),
    ),
    Kind(
        "inertia of kg mm2 said to be kg m2",
        "both",
        all_of(
            lambda f: f.__delitem__("body/mass"),
            *(
                add(f"body/{name}", value * 1e6 if name == "inertia" else value)
                for name, value in RIGID.items()
            ),
        ),
    ),
    Kind(
        "whole mass center far from the nodes",
        "both",
        all_of(
            lambda f: f.__delitem__("body/mass"),
            *(
                add(f"body/{name}", value + 40 * X if name == "mass_center" else value)
                for name, value in RIGID.items()
            ),
        ),
    ),
    Kind("total mass of zero", "pose", add("body/total_mass", 0.0)),
]
SPRINGS = [
    Kind("damping of -5", "modes", add("body/mode_damping", np.array([0.01, -5.0]))),
    Kind("damping of 50", "modes", add("body/mode_damping", np.array([0.01, 50.0]))),
    Kind("frequency below zero", "modes", add("body/mode_frequency", np.array([12.0, -19.0]))),
    Kind("frequency of 1e30 Hz", "modes", add("body/mode_frequency", np.array([12.0, 1e30]))),
    Kind(
        "mode shape of zero",
        "modes",
        change("body/mode_shape", lambda s: s * np.array([1, 0])[:, None, None]),
    ),
    Kind("mode shapes that are rigid", "modes", add("body/mode_shape", rigid_shapes())),
    Kind("two mode shapes that are the same", "modes", change("body/mode_shape", lambda s: s[[0, 0]])),
    Kind("indefinite stiffness", "matrix", change("body/stiffness", lambda K: -K)),
    Kind("stiffness held to the ground", "matrix", change("body/stiffness", pinned)),
    Kind("stiffness that is not symmetric", "matrix", change("body/stiffness", np.triu)),
    Kind("stiffness of zero", "matrix", change("body/stiffness", np.zeros_like)),
    Kind(
        "frequencies beside a stiffness of others",
        "matrix",
        all_of(
            add("body/mode_shape", modes()["mode_shape"]), add("body/mode_frequency", np.array([1.0, 2.0]))
        ),
    ),
]
MOTIONS = [
    Kind(
        "markers and pose 45 m/s2 apart",
        "both",
        change("motion/center", lambda c: c + 22.5 * (flight()["time"] ** 2)[:, None] * X),
    ),
    Kind(
        "markers and pose that turn apart",
        "both",
        change(
            "motion/orientation",
            lambda q: turned(q, Rotation.from_rotvec(3.0 * flight()["time"][:, None] * X)),
        ),
    ),
    Kind("center 1 m beside the markers", "both", change("motion/center", lambda c: c + Y)),
    Kind("center 2 cm beside the markers", "both", change("motion/center", lambda c: c + 0.02 * Y)),
    Kind(
        "orientation a quarter turn from the markers",
        "both",
        change("motion/orientation", lambda q: turned(q, Rotation.from_rotvec(np.pi / 2 * X))),
    ),
    Kind(
        "orientation of the world in the body",
        "both",
        change("motion/orientation", lambda q: q * [-1, -1, -1, 1]),
    ),
    Kind(
        "orientation with the scalar first",
        "both",
        change("motion/orientation", lambda q: q[:, [3, 0, 1, 2]]),
    ),
    Kind("pose 0.1 s late beside the markers", "both", change("motion/center", lambda c: np.roll(c, 10, 0))),
    Kind("gyro in degrees a second", "sensors", change("motion/angular_velocity", lambda w: np.degrees(w))),
    Kind("gyro of the other sense", "sensors", change("motion/angular_velocity", lambda w: -w)),
    Kind("accelerometer in g", "sensors", change("motion/specific_force", lambda a: a / 9.81)),
    Kind(
        "accelerometer that reads gravity too",
        "sensors",
        change("motion/specific_force", lambda a: a + np.array([0, 0, 9.81])),
    ),
    Kind(
        "two gyros, one twice the other",
        "sensors",
        all_of(
            change("motion/angular_velocity", lambda w: np.concatenate([w, 2 * w], 1)),
            change("motion/specific_force", lambda a: np.concatenate([a, a], 1)),
            change("body/sensor_position", lambda p: np.tile(p, (2, 1))),
            change("body/sensor_rotation", lambda q: np.tile(q, (2, 1))),
        ),
    ),
    Kind("mirrored markers", "markers", change("motion/position", lambda x: x * [1, 1, -1])),
    Kind("millimeters said to be meters", "markers", change("motion/position", lambda x: 1e3 * x)),
    Kind("reference shape twice as large", "markers", change("body/position", lambda x: 2 * x)),
    Kind("two markers swapped", "markers", change("motion/position", lambda x: x[:, [1, 0, 2, 3, 4]])),
    Kind("noise stated a hundredth of what it is", "markers", said("motion/position", "noise_std", 1e-6)),
    Kind("noise stated as 1 km", "markers", said("motion/position", "noise_std", 1e3)),
    Kind("gravity of 9810 m/s2", "markers", said("motion", "gravity", [0.0, 0, -9810])),
    Kind("nodes in another order", "markers", add("motion/node", [f"n{k}" for k in (1, 0, 2, 3, 4)])),
    Kind("quaternions of norm 2", "pose", change("motion/orientation", lambda q: 2 * q)),
    Kind("sensor 40 m off the body", "sensors", change("body/sensor_position", lambda p: p + 40 * X)),
    Kind(
        "one reading of 1e300 m", "markers", change("motion/position", lambda x: moved(x, (20, 1, 0), 1e300))
    ),
    Kind("an axis never seen", "markers", change("motion/position", lambda x: moved(x, (..., 2), np.nan))),
    Kind(
        "truth on another clock than the motion",
        "markers",
        all_of(add("truth/time", flight()["time"] + 1e4), add("truth/force", np.zeros((60, 3)))),
    ),
]
CLOCKS = [
    Kind("one step of 1e-9 s", "markers", change(TIME, lambda t: moved(t, 30, t[29] + 1e-9))),
    Kind("one gap of 1e6 s", "markers", change(TIME, lambda t: t + 1e6 * (np.arange(len(t)) > 30))),
    Kind("steps of 1e-300 s", "markers", change(TIME, lambda t: np.arange(len(t)) * 1e-300)),
    Kind("steps of 1e300 s", "markers", change(TIME, lambda t: np.arange(len(t)) * 1e300)),
    Kind("Unix nanoseconds as seconds", "markers", change(TIME, lambda t: np.round(1.7e18 + 1e9 * t))),
    Kind("milliseconds as seconds beside a gyro", "sensors", change(TIME, lambda t: 1e3 * t)),
]
KINDS = [*MASSES, *SPRINGS, *MOTIONS, *CLOCKS]
