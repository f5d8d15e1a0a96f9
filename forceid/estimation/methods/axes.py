"""The axes that each load keeps to, those of the world or of the body, by how likely they make the record.

A gust is slow in the axes of the world, a thrust or a fin in those of the body. Of a flight solved along the
axes of the world each load is tuned along those of the body as well, and takes them where they are e^PATIENCE
times as likely. Where neither is that, the estimate is along the axes of the world, and what that along the
others differs by is part of the claim. Source: principal equations 4f.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.loads.body_axes import body_fixed_prior, channel_likelihood
from forceid.estimation.methods.problem import Problem
from forceid.flight.channels import middle
from forceid.flight.model import seen_part
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.significance import CHANCE, PATIENCE
from forceid.timing import stage

LOADS = {"force": slice(0, 3), "moment": slice(3, 6)}  # of a wrench


@stage("axes")
def choose_axes(problem: Problem) -> Problem:
    """The flight under priors along the axes that the record calls for, load by load."""
    asked = problem.settings.load_axes
    if asked == "world" or not problem.kin.attitude or problem.state.reference is None:
        return problem
    if asked == "auto" and not tells_axes(problem):
        return problem
    found = {load: along_body(problem, load) for load in problem.priors}
    turning = {load: one for load, one in found.items() if one is not None}
    gained = {f"{load}_body_axes_evidence": gain for load, (_, gain) in turning.items()}
    problem = replace(problem, gained=gained)
    taken = {load: p for load, (p, gain) in turning.items() if asked == "body" or gain > PATIENCE}
    doubted = {load: one for load, one in turning.items() if load not in taken and share_of(one[1]) > CHANCE}
    if taken:
        problem = under(problem, taken)
    if not doubted:
        return problem
    other = under(problem, {load: prior for load, (prior, _) in doubted.items()}).state
    between = np.zeros_like(other.wrench_cov)
    for load, (_, gain) in doubted.items():
        off = getattr(other, load) - getattr(problem.state, load)
        between[:, LOADS[load], LOADS[load]] = share_of(gain) * off[:, :, None] * off[:, None]
    return replace(problem, between=between)


def tells_axes(problem: Problem) -> bool:
    """Whether what the markers show tells axes apart: their errors do not follow each other, loads are smooth
    throughout, and no sensors read, which see a load far better.
    """
    whole = all(p.kernel.rivals and p.tuned.pieces is None for p in problem.priors.values())
    return problem.slow is None and problem.flight.sensors is None and whole


def share_of(gain: float) -> float:
    """Probability of axes that are e^gain times as likely as others, at even odds."""
    return float(1 / (1 + np.exp(-gain)))


def along_body(problem: Problem, load: str) -> tuple[LoadPrior, float] | None:
    """The prior of a load along axes of the body, and how much likelier it makes the record, as a logarithm.

    None where it is not expected to be near as likely. Lines have to make it as much likelier as any more of
    a load has to, and so do those that the prior in use holds.
    """
    prior, channel, R = problem.priors[load], problem.channels[load], problem.turned_at(load)
    here = channel_likelihood(channel, prior, R, problem.engine) - PATIENCE * len(prior.lines)
    least = here - PATIENCE if problem.settings.load_axes == "auto" else -np.inf
    seen = getattr(problem.state, load)[np.isin(problem.flight.time, channel.time)]
    tried = [
        body_fixed_prior(channel, prior, R, seen, problem.engine, lines, least + PATIENCE * len(lines))
        for lines in ((), *([prior.lines] if prior.lines else []))
    ]
    kept = [one for one in tried if one is not None]
    if not kept:
        return None
    best = max(kept, key=lambda one: one.tuned.log_likelihood - PATIENCE * len(one.lines))
    more = PATIENCE * (len(prior.lines) - len(best.lines))
    return best, flight_evidence(problem, load, best) - flight_evidence(problem, load, prior) + more


def flight_evidence(problem: Problem, load: str, prior: LoadPrior) -> float:
    """Log-likelihood of what a load moves by itself, about the flight solved, under a prior of it."""
    flight, about = problem.flight, problem.state.reference
    assert about is not None
    if load == "force":
        return float(problem.engine.log_likelihood(*seen_part(flight, prior, carrier=about.rotation)))
    about = about if prior is about.moment else about.under(prior)
    return float(problem.engine.log_likelihood(*seen_part(flight, prior, about)))


def under(problem: Problem, priors: dict[str, LoadPrior]) -> Problem:
    """The problem solved under other priors of some loads."""
    problem = replace(problem, priors=problem.priors | priors)
    about = problem.state.reference
    assert about is not None
    if "moment" in priors:
        about = about.under(priors["moment"])
    if "force" in priors:
        about = replace(about, force=None)
    state: FlightState = problem.smoothed(problem.flight, about)
    return replace(problem, state=state)
