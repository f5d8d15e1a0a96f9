"""The flights of the parts of a body smoothed together, under the loads that the joints pass between them.

Each part by itself claims an error that is half noise and half load smoothed away. The noise of two parts is
independent, the load between them is one and the same: averaged as if independent, their wrenches claim too
little. So the poses and momenta of all parts stand side by side with the loads of the links, each of which
moves all parts that it acts on, and rows hold what the joints keep of the poses, beside what bending moves
them by. Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.joints.constraints import Constraints
from forceid.estimation.joints.link_loads import LinkLoad
from forceid.estimation.methods.problem import Solution
from forceid.flight.model import Flight
from forceid.flight.path.linear import flexed, linear_flight
from forceid.flight.path.reference import UNKNOWN_TURN, Reference, added_moment, translation, turn_step
from forceid.kalman.model import StateSpace
from forceid.records import Array

OWN = 12  # states of a part without its loads: mass center, momentum, rotation error, angular momentum


@dataclass(frozen=True)
class LinkedPart:
    """A part along the flight it was smoothed to by itself, without its loads: the states of the mass center,
    its momentum, the rotation error and the angular momentum first, those of modes and of errors behind.

    seen (time, channel): what the model measures; to_Y, to_H (step, state, 6): what the second and the first
    integral of a wrench about the center over a step does to the states.
    """

    flight: Flight
    reference: Reference
    model: StateSpace
    seen: Array
    to_Y: Array
    to_H: Array


@dataclass(frozen=True)
class LinkedFlight:
    """Parts, the loads of their links, and what holds the parts together.

    unplaced (time, part): variance of the moment about a center as the place of a load is not known, N2 m2.
    """

    parts: Sequence[LinkedPart]
    loads: Sequence[LinkLoad]
    constraints: Constraints
    unplaced: Array

    def moved(self, by: Array) -> LinkedFlight:
        """The same with its loads moved, for a search."""
        return replace(self, loads=[load.moved(by) for load in self.loads])


def linked_parts(solutions: list[Solution | None]) -> list[LinkedPart]:
    """Solved parts, ready to be smoothed together; none where one of them was not smoothed."""
    found = [None if solution is None else linked_part(solution) for solution in solutions]
    kept = [part for part in found if part is not None]
    return kept if len(kept) == len(solutions) else []


def linked_part(solution: Solution) -> LinkedPart | None:
    """A part that was smoothed; None for one that was not, or has no moment."""
    smoothing, reference = solution.smoothing, solution.state.reference
    if smoothing is None or reference is None or "moment" not in smoothing.priors:
        return None
    own = smoothing.flight
    flight, step = flexed(own, reference), np.diff(own.time)
    force = replace(smoothing.priors["force"], axes=np.eye(3), lines=(), body_axes=None)
    center = first_states(translation(flight, force))
    F = reference.moment.chain(step, reference.rotation, own.time[0])[0]
    turn = turn_step(flight, reference, *added_moment(reference.moment, F, reference.chain))
    G, u = np.zeros((len(step), 6, 6)), np.zeros((len(step), 6))
    G[:, :3, :3], G[:, :3, 3:], G[:, 3:, 3:] = turn.d_theta, turn.by_H, np.eye(3)
    u[:, :3] = turn.offset
    P0 = np.diag(np.repeat([UNKNOWN_TURN**2, reference.moment.start.first], 3))
    turning = StateSpace(G, np.zeros_like(G), np.eye(3, 6), flight.pose_cov[:, 3:, 3:], np.zeros(6), P0, u)
    prior = smoothing.priors["moment"]
    model, seen = linear_flight(own, force, prior, reference, (center, turning))
    to_Y, to_H = (np.zeros((len(step), len(model.x0), 6)) for _ in range(2))
    to_Y[:, :3, :3], to_H[:, 3:6, :3] = np.eye(3) / flight.mass, np.eye(3)
    to_Y[:, 6:9, 3:], to_H[:, 6:9, 3:], to_H[:, 9:12, 3:] = turn.by_Y, turn.by_more, np.eye(3)
    return LinkedPart(flight, reference, model, seen, to_Y, to_H)


def first_states(model: StateSpace, count: int = 6) -> StateSpace:
    """A model whose first states the others only push, without these."""
    own = slice(0, count)
    F, u = model.F[..., own, own], model.u
    assert u is not None
    return StateSpace(
        F, np.zeros(F.shape), model.H[..., own], model.R, model.x0[own], model.P0[own, own], u[:, own]
    )
