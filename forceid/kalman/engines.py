"""Engines: implementations of one filter, smoother and likelihood, chosen by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from forceid.errors import ConfigError
from forceid.kalman.model import Filtered, Smoothed, StateSpace
from forceid.kalman.recursions import linear
from forceid.records import Array

# fastest first; an engine that nobody asked for is never imported
MODULES = {
    "compiled": "forceid.compiled._engine",
    "numpy": "forceid.kalman.recursions.passes",
    "filterpy": "forceid.kalman.recursions.filterpy",
}


@dataclass(frozen=True)
class Engine:
    """One implementation of the linear Gaussian estimators; all agree to 1e-8."""

    name: str
    filter: Callable[[StateSpace, Array], Filtered]
    smooth: Callable[[StateSpace, Array], Smoothed]
    smooth_states: Callable[[StateSpace, Array], Array]
    log_likelihood: Callable[..., Array]
    filter_and_smooth_states: Callable[[StateSpace, Array], tuple[Filtered, Array]]
    with_covariances: Callable[[Filtered, Array], Smoothed]
    innovations: Callable[[StateSpace, Array], Array]
    followed: Callable[[Filtered, Array, int], Array]


def engine(name: str = "auto") -> Engine:
    """The engine called `name`: "compiled", "numpy", "filterpy" (the reference) or "auto", the fastest.

    Raises ConfigError for any other name, and for "compiled" where it was not built.

    >>> engine("numpy").name
    'numpy'
    >>> engine("filterpi")
    Traceback (most recent call last):
    forceid.errors.ConfigError: unknown engine 'filterpi'; did you mean 'filterpy'?
    """
    name = fastest() if name == "auto" else name
    if name not in MODULES:
        near = difflib.get_close_matches(name, ["auto", *MODULES], n=1, cutoff=0.0)[0]
        raise ConfigError(f"unknown engine '{name}'", next_step=f"did you mean '{near}'?")
    try:
        module: Any = import_module(MODULES[name])
    except ImportError as e:
        raise ConfigError(
            f"the engine '{name}' is not here: {e}",
            next_step='install again with a C++ compiler, or choose engine = "auto"',
        ) from e
    if name == "filterpy":
        return Engine(
            name, module.filter, module.smooth, module.smooth_states, module.log_likelihood,
            lambda model, z: (module.filter(model, z), module.smooth_states(model, z)),
            lambda f, x: module.smooth(f.model, f.z),
            *(partial(of, import_module(MODULES["numpy"])) for of in (linear.innovations, linear.followed)),
        )  # fmt: skip
    return Engine(name, *(partial(getattr(linear, work.name), module) for work in fields(Engine)[1:]))


def for_tuning(chosen: Engine | None) -> Engine:
    """The engine chosen; the fastest in place of none or of the reference, which knows no outliers."""
    return engine() if chosen is None or chosen.name == "filterpy" else chosen


def instructions(name: str) -> list[str]:
    """Name of the instructions that an engine was compiled for and uses here; none of others."""
    arch = getattr(import_module(MODULES[name]), "arch", None)
    return [{"baseline": "baseline", "v3": "avx2", "v4": "avx512"}[arch]] if arch else []


def fastest() -> str:
    """Name of the fastest engine that works here."""
    if find_spec(MODULES["compiled"]) is None:
        return "numpy"
    try:
        import_module(MODULES["compiled"])
    except ImportError:  # built for another processor
        return "numpy"
    return "compiled"
