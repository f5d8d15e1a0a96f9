"""Where a flight comes to rest: Gauss and Newton on rotations, from a first path."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from forceid.errors import EstimationError
from forceid.flight.attitude import turn_along, turned
from forceid.flight.instruments.dead_reckoning import gyro_rate, path_read, reckoned
from forceid.flight.model import LOOK_AFTER, Flight, unsettled
from forceid.flight.path.linear import linear_flight, steady_of
from forceid.flight.path.reference import Reference, trajectory_of
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered
from forceid.motion import exp, free_turn, momentum_between
from forceid.records import Array
from forceid.rounding import ITERATIONS, SINGLE
from forceid.significance import TENTH

SHORTEST = 1 / 64  # of a step: what does not get nearer by so little is as near as it gets
SETTLED = 1e-4  # rad, m: less is no matter to a path, which rounding may keep moving by so much


def settled(
    flight: Flight,
    force: LoadPrior | None,
    moment: LoadPrior,
    engine: Engine,
    first: Reference | None = None,
) -> tuple[Filtered, Array, Reference, Reference]:
    """The flight filtered where it comes to rest, its states given all, the reference, and where it leads.

    first: a reference near to it, if one is known. Raises EstimationError when it does not come to rest.
    Where sensors alone tell the rotation a step that leaves more to correct than there was is halved (the
    natural test of monotony: Deuflhard, Newton Methods for Nonlinear Problems, 3.3), and a path as near as it
    gets is taken: what is left of the way stands in the smoothed states.
    """
    reference = first_reference(flight, moment) if first is None else first
    n = states_of(force)
    seen = np.isfinite(flight.rotation).all((1, 2))
    attitude_seen = attitude_is_observed(flight)
    rest = float(np.sqrt(np.median(np.trace(flight.pose_cov[seen, 3:, 3:], axis1=1, axis2=2))))
    swamped = TENTH * rest  # by less the errors of what is measured are no larger
    rest *= SINGLE if attitude_seen else TENTH
    lead = partial(led, flight, force, moment)
    found: tuple[Filtered, Array, Reference] | None = None
    size, share, steps = np.inf, 1.0, 0
    least, since, nearest = np.inf, 0, (found, reference)
    for _ in range(ITERATIONS):
        try:
            f, x = engine.filter_and_smooth_states(*linear_flight(flight, force, moment, reference))
            far = float(np.abs(x[:, n : n + 3]).max())
        except EstimationError:
            if found is None:
                raise
            far = np.inf
        too_long = not far < (np.inf if attitude_seen else size)
        if found is not None and too_long and size > SETTLED:
            share *= 0.5
            if share < SHORTEST:
                break
            reference = lead(found[2], found[1], share)
            continue
        last, size, share = size, far, min(1.0, 2 * share)
        found, reference = (f, x, reference), lead(reference, x, share)
        steps += 1
        if steps == LOOK_AFTER and not attitude_seen:  # far is then what the sensors cannot tell
            P = engine.with_covariances(f, x).P
            var = np.diagonal(P, axis1=1, axis2=2)[:, n : n + 3]
            rest = max(rest, TENTH * float(np.sqrt(var.max())))
        # at rest, or where the step to come, shorter by as much again, would be; or moved by rounding alone
        to_come = size * min(size / last, 1.0) if attitude_seen and np.isfinite(last) else size
        if to_come < rest or (size < SETTLED and size > 0.5 * last):
            break
        least, since, nearest = (size, 0, (found, reference)) if size < least else (least, since + 1, nearest)
        if since == LOOK_AFTER and attitude_seen:
            size, (found, reference) = least, nearest
            break
    assert found is not None
    if size > max(SETTLED, swamped) and attitude_seen:
        what = f"does not settle: its last step turned the path by {size:.1e} rad"
        raise EstimationError(what, *unsettled(flight))
    return *found, reference


def attitude_is_observed(flight: Flight) -> bool:
    """Whether more than one rotation, that of a start, is measured."""
    return bool(np.isfinite(flight.rotation).all((1, 2)).sum() > 1)


def states_of(force: LoadPrior | None) -> int:
    """Of the chain of a force, none where a rotation goes by itself."""
    return 0 if force is None else force.states


def led(
    flight: Flight, force: LoadPrior | None, moment: LoadPrior, reference: Reference, x: Array, share: float
) -> Reference:
    """Where the states x (time, state) about a reference lead, after that share of the way.

    Where sensors alone tell the rotation, the chains are turned along with the body: what these read depends
    on the vectors in body axes alone, so it stays linear in the step, however far that turns the path.
    """
    n, m, pushed = states_of(force), moment.states, reference.force
    theta = share * x[:, n : n + 3]
    chain = reference.chain + share * (x[:, n : n + m] - reference.chain)
    aside = not attitude_is_observed(flight)
    if aside:
        chain = turned_along(chain, reference.chain, theta, moment, 3)
    if force is not None:
        was = np.zeros_like(x[:, :n]) if pushed is None else pushed
        pushed = was + share * (x[:, :n] - was)
        if aside:
            pushed = turned_along(pushed, was, theta, force, 6)
    steady, modes = None, None
    if flight.sensors is not None:
        steady = steady_of(flight.sensors, reference)
        steady = steady + share * (flight.sensors.steady_in(x[-1]) - steady)
    if flight.modes is not None:
        modes = x[:, n + m :][:, : flight.modes.path.shape[1]]
        before = flight.modes.path if reference.modes is None else reference.modes
        modes = before + share * (modes - before)
    R = turned(theta, reference.rotation)  # takes the rotation error of the chain
    chain = np.concatenate([np.zeros_like(chain[:, :3]), chain[:, 3:]], 1)
    return Reference(R, chain, moment, pushed, steady, modes)


def turned_along(chain: Array, before: Array, theta: Array, prior: LoadPrior, first: int) -> Array:
    """A chain (time, state) whose vectors from state `first` on turn by exp(theta).

    To first order as the linear model says, where the chain before stands for what theta moves: nothing of a
    load that turns with the body, whose states stand in it.
    """
    smooth, out = prior.vectors, chain.copy()
    v, v0 = (a[:, first:smooth].reshape(len(a), -1, 3) @ prior.axes.T for a in (chain, before))
    if prior.body_axes is not None:
        v0[:, (6 - first) // 3 :] = 0.0
    body = v - np.cross(theta[:, None], v0)
    out[:, first:smooth] = (np.einsum("tab,tkb->tka", exp(theta), body) @ prior.axes).reshape(len(chain), -1)
    return out


def first_reference(flight: Flight, moment: LoadPrior) -> Reference:
    """Measured rotations, bridged across gaps by a free body, with the H that takes it from frame to frame.

    Where gyros read, H is theirs, and the bridges are laid by dead reckoning: any number of turns between two
    frames. Other sensors that count the turns give bridges that turn about one axis each.
    """
    time, brought = flight.time, flight.whole(np.zeros((len(flight.time), 3)))
    chain = np.zeros((len(time), moment.states))
    rate, path = gyro_rate(time, flight.sensors), None
    if rate is None and (path := path_read(time, flight.rotation, flight.sensors)) is not None:
        rate = path[1]
    if rate is not None:
        H_body = np.einsum("tij,tj->ti", flight.inertia, rate) + flight.h
        rot = reckoned(time, steps_of(flight, H_body), flight.rotation) if path is None else path[0]
        chain[:, MOMENTUM] = (np.einsum("tij,tj->ti", rot, H_body) - brought) @ moment.axes
        return Reference(rot, chain, moment)
    seen = np.isfinite(flight.rotation).all((1, 2))
    t, R, J, h = (a[seen] for a in (time, flight.rotation, flight.inertia, flight.h))
    H = momentum_between(t, R, J, h)[0]
    last = np.clip(np.searchsorted(t, time, "right") - 1, 0, len(H) - 1)
    rot = free_turn(time - t[last], R[last], H[last], J[last], h[last])[0]
    H = np.stack([np.interp(time, 0.5 * (t[1:] + t[:-1]), axis) for axis in H.T], 1)
    chain[:, MOMENTUM] = (H - brought) @ moment.axes
    return Reference(rot, chain, moment)


def steps_of(flight: Flight, H: Array) -> Array:
    """Turns (time - 1, 3, 3) from each sample to the next, body axes, of H (time, 3) in body axes.

    Without a moment over the step, by the equations of the top: exact for a free one, however far it turns.
    """
    still, free = np.zeros_like(H), replace(flight, known=None)
    return turn_along(trajectory_of(free, np.tile(np.eye(3), (len(H), 1, 1)), H, still, still))[0]
