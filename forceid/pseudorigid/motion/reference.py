"""DOP853 with tolerances near rounding: one body, any material, with or without det F = 1.

The reference for other integrators; nothing is kept exactly. Source: pseudo-rigid bodies, section 9.
"""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import determinant
from forceid.pseudorigid.motion.constrained import driven_acceleration
from forceid.pseudorigid.motion.driven import AffineState, Drive
from forceid.pseudorigid.motion.system import EVENT_DTYPE, AffineSystem, Path
from forceid.records import Array

REFERENCE_RTOL, REFERENCE_ATOL = 1e-13, 1e-14
COLLAPSED = 1e-9  # of det F at the start: below, a body with a barrier has collapsed
REFLECTION = np.diag([1.0, 1.0, -1.0])


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
