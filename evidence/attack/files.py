"""Hostile motion files, each from its number alone, and what `forceid` makes of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evidence.attack.bodies import BASES, write
from evidence.attack.structures import by_structure
from evidence.attack.values import by_value
from evidence.attack.watched import End, forked

COMMANDS = (
    ("inspect",), ("estimate", "--json"), ("estimate",), ("estimate", "--method", "savgol"),
    ("estimate", "--method", "filter"), ("estimate", "--model", "affine"), ("estimate", "--model", "modal"),
    ("estimate", "--method", "spline"), ("identify",),
)  # fmt: skip
ODDS = (0.25, 0.2, 0.25, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05)


def hostile(path: Path, seed: int, number: int) -> str:
    """Write the file of a number; what was done to it, in words."""
    rng = np.random.default_rng([seed, number])
    done: list[str] = []

    def edit(f: Any) -> None:
        for _ in range(int(rng.choice([1, 2, 3], p=[0.7, 0.2, 0.1]))):
            try:
                done.append(by_value(rng, f) if rng.random() < 0.6 else by_structure(rng, f))
            except (TypeError, ValueError, KeyError, AttributeError, IndexError, OSError, RuntimeError):
                done.append("no more")  # what was done before left nothing for it

    base = str(rng.choice(list(BASES)))
    write(path, base, edit, seed=number)
    return f"{base}: {', '.join(done)}"


def each_file(folder: Path, seed: int, first: int, count: int) -> Iterator[tuple[int, str, End, list[str]]]:
    """Number, kind, end and faults of each of that many files."""
    for number in range(first, first + count):
        path = folder / f"h{number}.h5"
        kind = hostile(path, seed, number)
        rng = np.random.default_rng([seed, number, 1])
        before = path.read_bytes()
        words = COMMANDS[rng.choice(len(COMMANDS), p=ODDS)]
        end = forked([words[0], path.name, *words[1:]], folder)
        faults = end.faults(path.name)
        if path.read_bytes() != before:
            faults.append("overwritten")
        yield number, kind, end, faults
        for left in folder.glob(f"h{number}.*"):
            left.unlink()
