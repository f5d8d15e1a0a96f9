"""Hostile structures: something done to the variables, attributes and links of a motion file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np

from evidence.attack.bodies import LUMPS, put

TYPES = ("i1", "u1", "i8", "f2", "f4", ">f8", "c16", "?", "S4", "V8", "f8,f8", "O")
NAMES = (
    "",
    "\x1b[31mred\x1b[0m",
    "a\nb",
    "λ" * 40,
    "x" * 5000,
    "<script>alert(1)</script>",
    "../../etc",
    "n0",
    "\u202egnp",
)
WORDS = ("m", "mm", "", "furlong", "m\x1b[2J", "kg", "m s-2", "1e300 m", "x" * 3000, "μm", "m/m")
NUMBERS = (0.0, -1.0, 5e-324, 1e300, np.nan, np.inf, 1e-30, 1e3)
VARIABLES = (
    "body/total_mass",
    "body/mass_center",
    "body/inertia",
    "body/mass_matrix",
    "body/stiffness",
    "body/mode_shape",
    "body/mode_frequency",
    "body/mode_damping",
    "body/sensor_position",
    "body/sensor_rotation",
    "motion/center",
    "motion/orientation",
    "motion/specific_force",
    "motion/angular_velocity",
    "motion/strain",
    "truth/force",
    "body/internal_momentum",
    "motion/magnetic_field",
    "body/strain_shape",
    "load_known/force",
)


def pick(rng: np.random.Generator, file: Any) -> str:
    """A variable that is there."""
    return str(rng.choice([f"{g}/{n}" for g in ("body", "motion") for n in file[g]]))


def dropped(rng: np.random.Generator, file: Any) -> None:
    """A variable is gone."""
    del file[pick(rng, file)]


def retyped(rng: np.random.Generator, file: Any) -> None:
    """A variable of another type."""
    name, kind = pick(rng, file), str(rng.choice(TYPES))
    shape = file[name].shape
    if kind == "O":
        put(file, name, np.full(shape, "text", object))
    else:
        with np.errstate(all="ignore"):
            values = (
                file[name][()] if file[name].dtype.kind == "f" and kind[-2] not in "SV," else np.zeros(shape)
            )
            put(
                file,
                name,
                values.astype(kind) if "," not in kind and kind[0] not in "SV" else np.zeros(shape, kind),
            )


def reshaped(rng: np.random.Generator, file: Any) -> None:
    """A variable of another shape."""
    name = pick(rng, file)
    a = file[name][()]
    if not isinstance(a, np.ndarray) or a.dtype.kind != "f":
        a = np.zeros((3, 3))
    ways: list[Callable[[], np.ndarray]] = [
        lambda: a.T.copy(),
        lambda: a[None],
        lambda: a.ravel(),
        lambda: a[:0],
        lambda: a[:1],
        lambda: a[..., :2],
        lambda: a[..., :1],
        lambda: np.concatenate([a, a]),
        lambda: np.zeros(()),
        lambda: a[: int(rng.integers(2, 14))],
    ]
    put(file, name, ways[rng.integers(len(ways))]())


def short(rng: np.random.Generator, file: Any) -> None:
    """A record of few frames."""
    n = int(rng.integers(0, 20))
    for name in list(file["motion"]):
        a = file["motion"][name]
        if a.dtype.kind == "f":
            put(file, f"motion/{name}", a[:n], **dict(a.attrs))


def few(rng: np.random.Generator, file: Any) -> None:
    """A body of few nodes, some of them in one place or on a line."""
    n = int(rng.integers(0, 5))
    for name in ("body/position", "body/mass", "body/node", "motion/node"):
        if name in file:
            put(file, name, file[name][:n])
    if "motion/position" in file:
        put(file, "motion/position", file["motion/position"][:, :n], noise_std=1e-4)


def many(rng: np.random.Generator, file: Any) -> None:
    """Five hundred sensors, or as many modes."""
    n, frames = int(rng.choice([40, 500])), len(file["motion/time"])
    if rng.random() < 0.5:
        for name, a in (("specific_force", 9.81), ("angular_velocity", 4.0)):
            put(file, f"motion/{name}", a + 0.01 * rng.standard_normal((frames, n, 3)), noise_std=0.01)
        put(file, "body/sensor_position", 0.1 * rng.standard_normal((n, 3)))
        put(file, "body/sensor_rotation", np.tile([0.0, 0, 0, 1], (n, 1)))
    else:
        put(file, "body/mode_shape", rng.standard_normal((n, len(LUMPS), 3)))
        put(file, "body/mode_frequency", np.linspace(5, 40, n))


def beside(rng: np.random.Generator, file: Any) -> None:
    """A further variable, of about the right shape."""
    name, n, frames = str(rng.choice(VARIABLES)), len(LUMPS), len(file["motion/time"])
    last = name.rsplit("/", 1)[-1]
    shape = {
        "total_mass": (),
        "mass_center": (3,),
        "inertia": (3, 3),
        "mass_matrix": (3 * n, 3 * n),
        "internal_momentum": (3,),
        "stiffness": (3 * n, 3 * n),
        "mode_shape": (2, n, 3),
        "mode_frequency": (2,),
        "mode_damping": (2,),
        "sensor_position": (1, 3),
        "sensor_rotation": (1, 4),
        "orientation": (frames, 4),
        "strain": (frames, 2),
        "specific_force": (frames, 1, 3),
        "angular_velocity": (frames, 1, 3),
        "magnetic_field": (frames, 1, 3),
        "strain_shape": (2, n, 3),
        "force": (frames, 1, 3) if name.startswith("load") else (frames, 3),
    }.get(last, (frames, 3))
    a = rng.standard_normal(shape) * rng.choice([1e-3, 1.0, 1e3])
    a = np.asarray(a) + np.swapaxes(a, -1, -2) if len(shape) == 2 and shape[0] == shape[1] else np.asarray(a)
    put(file, name, a)


def attributed(rng: np.random.Generator, file: Any) -> None:
    """An attribute that says something odd of a variable."""
    key = str(rng.choice(["units", "noise_std", "_FillValue", "scale_factor", "add_offset", "missing_value"]))
    value: Any = (
        rng.choice(WORDS) if rng.random() < (0.9 if key == "units" else 0.15) else rng.choice(NUMBERS)
    )
    file[pick(rng, file)].attrs[key] = [value, np.array([value, value]), np.zeros(0)][
        rng.choice(3, p=[0.8, 0.1, 0.1])
    ]


def about(rng: np.random.Generator, file: Any) -> None:
    """An attribute of the file, or its gravity, that is odd."""
    if rng.random() < 0.5:
        odd = [
            np.zeros(3),
            np.zeros(2),
            np.array([0, 0, -9810.0]),
            "down",
            np.full(3, np.nan),
            9.81,
            np.array([1, 2, 3]),
        ]
        file["motion"].attrs["gravity"] = odd[rng.integers(len(odd))]
    else:
        key = str(rng.choice(["forceid_schema", "title", "source", "history"]))
        file.attrs[key] = str(rng.choice(NAMES)) if rng.random() < 0.7 else rng.standard_normal(3)


def named(rng: np.random.Generator, file: Any) -> None:
    """Odd names of nodes."""
    names = [
        str(rng.choice(NAMES)).replace("\0", "") + (str(k) if rng.random() < 0.7 else "")
        for k in range(len(LUMPS))
    ]
    for group in ("body", "motion"):
        if f"{group}/node" in file:
            put(file, f"{group}/node", names)


def linked(rng: np.random.Generator, file: Any) -> None:
    """A variable that is a link: to nowhere, to itself, out of the file, or to its group."""
    name = pick(rng, file)
    del file[name]
    ways = [
        h5py.SoftLink("/nowhere"),
        h5py.SoftLink(f"/{name}"),
        h5py.ExternalLink("other.h5", "/x"),
        h5py.ExternalLink("/dev/zero", "/x"),
        file["motion"],
        file["body"],
        h5py.SoftLink("/motion/time"),
        np.dtype("f8"),
    ]
    file[name] = ways[rng.integers(len(ways))]


def stored(rng: np.random.Generator, file: Any) -> None:
    """A variable in chunks, compressed, or never written."""
    name = pick(rng, file)
    if not hasattr(file[name], "shape") or file[name].shape == () or file[name].size == 0:
        return
    a, attrs = file[name][()], dict(file[name].attrs)
    del file[name]
    if rng.random() < 0.3:
        file.create_dataset(name, a.shape, a.dtype, chunks=True)
    else:
        options = {"compression": "gzip"} if rng.random() < 0.7 else {"fletcher32": True}
        file.create_dataset(name, data=a, chunks=True, maxshape=(None,) * a.ndim, **options)
    file[name].attrs.update(attrs)


WAYS = (dropped, retyped, reshaped, short, few, many, beside, attributed, about, named, linked, stored)


def by_structure(rng: np.random.Generator, file: Any) -> str:
    """Do something to the structure of a file; what, in words."""
    work = WAYS[rng.integers(len(WAYS))]
    work(rng, file)
    return work.__name__
