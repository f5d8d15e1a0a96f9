"""What the reduced forms share: checks of what they start from, and steps until their chart ends.

Source: pseudo-rigid bodies, section 5.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.integrate import solve_ivp

from forceid.errors import DataError, EstimationError
from forceid.pseudorigid.material.material_law import Material
from forceid.pseudorigid.validation import deformation, instants, matrix
from forceid.records import Array

REDUCED_RTOL, REDUCED_ATOL = 3e-14, 1e-15  # DOP853: the tightest that its estimate tells from rounding
State = TypeVar("State", bound=NamedTuple)  # arrays
SYMMETRY = 1e-10  # of the force: what tells a material that lacks a symmetry from rounding


def integrate_form(
    rates: Callable[[State], State],
    start: State,
    time: Array,
    ends: Sequence[tuple[Callable[[Array], float], str]],
    where: str,
) -> State:
    """States, each part (time, ...), of y' = rates(y); EstimationError where one of `ends` is 0.

    ends: functions of a state in a row (size,), positive inside the chart, each with the reason to stop. The
    error names the time.
    """
    shapes = [np.shape(part) for part in start]
    edges = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]

    def row(state: State) -> Array:
        return np.concatenate([part.ravel() for part in state])

    def state(y: Array) -> State:
        parts = np.split(y, edges, axis=-1)
        return start._make(a.reshape(*y.shape[:-1], *n) for a, n in zip(parts, shapes, strict=True))

    def event(inside: Callable[[Array], float]) -> Callable[[float, Array], float]:
        def value(_: float, y: Array) -> float:
            return inside(y)

        value.terminal = True  # type: ignore[attr-defined]
        return value

    run = solve_ivp(
        lambda _, y: row(rates(state(y))),
        (time[0], time[-1]),
        row(start),
        "DOP853",
        time,
        events=[event(inside) for inside, _ in ends],
        rtol=REDUCED_RTOL,
        atol=REDUCED_ATOL,
    )
    if run.status == 0:
        return state(run.y.T)
    hit = [
        (float(times[0]), why)
        for times, (_, why) in zip(run.t_events or [], ends, strict=False)
        if len(times)
    ]
    stop, why = min(hit, default=(float(run.t[-1]) if len(run.t) else float(time[0]), "the step falls to 0"))
    raise EstimationError(
        f"at t = {stop:.6g} s {why}", where, "end earlier, or integrate F itself: Body.simulate"
    )


def checked_body(
    second_moment: Array, F0: Array, dF0: Array, time: Array, where: str
) -> tuple[Array, Array, Array, Array]:
    """Second moment, F0, dF0 (3, 3) and time, once all are sound; DataError says what is not."""
    E = matrix(second_moment, f"{where}: second_moment")
    if not np.allclose(E, E.T, rtol=1e-12) or not np.linalg.eigvalsh(E)[0] > 1e-12 * E.max():
        raise DataError(
            "second_moment is not symmetric positive definite (3, 3)", where, "give a body with volume"
        )
    F, V = deformation(F0, f"{where}: F0"), matrix(dF0, f"{where}: dF0")
    return E, F, V, instants(time, f"{where}: time", least=2)


def check_unconstrained(material: Material, where: str) -> None:
    """DataError for a material that needs det F = 1, which these equations do not hold."""
    if getattr(material, "incompressible", False):
        raise DataError("holds no constraint det F = 1", where, "integrate F: Body(..., incompressible=True)")


def check_symmetry(force: Array, expected: Array, claim: str, where: str) -> None:
    """DataError where the force (3, 3) is not the one expected of a material that ... (the claim)."""
    if not np.abs(force - expected).max() <= SYMMETRY * max(np.abs(force).max(), 1.0):
        raise DataError(
            f"holds for a material that {claim}; dW/dF at F0 does not",
            where,
            "integrate F itself: Body.simulate",
        )
