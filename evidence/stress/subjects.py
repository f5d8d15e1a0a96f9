"""What the stress study tests: estimators on flights, solvers of bodies in parts, affine bodies."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from evidence import judged, subject
from evidence.judged import UNKNOWN
from evidence.stress.failure import Failure
from evidence.subject import Answer, Contestant
from evidence.subjects.affine import bodies as affine_bodies
from evidence.subjects.affine import contestants as affine_contestants
from evidence.subjects.affine import exact_polar
from evidence.subjects.affine import fliers as affine_fliers
from evidence.subjects.affine import flights as affine_flights
from evidence.subjects.affine import movers as affine_movers
from evidence.subjects.affine import problem as affine_problem
from evidence.subjects.affine import trial as affine_trial
from evidence.subjects.flights import bodies as flown_bodies
from evidence.subjects.flights import drawn_loads, oracle, trial
from evidence.subjects.flights.failures import record
from evidence.subjects.parts import bodies as parted_bodies
from evidence.subjects.parts import trial as partition_trial

Pair = tuple[float, float]


def unknown(case: Any) -> Pair:
    """No error is known that none in double precision can go below."""
    return UNKNOWN


@dataclass(frozen=True)
class Subject:
    """One kind of trial.

    contestants: who meets a failure, all or the default only; default: what that is called of all failures;
    quantities: the two that are judged; against: what a number in a map is relative to; told: what was done,
    in words; folders: of code under test, and sources: what else the trials depend on. errors: of an answer
    to a case; bound: of them; promised: what an answer without a word is held to.
    """

    contestants: Callable[[Failure, bool], tuple[Contestant, ...]]
    default: str
    quantities: tuple[str, str]
    against: str
    told: str
    folders: tuple[str, ...]
    sources: tuple[ModuleType, ...]
    errors: Callable[[Any, Answer], Pair]
    bound: Callable[[Any], Pair] = unknown
    promised: Callable[[Any], Pair] = unknown


TOLD_OF_FLIGHTS = """\
Records of a body whose motion was written down together with the force and moment that drove it. *Bound*
is what a smoother attains that is told the prior of the loads, the noise and the body, on the record
without its fault. Errors, claims and bounds are root mean squares per axis over the central three quarters.
A record is silently wrong as in [drawn records](../calibration.md): `ok`, and within its band off by more
than twice its claim; the smoother also where it is off by more than twice the plain route."""
TOLD_OF_PARTS = """\
Bodies in parts at rest, whose motion was written down first; loads and forces between parts were worked
out from it in extended precision. Errors and claims are of all forces between parts and of all motions,
relative to their length, pooled over the seeds. No bound is known: rounding costs one body more than
another."""
TOLD_OF_AFFINE = """\
Bodies that move affinely, F'' E = -dW/dF. Their motion has a closed form, or is known from DOP853 near
rounding and polar factors of eighty digits. Errors are relative, pooled over the seeds: of factors and rates
of their axes, of F and F', of rotation and rate of turn. They are put beside what an answer claims. Steps of
a fixed length claim what half the step changes, times 4/3. Peers claim the tolerance that they are given. Who
says nothing claims 1e-13 of factors, 1e-6 of their rates, 1e-10 of a motion. Along a path of factors the
first quantity is the largest unflagged turn from frame to frame over 0.3 rad. Who goes on after det F = 0 is
wrong by 1."""
TOLD_OF_AFFINE_LOADS = """\
Half a second of markers on a body whose affine motion is a sum of tones, turning: force and the nine first
moments of force follow in closed form. Errors and claims are root mean squares a component over the central
three quarters, pooled over the seeds. Least squares frame by frame, differentiated twice, claims the noise of
the markers that goes through."""
FLIGHTS = Subject(
    trial.contestants,
    "smoother",
    ("force", "moment"),
    "bound",
    TOLD_OF_FLIGHTS,
    ("estimation", "kalman", "motion", "principal"),
    (
        sys.modules[drawn_loads.draw_matern.__module__],
        flown_bodies,
        record,
        oracle,
        trial,
        subject,
        judged,
    ),
    trial.errors,
    bound=trial.bound_of_trial,
)
PARTS = Subject(
    partition_trial.solvers,
    partition_trial.DEFAULT.name,
    ("force", "motion"),
    "claim",
    TOLD_OF_PARTS,
    ("partition",),
    (parted_bodies, partition_trial, subject),
    partition_trial.errors,
)


AFFINE = Subject(
    affine_trial.takers,
    "functions of affine bodies",
    ("motion", "rate"),
    "claim",
    TOLD_OF_AFFINE,
    ("pseudorigid", "motion"),
    (affine_bodies, affine_contestants, affine_movers, affine_problem, affine_trial, exact_polar, subject),
    affine_trial.errors,
    promised=affine_trial.promised,
)
AFFINE_LOADS = Subject(
    affine_trial.takers,
    "affine estimate",
    ("force", "first moment"),
    "claim",
    TOLD_OF_AFFINE_LOADS,
    ("pseudorigid", "motion", "kalman", "principal", "estimation"),
    (affine_fliers, affine_flights, affine_problem, affine_trial, subject),
    affine_trial.errors,
    promised=affine_trial.promised,
)
OTHERS = {"partition": PARTS, "affine": AFFINE, "affine_loads": AFFINE_LOADS}
SUBJECTS = (FLIGHTS, *OTHERS.values())


def subject_of(failure: Failure) -> Subject:
    """The kind of trial that a failure is met in."""
    return OTHERS.get(failure.group, FLIGHTS)


def default_of(failure: Failure) -> str:
    """Who meets a failure when only one does."""
    return subject_of(failure).contestants(failure, True)[0].name
