"""Smoother and filter of a body of segments: a person, a machine. No shape of it is asked for.

All mass is seen at mass points, so force and moment each drive a linear channel, the mass center and what
arms sweep about it, under the errors of segments that joint gaps show. Nothing turns as a whole that a load
could turn with, so no lines are searched.

Joint gaps tell the errors of segments to a factor, and their color in the mean of each octave. What errors
are more of where no load is left would make a load rough, so that it lets through the errors of all slower
ones as well: no load is rougher than under errors as large as those of the loudest joint. Its claim allows
for the other priors of such orders, as far as the doubt about each octave lets the record tell them, and for
what a filter took that the tracks went through.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.cleaning import without_frames
from forceid.estimation.body.deformation import Deformation, inertia_along
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.segment_noise import (
    SegmentNoise,
    SegmentPoses,
    segment_noise,
    segment_poses,
)
from forceid.estimation.body.tracks.segment_color import new_in
from forceid.estimation.loads.channels import LEAST_FRAMES, force_channel, swept_momentum, tune_channel
from forceid.estimation.loads.hidden.left_out import hidden_load
from forceid.estimation.loads.hidden.misfit import shown_misfit, typical_variance
from forceid.estimation.loads.hidden.order_uncertainty import grown, growth_along_own
from forceid.estimation.loads.hidden.whitened import whitened
from forceid.estimation.methods.misplaced_mass import misplaced_each, widened_by_misplaced_mass
from forceid.estimation.methods.problem import Solution, named
from forceid.estimation.methods.tuning import stated_of
from forceid.estimation.verdict.catalogue import note
from forceid.flight.channels import Channel
from forceid.flight.color import Color
from forceid.flight.model import Flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState, smooth_translation
from forceid.flight.tuning import FREE, ORDERS
from forceid.kalman.engines import Engine
from forceid.kalman.model import mean_square
from forceid.principal import cross_matrix
from forceid.records import Array, Body, Finding, Flags, Motion
from forceid.rounding import SINGLE
from forceid.timing import stage

SEGMENTS = "segments"  # the model
AS_IT_IS = (1.0, 1.0)  # factors on a noise that is measured: none


def estimate_in_segments(
    body: Body, motion: Motion, settings: Settings, engine: Engine, kin: Kinematics
) -> Solution | None:
    """Wrench and motion of a body of segments; None where its joints show no noise.

    kin: a rigid fit, whose rotation stands for the mean one.
    """
    poses = segment_poses(body, motion)
    noise = segment_noise(body, motion.time, poses)
    if noise is None:
        return None
    misplaced = misplaced_each(kin.inertia.weight, noise, settings)
    return estimate_mass_points(kin, motion, noise, poses, misplaced, settings, engine)


def estimate_mass_points(
    kin: Kinematics,
    motion: Motion,
    noise: SegmentNoise,
    poses: SegmentPoses,
    misplaced: float,
    settings: Settings,
    engine: Engine,
    part_of: Mapping[str, LoadPrior] | None = None,
) -> Solution:
    """Wrench and motion of mass points, all of a body or some: kin, motion and noise are of these.

    misplaced: as of `misplaced_each`; part_of: the priors of all of a body, whose loads are as smooth as
    those on a part, None where it is all. EstimationError: too few frames show them all.
    """
    kin = replace(kin, model=SEGMENTS, color=noise.color, shared=None)
    channels, arm = driven_channels(kin, motion, noise)
    tune = partial(tune_channel, limits=AS_IT_IS, lines=(), engine=engine, kind=settings.load_prior)
    causal, priors, states, orders = settings.method == "filter", {}, {}, {}
    for load, channel in channels.items():
        with stage("force" if load == "force" else "moment"):
            stated = stated_of(settings, load)
            if part_of is None:
                loud = replace(channel, noise_cov=noise.most**2 * channel.noise_cov)
                least = min(tune(loud, stated=stated, orders=ORDERS).kernel.order, FREE)
                orders[load] = tuple(order for order in ORDERS if order >= least)
            else:
                orders[load] = (part_of[load].kernel.order,)
            priors[load] = tune(channel, stated=stated, orders=orders[load])
            states[load] = smoothed(channel, priors[load], engine, causal)
    state = both(kin, motion, *of_both(states))
    alone = typical_variance(state.wrench_cov)
    with stage("claims"):
        looks = {
            load: replace(
                whitened(channel, priors[load], engine),
                orders=orders[load],
                doubt=noise.doubt,
                source=noise.source,
            )
            for load, channel in channels.items()
            if priors[load].kernel.rivals
        }
        state = grown(state, growth_along_own(state, looks) * noise.size[:, None, None])
        mass = kin.inertia.weight
        state = widened_by_misplaced_mass(
            state, channels, priors, poses, noise.owner, mass, arm, misplaced, engine
        )
    still = np.zeros((len(motion.time), 0))
    deformation = Deformation(still, still, *inertia_along(kin, still, still))
    numbers = named(replace(kin, noise_root={}), priors) | noise.numbers(kin.inertia.weight)
    misfit = shown_misfit(channels, priors, motion.time, state.innovation, {}) * alone
    hidden = None if causal else hidden_load(channels, priors)
    said: tuple[Finding, ...] = ()
    if (source := noise.source) is not None:  # which took of a load that is followed up to it
        lost = hidden is not None and bool(np.nanmax(hidden.band) > source.cut)
        said = (note("smoothed-at-source", "degraded" if lost else "ok", cut_hz=source.cut),)
    return Solution(
        kin, deformation, state, engine.name, numbers, {}, said, priors, hidden=hidden, shown=misfit
    )


def of_both(states: dict[str, FlightState]) -> tuple[FlightState, FlightState]:
    """What is found of force and of moment; a single mass point has no moment about itself."""
    force, none = states["force"], np.zeros_like(states["force"].force)
    still = replace(
        force, force=none, velocity=none, wrench_cov=np.zeros_like(force.wrench_cov),
        innovation=force.innovation[:, :0], log_likelihood=0.0,
    )  # fmt: skip
    return force, states.get("moment", still)


def driven_channels(kin: Kinematics, motion: Motion, noise: SegmentNoise) -> tuple[dict[str, Channel], Array]:
    """What force and moment drive, by load, and the arms (time, node, 3) m of the mass points.

    EstimationError: some frames show all mass, but few.
    """
    assert motion.position is not None
    mass, known = kin.inertia.weight, None if motion.known is None else motion.known.turned
    Y, arm = swept_momentum(motion.position, mass, known)
    if np.isfinite(Y).all(1).sum() < LEAST_FRAMES:
        raise EstimationError("shows all mass in too few frames", "the recording", "restore the markers")
    force, share = force_channel(kin, motion.gravity), mass / mass.sum()
    filled = np.zeros(motion.position.shape[:2]) if motion.bridged is None else np.nan_to_num(motion.bridged)
    lever = cross_matrix(mass[:, None] * np.nan_to_num(arm))
    lost = (filled @ share**2)[:, None, None] * np.eye(3)
    lost_turn = np.einsum("tn,tnab->tab", filled, lever @ lever.mT)
    turning = np.nanmean(noise.of_momentum(mass, arm), axis=0)
    channels = {"force": replace(force, noise_cov=noise.of_center(mass) + lost, color=noise.color)}
    if len(mass) > 1:
        channels["moment"] = Channel(kin.time, Y, 1.0, turning + lost_turn, np.zeros((3, 3)), noise.color)
    told = np.where(np.arange(len(kin.time)) % new_in(noise.source), np.nan, 1.0)[:, None]
    return {load: replace(channel, z=channel.z * told) for load, channel in channels.items()}, arm


def of_new_frames(motion: Motion, kin: Kinematics) -> Motion:
    """The motion of segments in frames alone that tell anything new: their errors have a step of so many."""
    assert isinstance(kin.color, Color)
    new = round(kin.color.step * (len(motion.time) - 1) / float(np.ptp(motion.time)))
    return motion if new < 2 else without_frames(motion, np.arange(len(motion.time)) % new != 0)


def smoothed(channel: Channel, prior: LoadPrior, engine: Engine, causal: bool) -> FlightState:
    """The load of a channel, as the force on a mass center that moves as the channel does."""
    T, still = len(channel.time), np.zeros((len(channel.time), 3))
    cov = np.zeros((T, 6, 6))
    cov[:, :3, :3] = channel.noise_cov
    flight = Flight(channel.time, channel.z, np.full((T, 3, 3), np.nan), cov, 1 / channel.gain,
                    np.zeros((T, 3, 3)), still, np.zeros(3), color=channel.color)  # fmt: skip
    return smooth_translation(flight, prior, engine, causal)


def both(kin: Kinematics, motion: Motion, force: FlightState, moment: FlightState) -> FlightState:
    """Force and moment found apart in one state; the body turns with the angular velocity J^-1 H."""
    assert motion.position is not None
    fall = (motion.time - motion.time[0])[:, None] * motion.gravity
    center, velocity = (
        force.center + 0.5 * (motion.time - motion.time[0])[:, None] * fall,
        force.velocity + fall,
    )
    H = moment.velocity + (0.0 if motion.known is None else motion.known.momentum)
    arm = cross_matrix(motion.position - center[:, None])
    J = np.einsum("n,tnab,tncb->tac", kin.inertia.weight, arm, arm, optimize=True)
    seen: Flags = np.asarray(np.isfinite(J).all((1, 2)) & np.isfinite(H).all(1))
    omega = np.full_like(H, np.nan)
    whole = np.linalg.pinv(J[seen], rcond=SINGLE, hermitian=True)  # points on a line do not turn about it
    omega[seen] = np.einsum("tab,tb->ta", whole, H[seen])
    wrench_cov, pose_cov = force.wrench_cov.copy(), force.pose_cov.copy()
    wrench_cov[:, 3:, 3:], wrench_cov[:, :3, 3:], wrench_cov[:, 3:, :3] = (
        moment.wrench_cov[:, :3, :3],
        0.0,
        0.0,
    )
    pose_cov[:, 3:, 3:] = kin.pose.cov[:, 3:, 3:]
    innovation = np.concatenate([force.innovation, moment.innovation], 1)
    return replace(
        force, center=center, velocity=velocity, rotation=kin.pose.rotation, H=H, omega=omega,
        moment=moment.force,
        wrench_cov=wrench_cov, pose_cov=pose_cov, innovation=innovation, nis=mean_square(innovation),
        log_likelihood=force.log_likelihood + moment.log_likelihood,
    )  # fmt: skip
