"""Engines: implementations of one filter, smoother and likelihood, chosen by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from forceid.errors import ConfigError
from forceid.kalman.linear import Filtered, Smoothed, StateSpace
from forceid.records import Array

# a reference engine that nobody asked for is never imported
MODULES = {"numpy": "forceid.kalman.linear", "filterpy": "forceid.kalman.filterpy"}
AUTO = "numpy"


@dataclass(frozen=True)
class Engine:
    """One implementation of the linear Gaussian estimators; all agree to 1e-8."""

    name: str
    filter: Callable[[StateSpace, Array], Filtered]
    smooth: Callable[[StateSpace, Array], Smoothed]
    log_likelihood: Callable[[StateSpace, Array], Array]


def engine(name: str = "auto") -> Engine:
    """The engine called `name`: "numpy", "filterpy" (slow, the reference) or "auto", the fastest here.

    Raises ConfigError for any other name.

    >>> engine("auto").name
    'numpy'
    >>> engine("filterpi")
    Traceback (most recent call last):
    forceid.errors.ConfigError: unknown engine 'filterpi'; did you mean 'filterpy'?
    """
    name = AUTO if name == "auto" else name
    if name not in MODULES:
        near = difflib.get_close_matches(name, ["auto", *MODULES], n=1, cutoff=0.0)[0]
        raise ConfigError(f"unknown engine '{name}'", next_step=f"did you mean '{near}'?")
    module = import_module(MODULES[name])
    return Engine(name, module.filter, module.smooth, module.log_likelihood)
