"""Who meets a failure of a body in parts: every solver, with the errors of its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from evidence.stress.failure import Failure
from evidence.subject import Answer, Contestant, at_once
from evidence.subjects.affine.problem import relative_error
from evidence.subjects.parts.bodies import Loaded
from forceid.partition.statics import Statics


@dataclass(frozen=True)
class Way:
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


MOST = 300  # steps, more than any of these bodies takes that is solved at all
DEFAULT = Way("dirichlet")
WAYS = (Way(), Way("none"), Way("lumped"), DEFAULT, Way("dirichlet", "stiffness"))


def solvers(failure: Failure, short: bool = False) -> tuple[Contestant, ...]:
    """Who meets a failure: every solver, one that relieves a floating body beside; or the default only."""
    if short:
        return (solver(DEFAULT),)
    return tuple(map(solver, (*WAYS, Way(relief=True)) if failure.name == "floating" else WAYS))


def solved(body: Loaded, way: Way) -> Statics:
    """The body at rest, solved that way."""
    system = body.system()
    if not way.preconditioner:
        return system.solve(body.load, relief=way.relief)
    return system.solve_cg(
        body.load, way.preconditioner, way.weights, body.tolerance, MOST, relief=way.relief
    )


def solver(way: Way, solve: Callable[[Loaded, Way], Statics] = solved) -> Contestant:
    """A way as a contestant; solve: in place of `solved`."""

    def answer(body: Loaded) -> Answer:
        found = solve(body, way)
        claimed = found.lam_error, found.error
        return Answer((found.lam, found.u), claimed, found.verdict.level, found.verdict.reasons)

    return at_once(way.name, answer)


def errors(body: Loaded, answer: Answer) -> tuple[float, float]:
    """Errors of lambda and of u, relative to their length; one part has no forces between parts."""
    lam, u = answer.found
    return relative_error(lam, body.lam) if len(body.lam) else 0.0, relative_error(u, body.u)
