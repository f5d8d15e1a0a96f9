"""What a record leaves open: the priors of its loads, a body that is told wrong, a wheel inside."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.loads.hidden import body_told, inner_wheel, ringing_body, signatures
from forceid.estimation.loads.hidden.order_uncertainty import Rivals
from forceid.estimation.loads.hidden.patterns import Smaller, under_smaller
from forceid.estimation.loads.hidden.whitened import Whitened, whitened
from forceid.estimation.methods.problem import Problem
from forceid.estimation.methods.tuning import stated_of
from forceid.flight.channels import Channel
from forceid.principal import cross_matrix
from forceid.records import Array
from forceid.significance import TENTH

POSE = 6  # freedoms of a pose


def allow_for_priors(problem: Problem) -> Problem:
    """What the record does not tell of the priors of its loads and of its body, and a wheel inside."""
    problem, under, off = allow_for_body(problem)
    state, kin, looks, growth = problem.state, problem.kin, problem.looks, problem.growth
    assert growth is not None
    # the saw teeth of rounding would pass for a shape that rings
    rounded = problem.rounding > TENTH * kin.noise.get("position", np.inf)
    shape = None if rounded else markers_beside_pose(kin, looks)
    if shape is not None and (ringing := ringing_body.ringing(looks, shape)) is not None:
        ringing, said = ringing_body.allow_for_ringing_body(looks, ringing, state, growth)
        problem = replace(problem, ringing=ringing).noting(*said)
    if "moment" not in looks or not may_turn_inside(problem):
        return problem
    seen = looks["moment"], under["moment"], state, growth, arm(problem), off
    growth, said = inner_wheel.allow_for_wheels(*seen)
    return replace(problem, growth=growth).noting(*said)


def allow_for_body(
    problem: Problem, loads: Collection[str] = ("force", "moment")
) -> tuple[Problem, dict[str, Smaller], float]:
    """What the record does not tell of the priors of some loads, and of the body, told as numbers.

    Also returned: what channels show under smaller loads, and by what part the inertia may be told wrong.
    """
    state, kin, priors = problem.state, problem.kin, problem.priors
    every = channels_on_every_axis(problem)
    channels = {name: ch for name, ch in every.items() if name in loads and priors[name].kernel.rivals}
    inside = "moment" in channels and may_turn_inside(problem)
    turned = {name: problem.turned_at(name) for name in channels if kin.attitude}
    beside = told_of_body(problem, channels)
    told = {*beside}
    if inside or "moment" in told:
        clock = channels["moment"].time
        force = state.force[np.isin(problem.flight.time, clock)]
        seen = inner_wheel.signals(clock, turned["moment"], force)
        beside["moment"] = np.concatenate([seen, *([beside["moment"]] if "moment" in told else [])], 2)
    looks = {
        name: whitened(channel, priors[name], problem.engine, beside.get(name), turned.get(name))
        for name, channel in channels.items()
    }
    known = {name: stated_of(problem.settings, name) for name in looks}
    rivals = {name: look for name, look in looks.items() if (one := known[name]) is None or not one.whole}
    problem = replace(problem, looks=looks, rivals=Rivals(rivals, state))
    doubt, taken = problem.settings.body_std, problem.body.shown
    under = {name: under_smaller(look, body_told.found_of(state, name)) for name, look in looks.items()}
    of_body = state, kin.inertia, doubt, arm(problem), inside
    wrong = {
        name: body_told.told_in(name, looks[name], under[name], *of_body, name in taken) for name in told
    }
    allowed = body_told.allow_for_told(wrong, state, Rivals(rivals, state).growth(), taken)
    # of a mean motion the center is measured, wherever the body is told to have it
    center_off = None if problem.motion.position is None else allowed.center_off
    inertia_off = None
    if allowed.inertia_off is not None:
        inertia_off = signatures.of_parts(kin.inertia.tensor, allowed.inertia_off)
    problem = replace(
        problem,
        growth=allowed.growth,
        wrong_mass=allowed.wrong_mass,
        center_off=center_off,
        inertia_off=inertia_off,
    )
    return problem.noting(*allowed.said), under, wrong["moment"].std if "moment" in wrong else 0.0


def arm(problem: Problem) -> float:
    """Arm (m) of a force that turns the body; what flies without weight has none, and 0."""
    return problem.kin.inertia.gyration if problem.motion.gravity.any() else 0.0


def told_of_body(problem: Problem, channels: Mapping[str, Channel]) -> dict[str, Array]:
    """What each channel (time, 3, column) may show of a mass center and an inertia that are told as numbers.

    Not of mass told by its places.
    """
    kin, state, seen = problem.kin, problem.state, dict[str, Array]()
    if kin.inertia.nodal is not None or not kin.attitude:
        return seen
    U, R = signatures.deforming_map(kin, problem.deformation.amplitude), state.rotation
    F, turning = R @ U, sorted({line.frequency for line in problem.lines.moment})
    if "force" in channels:
        time, shown = channels["force"].time, np.isin(kin.time, channels["force"].time)
        moves = R[shown], state.omega[shown], state.moment[shown], state.velocity[shown]
        seen["force"] = signatures.by_center(time, F[shown], moves, kin.inertia.mass, turning)
    if "moment" in channels:
        shown = np.isin(kin.time, channels["moment"].time)
        rate = cross_matrix(state.omega) @ F + R @ np.gradient(U, kin.time, axis=0)
        inertia = kin.inertia.tensor
        carried = F[shown], rate[shown]
        seen["moment"] = signatures.by_inertia(channels["moment"].time, *carried, inertia, turning)
    return seen


def may_turn_inside(problem: Problem) -> bool:
    """Whether mass may turn in the body unseen: none does where markers on all mass keep their shape."""
    kin = problem.kin
    if problem.body.inside_stated:
        return False
    marked = kin.inertia.nodal is not None and not (kin.inertia.weight[~kin.seen] > 0).any()
    return not len(kin.shapes) and not marked


def markers_beside_pose(kin: Kinematics, looks: Mapping[str, Whitened]) -> ringing_body.Shape | None:
    """What markers show beside the pose of a body taken as rigid.

    None where shapes follow it, tracks were low-passed, or not every frame of the channels shows it.
    """
    if len(kin.shapes) or kin.every > 1 or not kin.attitude or len(looks) < 2:
        return None
    time = looks["force"].channel.time
    shown = np.isin(kin.time, time)
    y = kin.pose.residual[shown][:, kin.seen].reshape(int(shown.sum()), -1)
    freedoms = y.shape[1] - POSE
    if freedoms <= 0 or not np.array_equal(time, looks["moment"].channel.time) or not np.isfinite(y).all():
        return None
    return ringing_body.Shape(y, freedoms, kin.memory)


def channels_on_every_axis(problem: Problem) -> dict[str, Channel]:
    """Channels that show their load on every axis: the moment of a mass on a line does not."""
    channels = problem.channels
    if problem.kin.inertia.line is not None:
        channels.pop("moment", None)
    return channels
