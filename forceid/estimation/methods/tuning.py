"""Stages that tune the prior of each load on the channel it drives, and the noise of what shows the body."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.deformation import load_on_unit_mass
from forceid.estimation.body.kinematics import Kinematics, scaled_noise
from forceid.estimation.body.tracks.late_frames import lateness
from forceid.estimation.loads.channels import force_channel, tune_channel
from forceid.estimation.loads.pieces.character import with_character
from forceid.estimation.loads.shared_errors import may_be_shared, shared_errors
from forceid.estimation.methods.noise import errors_shared, measured_errors, noise_beyond_motion
from forceid.estimation.methods.problem import Problem
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import GROWTH
from forceid.flight.color import LowPassed
from forceid.flight.elastic_spectra import UNEVEN
from forceid.flight.priors.matern import UNTOLD_ORDER, Matern
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.priors.stated import Stated
from forceid.flight.tuning import FREE, ORDERS
from forceid.kalman.building.process import matern_density
from forceid.motion import noise_growth
from forceid.records import Array
from forceid.rounding import SINGLE
from forceid.significance import PATIENCE, SIGMAS
from forceid.timing import stage

STATED = (1.0, 4.0)  # factors on a stated noise: it is a floor
AS_LOOKED = (1.0, 1.0), (), ORDERS, None, "matern"  # how a look at a level tunes: `DrivenMotion`
UNSTATED = (0.02, 3.0)  # factors on the noise that high-order differences show: nearly a ceiling


@stage("noise")
def see_motion(problem: Problem) -> Problem:
    """Poses and deformation under the noise known so far."""
    kin, slow, source = problem.look(problem.slow), problem.slow is not None, problem.source
    # where a pose is as uncertain as the body deforms, how smooth it is says nothing of the noise of markers
    followed = kin.apart or not kin.deforms
    limits = range_of(kin, source, known=slow or not followed)
    errors, std, said = (None, None, ()) if slow else measured_errors(kin, problem.motion)
    if std is not None:
        kin, limits = problem.look({source: np.diag(std)}), STATED if followed else limits
    if problem.shared is not None:
        limits = 1.0, 1.0
    late, filtered = None, errors is not None and isinstance(errors.color, LowPassed)
    if kin.attitude and not kin.deforms and not filtered:
        found = lateness(kin.time, kin.pose)
        if found is not None:
            late = found[0] * found[1]
            said = (*said, note("frames-late", late_ms=1e3 * found[0]))
    seen = replace(
        problem, errors=errors, late=late, noise_range=limits, followed=followed, notes=(), cut=None
    )
    return seen.seeing(kin).noting(*said)


def range_of(kin: Kinematics, variable: str, known: bool = False) -> tuple[float, float]:
    """Smallest and largest factor that tuning may put on the noise of a variable: none, if it is known."""
    if known:
        return 1.0, 1.0
    return STATED if kin.stated[variable] else UNSTATED


@stage("force")
def tune_force(problem: Problem) -> Problem:
    """The prior of the force, and the noise of the mass center."""
    force = tuned_beside(problem, "force", problem.noise_range)
    if problem.errors is not None and problem.kin.apart and problem.kin.every == 1:
        # a mass center known by itself denies errors that markers do not have: then what they show is motion
        own = replace(problem, errors=None).seeing(problem.look(None))
        own = replace(own, noise_range=range_of(own.kin, problem.source))
        other = tuned_beside(own, "force", own.noise_range)
        if other.tuned.log_likelihood > force.tuned.log_likelihood + PATIENCE:
            problem, force = own, other
    at_limit = {problem.source: force.tuned.noise_at_limit} if problem.errors is None else {}
    like_modes = np.full(3, np.sqrt(problem.kin.inertia.mass))
    force = as_on_modes(problem, force, like_modes)
    return replace(problem, priors={"force": force}, at_limit=at_limit)


def tuned_beside(problem: Problem, load: str, limits: tuple[float, float]) -> LoadPrior:
    """The prior of a load on its channel, and the factor on the noise of that.

    Where a deformation hides what loads do, the record cannot ask for the smoothest priors. Beside mass
    without markers, a load as fast as that may hide too, and how smooth it is extrapolates: so the order is
    that where little tells orders apart, unless another is e^PATIENCE likelier.
    """
    near, engine, kind = problem.near.get(load), problem.engine, problem.settings.load_prior
    channel, lines = getattr(problem.driven, load), getattr(problem.lines, load)
    orders, stated = orders_asked(problem), stated_of(problem.settings, load)
    if (limits, lines, orders, near, kind, stated) == (*AS_LOOKED, None):
        prior = problem.driven.prior(load, engine)
    else:
        pieces = None if near is None else near.tuned.pieces
        prior = tune_channel(channel, limits, lines, orders, engine, near, kind, pieces, stated)
    kernel, hidden = prior.kernel, problem.kin.hidden
    if hidden is None or (stated is not None and stated.order is not None):
        return prior
    if not isinstance(kernel, Matern) or kernel.order <= UNTOLD_ORDER:
        return prior
    untold = tune_channel(channel, limits, lines, (UNTOLD_ORDER,), engine, kind=kind, stated=stated)
    return prior if untold.tuned.log_likelihood < prior.tuned.log_likelihood - PATIENCE else untold


def stated_of(settings: Settings, load: str) -> Stated | None:
    """What the settings know of the prior of a load, None for nothing."""
    stated = Stated(**getattr(settings.prior, load).model_dump())
    return None if stated == Stated() else stated


def with_stated_priors(problem: Problem) -> Problem:
    """The problem, with what the settings know of its priors in the place of what changed them since."""
    known = {load: stated_of(problem.settings, load) for load in problem.priors}
    kept = {load: one.kept(problem.priors[load]) for load, one in known.items() if one is not None}
    return replace(problem, priors=problem.priors | kept) if kept else problem


def orders_asked(problem: Problem) -> tuple[int, ...]:
    """Orders of priors that a record can ask for: not the smoothest where a deformation hides loads."""
    return ORDERS if not problem.hides else tuple(order for order in ORDERS if order <= FREE)


def as_on_modes(problem: Problem, prior: LoadPrior, root: Array) -> LoadPrior:
    """The prior, on axes where it is far weaker than the loads that deform the body with one as strong.

    Absence of evidence is not zero: a deformation hides a load. A load moves rigid and elastic modes of unit
    modal mass alike, but for where it acts: root (axis,) of the mass or the inertia makes one the other.
    Beside hidden mass a load may be weak at the frequency of the modes alone: what is there passes for noise
    while the prior is tuned, and a prior without it would make it motion of that mass.
    """
    kin, modes, kernel = problem.kin, problem.deformation.prior, prior.kernel
    if not problem.hides or modes is None or not isinstance(kernel, Matern):
        return prior
    size = load_on_unit_mass(kin, modes) * root
    if kin.elastic is None:  # what hidden mass does in the band of the modes is as open as its weights
        rate, std = np.full(3, modes.frequency[modes.std.argmax()]), size
        largest = modes.frequency[(modes.std * modes.frequency**2).argmax()]
        found = np.sqrt(matern_density(kernel.order, kernel.std, kernel.rate, largest))
        like = np.sqrt(matern_density(kernel.order, size, rate, largest))
    else:  # and no weaker than what was found where that bends: loads on modes may be of a lower order
        rate, found, like = np.full(3, modes.rate[0]), kernel.std, size
        own, other = (matern_density(kernel.order, 1.0, r, kernel.rate) for r in (kernel.rate, rate))
        std = np.maximum(size, kernel.std * np.sqrt(own / other))
    weak = found < np.exp(-SIGMAS * UNEVEN) * like
    std, rates = np.where(weak, std, kernel.std), np.where(weak, rate, kernel.rate)
    return prior.with_kernel(Matern(kernel.order, std, rates)) if weak.any() else prior


@stage("noise")
def find_shared_errors(problem: Problem) -> Problem:
    """Errors that all markers share, of a body whose markers tell all others, and the force beside them."""
    kin, force = problem.kin, problem.priors["force"]
    told = problem.source == "position" and kin.attitude and bool((kin.pose.dof > 0).any())
    bends = kin.deforms and not kin.apart  # what it does would pass for errors of the center
    if problem.shared is not None or problem.slow is not None or bends or not told:
        return problem
    if kin.every > 1 or kin.memory is not None:
        return problem
    alone = (1.0, 1.0)  # which what no motion makes has told
    known = kin.stated[problem.source] or problem.errors is not None
    if not known or stated_of(problem.settings, "force") is not None or not may_be_shared(force):
        return problem
    shared = shared_errors(problem.driven.force, problem.engine)
    if shared is None:
        return problem
    found = replace(problem, shared=shared, noise_range=alone, near={})
    found = tune_force(found.seeing(problem.driven.looked))
    rival = in_pieces(settle_noise(problem), "force").priors["force"]  # a load may change its character
    if found.priors["force"].tuned.log_likelihood < rival.tuned.log_likelihood:
        return replace(problem, cut=rival)
    held = 1 / shared.rate
    return found.noting(note("errors-of-all", std_mm=1e3 * shared.std, memory_s=held))


@stage("noise")
def settle_noise(problem: Problem) -> Problem:
    """Poses and deformation under the noise that the force has left."""
    force = problem.priors["force"]
    if np.abs(np.log(force.tuned.noise)).max() <= SINGLE:
        return problem
    return problem.seeing(problem.look(scaled_noise(problem.kin, {problem.source: force.noise})))


@stage("noise")
def find_slow_errors(problem: Problem) -> Problem:
    """The noise of tracks whose errors follow each other, which passes for motion: all beyond the motion."""
    kin, source = problem.kin, problem.source
    stated = kin.stated[source]
    open_ = problem.slow is None and problem.shared is None and problem.followed
    if open_ and follow_each_other(problem):
        beyond = noise_beyond_motion(force_channel(kin, problem.motion.gravity), stated)
        slow = scaled_noise(kin, {source: beyond * np.eye(3)})
        apart = {load: prior for load, prior in problem.near.items() if load != "force"}
        problem = replace(
            problem, slow=slow, errors=None, noise_range=range_of(kin, source, known=True), near=apart
        )
        problem = problem.seeing(problem.look(slow))
        problem = tune_force(problem)
    if problem.slow is None:
        return problem
    code = "slow-errors-allowed" if stated else "noise-hidden"
    noted = problem.noting(note(code, variable=source, noise=problem.kin.noise[source]))
    return replace(noted, at_limit={})  # said in the note


def follow_each_other(problem: Problem) -> bool:
    """Whether errors of the mass center do."""
    kin, force, channel = problem.kin, problem.priors["force"], problem.driven.force
    if kin.stated[problem.source] or problem.errors is not None:
        return errors_shared(kin, force, problem.motion.gravity, problem.engine)
    return force.tuned.noise_at_limit or noise_growth(channel.time, channel.z) > GROWTH


@stage("force")
def cut_force(problem: Problem) -> Problem:
    """The prior of the force in pieces, where it changes its character: at edges of the moment, if these are
    known.
    """
    if "moment" in problem.priors and problem.priors["moment"].tuned.pieces is None:
        return problem  # as before
    if problem.cut is None or problem.slow is not None:
        return in_pieces(problem, "force")
    priors = problem.priors if problem.cut.tuned.pieces is None else problem.priors | {"force": problem.cut}
    return replace(problem, priors=priors, cut=None)


@stage("moment")
def cut_moment(problem: Problem) -> Problem:
    """The prior of the moment in pieces, where it changes its character: most likely where the force does."""
    if "moment" not in problem.priors:
        return problem
    return in_pieces(problem, "moment")


def in_pieces(problem: Problem, load: str) -> Problem:
    """The problem with a load in pieces, where the evidence is for them.

    Not where errors of tracks follow each other: these have edges too. Nor where a deformation hides loads,
    or sensors show them, or settings say what the load is.
    """
    hidden = problem.hides or problem.slow is not None or problem.motion.readings
    if hidden or stated_of(problem.settings, load) is not None:
        return problem
    prior, others = problem.priors[load], [prior for name, prior in problem.priors.items() if name != load]
    given = [other.tuned.pieces.edges for other in others if other.tuned.pieces is not None]
    prior = replace(prior, tuned=replace(prior.tuned, noise=np.ones(3)))  # the channel has it by now
    engine, kind = problem.engine, problem.settings.load_prior
    channel, lines = getattr(problem.driven, load), getattr(problem.lines, load)
    tune = partial(tune_channel, channel, (1.0, 1.0), lines, engine=engine, kind=kind)
    found = with_character(channel, prior, engine, tune, *given)
    return problem if found is prior else replace(problem, priors=problem.priors | {load: found})


@stage("moment")
def tune_moment(problem: Problem) -> Problem:
    """The prior of the moment, and the noise of orientations where these are measured."""
    kin = problem.kin
    if not kin.attitude:
        return problem
    measured = "orientation" in kin.noise
    factors = range_of(kin, "orientation", known=not measured)
    moment = tuned_beside(problem, "moment", factors)
    inertia = np.diagonal(moment.axes.T @ kin.inertia.tensor @ moment.axes)
    moment = as_on_modes(problem, moment, np.sqrt(inertia))
    problem = replace(problem, priors=problem.priors | {"moment": moment})
    if not measured:
        return problem
    at_limit = {**problem.at_limit, "orientation": moment.tuned.noise_at_limit}
    kin = problem.look(scaled_noise(kin, {"orientation": moment.noise}))
    return replace(problem, driven=replace(problem.driven, kin=kin), at_limit=at_limit)
