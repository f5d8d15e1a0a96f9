"""All failures of the stress map, and those that words name."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from evidence.stress.failure import KNOWN, Failure
from evidence.subjects.affine import failures as _affine
from evidence.subjects.affine import failures_loads as _loads
from evidence.subjects.flights.failures import body as _body
from evidence.subjects.flights.failures import noise as _noise
from evidence.subjects.flights.failures import sensing as _sensing
from evidence.subjects.parts import failures as _parts
from forceid.errors import ConfigError

GROUPS = (
    "sensing", "clock", "noise", "load", "body", "deformation", "length", "partition", "affine",
    "affine_loads",
)  # fmt: skip
MODULES = _affine, _loads, _body, _noise, _sensing, _parts  # each enters its failures when it is imported
FAILURES: tuple[Failure, ...] = tuple(sorted(KNOWN, key=lambda failure: GROUPS.index(failure.group)))


def failures_named(words: Sequence[str]) -> tuple[Failure, ...]:
    """Failures by name or by group, in the order of the table; all of them for no word.

    >>> [f.name for f in failures_named(["load"])]
    ['impact', 'spin_load', 'load_directions']
    >>> failures_named(["colinear"])
    Traceback (most recent call last):
    forceid.errors.ConfigError: unknown failure 'colinear'; did you mean 'collinear'?
    """
    known = [*(f.name for f in FAILURES), *GROUPS]
    for word in words:
        if word not in known:
            near = get_close_matches(word, known, n=1, cutoff=0.0)[0]
            raise ConfigError(f"unknown failure '{word}'", next_step=f"did you mean '{near}'?")
    return tuple(f for f in FAILURES if not words or f.name in words or f.group in words)
