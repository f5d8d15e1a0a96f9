"""Loads on an affine body and its mass center: F'' E = N - P and m c'' = f + weight.

f = sum f_k is the applied force and N = sum f_k X_k^T the applied first moment of forces f_k at X_k, world
axes in rows, body axes in columns. Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.pseudorigid.material.material_law import check_above
from forceid.pseudorigid.material.stress import viscous
from forceid.pseudorigid.validation import real_vector, shaped
from forceid.records import Array

Load = ArrayLike | Callable[..., ArrayLike]
ADVICE = "give finite numbers at all times, world axes in rows"


class AffineState(NamedTuple):
    """One body at an instant, as loads may ask for it: F, dF (3, 3), 1 and 1/s; center m, velocity m/s (3,).

    Source: pseudo-rigid bodies, section 1.
    """

    F: Array
    dF: Array
    center: Array
    velocity: Array


@dataclass(frozen=True)
class Drive:
    """What moves a body beside its elastic stress, the same for every body of a batch.

    force (3,) N and first_moment (3, 3) N m: functions of time and state; weight (3,) N; damping J s;
    mass kg, infinite where none is needed; start (6,): place m and velocity m/s of the mass center.
    """

    force: Callable[[float, AffineState], Array]
    first_moment: Callable[[float, AffineState], Array]
    weight: Array
    damping: float
    mass: float
    start: Array

    def pull(self, t: float, state: AffineState) -> Array:
        """N less what damping takes (3, 3), N m: it adds to F'' E."""
        N = self.first_moment(t, state)
        return N - self.damping * viscous(state.F, state.dF) if self.damping else N

    def lift(self, t: float, state: AffineState) -> Array:
        """Acceleration of the mass center (3,), m/s2."""
        return (self.force(t, state) + self.weight) / self.mass

    def sampled(self, time: Array, *path: Array) -> tuple[Array, Array, Array]:
        """Force (time, body, 3), first moment and pull (..., 3, 3) on a path, fields of `AffineState`."""
        shape = path[0].shape
        force, N, pull = np.full(shape[:-1], np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
        for k, i in zip(*np.nonzero(~np.isnan(path[0][..., 0, 0])), strict=True):
            state = AffineState(*(part[k, i] for part in path))
            force[k, i] = self.force(time[k], state)
            N[k, i], pull[k, i] = self.first_moment(time[k], state), self.pull(time[k], state)
        return force, N, pull


def drive_of(
    force: Load | None,
    first_moment: Load | None,
    weight: ArrayLike | None,
    damping: float,
    mass: float | None,
    start: tuple[ArrayLike | None, ArrayLike | None],
) -> Drive:
    """The drive of what a user gives, start: center and velocity.

    DataError for what is out of range, or has no mass to move.
    """
    check_above("simulate", "damping", damping, itself=True)
    given = [name for name, load in (("force", force), ("weight", weight)) if load is not None]
    if given and mass is None:
        raise DataError("has no mass to move", given[0], "give the body one: Body(..., mass=)")
    return Drive(
        load_of(force, (3,), "force"),
        load_of(first_moment, (3, 3), "first_moment"),
        np.zeros(3) if weight is None else real_vector(weight, "weight"),
        float(damping),
        np.inf if mass is None else mass,
        np.ravel([real_vector([0, 0, 0] if x is None else x, "center") for x in start]),
    )


def load_of(load: Load | None, shape: tuple[int, ...], name: str) -> Callable[[float, AffineState], Array]:
    """A load as a function of time and state: of one that is constant, of time alone, or of both."""
    if load is None:
        load = np.zeros(shape)
    if not callable(load):
        fixed = shaped(load, shape, name, ADVICE)
        return lambda t, state: fixed
    function: Callable[..., Any] = load
    try:
        inspect.signature(function).bind(0.0)
    except TypeError:  # time alone does not do
        return lambda t, state: shaped(function(t, state), shape, f"{name} at t = {t:.6g} s", ADVICE)
    except ValueError:  # it does not tell what it takes
        pass
    return lambda t, state: shaped(function(t), shape, f"{name} at t = {t:.6g} s", ADVICE)
