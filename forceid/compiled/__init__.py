"""The compiled engine, where a compiler was: one module for every kind of processor.

`engine` is that module or None. What it holds is written in numpy too, beside each place that asks for it.
"""

from importlib import import_module
from typing import Any

try:
    engine: Any = import_module("forceid.compiled._engine")
except ImportError:  # no compiler, or built for another processor
    engine = None
