"""Simplifications of the computation: what each saves in time, and what it loses in accuracy.

Converged gain: covariances at rest are not computed again (translation, whose model is constant). Decoupled
axes: force and moment each by itself, along their own axes, with the noise of the mean frame, in place of the
flight on SO(3). Compression: six numbers a frame in place of three rows a marker.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from evidence.chart.timing import mean_seconds, seconds_of
from evidence.journal import Journal, key
from evidence.subjects.flights.cases import LOADS, Case, case_of, shipped
from evidence.subjects.flights.chart import rms
from evidence.subjects.flights.true_prior import Problem, problem_of
from forceid import kalman
from forceid.flight.channels import Channel, driven, load_chain
from forceid.flight.priors.load import LoadPrior, load_rows
from forceid.flight.smoother import settled
from forceid.kalman.engines import engine
from forceid.records import Array
from forceid.scenes.recipe import load_recipe, simulate

SCENES = {"centripetal_trap": 3.0, "flexible_boomerang": 0.6}  # s
ROUNDS = 3

Job = Callable[[], Array]


@dataclass(frozen=True)
class Pair:
    """A computation and the same made simpler: jobs that give a wrench (time, 6), NaN where none."""

    name: str
    about: str
    exact: Job
    simple: Job


def simplifications(journal: Journal, stamp: str, said: Callable[[str, float], None]) -> list[dict[str, Any]]:
    """Every simplification on every scene, as plain data."""
    found = []
    for i, scene in enumerate(SCENES):
        said(f"simplifications: {scene}", i / len(SCENES))
        case = longer(scene)
        found += journal.once(key(stamp, "simpler", case.key), partial(compared, case))
    return found


def longer(scene: str) -> Case:
    """A shipped scene for as long as its simplifications are compared on."""
    recipe = load_recipe(shipped()[scene])
    return case_of(scene, simulate(recipe.model_copy(update={"duration": SCENES[scene]})), False)


def compared(case: Case) -> list[dict[str, Any]]:
    """Both of each pair, in turns: seconds, errors, and how far the answers are apart."""
    rows = []
    for pair in pairs(case):
        answers, first = zip(*(seconds_of(job) for job in (pair.exact, pair.simple)), strict=True)
        turns = [
            [mean_seconds(job, spent) for job, spent in zip((pair.exact, pair.simple), first, strict=True)]
            for _ in range(ROUNDS)
        ]
        exact, simple = np.median(turns, axis=0)
        errors = [rms(((a - case.wrench)[case.judged] ** 2).mean(0)) for a in answers]
        apart = rms(((answers[1] - answers[0])[case.judged] ** 2).mean(0))
        rows.append(
            {
                "name": pair.name, "about": pair.about, "case": case.name, "exact_s": float(exact),
                "simple_s": float(simple), "saved": float(np.median([a / b for a, b in turns])),
                "error": {load: [float(e[i]) for e in errors] for i, load in enumerate(LOADS)},
                "apart": {load: float(apart[i]) for i, load in enumerate(LOADS)},
            }
        )  # fmt: skip
    return rows


def pairs(case: Case) -> list[Pair]:
    """The simplifications of a case, all under the priors of its true loads."""
    problem = problem_of(case)
    problem = replace(problem, flight=replace(problem.flight, modes=None, sensors=None))
    return [
        Pair(
            "converged gain", "force, axis by axis: covariances at every sample, and only until at rest",
            partial(center_alone, problem, True), partial(center_alone, problem, False),
        ),
        Pair(
            "decoupled axes", "the flight on SO(3), and force and moment axis by axis",
            partial(on_rotations, problem), partial(axis_by_axis, problem),
        ),
        Pair(
            "compression", "one pass over three rows a marker, and over six numbers a frame",
            pass_over(case, raw=True, problem=problem), pass_over(case, raw=False, problem=problem),
        ),
    ]  # fmt: skip


def center_alone(problem: Problem, every: bool) -> Array:
    """Force by smoothers of the mass center, axis by axis; every: a gain for each sample, at rest or not.

    Without the constant that a load may hold: never forgotten, it keeps covariances from coming to rest.
    """
    channel, prior = problem.channels["force"], problem.priors["force"]
    step, axes = float(np.median(np.diff(channel.time))), prior.axes
    z, var = channel.moved @ axes, np.nanmean(channel.var(axes), axis=0)
    found = np.empty_like(z)
    for i in range(3):
        load = kalman.matern(prior.tuned.order, prior.tuned.std[i], prior.tuned.rate[i])
        chain = kalman.integrate(kalman.integrate(load, prior.start.first), prior.start.second)
        F, Q = kalman.discretize(chain, step)
        if every:
            F, Q = (np.broadcast_to(a, (len(z) - 1, *a.shape)) for a in (F, Q))
        H = channel.gain * chain.output[None]
        model = kalman.StateSpace(F, Q, H, var[i] * np.eye(1), np.zeros(len(chain.output)), chain.P0)
        found[:, i] = kalman.smooth(model, z[:, i]).x[:, 2]
    return beside(found @ axes.T, "force")


def on_rotations(problem: Problem) -> Array:
    """Force and moment by Gauss-Newton on SO(3)."""
    state = problem.smoothed()
    return np.concatenate([state.force, state.moment], 1)


def axis_by_axis(problem: Problem) -> Array:
    """Force and moment as six channels that know nothing of each other."""
    wrench = np.full((len(problem.flight.time), 6), np.nan)
    for load, channel in problem.channels.items():
        prior = problem.priors[load]
        at = np.searchsorted(problem.flight.time, channel.time)
        wrench[at, LOADS[load]] = smoothed_axes(channel, prior) @ prior.axes.T
    return wrench


def smoothed_axes(channel: Channel, prior: LoadPrior) -> Array:
    """The load (time, 3) along the axes of its prior, each axis by itself."""
    tuned, axes = prior.tuned, prior.axes
    z = channel.moved @ axes
    var = np.nanmean(channel.var(axes), axis=0)
    drift = np.einsum("ai,ab,bi->i", axes, channel.drift, axes)
    chain = load_chain(tuned.order, tuned.std, tuned.rate, prior.start)
    model = driven(chain, channel.gain, var[None], drift, np.diff(channel.time))
    found = np.empty_like(z)
    for i in range(3):
        one = model.one(i)
        one = replace(one, F=one.F[0], Q=one.Q[0], H=one.H[0], R=one.R[0]) if len(one.F) == 1 else one
        x = kalman.smooth(one, z[:, i]).x
        found[:, i] = x[:, 2] + x[:, 3]
    return found


def pass_over(case: Case, raw: bool, problem: Problem | None = None) -> Job:
    """One smoothing pass about the settled path, over poses or over the rows of all markers."""
    problem = problem or problem_of(case)
    force, moment = problem.priors["force"], problem.priors["moment"]
    flight = problem.flight
    model, z, about, _ = settled(flight, force, moment, engine())
    n = force.states
    if raw:
        model, z = with_marker_rows(case, model, about.rotation, n, force.axes)

    def job() -> Array:
        x = kalman.smooth(model, z).x
        end = n + about.chain.shape[1]
        F = x[:, :n] @ load_rows(n, force.axes, force.lines).T
        T = x[:, n:end] @ load_rows(end - n, about.axes, about.lines).T
        return np.concatenate([F, T], 1)

    return job


def with_marker_rows(
    case: Case, model: kalman.StateSpace, rotation: Array, n: int, axes: Array
) -> tuple[kalman.StateSpace, Array]:
    """The model of a flight that measures every coordinate of every marker, about a path of rotations."""
    body, motion = case.blind.body, case.blind.motion
    assert body.position is not None
    assert motion.position is not None
    center = np.zeros(3) if body.mass_center is None else body.mass_center
    if body.mass is not None:
        center = body.mass @ body.position / body.mass.sum()
    arm = (body.position - center) @ rotation.swapaxes(1, 2)  # (time, node, 3)
    T, nodes = arm.shape[:2]
    H = np.zeros((T, nodes, 3, len(model.x0)))
    H[..., :3] = axes
    # theta x arm, row by row
    for row, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        H[:, :, row, n + i], H[:, :, row, n + j] = arm[..., j], -arm[..., i]
    R = motion.noise_std["position"] ** 2 * np.eye(3 * nodes)
    z = (motion.position - arm).reshape(T, -1)
    return replace(model, H=H.reshape(T, 3 * nodes, -1), R=R), z


def beside(load: Array, name: str) -> Array:
    """One load (time, 3) as a wrench (time, 6), NaN for the other."""
    wrench = np.full((len(load), 6), np.nan)
    wrench[:, LOADS[name]] = load
    return wrench
