"""The model ladder: the smallest of its levels that is enough.

What markers show beyond the rigid motion is one data set for every level: its part inside the shapes of a
level moves under a dynamic prior, its part outside is noise. So levels compare by likelihood, without any
flight solved. From the level that explains the motion best the choice descends to the smallest one whose
force and moment are hardly worse: whose expected error, what it claims and how far it is off, is at most a
tenth above. A level that speaks for mass which no marker shows has to be the better guess of it.
Source: principal equations 4g.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.deformation_residual import (
    Beyond,
    beyond_rigid,
    errors_gain,
    principal_axes,
    speaks_for_mass,
)
from forceid.estimation.body.deforming.resonance import ringing_gain
from forceid.estimation.body.kinematics import Kinematics, at_level
from forceid.estimation.body.tracks.marker_errors import MarkerErrors, marker_errors
from forceid.estimation.loads.channels import DrivenMotion, driven_motion
from forceid.estimation.methods.problem import Solution
from forceid.estimation.model_choice.levels import (
    LevelCandidate,
    Step,
    brings_modes,
    chance,
    explaining,
    levels,
    weigh,
)
from forceid.estimation.model_choice.load_seen import (
    NEAR,
    claims_more,
    from_view,
    looked,
    moves,
    view,
    worse,
)
from forceid.estimation.model_choice.words import LevelChoice, sentence_of, without_choice
from forceid.estimation.verdict.finding import FEW
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.flight.color import LowPassed
from forceid.kalman.engines import Engine
from forceid.records import Body, Motion
from forceid.significance import PATIENCE, WORSE
from forceid.timing import stage

CLEAR = np.sqrt(WORSE**2 - 1)  # standard errors by which a level may be off that claims no less

SolveLevel = Callable[[Settings, Kinematics, DrivenMotion | None], Solution]


@stage("level")
def choose_level(
    kin: Kinematics, motion: Motion, settings: Settings, engine: Engine, solve: SolveLevel
) -> tuple[LevelChoice, Solution]:
    """The level that a recording asks for, and the solution at that level.

    kin: its kinematics under the settings, which leave the level open; solve: the estimate at a level, from
    the settings that name it, the kinematics at it, and what a look at it showed, if there was one. It runs
    for the level taken; and for the explaining one where the flight of a smaller one is not what a look
    without the flight said. The wrench covariance of a smaller one allows for its distance.
    """
    rigid, markers = settings.model_copy(update={"model": "rigid"}), kin.markers
    if markers is None:
        return without_choice("rigid", "a mean motion shows no deformation"), solve(rigid, kin, None)

    def without_shapes(reason: str) -> tuple[LevelChoice, Solution]:
        seen = at_level(markers, rigid) if kin.deforms else kin
        return without_choice("rigid", reason), solve(rigid, seen, None)

    if settings.modes == 0:
        return without_shapes("no modes are asked for")
    most = replace(kin, model="modal")  # with every shape that shows
    if most.inertia.on_line or most.inertia.point:
        return without_shapes("all mass lies on a line or a point")
    beyond = None
    if most.attitude and motion.measured is not None:
        beyond = beyond_rigid(motion.time, motion.measured, most)
    if beyond is None or not beyond.y.shape[1]:
        return without_shapes("so few markers show no deformation")
    if beyond.frames < FEW:
        if rigid_fits(at_level(markers, rigid)):
            return without_shapes("the markers that each frame shows keep their shape")
        solution = solve(settings, at_level(markers, settings), None)
        said = f"{beyond.frames} frames that show every marker are too few to tell levels apart"
        return without_choice(solution.kinematics.model, said), solution
    own_modes = brings_modes(markers.body, most)
    several, noise = levels(markers, settings, most), np.sqrt(beyond.var)
    # shapes found in a record do not say where mass goes that is known as a whole
    given = own_modes or most.inertia.nodal is not None
    telling = [level for level in several if given or level.settings.model != "modal"]
    errors, least = errors_beside(beyond, telling)
    alike, stated = errors is not None and errors.alike, all(most.stated.values())
    if errors is not None and stated and errors.as_stated(noise):
        alike, least = alike and least is several[0], several[0]
    if errors is not None and alike and isinstance(errors.color, LowPassed):
        beyond, errors = beyond.told_anew(errors.color, errors.std), replace(errors, color=None)
    candidates = [
        level for level in several if level.settings.model != "affine" or speaks_for_mass(level.seen, beyond)
    ]
    if len(candidates) < 2 or (
        not own_modes and not len(most.shapes) and quiet(beyond, candidates[-1], most)
    ):
        return without_shapes("no deformation stands out of the noise")
    steps = weigh(beyond, candidates, free_shapes(markers.body, most), stated, engine)
    # what smaller levels leave would pass for noise, and errors that are alike would pass for further shapes
    first = next((i for i, level in enumerate(candidates) if level is least), 0)
    if candidates[first] is not least or steps[first].evidence < steps[0].evidence:
        first, alike = 0, alike and least is several[0]  # its shapes do not move as those of a body do
    best = explaining(steps, first)
    if errors is not None and alike:
        gained = [beside_errors(beyond, level, engine) for level in candidates]
        worth = [step.evidence + more for step, more in zip(steps, gained, strict=True)]
        likeliest = first + int(np.argmax(worth[first:]))
        if worth[likeliest] > max(s.evidence for s in steps[1:]):
            best = likeliest
            if not best:
                said = "errors of the markers, alike in all that no motion makes, explain it better"
                return without_shapes(said)
    # modes that a body brings are taken, whether shapes show them or poses alone, unless rigid is as good
    best = len(candidates) - 1 if own_modes else best
    return descend(motion, candidates, steps, best, engine, solve, first)


def errors_beside(
    beyond: Beyond, candidates: list[LevelCandidate]
) -> tuple[MarkerErrors | None, LevelCandidate]:
    """Errors of the markers beside the smallest level that leaves them alike, and that level.

    Those beside the first one, which is rigid, where none leaves them so.
    """
    rigid = marker_errors(beyond.time, beyond.y)
    for level in candidates:
        found = rigid
        if len(level.shapes):
            found = marker_errors(beyond.time, beyond.without(level.shapes).y)
        if found is not None and found.alike:
            return found, level
    return rigid, candidates[0]


def beside_errors(beyond: Beyond, level: LevelCandidate, engine: Engine) -> float:
    """Log-likelihood that errors with a memory gain over white ones beside a level, if they are alike."""
    left = beyond.without(level.shapes) if len(level.shapes) else beyond
    errors = marker_errors(left.time, left.y) if left.y.shape[1] else None
    if errors is None or not errors.alike:
        return 0.0
    known = replace(errors, color=None) if isinstance(errors.color, LowPassed) else errors
    return errors_gain(left, known, engine)


def rigid_fits(kin: Kinematics) -> bool:
    """Whether the markers that each frame shows, all or some, leave the rigid shape by no more than noise."""
    dof = kin.pose.dof > 0
    return bool(np.nansum(kin.pose.chi_square[dof]) < NIS_BAND[1] * kin.pose.dof[dof].sum())


def quiet(beyond: Beyond, level: LevelCandidate, kin: Kinematics) -> bool:
    """Whether the amplitudes of a level are no larger than noise, and none rings."""
    q = beyond.y @ principal_axes(beyond.y, beyond.of(level.shapes))
    dof = q.shape[1] * beyond.frames
    if not float(np.nansum(q**2) / beyond.var / dof) < chance(dof, all(kin.stated.values())):
        return False
    return bool((ringing_gain(beyond.time, q, beyond.var) < PATIENCE).all())


def free_shapes(body: Body, kin: Kinematics) -> bool:
    """Whether the shapes of a modal level are found in the record, and do not come with the body."""
    return body.mode_shape is None and not brings_modes(body, kin)


def descend(
    motion: Motion,
    candidates: list[LevelCandidate],
    steps: list[Step],
    best: int,
    engine: Engine,
    solve: SolveLevel,
    first: int = 0,
) -> tuple[LevelChoice, Solution]:
    """From the level that explains the motion, the best one, down to the smallest that is enough.

    first: the smallest that comes in question.
    """
    steps = list(steps)
    shown: dict[int, DrivenMotion] = {}

    @cache
    def look(i: int) -> Kinematics:
        return candidates[i].seen

    @cache
    def solved(i: int) -> Solution:
        return solve(candidates[i].settings, look(i), shown.get(i))

    def seen(i: int) -> DrivenMotion:
        shown[i] = driven_motion(look(i), motion.gravity, engine)
        return shown[i]

    def chosen(i: int) -> tuple[LevelChoice, Solution]:
        solution = solved(i)
        said = sentence_of(steps, i, best)
        if i != best:  # its error allows for what the level leaves out: its step to the best one
            room = np.sqrt(1 + np.repeat([steps[i].force_change, steps[i].moment_change], 3) ** 2)
            cov = solution.state.wrench_cov * np.outer(room, room)
            solution = replace(solution, state=replace(solution.state, wrench_cov=cov))
        return LevelChoice(steps[i].model, said, steps[i], tuple(steps)), solution

    def settles(i: int) -> bool:
        try:
            solved(i)
        except EstimationError:  # a level at which the flight does not settle explains nothing
            return False
        return True

    # shapes that are found leave open what mass without markers does; strains above them say so, and may be
    # off by less than is claimed for that
    speaking = [i for i in range(best + 1, len(steps)) if look(i).hidden is None]
    if speaking and look(best).hidden is not None and settles(best) and settles(speaking[0]):
        best = speaking[0] if WORSE * worse(solved(speaking[0]), solved(best)) < 1 else best
    if best <= first:
        return chosen(best)
    # to mass that neither markers nor shapes follow all levels are blind: their distance proves nothing
    if not first and look(best).unfollowed.any() and look(best).hidden is None:
        if claims_more(solved(0), solved(best)) >= claims_more(solved(best), solved(0)):
            return chosen(best)
        force, moment = moves(solved(0), solved(best))
        steps[0] = replace(steps[0], force_change=force, moment_change=moment)
        return chosen(0)
    # mass without markers may deform whether shapes are few or many, but a rigid body denies it
    least = first if look(best).hidden is None else max(first, 1)
    nested = [i for i in range(least, best) if steps[i].model != "affine"]
    if steps[best].model == "affine" and free_shapes(candidates[best].markers.body, look(best)):
        # few shapes that are found, each a direction chosen, are no smaller than strains that are given
        nested = [i for i in nested if not steps[i].modes]
    if not nested:
        return chosen(best)
    below = seen(nested[-1])
    top = view(seen(best), below, engine)

    def near(i: int) -> bool:
        if np.isnan(steps[i].change):
            force, moment = looked(below if i == nested[-1] else seen(i), top, engine)
            steps[i] = replace(steps[i], force_change=force, moment_change=moment)
        return steps[i].change <= NEAR

    def enough(i: int) -> bool:
        if not settles(i):
            return False
        if (ringing := solved(i).ringing) is not None and ringing.growth.max() > WORSE:
            return False  # it is seen to ring, and claims what it then may do: the shapes follow that
        if not any(prior.lines for prior in solved(i).priors.values()):
            if from_view(solved(i), top, motion.time) <= WORSE:
                return True
            if steps[i].change > CLEAR:
                return False
        # the flight found what the look did not, such as a line: whether the explaining level has it tells
        force, moment = moves(solved(i), solved(best), either=True)
        steps[i] = replace(steps[i], force_change=force, moment_change=moment)
        return worse(solved(i), solved(best)) <= WORSE

    if not near(nested[-1]):
        return chosen(best)
    # the fewer the shapes, the farther force and moment move: the first that is near is found by halving
    smallest, *larger = nested[bisect_left(nested[:-1], True, key=near) :]
    if enough(smallest):  # as it mostly is
        return chosen(smallest)
    # above that, only those clearly near are worth another flight: both found by halving as well
    clearly = bisect_left(larger, True, key=lambda i: near(i) and steps[i].change <= CLEAR)
    rest = larger[clearly:]
    place = bisect_left(rest, True, key=lambda i: near(i) and enough(i))
    return chosen(rest[place] if place < len(rest) else best)
