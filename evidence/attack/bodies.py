"""Motion files by the contract, written with h5py alone: one small free flight, described in five ways."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY

BodyEdit: TypeAlias = Callable[[Any], None]
LUMPS = np.array([[0.1, 0, 0], [-0.1, 0.1, 0], [0, -0.1, 0.1], [0, 0, -0.1], [0.05, 0.08, 0.02]])
MASS = np.array([0.03, 0.02, 0.02, 0.02, 0.01])
NOISE = {
    "position": 1e-4,
    "center": 1e-4,
    "orientation": 1e-3,
    "specific_force": 0.02,
    "angular_velocity": 1e-3,
}
FRAMES, RATE = 60, 100.0
UNITS = {
    "position": "m",
    "center": "m",
    "orientation": "1",
    "specific_force": "m s-2",
    "angular_velocity": "rad s-1",
    "mass": "kg",
    "mass_matrix": "kg",
    "total_mass": "kg",
    "mass_center": "m",
    "inertia": "kg m2",
    "stiffness": "N m-1",
    "mode_shape": "1",
    "mode_frequency": "Hz",
    "mode_damping": "1",
    "sensor_position": "m",
    "sensor_rotation": "1",
    "time": "s",
}


def whole() -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, its center and the inertia about it of the lumped body."""
    center = MASS @ LUMPS / MASS.sum()
    arm = LUMPS - center
    J = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(MASS, arm, strict=True))
    return float(MASS.sum()), center, J


def flight(frames: int = FRAMES) -> dict[str, np.ndarray]:
    """All that could be measured of the flight, without noise: a push along x, a fall, a turn about z."""
    t = np.arange(frames) / RATE
    mass, center, _ = whole()
    c = np.outer(t, [2.0, 0.5, 3.0]) + 0.5 * t[:, None] ** 2 * (GRAVITY + np.array([0.3, 0, 0]) / mass)
    angle, rate = 4 * t + 0.4 * np.sin(9 * t), 4 + 3.6 * np.cos(9 * t)
    R = Rotation.from_rotvec(angle[:, None] * [0, 0, 1])
    arm = LUMPS - center
    x = c[:, None] + np.einsum("tij,kj->tki", R.as_matrix(), arm)
    push = np.tile(np.array([0.3, 0, 0]) / mass, (frames, 1))
    at_center = R.inv().apply(push)
    return {
        "time": t,
        "position": x,
        "center": c,
        "orientation": R.as_quat(canonical=True),
        "specific_force": at_center[:, None],
        "angular_velocity": rate[:, None, None] * [0.0, 0, 1],
    }


def modes() -> dict[str, np.ndarray]:
    """Two shapes orthogonal to rigid motion, with frequency and damping."""
    rng = np.random.default_rng(5)
    arm = LUMPS - whole()[1]
    rigid = np.concatenate(
        [np.tile(np.eye(3), (len(LUMPS), 1)), np.concatenate([np.cross(np.eye(3), a).T for a in arm])], 1
    )
    q, _ = np.linalg.qr(np.concatenate([rigid, rng.standard_normal((rigid.shape[0], 2))], 1))
    return {
        "mode_shape": q[:, 6:].T.reshape(2, -1, 3),
        "mode_frequency": np.array([12.0, 19.0]),
        "mode_damping": np.array([0.01, 0.02]),
    }


def stiffness() -> np.ndarray:
    """Springs between all nodes, stiff enough that nothing of them shows."""
    n = len(LUMPS)
    K = np.zeros((3 * n, 3 * n))
    for a in range(n):
        for b in range(a):
            u = (LUMPS[a] - LUMPS[b]) / np.linalg.norm(LUMPS[a] - LUMPS[b])
            row = np.zeros(3 * n)
            row[3 * a : 3 * a + 3], row[3 * b : 3 * b + 3] = u, -u
            K += 2000.0 * np.outer(row, row)
    return K


LUMPED = {"position": LUMPS, "mass": MASS}
AS_RIGID = dict(zip(("total_mass", "mass_center", "inertia"), whole(), strict=True))
SENSORS = {"sensor_position": whole()[1][None], "sensor_rotation": np.array([[0.0, 0, 0, 1]])}
BASES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "markers": (LUMPED, ("position",)),
    "pose": (AS_RIGID, ("center", "orientation")),
    "matrix": (
        {"position": LUMPS, "mass_matrix": np.kron(np.diag(MASS), np.eye(3)), "stiffness": stiffness()},
        ("position",),
    ),
    "modes": (LUMPED | modes(), ("position",)),
    "sensors": (LUMPED | SENSORS, ("position", "specific_force", "angular_velocity")),
    "alone": (AS_RIGID | SENSORS, ("specific_force", "angular_velocity")),
    "both": (LUMPED, ("position", "center", "orientation")),
}


def put(file: Any, name: str, value: Any, **attrs: Any) -> None:
    """A variable by its path in a file, in place of what is there."""
    if name in file:
        del file[name]
    item = file.create_dataset(name, data=value)
    if (units := UNITS.get(name.rsplit("/", 1)[-1])) is not None:
        item.attrs["units"] = units
    item.attrs.update(attrs)


def write(
    path: Path, base: str = "markers", edit: BodyEdit | None = None, seed: int = 0, frames: int = FRAMES
) -> Path:
    """The flight as that base describes it, with noise, and something done to the open file."""
    rng, (body, measured), all_of_it = np.random.default_rng(seed), BASES[base], flight(frames)
    with h5py.File(path, "w") as f:
        f.attrs.update(forceid_schema="1", title="attack", source="", history="", Conventions="CF-1.11")
        put(f, "motion/time", all_of_it["time"])
        for name in measured:
            noisy = all_of_it[name] + NOISE[name] * rng.standard_normal(all_of_it[name].shape)
            if name == "orientation":
                noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
            put(f, f"motion/{name}", noisy, noise_std=NOISE[name])
        for name, value in body.items():
            put(f, f"body/{name}", value)
        if "position" in body:
            for group in ("body", "motion"):
                f.create_dataset(f"{group}/node", data=[f"n{k}" for k in range(len(LUMPS))])
        f["motion"].attrs["gravity"] = GRAVITY
        if edit is not None:
            edit(f)
    return path
