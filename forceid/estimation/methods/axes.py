"""The axes that each load keeps to, those of the world or of the body, by how likely they make the record.

A gust is slow in the axes of the world, a thrust or a fin in those of the body. Of a flight solved along the
axes of the world each load is tuned along those of the body as well, and takes them where they are e^PATIENCE
times as likely. Where neither is that, the estimate is along the axes of the world, and what that along the
others differs by is part of the claim. Source: principal equations 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import expit

from forceid.errors import EstimationError
from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.estimation.loads.body_axes import body_fixed_prior, channel_likelihood
from forceid.estimation.methods.problem import Problem
from forceid.estimation.methods.tuning import as_on_modes, orders_asked, stated_of
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.flight.path.linear import seen_part
from forceid.flight.priors.protocol import CONSTANT, LoadPrior
from forceid.kalman.model import Filtered, StateSpace
from forceid.records import Array
from forceid.rounding import SOLVED
from forceid.significance import CHANCE, PATIENCE
from forceid.timing import stage

LOADS = {"force": slice(0, 3), "moment": slice(3, 6)}  # of a wrench
MEAN_SIZES = 128  # from none to as good as unknown: of the steps between, the best is met to 0.1


@dataclass(frozen=True)
class BodyAxes:
    """A load along axes of the body beside the same one along those of the world.

    gain: by how much they make the record likelier, as a logarithm; off (time, 3): what the loads differ by,
    world axes.
    """

    prior: LoadPrior
    gain: float
    off: Array

    @property
    def share(self) -> float:
        """Probability of the axes of the body, at even odds."""
        return float(expit(self.gain))


@stage("axes")
def choose_axes(problem: Problem) -> Problem:
    """The flight under priors along the axes that the record calls for, load by load."""
    asked = problem.settings.load_axes
    if asked == "world" or not problem.kin.attitude or problem.state.reference is None:
        return problem
    if asked == "auto" and not tells_axes(problem):
        return problem
    told = {load: stated_of(problem.settings, load) is not None for load in problem.priors}
    each = {load: along_body(problem, load) for load in problem.priors if not told[load]}
    found = {load: one for load, one in each.items() if one is not None}
    taken = {load: one.prior for load, one in found.items() if asked == "body" or one.gain > PATIENCE}
    solved = along_those_of_the_body(problem, taken) if taken else problem
    if taken.keys() != found.keys():  # of no load is it asked along which axes it is none
        solved = solved.claimed()
        shown = {load for load, one in found.items() if one.gain > -np.log(CHANCE)}
        found = {load: one for load, one in found.items() if load in shown or not is_quiet(solved, load)}
    between = np.zeros_like(problem.state.wrench_cov)
    for load, one in found.items():
        if load not in taken and one.share > CHANCE:
            between[:, LOADS[load], LOADS[load]] = one.share * one.off[:, :, None] * one.off[:, None]
    gained = {f"{load}_body_axes_evidence": one.gain for load, one in found.items()}
    return replace(solved, gained=gained, between=between)


def along_those_of_the_body(problem: Problem, taken: dict[str, LoadPrior]) -> Problem:
    """The problem solved under priors along axes of the body; itself where it does not settle so."""
    asked = problem.settings.load_axes == "body"
    before = np.isfinite(np.concatenate([problem.state.force, problem.state.moment], 1))
    try:
        with np.errstate(invalid="ignore"):  # covariances that rounding swamps are looked at below
            solved = along(problem, taken)
        if np.isfinite(solved.state.wrench_cov)[before[:, :, None] & before[:, None]].all():
            return solved
    except EstimationError:  # what does not settle along axes of the body stays along those of the world
        if asked:
            raise
    if asked:
        raise EstimationError(
            "loads along axes of the body leave covariances that rounding swamps",
            "the recording",
            'leave load_axes at "auto", which then keeps to the world',
        )
    return problem


def tells_axes(problem: Problem) -> bool:
    """Whether what the markers show tells axes apart: their errors do not follow each other, loads are smooth
    throughout, all mass is seen, and no sensors read, which see a load far better. Not of a long record: axes
    that turn have every sample a model of its own.
    """
    whole = all(p.kernel.rivals and p.tuned.pieces is None for p in problem.priors.values())
    seen = problem.kin.hidden is None and problem.kin.inertia.line is None
    short = len(problem.flight.time) <= CHANNEL_SAMPLES
    return short and whole and seen and problem.slow is None and problem.flight.sensors is None


def along_body(problem: Problem, load: str) -> BodyAxes | None:
    """A load along axes of the body; None where these are not expected to be near as likely.

    Lines have to make the record as much likelier as any more of a load has to, those of either prior. Where
    the flight contradicts the channel of its moment, size and rate are those by the flight, of either prior.
    """
    prior, channel, R = problem.priors[load], problem.channels[load], problem.turned_at(load)
    here = channel_likelihood(channel, prior, R, problem.engine) - PATIENCE * len(prior.lines)
    by_flight = prior is not problem.apiece[load]
    least = -np.inf if by_flight or problem.settings.load_axes == "body" else here - PATIENCE
    seen = getattr(problem.state, load)[np.isin(problem.flight.time, channel.time)]
    orders = orders_asked(problem)
    search = partial(body_fixed_prior, channel, prior, R, seen, problem.engine, orders)
    ways = ((), prior.lines) if prior.lines else ((),)
    tried = [search(lines, least + PATIENCE * len(lines)) for lines in ways]
    kept = [one for one in tried if one is not None]
    if not kept:
        return None
    best = max(kept, key=lambda one: one.tuned.log_likelihood - PATIENCE * len(one.lines))
    if by_flight:
        found, passes = best, problem.engine
        best = best.moved(
            bfgs_maximum(
                lambda by: float(passes.log_likelihood(*half_of(problem, load, found.moved(by)))), np.zeros(2)
            )
        )
    best = as_on_modes(problem, best, np.sqrt(moved_by(problem, load, best)))
    (own, turned), (stated, still) = by_itself(problem, load, best), by_itself(problem, load, prior)
    gain = own - stated + PATIENCE * (len(prior.lines) - len(best.lines))
    return BodyAxes(best, gain, turned - still)


def is_quiet(problem: Problem, load: str) -> bool:
    """Whether no load was found along the axes of the world: one that turns has to be found as well."""
    claimed = np.nanmean(np.diagonal(problem.state.wrench_cov, axis1=1, axis2=2)[:, LOADS[load]], axis=0)
    return bool((problem.priors[load].kernel.std ** 2).max() < claimed.min())


def moved_by(problem: Problem, load: str, prior: LoadPrior) -> Array:
    """Mass, or moments of inertia (axis,), that a load along axes of the body moves."""
    inertia, axes = problem.kin.inertia, prior.body_axes
    assert axes is not None
    return np.full(3, inertia.mass) if load == "force" else np.diagonal(axes.T @ inertia.tensor @ axes)


def half_of(problem: Problem, load: str, prior: LoadPrior) -> tuple[StateSpace, Array]:
    """The model of what a load moves by itself, about the flight solved, and what shows that."""
    flight, about = problem.flight, problem.state.reference
    assert about is not None
    if load == "force":
        return seen_part(flight, prior, carrier=about.rotation)
    return seen_part(flight, prior, about if prior is about.moment else about.under(prior))


def by_itself(problem: Problem, load: str, prior: LoadPrior) -> tuple[float, Array]:
    """Log-likelihood of what a load moves by itself, about the flight solved, and the load (time, 3) so."""
    filtered, x = problem.engine.filter_and_smooth_states(*half_of(problem, load, prior))
    x = filtered.x if problem.causal else x
    likely = float(filtered.log_likelihood) + with_mean_of_any_size(filtered, prior.start.mean)
    return likely, prior.read(x[:, : prior.states])[1]


def with_mean_of_any_size(filtered: Filtered, var: float) -> float:
    """What a record gains, as a logarithm, where the mean of a load is of the size that is likeliest.

    filtered: with a mean of variance var along each axis, as good as unknown. What so wide a prior costs goes
    by how well the record tells the mean, which along axes that turn is far worse: it is no evidence for
    these (Bartlett, Biometrika 44 (1957) 533).
    """
    if not var > 0:
        return 0.0
    told, turned = np.linalg.eigh(filtered.gains.P[-1, CONSTANT, CONSTANT] / var)
    told = np.maximum(told, np.finfo(float).eps ** 2)  # what rounding leaves of none
    square = (turned.T @ filtered.x[-1, CONSTANT]) ** 2 / var
    share = np.geomspace(1.0, min(SOLVED * told.min(), 1.0), MEAN_SIZES)[:, None]  # of the variance
    more = 1 / share - 1
    lost = np.log(share) + np.log1p(told * more) + square * more / (1 + told * more)
    return float(-0.5 * lost.sum(1).min())


def along(problem: Problem, priors: dict[str, LoadPrior]) -> Problem:
    """The problem solved under other priors of some loads, near to where it was solved."""
    problem, about = replace(problem, priors=problem.priors | priors), problem.state.reference
    assert about is not None
    about = about.under(priors["moment"]) if "moment" in priors else replace(about, force=None)
    return replace(problem, state=problem.smoothed(problem.flight, about, claimed=True))
