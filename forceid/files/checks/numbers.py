"""Numbers that can be what they say: finite, of a size that its unit can have, symmetric, definite."""

from __future__ import annotations

import numpy as np

from forceid.errors import DataError
from forceid.records import Array, Body, KnownLoads

NEARLY = 1e-6  # of the largest entry: float32 matrices pass
LARGEST = {
    "kg": 1e15,  # a mountain
    "kg m2": 1e27,  # of a mountain a thousand kilometers wide
    "m": 1e9,  # twice the way to the moon
    "m s-2": 1e9,  # a hammer blow has 1e6
    "rad s-1": 1e9,  # the fastest turn of a body that was ever measured, a grain held by light
    "N m-1": 1e20,  # a kilometer of diamond has 1e15
    "Hz": 1e12,  # atoms in a crystal swing faster; no body does
}
ANY = 1e15  # of any other unit: a sixteenth digit that counts in thousandths
SMALLEST_MASS = 1e-15  # kg, a bacterium


def check_range(values: Array, units: str, where: str) -> None:
    """No value but NaN beyond what its unit can have, and none infinite."""
    most, limit = largest(values), LARGEST.get(units, ANY)
    if np.isinf(most):
        raise DataError(
            f"holds {np.isinf(values).sum()} infinite values, expected finite ones or NaN",
            where,
            "write NaN where nothing was measured",
        )
    if most > limit:
        raise DataError(
            f"holds {np.sum(np.abs(values) > limit)} values beyond {limit:g} {units}, the largest {most:.3g}",
            where,
            "correct the units, and write NaN where nothing was measured",
        )


def largest(values: Array) -> float:
    """The largest size among values, gaps left out; 0 of none.

    >>> largest(np.array([1.0, -3.0, np.nan]))
    3.0
    """
    high = np.fmax.reduce(values, axis=None, initial=0.0)
    return float(max(high, -np.fmin.reduce(values, axis=None, initial=0.0)))


def check_finite(record: Body | KnownLoads, words: tuple[str, ...], where: str, next_step: str) -> None:
    """No number of a record, but for its words, is a gap."""
    for name, value in vars(record).items():
        if name not in words and value is not None and not np.isfinite(value).all():
            what = f"holds {np.sum(~np.isfinite(value))} values that are not finite, expected none"
            raise DataError(what, f"{where}/{name}", next_step)


def check_symmetric(matrix: Array, where: str) -> None:
    """Symmetric to 1e-6 of the largest entry."""
    error, scale = np.abs(matrix - matrix.T).max(initial=0.0), np.abs(matrix).max(initial=0.0)
    if error > NEARLY * scale:
        raise DataError(
            f"is not symmetric: entries differ by {error:.3g} across the diagonal, expected equal",
            where,
            "give the symmetric matrix",
        )


def check_definite(matrix: Array, meaning: str, where: str) -> None:
    """No motion of negative energy; each row counts in its own size, as places and rotations differ."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    size = np.where(size > 0, size, np.sqrt(np.abs(matrix).max(initial=0.0)) or 1.0)
    scaled = matrix / np.outer(size, size)
    try:
        np.linalg.cholesky(0.5 * (scaled + scaled.T) + NEARLY * len(matrix) * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        low = float(np.linalg.eigvalsh(scaled)[0])
        raise DataError(
            f"is indefinite: a motion has negative {meaning}, {low:.2g} of that of its nodes alone, "
            "expected none below zero",
            where,
            "give the whole matrix, node-major, as it was assembled",
        ) from None


def check_quaternions(q: Array, where: str) -> None:
    """Norms within 1 % of one; NaN is a gap."""
    norm = np.hypot.reduce(q, axis=-1)  # of any numbers
    far = np.abs(norm - 1) > 0.01
    if far.any():
        k = int(np.argmax(far))
        raise DataError(
            f"has {far.sum()} quaternions off unit norm, the first at index {k} with norm {norm[k]:.4g}, "
            "expected 1",
            where,
            "write unit quaternions x, y, z, w, and NaN for gaps",
        )


def check_mass(mass: float, where: str, what: str) -> None:
    """A mass that a body can have."""
    if mass <= 0:
        raise DataError(f"has {what} {mass:g} kg, expected more than zero", where, "give the masses in kg")
    if not SMALLEST_MASS <= mass <= LARGEST["kg"]:
        raise DataError(
            f"has {what} {mass:.3g} kg, expected {SMALLEST_MASS:g} to {LARGEST['kg']:g}",
            where,
            "give the masses in kg",
        )
