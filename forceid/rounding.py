"""What counts as zero in arithmetic with doubles of 16 digits: each tolerance of rounding is one of these."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from forceid.errors import EstimationError

ROUNDED = 1e-12  # of the largest term: what sums of thousands of products leave of zero, 4500 roundoffs
SOLVED = 1e-9  # of the largest entry: what solving leaves of zero, which multiplies roundoff by a condition
SINGLE = 10.0 ** -np.finfo(np.float32).precision  # of the size: digits of single precision, as files hold
COMPLEX_STEP = float(np.finfo(float).eps ** 2)  # imaginary, of a derivative: its square is lost beside reals
CENTRAL_STEP = float(np.finfo(float).eps ** (1 / 3))  # relative, of central differences: both errors alike
HARMLESS = 1e4  # condition that takes four digits of sixteen: none that counts
ITERATIONS = 40  # of what settles in ten, at most


@contextmanager
def solvable() -> Iterator[None]:
    """An EstimationError in place of what solvers raise on numbers that they cannot follow."""
    try:
        yield
    except (np.linalg.LinAlgError, ArithmeticError) as e:
        said = f"leads to equations that have no solution in doubles ({e})"
        next_step = "look for values far off, and for units"
        raise EstimationError(said, "the recording", next_step) from e
