"""One recording in, one estimate out: kinematics, method, moment point, loads, verdict."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np

from forceid.config import BodyStdSetting, Settings
from forceid.errors import ConfigError, EstimationError
from forceid.estimation.applied import check_points
from forceid.estimation.assembly import assemble, refused_estimate
from forceid.estimation.blocks import estimate_blocks
from forceid.estimation.body.affine_fit import shows_affine
from forceid.estimation.body.cleaning import prepared
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.thin_mass import with_known_moment
from forceid.estimation.changing_mass import (
    check_constant,
    of_changing_mass,
    seen_by_witness,
    share_of_mass,
)
from forceid.estimation.joints.segments import segment_joints
from forceid.estimation.known.loads import known_loads
from forceid.estimation.known.removal import Beside, beside_known
from forceid.estimation.loads.hidden.order_uncertainty import grown
from forceid.estimation.methods.imu_only import estimate_unmarked, is_unmarked, judge_unmarked
from forceid.estimation.methods.in_segments import SEGMENTS, of_new_frames
from forceid.estimation.methods.problem import Solution
from forceid.estimation.model_choice.words import without_choice
from forceid.estimation.routes import (
    at_its_level,
    by_masses_alone,
    by_plain_route,
    moves_in_segments,
    of_segments,
)
from forceid.estimation.standing import ground_on_feet, told_on_parts
from forceid.estimation.stated import (
    check_stiffness,
    further_places,
    judge_shown,
    with_body_shown,
    with_stated,
    without_mechanism,
)
from forceid.estimation.verdict.body_errors import with_uncertain_body
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import (
    judge_recording,
    judge_rounding,
    refusing,
)
from forceid.estimation.verdict.sensitivity import length
from forceid.estimation.verdict.tracks import judge_mending
from forceid.estimation.witness.witness import judge_witness, witness_of, yielding
from forceid.kalman.engines import engine
from forceid.records import Body, Estimate, Interface, Recording, Verdict
from forceid.rounding import solvable
from forceid.sections import to_toml
from forceid.threads import threads_for
from forceid.timing import in_order, recorded, stage


@solvable()
def estimate_recording(recording: Recording, settings: Settings) -> Estimate:
    """Applied wrench (weight excluded), mean motion and deformation; the joint forces of a body in parts.

    A body in parts that is refused as a whole, since it deforms too much, still has its parts.
    """
    began = perf_counter()
    with recorded() as spent, stage("rest"), threads_for(rows_solved(recording.body)):
        recording = with_stated(recording, settings)
        blocks = bool(settings.part) and is_unmarked(recording.motion)
        try:
            if blocks:
                result, solution = estimate_blocks(recording, settings, estimate_whole), None
            else:
                result, solution = estimate_shown(without_mechanism(recording, settings), settings)
        except EstimationError as e:
            if not settings.part:
                raise
            result, solution = (
                refused_estimate(recording, settings, [note("whole-body-fails", error=str(e))]),
                None,
            )
        if (settings.part or settings.joint) and not blocks:
            # with forceid.partition: only bodies in parts pay for it
            from forceid.estimation.joints.forces import joint_forces

            told = partial(told_on_parts, recording, settings)
            result = replace(result, interface=joint_forces(recording, settings, estimate_whole, told))
        elif settings.joint_loads and solution is not None:
            result = replace(result, interface=loads_of_joints(recording, settings, solution, result.verdict))
    return replace(
        result,
        settings=to_toml(settings),
        input_sha256=recording.sha256,
        runtime_s=perf_counter() - began,
        timing=in_order(spent),
    )


def loads_of_joints(recording: Recording, settings: Settings, whole: Solution, verdict: Verdict) -> Interface:
    """What passes the joints of a person, whole; a ConfigError where it was not estimated in segments."""
    if whole.kinematics.model != SEGMENTS:
        what = f"asks for the joints of segments, and the model is {whole.kinematics.model}"
        raise ConfigError(what, "joint_loads", 'use model = "segments", on a body imported with joints')
    ground = ground_on_feet(recording, settings, whole)
    return segment_joints(recording, settings, whole, ground, verdict)


def rows_solved(body: Body) -> int:
    """Of the largest matrix that is solved: all else, however many the nodes, is done in small pieces."""
    return max((len(a) for a in (body.mass_matrix, body.stiffness) if a is not None), default=0)


def estimate_shown(recording: Recording, settings: Settings) -> tuple[Estimate, Solution | None]:
    """The estimate of a recording as one body, its mass center and its inertia where its motion shows them;
    and the solution behind it unless it is refused.

    Loads that passed for one told wrong leave it a little beside; under what is left of them the motion shows
    it better. Lines, which would hold what is left, are sought when all rests.
    """
    result, solution = estimate_whole(recording, settings)
    told, moved, rests = None, dict[str, tuple[float, ...]](), True
    while solution is not None:
        now = solution.kinematics.inertia
        told = now if told is None else told
        off = {"center": solution.center_off, "tensor": solution.inertia_off}
        places, moved = further_places(off, moved, told, now)
        if rests and not places:
            break
        rests = not places or settings.lines != "auto"
        recording = replace(recording, body=with_body_shown(recording.body, told, **places))
        asked = settings if rests else settings.model_copy(update={"lines": "none"})
        try:
            shown, behind = estimate_whole(recording, asked)
        except EstimationError:  # what there is claims a body told wrong
            break
        if shown.verdict.level == "refused":
            break
        result, solution = shown, behind
    return result, solution


def estimate_whole(recording: Recording, settings: Settings) -> tuple[Estimate, Solution | None]:
    """The estimate of a recording as one body, and the solution behind it unless it is refused."""
    check_stiffness(recording.body)
    check_points(settings, recording.body)
    check_constant(recording, settings)
    if loads := known_loads(recording, settings):
        return beside_known(loads, recording, settings, estimate_beside)
    return estimate_beside(recording, settings)


def estimate_beside(
    recording: Recording, settings: Settings, beside: Beside | None = None
) -> tuple[Estimate, Solution | None]:
    """The estimate of what acts beside the loads known, and the solution behind it unless it is refused."""
    body, motion, kin = recording.body, recording.motion, None
    if settings.model == "auto" and body.material is not None and shows_affine(body, motion):
        settings = settings.model_copy(update={"model": "affine"})  # which the material is one of
    asked, segments = settings, moves_in_segments(body, motion, settings)
    if segments:
        settings = settings.model_copy(update={"model": "rigid"})  # for the mean rotation alone
    if is_unmarked(motion):
        findings = judge_unmarked(body, motion, settings)
    else:
        kin = kinematics(body, motion, settings)
        findings = judge_recording(kin, motion)
    if refusing(findings):
        return refused_estimate(recording, settings, findings), None
    motion, mended = prepared(body, motion, None if segments else kin)
    if beside is not None:
        motion = beside.taken.removed(motion)
    if kin is None:
        solution = estimate_unmarked(body, motion, settings, engine(settings.engine))
        choice = without_choice("rigid", "sensors alone show no deformation")
        if settings.model != "auto":
            choice = without_choice(settings.model, "it was asked for")
    else:
        seen = kin if motion is recording.motion else kinematics(body, motion, settings)
        kin = kin if beside is None else seen
        try:
            at = of_segments if segments else at_its_level
            with solvable():
                solution, choice = at(seen, body, motion, asked)
        except EstimationError as e:
            instead = by_masses_alone(body, motion, settings, e) or by_plain_route(body, motion, kin, e)
            if instead is None:
                raise
            solution, choice = instead
        solution = with_known_axes(solution)
    doubt, solution = with_mass_in_doubt(settings.body_std, solution)
    if solution.kinematics.model == SEGMENTS:  # whose claims have the place of their mass by now
        doubt = doubt.model_copy(update={"mass_center": 0.0})
    wider = with_uncertain_body(solution.state, solution.kinematics, solution.deformation, doubt, body.shown)
    rounded = judge_rounding(solution.kinematics)
    said = (*judge_shown(body), *rounded, *judge_mending(mended), *solution.findings)
    solution = replace(solution, state=wider, findings=said)
    found = solution.kinematics
    deforms = bool(len(found.shapes))
    seen_by = of_new_frames(motion, found) if found.model == SEGMENTS else motion
    witness = witness_of(body, seen_by, solution.state, found.color, deforms, found.of_center)
    solution = replace(solution, state=yielding(solution.state, witness))
    differs = judge_witness(witness, solution.state)
    known = None
    if beside is not None:
        state, known = beside.restored(solution.state, body, motion.time)
        solution = replace(solution, state=state, findings=(*solution.findings, beside.judged(known)))
    share = share_of_mass(body, motion, solution.kinematics.inertia.mass)
    if share is not None:
        solution, witness = of_changing_mass(solution, share), seen_by_witness(witness, share)
    result = assemble(recording, settings, solution, findings, choice.left, differs, known)
    if share is not None and result.flown is not None:
        result = replace(result, flown=replace(result.flown, current_mass=share * result.mass))
    result = replace(result, witness=witness, model_choice=choice.sentence, ladder=choice.numbers())
    return result, solution


def with_mass_in_doubt(doubt: BodyStdSetting, solution: Solution) -> tuple[BodyStdSetting, Solution]:
    """How well a body is known whose mass may be told wrong; the solution says so where it matters."""
    if not solution.wrong_mass or doubt.mass:
        return doubt, solution
    claimed = np.sqrt(np.nanmean(np.trace(solution.state.wrench_cov[:, :3, :3], axis1=1, axis2=2)))
    if solution.wrong_mass * length(solution.state.force) > claimed:
        said = note("mass-told", part=100 * solution.wrong_mass)
        solution = replace(solution, findings=(*solution.findings, said))
    return doubt.model_copy(update={"mass": solution.wrong_mass}), solution


def with_known_axes(solution: Solution) -> Solution:
    """The solution with claims grown for what tells nothing of its priors, and the moment that mass on a line
    or a point cannot have.
    """
    if (growth := solution.grown) is not None:
        solution = replace(solution, state=grown(solution.state, growth))
    claimed = replace(solution.state, wrench_cov=solution.state.wrench_cov + solution.between)
    solution = replace(solution, state=claimed)
    moved = solution.deformation.grown(growth, solution.moving)
    solution = replace(solution, deformation=moved)
    kin = solution.kinematics
    # a flight that leaves out the spin cannot be smoothed together with others that joints hold to it
    smoothing = solution.smoothing if kin.inertia.line is None else None
    state = with_known_moment(solution.state, kin.inertia, kin.spin, kin.pose.rotation)
    return replace(solution, state=state, smoothing=smoothing)
