"""Every finding that a verdict may hold: code, level, sentence, meaning, and what to do.

The tables are `findings/*.toml`, one a subject: a new finding is one row there and a check that calls `note`.
The page docs/findings.md is made from them. Codes are kept once they were released: people and programs rely
on them.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from forceid.records import Finding, Level

SUBJECTS = ("recording", "noise", "shape", "loads", "sensors", "affine", "identified", "joints")


@dataclass(frozen=True)
class Entry:
    """One kind of finding.

    level: the verdict it leads to by itself; sentence: a template over the values, that ends with the next
    step; meaning and action: the same for the documentation, without numbers.
    """

    code: str
    level: Level
    sentence: str
    meaning: str
    action: str


def entries_of(subject: str) -> tuple[str, tuple[Entry, ...]]:
    """Title and entries of the table of a subject."""
    path = files("forceid.estimation.verdict") / "findings" / f"{subject}.toml"
    table = tomllib.loads(path.read_text("utf-8"))
    return table.pop("title"), tuple(Entry(code, **row) for code, row in table.items())


GROUPS = dict(map(entries_of, SUBJECTS))
CATALOGUE = {entry.code: entry for group in GROUPS.values() for entry in group}


def note(code: str, level: Level | None = None, **values: str | float) -> Finding:
    """A finding of the catalogue, in its sentence over some values; level: where it is not the usual one.

    >>> note("markers-on-line", count=3).text
    'the 3 markers lie on a line, and a turn about it is not seen: force only; add a marker off the line'
    """
    entry = CATALOGUE[code]
    plain = {name: v.item() if isinstance(v, np.generic) else v for name, v in values.items()}
    text = entry.sentence.format(**plain).replace("\n", " ")  # files hold a finding a line
    known = {name: v if isinstance(v, str) or np.isfinite(v) else None for name, v in plain.items()}
    return Finding(code, entry.level if level is None else level, known, text)
