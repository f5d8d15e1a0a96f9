"""Hashes of every array and attribute of results, and their errors: what a change has changed, how far.

    python -m evidence.golden write FOLDER     what this tree finds, into FOLDER/golden.json
    python -m evidence.golden compare FOLDER   found again, beside that; exit code 1 where a bit differs

Where a result differs and the truth is known, its rms errors over the central three quarters are told over
those before.

Hashes hold on one machine under one BLAS kernel: they compare two trees there, and are not kept. Cases: every
shipped motion by every method, the Kalman methods on both engines; joints; sensors alone; every level of
deformation; loads on body axes; readings missing; one in blocks and one in windows, by limits forced small.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, get_args
from unittest.mock import patch

import h5py
import numpy as np

from evidence.judged import judged_part
from forceid.config import Method, Model, Settings, load_settings
from forceid.errors import ForceIdError
from forceid.estimation.long import windows as stretches
from forceid.estimation.long.out_of_core import estimate_source
from forceid.files.result import write_result
from forceid.files.stored import blocks
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Recording

ROOT = Path(__file__).parents[1]
SHIPPED = {path.stem: path for path in sorted((ROOT / "data" / "synthetic").glob("*.h5"))}
KALMAN = ("filter", "smoother")
CHANGING = ("runtime_s", "history", "forceid_version", "_NCProperties")  # attributes: when, by whom, not what
TIMES = "timing_"  # what attributes begin with that tell how long a stage took

Limits = tuple[tuple[Any, str, int], ...]
WINDOWS: Limits = ((stretches, "LONG", 270), (stretches, "MARGIN", 60))
BLOCKS: Limits = ((blocks, "STRETCH_BYTES", 24 * 2), (blocks, "BLOCK", 24 * 3 * 50), *WINDOWS)

Changed = Callable[[Recording], Recording]


def cases() -> dict[str, Callable[[Path], None]]:
    """The work of every case by its name; it writes a result file at the path that it is given."""
    found: dict[str, Callable[[Path], None]] = {}
    for name, path in SHIPPED.items():
        for method in get_args(Method):
            for engine in ("compiled", "numpy") if method in KALMAN else ("numpy",):
                settings = Settings(method=method, engine=engine)  # type: ignore[arg-type]
                found[f"{name}, {method}, {engine}"] = partial(estimated, path, settings, None, ())
    joints = load_settings(ROOT / "config" / "two_blocks.toml")
    found["two_blocks, joints"] = partial(estimated, SHIPPED["two_blocks"], joints, None, ())
    alone = partial(estimated, SHIPPED["instrumented"], Settings(), without_markers, ())
    found["instrumented, sensors alone"] = alone
    for model in (name for name in get_args(Model) if name != "segments"):  # no motion shipped has any
        found[f"wobbling_drop, {model}"] = partial(
            estimated, SHIPPED["wobbling_drop"], Settings(model=model), None, ()
        )
    found["frisbee, body axes"] = partial(estimated, SHIPPED["frisbee"], Settings(load_axes="body"), None, ())
    boomerang = SHIPPED["flexible_boomerang_5_markers"]
    found["flexible_boomerang_5_markers, readings missing"] = partial(
        estimated, boomerang, Settings(), losing_markers, ()
    )
    quick, spinning = Settings(method="savgol"), SHIPPED["spinning_block"]
    found["spinning_block, blocks"] = partial(estimated, spinning, quick, None, BLOCKS)
    found["spinning_block, windows"] = partial(estimated, spinning, quick, None, WINDOWS)
    return found


def estimated(path: Path, settings: Settings, changed: Changed | None, limits: Limits, out: Path) -> None:
    """The result file of one motion, changed before where that is asked for, under other limits of size."""
    if changed is not None:
        recording = replace(changed(read_motion(path)), source="", history="")
        path = out.with_suffix(".motion.h5")
        write_motion(path, recording)
    patches = [patch.object(module, name, value) for module, name, value in limits]
    for one in patches:
        one.start()
    try:
        write_result(out, *estimate_source(path, settings, out.with_suffix(".kept")))
    finally:
        for one in patches:
            one.stop()


def without_markers(recording: Recording) -> Recording:
    """The same flight with its gyros and accelerometers only."""
    return replace(recording, motion=replace(recording.motion, position=None))


def losing_markers(recording: Recording) -> Recording:
    """The same motion with each marker lost for ten frames, one after the other."""
    position = np.array(recording.motion.position)
    for k in range(position.shape[1]):
        position[35 * k + 20 : 35 * k + 30, k] = np.nan
    return replace(recording, motion=replace(recording.motion, position=position))


def hashes(path: Path) -> dict[str, str]:
    """Hash of every variable and attribute of a result file, by its path there."""
    found = {}

    def visit(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            if not (key in CHANGING or key.startswith(TIMES) or "REFERENCE" in key):
                found[f"{name}@{key}"] = digest(value)
        if isinstance(item, h5py.Dataset):
            found[name] = digest(item[()])

    with h5py.File(path) as f:
        visit("", f)
        f.visititems(visit)
    return found


def digest(value: Any) -> str:
    """Hash of a number, a text, or an array of these."""
    a = np.asarray(value)
    content = repr(a.tolist()).encode() if a.dtype.hasobject else a.tobytes()
    return hashlib.sha256(f"{a.shape}".encode() + content).hexdigest()[:16]


def hashed(name: str) -> tuple[str, dict[str, str]]:
    """A case and its hashes, or what it is refused with."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "case.result.h5"
        try:
            cases()[name](out)
        except ForceIdError as e:
            return name, {"refused": str(e).replace(folder, "")}
        return name, hashes(out) | errors(out, SHIPPED[name.split(",")[0]])


def errors(path: Path, motion: Path) -> dict[str, str]:
    """Rms errors of force and moment of a result, as numbers in words; none where no truth is known."""
    found = {}
    truth = read_motion(motion).truth
    with h5py.File(path) as f:
        for name in ("force", "moment"):
            if name in truth and f["estimate"][name].shape == truth[name].shape:
                off = judged_part(f["estimate"][name][()] - truth[name])
                found[f"{name} error"] = repr(float(np.sqrt(np.mean(off**2))))
    return found


def differences(before: dict[str, dict[str, str]], after: dict[str, dict[str, str]]) -> list[str]:
    """What differs, a line a case; cases that only one of the two knows count too."""
    lines = []
    for name in sorted(before | after):
        one, other = before.get(name, {}), after.get(name, {})
        if changed := [key for key in sorted(one | other) if one.get(key) != other.get(key)]:
            worse = [
                f"{key} {over(other[key], one[key])}"
                for key in changed
                if key.endswith("error") and key in one and key in other
            ]
            lines.append(f"{name}: {', '.join(worse)} of before; {len(changed)} differ")
    return lines


def over(now: str, before: str) -> str:
    """A number over another one, both as they are kept."""
    return f"{float(now) / float(before):.3f}"


def main(task: str, folder: str) -> int:
    """Hashes written, or compared with those that were."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    path = Path(folder) / "golden.json"
    with ProcessPoolExecutor() as pool:
        found = dict(pool.map(hashed, cases()))
    if task == "write":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
        print(f"{path}: {len(found)} results, {sum(map(len, found.values()))} hashes")
        return 0
    lines = differences(json.loads(path.read_text("utf-8")), found)
    print("\n".join(lines) or f"{len(found)} results are the same to the bit")
    return int(bool(lines))


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("write", "compare"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
