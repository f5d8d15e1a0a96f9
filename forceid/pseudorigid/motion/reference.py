"""DOP853 with tolerances near rounding, of one body under loads: F'' E = N - P and m c'' = f + weight.

The reference for other integrators; nothing is kept exactly. Any material, with or without det F = 1.
f = sum f_k is the applied force and N = sum f_k X_k^T the applied first moment of forces f_k at X_k, world
axes in rows, body axes in columns. Source: pseudo-rigid bodies, sections 1 and 9.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import determinant
from forceid.pseudorigid.material.material_law import check_above
from forceid.pseudorigid.material.stress import viscous
from forceid.pseudorigid.motion.constrained import driven_acceleration
from forceid.pseudorigid.motion.system import EVENT_DTYPE, AffineSystem, Path
from forceid.pseudorigid.validation import real_vector, shaped
from forceid.records import Array

REFERENCE_RTOL, REFERENCE_ATOL = 1e-13, 1e-14
COLLAPSED = 1e-9  # of det F at the start: below, a body with a barrier has collapsed
REFLECTION = np.diag([1.0, 1.0, -1.0])
Load = ArrayLike | Callable[..., ArrayLike]
ADVICE = "give finite numbers at all times, world axes in rows"


class TooLongError(Exception):
    """More evaluations than allowed."""


def reference(
    system: AffineSystem,
    F0: Array,
    V0: Array,
    time: Array,
    rtol: float = REFERENCE_RTOL,
    most: float = float("inf"),
    drive: Drive | None = None,
) -> Path:
    """One body from F0, V0 (3, 3) at time[0] through the samples `time`, with what drives it.

    Ends at det F = 0 where forces are finite beyond (inversion); where they are not, at 1e-9 of its start, or
    where no step is short enough (collapse). TooLongError after `most` evaluations of the force.
    """

    def rate(t: float, y: Array) -> Array:
        F, V = y[:18].reshape(2, 3, 3)
        if next(calls) >= most:
            raise TooLongError
        # a stage beyond det F = 0 has no force; the step that asked is rejected, or ends in the event
        with np.errstate(all="ignore"):
            if not (determinant(F) > 0) and not regular(system, F):
                return np.full_like(y, np.nan)
            pull, lift = np.zeros((3, 3)), y[:0]
            if drive is not None:
                state = AffineState(F, V, y[18:21], y[21:])
                pull, lift = system.over_moment(drive.pull(t, state)), drive.lift(t, state)
            a = driven_acceleration(system, F, V, pull)
        return np.concatenate([y[9:18], a.ravel(), y[21:], lift])

    start = np.concatenate([F0.ravel(), V0.ravel(), [] if drive is None else drive.start])
    kind, stop = np.array([""], EVENT_DTYPE), np.array([np.nan])
    if len(time) == 1:
        return Path(F0[None, None], V0[None, None], kind, stop, start[None, None, 18:])
    accepted, calls = [float(time[0])], count()
    floor = 0.0 if regular(system, F0 @ REFLECTION) else COLLAPSED * float(determinant(F0))

    def volume(t: float, y: Array) -> float:
        accepted.append(t)
        return float(determinant(y[:9].reshape(3, 3))) - floor

    volume.terminal = True  # type: ignore[attr-defined]
    longest = np.inf if drive is None else float(np.diff(time).max())  # no load between samples is missed
    options: dict[str, Any] = {
        "method": "DOP853",
        "t_eval": time,
        "events": volume,
        "rtol": rtol,
        "atol": REFERENCE_ATOL,
        "max_step": longest,
    }
    with np.errstate(all="ignore"):
        found: Any = solve_ivp(rate, (float(time[0]), float(time[-1])), start, **options)
    y = np.full((len(time), len(start)), np.nan)
    y[: len(found.t)] = found.y.T
    if found.status == 1:
        kind[:], stop[:] = "collapse" if floor else "inversion", found.t_events[0][0]
    elif found.status < 0:
        kind[:], stop[:] = "collapse", accepted[-1]
    F, V = y[:, None, :18].reshape(-1, 1, 2, 3, 3).transpose(2, 0, 1, 3, 4)
    return Path(F, V, kind, stop, y[:, None, 18:])


def regular(system: AffineSystem, F: Array) -> bool:
    """Whether the force is finite at det F <= 0, as where there is no barrier."""
    try:
        with np.errstate(all="ignore"):
            return bool(np.isfinite(system.acceleration(F)).all() and np.isfinite(system.material.energy(F)))
    except (np.linalg.LinAlgError, DataError):  # no singular values, or a barrier
        return False


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
