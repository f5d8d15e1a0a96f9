"""How far force and moment move from one level of a model to another, in standard errors.

A look without the flight: a smoother is linear in the poses, so that the prior of one level shows both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.loads.channels import DrivenMotion
from forceid.estimation.methods.problem import Solution
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.kalman.engines import Engine
from forceid.records import Array, deviation
from forceid.significance import PATIENCE, THOUSANDTH, WORSE

NEAR = float(np.sqrt(WORSE**2 + 1))  # standard errors by which a level may be off that claims none


@dataclass(frozen=True)
class Seen:
    """A load as one of its channels shows it: the prior tuned on it, load and its std (time, axis)."""

    channel: Channel
    prior: LoadPrior
    load: Array
    std: Array
    log_likelihood: float


def load_seen(driven: DrivenMotion, load: str, engine: Engine) -> Seen:
    """The load that its channel shows under the prior that a flight would tune on it, without lines."""
    channel, prior = getattr(driven, load), driven.prior(load, engine)
    model = channel_model(channel, prior)
    path = engine.smooth(model, channel.moved)
    rows, own = prior.rows, slice(prior.states)
    var = np.einsum("ai,tij,aj->ta", rows, path.P[:, own, own], rows)
    likelihood = path.filtered.log_likelihood
    return Seen(channel, prior, path.x[:, own] @ rows.T, np.sqrt(np.maximum(var, 0.0)), likelihood)


def view(own: DrivenMotion, below: DrivenMotion, engine: Engine) -> dict[str, Seen]:
    """Loads that a level shows, by name, to be compared with the level below and smaller ones.

    No force where the two share their mass centers.
    """
    names = ("moment",) if same_load(below.force, own.force) else ("force", "moment")
    return {name: load_seen(own, name, engine) for name in names}


def same_load(one: Channel, other: Channel) -> bool:
    """Whether two channels show the same load."""
    if len(one.time) != len(other.time) or (np.isfinite(one.z) != np.isfinite(other.z)).any():
        return False
    noise = np.sqrt(np.trace(other.noise_cov, axis1=1, axis2=2))
    return bool(np.nanmax(np.abs(one.moved - other.moved).max(1) / noise) < THOUSANDTH)


def looked(driven: DrivenMotion, top: dict[str, Seen], engine: Engine) -> tuple[float, float]:
    """How far force and moment that the channels of a level show are from what the explaining one shows.

    In standard errors of either. First under the priors of the explaining level. Where one of them does not
    fit as well, the load gets a prior of its own, which follows what deformation leaks into the poses, and
    may claim less error.
    """
    each = {name: under(seen, getattr(driven, name), engine) for name, seen in top.items()}
    found = {name: far for name, (far, _) in each.items()}
    if max(found.values()) <= NEAR:
        for name in (name for name, (_, fits) in each.items() if not fits):
            own, seen = load_seen(driven, name, engine), top[name]
            std = np.fmin(at_times(own.channel, seen.channel, own.std), seen.std)
            far = distance(at_times(own.channel, seen.channel, own.load), seen.load, std)
            found[name] = max(found[name], far)
    return found.get("force", 0.0), found["moment"]


def under(top: Seen, channel: Channel, engine: Engine) -> tuple[float, bool]:
    """How far the load of another channel is under the prior of the one seen; whether that fits as well."""
    model = channel_model(channel, top.prior)
    filtered, states = engine.filter_and_smooth_states(model, channel.moved)
    load = states[:, : top.prior.states] @ top.prior.rows.T
    change = distance(at_times(channel, top.channel, load), top.load, top.std)
    return change, filtered.log_likelihood > top.log_likelihood - PATIENCE


def from_view(solution: Solution, top: dict[str, Seen], time: Array) -> float:
    """Expected error of a solved flight over that of what the explaining level shows: the larger of two."""
    var, found = np.diagonal(solution.state.wrench_cov, axis1=1, axis2=2), [0.0]
    for name, seen in top.items():
        kept, first = np.isin(time, seen.channel.time), 3 * (name == "moment")
        load, own = getattr(solution.state, name), np.sqrt(var[kept, first : first + 3])
        found.append(expected_error(load[kept], own, seen.load, seen.std))
    return max(found)


def at_times(channel: Channel, other: Channel, load: Array) -> Array:
    """A load (time, axis) at the times of another channel; NaN where it is not known."""
    _, own, theirs = np.intersect1d(channel.time, other.time, return_indices=True)
    found = np.full((len(other.time), load.shape[1]), np.nan)
    found[theirs] = load[own]
    return found


def moves(one: Solution, other: Solution, either: bool = False) -> tuple[float, float]:
    """How far force and moment of a solution are from those of another, in errors of that or of either."""
    a, b = one.state, other.state
    std = np.fmin(deviation(a.wrench_cov), deviation(b.wrench_cov)) if either else deviation(b.wrench_cov)
    return distance(a.force, b.force, std[:, :3]), distance(a.moment, b.moment, std[:, 3:])


def claims_more(one: Solution, other: Solution) -> float:
    """How many times the error one solution claims of force or of moment than another: the larger ratio."""
    own, std = (deviation(s.state.wrench_cov) for s in (one, other))
    zero = np.zeros_like(own[:, :3])
    return max(distance(own[:, part], zero, std[:, part]) for part in (slice(3), slice(3, 6)))


def worse(one: Solution, other: Solution) -> float:
    """Expected error of one solution over that of another: the larger of force and moment."""
    a, b = one.state, other.state
    own, std = deviation(a.wrench_cov), deviation(b.wrench_cov)
    return max(
        expected_error(a.force, own[:, :3], b.force, std[:, :3]),
        expected_error(a.moment, own[:, 3:], b.moment, std[:, 3:]),
    )


def expected_error(load: Array, claimed: Array, best: Array, std: Array) -> float:
    """Rms error of a load over that of the best one, from what both claim and how far they are apart.

    All (time, axis). Two estimates of which one is the better are apart by the difference of their variances;
    what is beyond that is bias (Hausman, Econometrica 46 (1978) 1251), and error is claim and bias together
    (Claeskens and Hjort, J. Am. Stat. Assoc. 98 (2003) 900). Infinite where the load leaves open what the
    best one knows.
    """
    if (~np.isfinite(load + claimed).any(0) & np.isfinite(best + std).any(0)).any():
        return float("inf")
    var = distance(claimed, np.zeros_like(std), std) ** 2
    bias = max(distance(load, best, std) ** 2 - abs(1 - var), 0.0)
    return float(np.sqrt(var + bias))


def distance(a: Array, b: Array, std: Array) -> float:
    """Rms of (a - b) / std over the central three quarters; all (time, axis). Zero where none is known."""
    edge = len(a) // 8
    inner = slice(edge, len(a) - edge)
    square = ((a - b)[inner] / std[inner]) ** 2
    return float(np.sqrt(np.nanmean(square))) if np.isfinite(square).any() else 0.0
