"""Whole files of every kind that is read, with damage: bytes of any, words and lines of texts."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from evidence.attack.bodies import write
from evidence.attack.watched import End, forked

NAMES, RATE, FRAMES = ("nose", "left", "right", "top"), 100.0, 30
WORDS = (
    b"",
    b"nan",
    b"inf",
    b"-1e309",
    b"1e300",
    b"\xff\xfe",
    b"0",
    b"-1",
    b"99999999999",
    b"text",
    b'"',
    b"\0",
    b"1,5",
    b";",
)
READ_BY = {
    "motion": ("inspect {0}", "estimate {0} -o {out}.h5 --method savgol"),
    "result": (
        "report {0}",
        "simulate {0} -o {out}.h5",
        "export {0} -f csv -o {out}.csv",
        "report {0} whole.result.h5 -o {out}.html",
    ),
}
HEAD = "[import]\ngravity = [0.0, 0.0, -9.81]\n[import.body.mass]\n"
HEAD += "nose = 0.02\nleft = 0.03\nright = 0.03\ntop = 0.02\n"
PLACES = "[import.body.position]\n" + "".join(f'"{k}" = [{k}.0, 0.0, {k % 2}.0]\n' for k in range(1, 5))
NUMBERED = HEAD
for place, name in enumerate(NAMES, 1):
    NUMBERED = NUMBERED.replace(name, f'"{place}"')
NUMBERED += PLACES
TABLES = {
    "csv": '[import.csv]\ntime = "t"\n[import.csv.position]\n'
    + "".join(f'{n} = ["{n} x", "{n} y", "{n} z"]\n' for n in NAMES),
    "mat": '[import.channels]\ntime = "t"\nposition = "m.{name}"\n',
    "uff": '[import.channels]\ndisplacement = "displacement.{name}{axis}"\n',
    "tdms": f'[import.channels]\nrate = {RATE}\nunits.position = "m"\n'
    'position = "capture/{name}_{axis}"\n',
}


def tracks() -> np.ndarray:
    """Markers (time, node, axis) m of a body that falls."""
    t = np.arange(FRAMES)[:, None, None] / RATE
    shape = 0.1 * np.array([[1.0, 0, 0], [-1, 1, 0], [-1, -1, 0], [1, 0, 1]])
    noise = 1e-4 * np.random.default_rng(0).standard_normal((FRAMES, 4, 3))
    return shape + t * [1.0, 0, 2.0] + 0.5 * t**2 * [0, 0, -9.81] + noise


def originals(folder: Path) -> dict[str, tuple[tuple[str, bytes], ...]]:
    """By kind, the files (end of the name, bytes) that are imported or read together."""
    x, t = tracks(), np.arange(FRAMES) / RATE
    heads = ",".join(["t", *(f"{n} {a}" for n in NAMES for a in "xyz")])
    rows = [",".join(map(str, [at, *row])) for at, row in zip(t, x.reshape(FRAMES, -1).tolist(), strict=True)]
    found = {"csv": ((".csv", "\n".join([heads, *rows]).encode()),)}
    found["trc"] = ((".trc", trc(t, x).encode()),)
    mot = ["a", "version=1", f"nRows={FRAMES}", "nColumns=10", "endheader", "\t".join(["time", *PLATE])]
    mot += ["\t".join(map(str, [at, *[1.0] * 9])) for at in t]
    found["mot"] = (*found["trc"], (".mot", "\n".join(mot).encode()))
    made = {"mat": mat5, "mat73": mat73, "uff": uff, "tdms": tdms, "c3d": c3d}
    for name, make in made.items():
        path = folder / f"whole.{name.removesuffix('73')}"
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                make(path, t, x)
        except ImportError:  # an extra that is not here
            continue
        found[name] = ((path.suffix, path.read_bytes()),)
        path.unlink()
    found["motion"] = ((".h5", write(folder / "whole.h5").read_bytes()),)
    forked(["estimate", "whole.h5", "--method", "difference", "--model", "rigid"], folder)
    found["result"] = ((".result.h5", (folder / "whole.result.h5").read_bytes()),)
    return found


PLATE = [f"ground_force_1_{k}{a}" for k in "vp" for a in "xyz"] + [f"ground_force_1_m{a}" for a in "xyz"]


def trc(t: np.ndarray, x: np.ndarray) -> str:
    """A capture as a table of OpenSim has it."""
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"{RATE}\t{RATE}\t{len(t)}\t4\tm",
        "Frame#\tTime\t" + "\t\t\t".join(NAMES) + "\t\t",
        "\t\t" + "\t".join(f"{a}{k}" for k in range(1, 5) for a in "XYZ"),
        "",
    ]
    rows = x.reshape(len(t), -1).tolist()
    return "\n".join([*lines, *("\t".join(map(str, [k + 1, at, *rows[k]])) for k, at in enumerate(t))])


def mat5(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """A MAT file of version 5."""
    from scipy.io import savemat

    savemat(path, {"t": t, "m": {n: x[:, k] for k, n in enumerate(NAMES)}}, do_compression=True)


def mat73(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """A MAT file of version 7.3: HDF5 behind a head, axes in reverse."""
    with h5py.File(path, "w", userblock_size=512) as f:
        for name, value in [("t", t[None]), *((f"m/{n}", x[:, k].T) for k, n in enumerate(NAMES))]:
            f.create_dataset(name, data=value.T if name == "t" else value).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        f["m"].attrs["MATLAB_class"] = np.bytes_("struct")
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def uff(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """A universal file of displacements."""
    import pyuff

    sets = [
        {
            "type": 58,
            "binary": 0,
            "func_type": 1,
            "rsp_node": k + 1,
            "rsp_dir": a + 1,
            "ref_node": 0,
            "ref_dir": 0,
            "data": x[:, k, a],
            "x": t,
            "abscissa_spacing": 1,
            "abscissa_spec_data_type": 17,
            "abscissa_axis_units_lab": "s",
            "ordinate_spec_data_type": 8,
            "ordinate_axis_units_lab": "m",
            "orddenom_spec_data_type": 0,
            "z_axis_spec_data_type": 0,
        }
        for k in range(4)
        for a in range(3)
    ]
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def tdms(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """A recording of LabVIEW."""
    import nptdms

    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("capture", f"{n}_{a}", x[:, k, i])
                for k, n in enumerate(NAMES)
                for i, a in enumerate("xyz")
            ]
        )


def c3d(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """A capture in C3D."""
    import ezc3d

    made, points = ezc3d.c3d(), np.ones((4, 4, len(t)))
    made["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    made["parameters"]["POINT"]["LABELS"]["value"] = list(NAMES)
    made["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    points[:3] = x.transpose(2, 1, 0)
    made["data"]["points"] = points
    made.write(str(path))


def damaged_bytes(whole: bytes, rng: np.random.Generator, text: bool) -> tuple[str, bytes]:
    """The bytes damaged in one way, and which."""
    kinds = ["bytes", "bits", "near bytes", "number", "cut", "blank", "moved", "longer"]
    kind = str(rng.choice(kinds if not text else [*kinds[:1], *kinds[4:], *["word", "line", "lines"] * 3]))
    data, n = bytearray(whole), len(whole)
    at = int(rng.integers(n))
    if kind == "bytes":
        for k in rng.integers(0, n, rng.integers(1, 30)):
            data[k] = rng.integers(256)
    elif kind == "bits":
        for k in rng.integers(0, n, rng.integers(1, 4)):
            data[k] ^= 1 << int(rng.integers(8))
    elif kind == "near bytes":
        for k in rng.integers(at, min(at + 64, n), rng.integers(1, 8)):
            data[k] = rng.choice([0, 1, 127, 128, 255])
    elif kind == "number":
        value = (0, 1, 2**16, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)[rng.integers(7)]
        at = 8 * (at // 8)
        data[at : at + 8] = value.to_bytes(8, "little")[: n - at]
    elif kind == "cut":
        del data[at:]
    elif kind == "blank":
        size = min(int(rng.integers(1, 4096)), n - at)
        data[at : at + size] = bytes(size)
    elif kind == "moved":
        source, size = int(rng.integers(n)), int(rng.integers(8, 512))
        data[at : at + size] = data[source : source + size]
    elif kind == "longer":
        data[at:at] = rng.bytes(int(rng.integers(1, 64)))
    else:
        lines = bytes(data).split(b"\n")
        k = int(rng.integers(len(lines))) if rng.random() < 0.5 else int(rng.integers(min(12, len(lines))))
        if kind == "word":
            mark = b"," if b"," in lines[k] else b"\t" if b"\t" in lines[k] else b" "
            words = lines[k].split(mark)
            words[rng.integers(len(words))] = WORDS[rng.integers(len(WORDS))]
            lines[k] = mark.join(words)
        elif kind == "line":
            lines[k : k + 1] = [[], [lines[k]] * 2, [b"x" * 100_000], [lines[k][: len(lines[k]) // 2]]][
                rng.integers(4)
            ]
        else:
            lines = (
                [lines[j] for j in rng.permutation(len(lines))]
                if rng.random() < 0.5
                else lines[: int(rng.integers(9))]
            )
        data = bytearray(b"\n".join(lines))
    return kind, bytes(data)


def damaged_files(
    folder: Path, seed: int, first: int, count: int
) -> Iterator[tuple[str, str, End, list[str]]]:
    """Kind of the file and of the damage, end and faults, of each of that many."""
    whole = originals(folder)
    for kind in ("csv", "mat", "uff", "tdms"):
        names = NUMBERED if kind == "uff" else HEAD
        (folder / f"{kind}.toml").write_text(names + TABLES[kind])
    (folder / "trc.toml").write_text(HEAD)
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, 3, number])
        kind = str(rng.choice(list(whole)))
        spoiled, damage, paths = int(rng.integers(len(whole[kind]))), "", []
        for k, (end, data) in enumerate(whole[kind]):
            paths.append(folder / f"d{number}{end}")
            if k == spoiled:
                damage, data = damaged_bytes(data, rng, end in (".csv", ".trc", ".mot", ".uff"))
            paths[-1].write_bytes(data)
        names = [path.name for path in paths]
        config = {"mat73": "mat", "mot": "trc", "c3d": "trc"}.get(kind, kind)
        words = ["import", *names, "-o", f"i{number}.h5", "-c", f"{config}.toml"]
        if kind in READ_BY:
            ways = READ_BY[kind]
            words = [word.format(*names, out=f"i{number}") for word in ways[number % len(ways)].split()]
        found = forked(words, folder)
        yield kind, damage, found, found.faults(f"d{number}")
        for pattern in (f"d{number}.*", f"i{number}*"):
            for left in folder.glob(pattern):
                left.unlink()
