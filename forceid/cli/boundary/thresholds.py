"""The numbers that the method was given: constants of its modules, and the comments that say what and why."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import forceid

HOMES = ("rounding", "significance")  # of numbers that all rooms share
ROOMS = ("motion", "kalman", "flight", "laws", "estimation")


@dataclass(frozen=True)
class Number:
    """A constant: the module and the name it has, what it is, as written, and the comment beside it."""

    module: str
    name: str
    value: str
    reason: str


def chosen_numbers() -> list[Number]:
    """Every number that the modules of the method choose, by module."""
    root = Path(forceid.__file__).parent
    shared = [root / f"{home}.py" for home in HOMES]
    paths = [*shared, *sorted(path for room in ROOMS for path in (root / room).rglob("*.py"))]
    named = {path: ".".join(path.relative_to(root).with_suffix("").parts) for path in paths}
    return [number for path, name in named.items() for number in numbers_of(path.read_text("utf-8"), name)]


def numbers_of(source: str, module: str) -> Iterator[Number]:
    """The constants of one module that are numbers, or made of numbers.

    >>> list(numbers_of("SMALL, FAR = 0.5, 2.0  # m: of a lever", "motion.pose"))[1]
    Number(module='motion.pose', name='FAR', value='2.0', reason='m: of a lever')
    """
    lines = source.splitlines()
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign) or not made_of_numbers(node.value):
            continue
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        values = (
            node.value.elts if several and isinstance(node.value, ast.Tuple) else [node.value] * len(names)
        )
        for name, value in zip(names, values, strict=True):
            if isinstance(name, ast.Name) and name.id.isupper():
                yield Number(module, name.id, ast.unparse(value), reason(lines, node))


def made_of_numbers(node: ast.expr) -> bool:
    """Whether an expression holds numbers and no text, and is not made by a function other than numpy's."""
    parts = list(ast.walk(node))
    constants = [part.value for part in parts if isinstance(part, ast.Constant)]
    calls = [ast.unparse(part.func) for part in parts if isinstance(part, ast.Call)]
    numeric = bool(constants) and all(
        isinstance(c, int | float) and not isinstance(c, bool) for c in constants
    )
    return numeric and all(call.startswith(("np.", "float", "tuple", "range")) for call in calls)


def reason(lines: list[str], node: ast.Assign) -> str:
    """The comment at the end of a statement, else the comment lines right above it."""
    _, mark, text = lines[(node.end_lineno or node.lineno) - 1].rpartition("  # ")
    if mark:
        return text.strip()
    above = []
    for line in reversed(lines[: node.lineno - 1]):
        if not line.startswith("# "):
            break
        above.append(line.removeprefix("# ").strip())
    return " ".join(reversed(above))
