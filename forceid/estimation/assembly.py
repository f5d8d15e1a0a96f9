"""What a solved flight amounts to: the estimate that users get."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.affine.first_moments import given_stress, observed_first_moments, polar_motion
from forceid.estimation.applied import about_point, applied_loads, lever
from forceid.estimation.body.kinematics import Kinematics, mapped, shape_at
from forceid.estimation.body.modal_force import modal_forces
from forceid.estimation.feet import feet_of, split_by_foot
from forceid.estimation.flown import air_of, canonical_quaternions, flown_of
from forceid.estimation.known.removal import KnownWrench
from forceid.estimation.loads.hidden.misfit import typical_variance
from forceid.estimation.methods.in_segments import SEGMENTS
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.finding import (
    judge,
    judge_leakage,
    judge_tuning,
)
from forceid.estimation.verdict.innovations import judge_innovations
from forceid.estimation.verdict.leakage import leakage
from forceid.estimation.verdict.loads import (
    judge_haste,
    judge_loads,
    judge_overlap,
    judge_roughness,
)
from forceid.estimation.verdict.sensitivity import body_sensitivity
from forceid.estimation.verdict.shape import (
    judge_answers,
    judge_common,
    judge_modes,
    judge_reference,
    judge_shape,
    judge_size,
)
from forceid.estimation.verdict.turns import judge_momentum
from forceid.motion import fit_rotation
from forceid.records import Array, Estimate, Finding, Recording, deviation
from forceid.timing import stage


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
    rotation, deformation = under_gauge(
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
    whole = np.concatenate([state.force, state.moment], 1)
    shared = (
        None
        if known
        else split_by_foot(feet, recording.body.node, motion, state.center, whole, state.wrench_cov)
    )
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
        feet=shared.feet if shared else None,
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


def under_gauge(
    gauge: str, kin: Kinematics, shape: Array, rotation: Array, polar: Array | None
) -> tuple[Array, Array]:
    """Rotation (time, 3, 3) and deformation (time, node, 3) under the complement that `gauge` names.

    The estimator works in the mass gauge, or in one that holds a body which bends far; another one turns
    the mean axes by what its fit sees: euclidean to all nodes alike, sensor to those that carry a marker,
    which is no mean motion. polar: the rotation of F = R U, which is that of an affine body in the mass
    gauge. Source: principal equations 2.5.
    """
    mean = kin.shape
    if gauge == "mass" and polar is not None:
        return polar, np.einsum("tba,tbc,tnc->tna", polar, rotation, shape, optimize=True) - mean
    if (gauge == "mass" and kin.gauge is mean) or not len(mean):
        return rotation, shape - mean
    weights = {"mass": kin.inertia.weight, "euclidean": np.ones(len(mean)), "sensor": kin.seen}
    _, turned = fit_rotation(shape, mean, weights[gauge].astype(float))
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
