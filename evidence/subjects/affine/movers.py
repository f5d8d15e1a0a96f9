"""Who moves a free affine body, and what is told of the error.

Steps of a fixed length tell nothing: their claim is what half the step changes, 4/3 of it. Peers claim the
tolerance that they are given. Source: pseudo-rigid bodies, sections 5, 8, 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.subject import Answer, at_once
from evidence.subjects.affine.bodies import LinearSprings, Throw
from evidence.subjects.affine.problem import AffineProblem, relative_error
from evidence.subjects.affine.reduced import general_reduced, left_reduced, two_sided
from evidence.subjects.affine.reduced.two_sided import (
    TwoSidedState,
    reduced_velocity,
    two_sided_rates,
    two_sided_state,
)
from evidence.vectors import EYE, hat
from forceid.pseudorigid import Body, MooneyRivlin
from forceid.pseudorigid.motion.trajectory import Trajectory
from forceid.pseudorigid.steady.rigid_body import free_rotation
from forceid.records import Array

STEP = 0.01  # s, where a problem has none
RTOL = 1e-3  # of solve_ivp, where nothing is said
REFERRED = 1e-10  # what the reference is good for


def material_of(throw: Throw) -> Any:
    """The material, as forceid has it."""
    if len(throw.material) == 1:
        return LinearSprings(throw.material[0])
    a, b, c, d = throw.material
    return MooneyRivlin(a, b, incompressible=True) if throw.held else MooneyRivlin(a, b, c, d)


def stepped(method: str, problem: AffineProblem) -> Answer:
    """`Body.simulate` at the step of the problem, and at half of it."""
    throw: Throw = problem.given
    return halved(Body(throw.E, material_of(throw)), throw, method)


def halved(body: Body, throw: Throw, method: str) -> Answer:
    """The motion, with a claim from half the step."""
    step = throw.step or STEP
    coarse, fine = (body.simulate(throw.F0, throw.dF0, throw.time, method, step / n) for n in (1, 2))
    if not np.isfinite(coarse.F[1:]).any():
        return Answer((coarse.F, coarse.dF), None, "refused", (str(coarse.event),))
    return answered(coarse, (change_by_half_step(coarse.F, fine.F), change_by_half_step(coarse.dF, fine.dF)))


def change_by_half_step(coarse: Array, fine: Array) -> float:
    """4/3 of what half the step changes, no less than the truth is known to; 1 where one of them ends."""
    if (np.isfinite(coarse) & ~np.isfinite(fine)).any():
        return 1.0
    return max(4 / 3 * relative_error(np.where(np.isfinite(coarse), fine, np.nan), coarse), REFERRED)


def answered(found: Trajectory, claimed: tuple[float, float] | None = None) -> Answer:
    """A motion as far as it goes, and why it ends."""
    stopped = found.event is not None and bool(found.event.stopped.any())
    verdict, reasons = ("degraded", (str(found.event),)) if stopped else ("ok", ())
    return Answer((found.F, found.dF), claimed, verdict, reasons)


def referred(problem: AffineProblem) -> Answer:
    """`Body.simulate` by its reference."""
    throw: Throw = problem.given
    body = Body(throw.E, material_of(throw))
    return answered(body.simulate(throw.F0, throw.dF0, throw.time, "dop853"), (REFERRED, REFERRED))


def rattled(problem: AffineProblem) -> Answer:
    """RATTLE on det F = 1 of a body that is nearly so; what the pressure would change of it is claimed too.

    Lambda = -Gamma'(J), so J - 1 = (Gamma'(1) + Lambda) / -Gamma''(1), which comes and goes at the rate of
    breathing.
    """
    throw: Throw = problem.given
    a, b, c, d = throw.material
    body = Body(throw.E, MooneyRivlin(a, b, incompressible=True))
    answer = halved(body, throw, "verlet")
    pressure = body.simulate(throw.F0, throw.dF0, throw.time, "verlet", throw.step or STEP).pressure
    assert pressure is not None
    assert answer.claimed is not None
    strain = float(np.abs(pressure + 2 * c - d).max()) / (2 * c + d)
    breathing = np.sqrt(3 * (2 * c + d) / throw.E[0, 0]) / np.linalg.norm(answer.found[1], axis=(1, 2)).mean()
    return replace(
        answer, claimed=(answer.claimed[0] + strain, answer.claimed[1] + strain * float(breathing))
    )


def by_reduced_form(form: Any, problem: AffineProblem) -> Answer:
    """The `simulate` of a reduced form."""
    throw: Throw = problem.given
    found = form.simulate(throw.E, material_of(throw), throw.F0, throw.dF0, throw.time)
    return Answer((found.F, found.dF))


def integrated_ode(method: str, problem: AffineProblem) -> Answer:
    """solve_ivp as it comes."""
    throw: Throw = problem.given
    y, reason = run(throw.rates, throw.start, throw.time, method)
    y = y.reshape(-1, 2, 3, 3)
    return so_far(y[:, 0], y[:, 1], RTOL, reason)


def so_far(motion: Array, rate: Array, claimed: float, reason: str) -> Answer:
    """A motion that was integrated, or how far; reason: why no further."""
    return Answer((motion, rate), (claimed, claimed), "refused" if reason else "ok", (reason,) * bool(reason))


def run(
    rates: Callable[[float, Array], Array], start: Array, time: Array, method: str, **tight: Any
) -> tuple[Array, str]:
    """States (time, size), NaN where it did not get to, and what it says of that."""
    options: dict[str, Any] = {"method": method, "t_eval": time, **tight}
    found: Any = solve_ivp(rates, (float(time[0]), float(time[-1])), start, **options)
    y = np.full((len(time), len(start)), np.nan)
    y[: found.y.shape[1]] = found.y.T
    return y, "" if found.status == 0 else found.message


def two_sided_plain(problem: AffineProblem) -> Answer:
    """The two-sided equations by DOP853 at 1e-10, with nothing that looks at the chart."""
    throw: Throw = problem.given
    W, mu = LinearSprings(throw.material[0]), float(throw.E[0, 0])
    state = two_sided_state(throw.F0, throw.dF0)
    ends = np.cumsum([len(part) for part in state])[:-1]

    def rates(_: float, y: Array) -> Array:
        return np.concatenate(two_sided_rates(TwoSidedState(*np.split(y, ends)), mu, W))

    y, reason = run(rates, np.concatenate(state), throw.time, "DOP853", rtol=1e-10, atol=1e-10)
    a, da, pi, kappa, q_L, q_R = np.split(y, ends, axis=1)
    i, j = [1, 2, 0], [2, 0, 1]
    s, d = 2 * (pi + kappa) / (a[:, i] + a[:, j]) ** 2, 2 * (pi - kappa) / (a[:, i] - a[:, j]) ** 2
    known = np.isfinite(y).all(1)
    L, R = (np.full((len(y), 3, 3), np.nan) for _ in range(2))
    L[known] = Rotation.from_quat(q_L[known]).as_matrix()
    R[known] = Rotation.from_quat(q_R[known]).as_matrix().swapaxes(1, 2)
    F, V = (L * a[:, None]) @ R, L @ reduced_velocity(a, da, s, d) @ R
    return so_far(F, V, 1e-9, reason)


def free_turning(problem: AffineProblem) -> Answer:
    """`free_rotation`."""
    J, w0, time = problem.given
    found = free_rotation(J, w0, time)
    return Answer((found.L, found.omega))


def rigid_integrated(method: str, problem: AffineProblem) -> Answer:
    """Euler's equations and the rotation matrix by solve_ivp as it comes."""
    J, w0, time = problem.given
    inverse = np.linalg.inv(J)

    def rates(_: float, y: Array) -> Array:
        w = y[9:]
        return np.concatenate([(y[:9].reshape(3, 3) @ hat(w)).ravel(), inverse @ np.cross(J @ w, w)])

    y, reason = run(rates, np.concatenate([EYE.ravel(), w0]), time, method)
    return so_far(y[:, :9].reshape(-1, 3, 3), y[:, 9:], RTOL, reason)


SCIPY = ("RK45", "DOP853", "Radau")
PEERS = tuple(at_once(f"scipy {m}", partial(integrated_ode, m), kind="peer") for m in SCIPY)
STEPS = (
    at_once("Verlet", partial(stepped, "verlet")),
    at_once("Blanes-Moan 6", partial(stepped, "blanes_moan_6")),
)
FREE = (*STEPS, *PEERS)
COLLAPSING = (
    *STEPS, at_once("reference", referred),
    at_once("left-reduced", partial(by_reduced_form, left_reduced)), *PEERS,
)  # fmt: skip
STIFF = (*STEPS, at_once("RATTLE", rattled), *PEERS)
HELD_PEERS = (
    at_once("RATTLE", partial(stepped, "verlet")),
    at_once("RATTLE, Suzuki 4", partial(stepped, "suzuki_4")), at_once("reference", referred), *PEERS,
)  # fmt: skip
CHARTS = (
    at_once("two-sided", partial(by_reduced_form, two_sided)),
    at_once("general", partial(by_reduced_form, general_reduced)),
    at_once("left-reduced", partial(by_reduced_form, left_reduced)), at_once("reference", referred),
    at_once("two-sided, unguarded", two_sided_plain, kind="peer"),
)  # fmt: skip
RIGID_PEERS = (
    at_once("free_rotation", free_turning),
    at_once("scipy RK45", partial(rigid_integrated, "RK45"), kind="peer"),
    at_once("scipy DOP853", partial(rigid_integrated, "DOP853"), kind="peer"),
)  # fmt: skip
