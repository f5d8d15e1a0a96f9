"""The solution at the level that is asked for or chosen, and the routes where that has none."""

from __future__ import annotations

from dataclasses import replace

from forceid.config import Settings
from forceid.errors import ConfigError, DataError, EstimationError
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.body.segment_noise import shows_segments
from forceid.estimation.loads.channels import DrivenMotion
from forceid.estimation.methods.classic import estimate_classic
from forceid.estimation.methods.in_segments import SEGMENTS, estimate_in_segments
from forceid.estimation.methods.problem import Solution
from forceid.estimation.methods.smoother import estimate_flight
from forceid.estimation.model_choice.ladder import choose_level, rigid_fits
from forceid.estimation.model_choice.words import LevelChoice, without_choice
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.witness.stand_in import stand_in
from forceid.kalman.engines import engine
from forceid.records import Body, Motion
from forceid.rounding import solvable


def moves_in_segments(body: Body, motion: Motion, settings: Settings) -> bool:
    """Whether a body is taken as segments: they are asked for, or show in a level that is left open.

    A DataError where they are asked for and the body has none, a ConfigError beside a method that knows none.
    """
    shown, known = shows_segments(body, motion), settings.method in ("smoother", "filter")
    if settings.model == "auto" and shown and known and body.mass is not None:
        return not rigid_fits(kinematics(body, motion, settings.model_copy(update={"model": "rigid"})))
    if settings.model != SEGMENTS:
        return False
    if not shown:
        what = "holds no markers on segments that meet at joints, which the model segments asks for"
        raise DataError(what, "/body", "import it with clusters and joints, or use another model")
    if not known:
        what = f"has method {settings.method}, expected smoother or filter beside the model segments"
        raise ConfigError(what, next_step="use one of them")
    return True


def of_segments(
    kin: Kinematics, body: Body, motion: Motion, settings: Settings
) -> tuple[Solution, LevelChoice]:
    """A body of segments, or one at its level where that is open. EstimationError: joints show too little."""
    solution = estimate_in_segments(body, motion, settings, engine(settings.engine), kin)
    if solution is not None:
        shown = "its markers leave the rigid shape, and its joints show by how much they err"
        return solution, without_choice(SEGMENTS, shown if settings.model == "auto" else "it was asked for")
    if settings.model == "auto":
        return at_its_level(kinematics(body, motion, settings), body, motion, settings)
    what = "shows the joints of its segments in too few frames for their errors"
    raise EstimationError(what, "the recording", "restore the markers, or use another model")


def at_its_level(
    kin: Kinematics, body: Body, motion: Motion, settings: Settings
) -> tuple[Solution, LevelChoice]:
    """The solution at the level asked for or chosen, and why that; kin: of the motion, cleaned."""
    passes = engine(settings.engine)

    def at(level: Settings, seen: Kinematics, shown: DrivenMotion | None = None) -> Solution:
        if settings.method in ("smoother", "filter"):
            return estimate_flight(body, motion, level, passes, seen, shown)
        return estimate_classic(body, motion, level, passes, seen)

    if settings.model != "auto":
        why = "it was asked for" if body.material is None else "it was asked for, or the material is stated"
        return at(settings, kin), without_choice(settings.model, why)
    choice, solution = choose_level(kin, motion, settings, passes, at)
    return solution, choice


def by_masses_alone(
    body: Body, motion: Motion, settings: Settings, error: EstimationError
) -> tuple[Solution, LevelChoice] | None:
    """The solution without a stiffness under which the flight has none; None where it has none either.

    What is told of a body makes nothing worse: what masses alone determine is not left open.
    """
    if body.stiffness is None:
        return None
    body = replace(body, stiffness=None)
    try:
        with solvable():
            solution, choice = at_its_level(kinematics(body, motion, settings), body, motion, settings)
    except EstimationError:
        return None
    said = note("stiffness-left-out", where=error.where, what=error.what)
    return replace(solution, findings=(*solution.findings, said)), choice


def by_plain_route(
    body: Body, motion: Motion, kin: Kinematics, error: EstimationError
) -> tuple[Solution, LevelChoice] | None:
    """What the plain route makes of a motion, None where so few frames show no force either."""
    plain = stand_in(body, motion, kin, error)
    choice = without_choice(kin.model, "the plain route takes none for granted")
    return None if plain is None else (plain, choice)
