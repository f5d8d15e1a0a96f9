"""All failures of the stress map, and those that words name."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches

from evidence.stress.failure import Failure
from evidence.subjects.affine import failures as failures_affine
from evidence.subjects.affine import failures_loads as failures_affine_loads
from evidence.subjects.flights.failures import body as failures_body
from evidence.subjects.flights.failures import length as failures_length
from evidence.subjects.flights.failures import noise as failures_noise
from evidence.subjects.flights.failures import sensing as failures_sensing
from evidence.subjects.parts import failures as failures_partition
from forceid.errors import ConfigError

GROUPS = (
    "sensing",
    "clock",
    "noise",
    "load",
    "body",
    "deformation",
    "length",
    "partition",
    "affine",
    "affine_loads",
)
MODULES = (
    failures_sensing, failures_noise, failures_body, failures_length, failures_partition, failures_affine,
    failures_affine_loads,
)  # fmt: skip
FAILURES: tuple[Failure, ...] = tuple(
    failure for group in GROUPS for module in MODULES for failure in module.FAILURES if failure.group == group
)


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
