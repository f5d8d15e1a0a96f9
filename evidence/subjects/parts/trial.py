"""One body in parts by every solver: errors of forces and motions, what is claimed, and the verdict."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from evidence.stress.cell import Trial
from evidence.subjects.flights.failures.failure import Failure
from evidence.subjects.parts.bodies import Loaded
from forceid.errors import ForceIdError
from forceid.partition.statics import Statics
from forceid.records import Array

NOTHING = (float("nan"), float("nan"))
UNKNOWN = (float("nan"), float("nan"))  # bound: no error is known that none in double precision can go below


@dataclass(frozen=True)
class Solver:
    """A way to solve: directly, or by conjugate gradients with a preconditioner and weights."""

    preconditioner: str = ""
    weights: str = "multiplicity"
    relief: bool = False

    @property
    def name(self) -> str:
        """As it is called in a map."""
        how = (
            f"CG, {self.preconditioner.replace('dirichlet', 'Dirichlet')}"
            if self.preconditioner
            else "direct"
        )
        weighted = ", by stiffness" if self.weights == "stiffness" else ""
        return f"{how}{weighted}{', relief' if self.relief else ''}"

    @property
    def coarse(self) -> bool:
        """Whether it may honestly be worse than twice the bound: there is none."""
        return False


MOST = 300  # steps, more than any of these bodies takes that is solved at all
DEFAULT = Solver("dirichlet")
SOLVERS = (Solver(), Solver("none"), Solver("lumped"), DEFAULT, Solver("dirichlet", "stiffness"))
Solve = Callable[[Loaded, Solver], Statics]


def solvers(failure: Failure, short: bool = False) -> tuple[Solver, ...]:
    """Who meets a failure: every solver, one that relieves a floating body beside; or the default only."""
    if short:
        return (DEFAULT,)
    return (*SOLVERS, Solver(relief=True)) if failure.name == "floating" else SOLVERS


def solved(body: Loaded, who: Solver) -> Statics:
    """The body at rest, as that solver has it."""
    system = body.system()
    if not who.preconditioner:
        return system.solve(body.load, relief=who.relief)
    return system.solve_cg(
        body.load, who.preconditioner, who.weights, body.tolerance, MOST, relief=who.relief
    )


def attempt_parts(
    failure: Failure, level: float, seed: int, who: tuple[Solver, ...], solve: Solve = solved
) -> dict[str, Any]:
    """The trials of one body, as plain numbers under the names of solvers; solve: in place of `solved`."""
    body = failure.make(level, np.random.default_rng([seed, 2026]))
    found = {}
    for one in who:
        began = process_time()
        trial = tried(body, one, solve)
        found[one.name] = {**vars(trial), "seconds": process_time() - began}
    return {"failure": failure.name, "level": level, "seed": seed, "trials": found}


def tried(body: Loaded, who: Solver, solve: Solve) -> Trial:
    """What one solver makes of a body: errors and claims of lambda and of u, relative to their length."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = solve(body, who)
    except ForceIdError as refusal:
        return Trial("refused", NOTHING, NOTHING, UNKNOWN, str(refusal))
    except Exception as crash:  # an error that is none of ours is a finding, and the map goes on
        return Trial("crashed", NOTHING, NOTHING, UNKNOWN, f"{type(crash).__name__}: {crash}")
    error = relative(found.lam, body.lam), relative(found.u, body.u)
    claimed = found.lam_error, found.error
    return Trial(found.verdict.level, error, claimed, UNKNOWN, next(iter(found.verdict.reasons), ""))


def relative(found: Array, true: Array) -> float:
    """Length of the difference over that of the truth; one part has no forces between parts, and no error.

    >>> relative(np.array([3.0, 4.5]), np.array([3.0, 4.0]))
    0.1
    """
    return float(np.linalg.norm(found - true) / np.linalg.norm(true)) if len(true) else 0.0
