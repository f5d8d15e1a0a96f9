"""One recording in, one estimate out: kinematics, method, moment point, loads, verdict."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from forceid.config import BodyStdSetting, Settings, to_toml
from forceid.errors import ConfigError, DataError, EstimationError
from forceid.estimation.affine.first_moments import given_stress, observed_first_moments, polar_motion
from forceid.estimation.applied import about_point, applied_loads, check_points, lever
from forceid.estimation.body.affine_fit import shows_affine
from forceid.estimation.body.cleaning import prepared
from forceid.estimation.body.inertia import without_node_rotations
from forceid.estimation.body.kinematics import Kinematics, kinematics, mapped, shape_at
from forceid.estimation.body.material import with_material
from forceid.estimation.body.modal_force import modal_forces
from forceid.estimation.body.rotors import with_rotors
from forceid.estimation.body.segment_noise import shows_segments
from forceid.estimation.body.thin_mass import with_known_moment
from forceid.estimation.changing_mass import (
    check_constant,
    of_changing_mass,
    seen_by_witness,
    share_of_mass,
)
from forceid.estimation.feet import feet_of, split_by_foot
from forceid.estimation.flown import air_of, canonical_quaternions, flown_of
from forceid.estimation.known.loads import known_loads
from forceid.estimation.known.removal import Beside, KnownWrench, beside_known
from forceid.estimation.loads.channels import DrivenMotion
from forceid.estimation.loads.hidden.misfit import typical_variance
from forceid.estimation.loads.hidden.order_uncertainty import grown
from forceid.estimation.methods.classic import estimate_classic
from forceid.estimation.methods.imu_only import estimate_unmarked, is_unmarked, judge_unmarked
from forceid.estimation.methods.in_segments import SEGMENTS, estimate_in_segments
from forceid.estimation.methods.problem import Solution
from forceid.estimation.methods.smoother import estimate_flight
from forceid.estimation.model_choice.ladder import choose_level, rigid_fits
from forceid.estimation.model_choice.words import LevelChoice, without_choice
from forceid.estimation.verdict.body_errors import with_uncertain_body
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import (
    judge,
    judge_leakage,
    judge_recording,
    judge_rounding,
    judge_tuning,
    refusing,
)
from forceid.estimation.verdict.innovations import judge_innovations
from forceid.estimation.verdict.leakage import leakage
from forceid.estimation.verdict.loads import (
    judge_haste,
    judge_loads,
    judge_overlap,
    judge_roughness,
)
from forceid.estimation.verdict.sensitivity import body_sensitivity, length
from forceid.estimation.verdict.shape import (
    judge_answers,
    judge_common,
    judge_modes,
    judge_reference,
    judge_shape,
    judge_size,
)
from forceid.estimation.verdict.tracks import judge_mending
from forceid.estimation.verdict.turns import judge_momentum
from forceid.estimation.witness.stand_in import stand_in
from forceid.estimation.witness.witness import judge_witness, witness_of, yielding
from forceid.kalman.engines import engine
from forceid.motion import fit_rotation
from forceid.principal import objectivity
from forceid.records import Array, Body, Estimate, Finding, Motion, Recording, deviation
from forceid.rounding import solvable
from forceid.threads import threads_for
from forceid.timing import in_order, recorded, stage


@solvable()
def estimate_recording(recording: Recording, settings: Settings) -> Estimate:
    """Applied wrench (weight excluded), mean motion and deformation; the joint forces of a body in parts.

    A body in parts that is refused as a whole, since it deforms too much, still has its parts.
    """
    began = perf_counter()
    with recorded() as spent, stage("rest"), threads_for(3 * len(recording.body.node)):
        recording = with_stated(recording, settings)
        try:
            result, _ = estimate_whole(without_mechanism(recording, settings), settings)
        except EstimationError as e:
            if not settings.part:
                raise
            result = refused_estimate(recording, settings, [note("whole-body-fails", error=str(e))])
        if settings.part or settings.joint:
            # with forceid.partition: only bodies in parts pay for it
            from forceid.estimation.joints.forces import joint_forces

            result = replace(result, interface=joint_forces(recording, settings, estimate_whole))
    return replace(
        result,
        settings=to_toml(settings),
        input_sha256=recording.sha256,
        runtime_s=perf_counter() - began,
        timing=in_order(spent),
    )


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
    open_state = with_uncertain_body(solution.state, solution.kinematics, solution.deformation, doubt)
    rounded = judge_rounding(motion, solution.kinematics.noise)
    said = (*rounded, *judge_mending(mended), *solution.findings)
    solution = replace(solution, state=open_state, findings=said)
    found = solution.kinematics
    deforms = bool(len(found.shapes))
    witness = witness_of(body, motion, solution.state, found.color, deforms, found.of_center)
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


def with_stated(recording: Recording, settings: Settings) -> Recording:
    """The recording under the gravity, and of a body with what turns inside and the material, that the
    settings state. Matrices of the body are those of the places of its nodes.
    """
    body, motion = without_node_rotations(recording.body), recording.motion
    if settings.gravity is not None:
        motion = replace(motion, gravity=np.array(settings.gravity))
    if settings.internal_momentum is not None:
        body = replace(body, internal_momentum=np.array(settings.internal_momentum))
    if settings.mass_rate is not None:
        body = replace(body, mass_rate=settings.mass_rate)
    body, motion = with_rotors(body, motion, settings.rotor)
    return replace(recording, body=with_material(body, settings), motion=motion)


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


def check_stiffness(body: Body) -> None:
    """A DataError where the stiffness of a body leaves a mechanism or holds a rigid motion."""
    if body.stiffness is None or body.position is None:
        return
    if not body.stiffness.any():
        raise DataError("is all zero", "/body/stiffness", "leave it out: a force needs no stiffness")
    if reasons := objectivity(body.stiffness, body.position).reasons:
        raise DataError(reasons[0].removeprefix("the stiffness "), "/body/stiffness")


def without_mechanism(recording: Recording, settings: Settings) -> Recording:
    """A recording without a stiffness under which parts move freely against each other: it is theirs."""
    body = recording.body
    if not settings.part or body.stiffness is None or body.position is None or not body.stiffness.any():
        return recording
    if not objectivity(body.stiffness, body.position).reasons:
        return recording
    return replace(recording, body=replace(body, stiffness=None))


@stage("verdict")
def assemble(
    recording: Recording,
    settings: Settings,
    solution: Solution,
    findings: list[Finding],
    left: float | None,
    further: list[Finding],
    known: KnownWrench | None = None,
) -> Estimate:
    """The estimate that a solved flight amounts to.

    left: chi-square that the rigid level leaves over that of the best, None where levels were not compared;
    further: what is to say beside, after all else; known: the loads that it is beside.
    """
    kin, motion = solution.kinematics, recording.motion
    feet = feet_of(settings.foot, recording.body.node)
    of_all = solution if known is None else replace(solution, state=known.added(solution.state))
    affine, unobserved = observed_first_moments(of_all, settings)
    state = given_stress(solution.state, affine, known.part.moment if known else np.zeros(3))
    shape = shape_at(kin, solution.deformation.amplitude)
    turning = polar_motion(affine)
    rotation, deformation = in_gauge(
        settings.gauge, kin, shape, state.rotation, turning.pop("rotation", None)
    )
    wrench = np.concatenate([state.force, state.moment], 1)
    modal = solution.modal or modal_forces(kin, state, solution.deformation)
    loads, same = applied_loads(
        settings,
        recording.body,
        kin.inertia,
        state,
        shape,
        wrench,
        modal if known is None else None,
    )
    wrench, cov = about_point(settings, recording.body, state, shape, wrench)
    leaks, point = leakage(recording.body, kin), settings.moment_about
    arm = None if point == "mass_center" else -lever(point, recording.body, state, shape)
    costs = body_sensitivity(
        kin, solution.deformation, of_all.state, recording.body.node, motion.gravity, arm
    )
    force_std = deviation(state.wrench_cov)[:, :3]
    wild_said = any(f.code == "wild-innovations" for f in solution.findings)
    exceeds = None if solution.shown is None else solution.shown / typical_variance(state.wrench_cov)
    shape_said = [*judge_shape(kin, recording.body, left), *judge_common(kin)]
    if not settings.part:  # parts stand where their joints let them
        shape_said = [*judge_reference(recording.body, kin), *shape_said]
    findings = [
        *findings,
        *judge_leakage(leaks),
        *judge_overlap(kin, solution.deformation.amplitude, solution.priors, force_std),
        *judge_size(kin),
        *judge_haste(kin, state.force),
        *([] if kin.model == SEGMENTS else shape_said),
        *judge_roughness(solution.priors),
        *judge_tuning(kin, solution.noise_at_limit),
        *judge_innovations(motion.time, state.innovation, state.nis, reach(solution), exceeds, wild_said),
        *judge_momentum(kin, state.H, state.moment),
        *judge_loads(loads),
        *same,
        *solution.findings,
        *unobserved,
        *judge_modes(kin),
        *judge_answers(kin, solution.deformation),
        *further,
    ]
    result = Estimate(
        time=motion.time, force=wrench[:, :3], moment=wrench[:, 3:], wrench_cov=cov, center=state.center,
        velocity=state.velocity, orientation=canonical_quaternions(rotation), angular_velocity=state.omega,
        angular_momentum=state.H, deformation=deformation, mean_shape=kin.shape, nis=state.nis,
        innovation=state.innovation, mass=kin.inertia.mass, gravity=motion.gravity, node=recording.body.node,
        method=settings.method, model=kin.model, engine=solution.engine, log_likelihood=state.log_likelihood,
        moment_about=str(settings.moment_about), verdict=judge(findings),
        mode_amplitude=solution.deformation.amplitude if kin.model == "modal" else None, modal=modal,
        stretch=affine.stretch if affine else stretch_to(kin.shape, shape) if kin.model == "affine" else None,
        first_moment=affine.first_moment if affine else None,
        first_moment_cov=affine.first_moment_cov if affine else None,
        known_force=known.part.force if known else None,
        known_moment=known.part.moment if known else None,
        applied_first_moment=affine.applied_first_moment if affine else None,
        applied_first_moment_cov=affine.applied_first_moment_cov if affine else None,
        loads=loads, tuned=solution.tuned, leakage=leaks.numbers() if leaks else {},
        sensitivity=costs.numbers(), hidden=solution.hidden, impulses=solution.impulses,
        flown=flown_of(solution, motion),
        feet=None if known else split_by_foot(feet, recording.body.node, motion, solution.state),
        aero=air_of(settings, solution, state, motion),
    )  # fmt: skip
    return replace(result, **turning)


def reach(solution: Solution) -> Array:
    """Load per claimed standard deviation (channel,) that one of a pose takes to be followed at 1 rad/s."""
    inertia, channels = solution.kinematics.inertia, solution.state.innovation.shape[1]
    covs = (solution.kinematics.pose.cov, solution.state.wrench_cov)
    var = [np.diagonal(cov, axis1=1, axis2=2)[:, :channels] for cov in covs]
    # zero where a load is open throughout
    moved, claimed = (np.sqrt(np.nansum(v, 0) / np.maximum(np.isfinite(v).sum(0), 1)) for v in var)
    if inertia.line is not None and channels > 3:  # along the line hardly any moment can hide
        claimed[3:] = np.sqrt(np.mean(claimed[3:] ** 2))
    moving = np.repeat([inertia.mass, np.trace(inertia.tensor) / 3], 3)[:channels]
    return np.asarray(moving * moved / np.where(claimed > 0, claimed, np.inf))


def in_gauge(
    gauge: str, kin: Kinematics, shape: Array, rotation: Array, polar: Array | None
) -> tuple[Array, Array]:
    """Rotation (time, 3, 3) and deformation (time, node, 3) under the complement that `gauge` names.

    The estimator works in the mass gauge; another one turns the mean axes by what its fit sees: euclidean to
    all nodes alike, sensor to those that carry a marker, which is no mean motion. polar: the rotation of
    F = R U, which is that of an affine body in the mass gauge. Source: principal equations 2.5.
    """
    mean = kin.shape
    if gauge == "mass" and polar is not None:
        return polar, np.einsum("tba,tbc,tnc->tna", polar, rotation, shape, optimize=True) - mean
    if gauge == "mass" or not len(mean):
        return rotation, shape - mean
    _, turned = fit_rotation(
        shape, mean, np.ones(len(mean)) if gauge == "euclidean" else kin.seen.astype(float)
    )
    return rotation @ turned, np.einsum("tba,tnb->tna", turned, shape) - mean


def stretch_to(mean: Array, shape: Array) -> Array:
    """Right stretch U (time, 3, 3) of the affine map that takes the mean shape to `shape` (time, node, 3)."""
    A = mapped(mean, shape)
    square, axes = np.linalg.eigh(A.swapaxes(1, 2) @ A)
    return np.asarray(axes * np.sqrt(square)[:, None] @ axes.swapaxes(1, 2))


def refused_estimate(recording: Recording, settings: Settings, findings: list[Finding]) -> Estimate:
    """An estimate that says nothing but why."""
    T, nodes = len(recording.motion.time), len(recording.body.node)
    v3, v4 = np.full((T, 3), np.nan), np.full((T, 4), np.nan)
    return Estimate(
        time=recording.motion.time, force=v3, moment=v3, wrench_cov=np.full((T, 6, 6), np.nan), center=v3,
        velocity=v3, orientation=v4, angular_velocity=v3, angular_momentum=v3,
        deformation=np.full((T, nodes, 3), np.nan), mean_shape=np.full((nodes, 3), np.nan), nis=v3[:, 0],
        innovation=np.zeros((T, 0)), mass=np.nan, gravity=recording.motion.gravity,
        node=recording.body.node, method=settings.method, model="rigid", engine="none",
        log_likelihood=np.nan, moment_about=str(settings.moment_about), verdict=judge(findings),
    )  # fmt: skip
