"""Counts that tell whether the house is easy to walk through: python tools/house.py [--walk]

Lines, files in a folder, names with several homes, chosen numbers, circles of imports. With --walk also
how often one default estimate of the shipped boomerang computes its kinematics, how many functions the
settings and the recording are handed to (stays), and how often they come back up to a room that they left
(climbs).
"""

from __future__ import annotations

import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "forceid"
EVIDENCE = ROOT / "evidence"
ESTIMATORS = ("estimation", "kalman", "flight")
HOMES = ("rounding", "significance")  # numbers that these rooms share


def sources(*folders: Path) -> list[Path]:
    """Python files in folders, however deep."""
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def lines(paths: list[Path]) -> int:
    """Lines of files."""
    return sum(len(path.read_text("utf-8").splitlines()) for path in paths)


def module_of(path: Path) -> str:
    """The dotted name of a source."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def top_level(path: Path) -> Iterator[str]:
    """Names of functions, classes and constants that a module defines at its top."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (t.id for t in node.targets if isinstance(t, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id


def shared_names(paths: list[Path]) -> tuple[int, int]:
    """Names that two or more modules define, and all names."""
    homes = Counter(name for path in paths for name in {*top_level(path)} if not name.startswith("__"))
    return sum(count > 1 for count in homes.values()), len(homes)


def chosen_numbers(paths: list[Path]) -> int:
    """Constants at the top of modules that are numbers, or tuples of numbers."""
    found = 0
    for path in paths:
        for node in ast.parse(path.read_text("utf-8")).body:
            if not isinstance(node, ast.Assign) or any(isinstance(n, ast.Call) for n in ast.walk(node.value)):
                continue
            kinds = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
            if not kinds or not all(isinstance(n.value, int | float) for n in kinds):
                continue
            for target in node.targets:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                found += sum(isinstance(n, ast.Name) and n.id.isupper() for n in names)
    return found


def circles(paths: list[Path]) -> int:
    """Modules that stand in a circle of imports, those for type checkers counted."""
    known = {module_of(path): path for path in paths}
    uses = {
        name: {
            target
            for node in ast.walk(ast.parse(path.read_text("utf-8")))
            if isinstance(node, ast.ImportFrom) and node.module and path.name != "__init__.py"
            for target in (node.module, *(f"{node.module}.{a.name}" for a in node.names))
            if target in known and target != name and known[target].name != "__init__.py"
        }
        for name, path in known.items()
    }
    reached = {name: set(targets) for name, targets in uses.items()}
    while True:  # everything that a module reaches, by rounds
        wider = {name: far.union(*(reached[t] for t in far)) if far else far for name, far in reached.items()}
        if wider == reached:
            return sum(name in far for name, far in reached.items())
        reached = wider


def walked() -> dict[str, tuple[int, int, int]]:
    """One default estimate: functions that hold `settings` and the recording, rooms, and climbs back up.

    A climb is a call from a room to one that stands above it on the way so far.
    """
    from forceid.config import Settings
    from forceid.estimation.run import estimate_recording
    from forceid.files.stored.hdf5 import read_motion
    from forceid.records import Recording

    recording = read_motion(ROOT / "data" / "synthetic" / "flexible_boomerang.h5")
    stays: dict[str, Counter[str]] = defaultdict(Counter)
    climbs: Counter[str] = Counter()
    left: dict[str, list[str]] = defaultdict(list)
    kinematics = 0

    def seen(frame: FrameType, event: str, _: Any) -> None:
        nonlocal kinematics
        module = frame.f_globals.get("__name__", "")
        if event != "call" or not module.startswith("forceid."):
            return
        kinematics += frame.f_code.co_name == "kinematics"
        arguments = frame.f_code.co_varnames[: frame.f_code.co_argcount + frame.f_code.co_kwonlyargcount]
        held = [frame.f_locals.get(name) for name in arguments]
        for what, kind in (("settings", Settings), ("recording", Recording)):
            if any(isinstance(value, kind) for value in held):
                stays[what][module] += 1
                above = left[what]
                if module in above[:-1]:
                    climbs[what] += 1
                    del above[above.index(module) + 1 :]
                elif not above or above[-1] != module:
                    above.append(module)

    estimate_recording(recording, Settings(method="savgol"))  # imports are no part of the walk
    sys.setprofile(seen)
    try:
        estimate_recording(recording, Settings())
    finally:
        sys.setprofile(None)
    found = {what: (sum(rooms.values()), len(rooms), climbs[what]) for what, rooms in stays.items()}
    return found | {"kinematics": (kinematics, 0, 0)}


def main(walk: bool) -> None:
    """The counts, a line each."""
    own, shown = sources(PACKAGE), sources(EVIDENCE)
    estimators = [
        *sources(*(PACKAGE / name for name in ESTIMATORS)),
        *(PACKAGE / f"{name}.py" for name in HOMES),
    ]
    flat = Counter(path.parent for path in [*own, *shown])
    folder, most = flat.most_common(1)[0]
    shared, names = shared_names([*own, *shown])
    longest = max(own, key=lambda path: lines([path]))
    print(f"lines of Python in forceid: {lines(own)}")
    print(f"lines of Python in evidence: {lines(shown)}")
    print(f"most files flat in one folder: {most} in {folder.relative_to(ROOT)}")
    print(f"longest module: {lines([longest])} lines, {longest.relative_to(ROOT)}")
    share = f"{shared} of {names}, {100 * shared / names:.0f} %"
    print(f"top-level names defined in two or more modules: {share}")
    print(f"chosen numbers in {', '.join((*ESTIMATORS, *HOMES))}: {chosen_numbers(estimators)}")
    print(f"modules in a circle of imports: {circles(own)}")
    if walk:
        found = walked()
        print(f"kinematics in a default estimate of the boomerang: {found.pop('kinematics')[0]}")
        for what, (stays, rooms, climbs) in sorted(found.items()):
            print(f"walk of {what}: {stays} stays, {rooms} rooms, {climbs} climbs")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main("--walk" in sys.argv[1:])
