"""The budget of a wrong body predicts by how much an estimate made with it is"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import closed_forms as cf
import numpy as np
import pytest
from scipy.linalg import eigh

from forceid.config import load_settings
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.estimation.methods import tuning
from forceid.estimation.methods.smoother import estimate_flight
from forceid.estimation.run import estimate_whole
from forceid.estimation.verdict import sensitivity as sn
from forceid.estimation.verdict.body_errors import (
    SYMMETRIC,
    after_fit,
    center_inertia,
    columns,
    marker_maps,
    shape_columns,
    turning_of,
    wrong_mass,
)
from forceid.estimation.verdict.loads import force_band
from forceid.files.stored.hdf5 import read_motion
from forceid.kalman.engines import engine
from forceid.records import Motion, Recording
from forceid.scenes.flights import flexible_boomerang as scene
from forceid.scenes.springs import spring_stiffness

DATA = Path(__file__).parents[3] / "data" / "synthetic"
SETTINGS = load_settings(load_axes="world")  # budgets keep priors as they are
ALONG = (np.eye(3)[0], np.array([0.6, -0.8, 0.0]))


def solved(recording, settings=SETTINGS):
    return estimate_flight(recording.body, recording.motion, settings, engine(settings.engine))


def motion_of(solution):
    return turning_of(solution.kinematics, solution.deformation, solution.state)


class Bias(NamedTuple):
    """Estimate minus truth of force (time, 3) N and moment (time, 3) N m, world axes, to first order."""

    force: np.ndarray
    moment: np.ndarray


def wrong_body(motion, d, dJ):
    """Bias of a center wrong by d (3,) and an inertia wrong by dJ (6,), entries in the order of SYMMETRIC."""
    force, moment = columns(motion)
    return Bias(force @ d, moment @ np.concatenate([d, dJ]))


def wrong_center(motion, d):
    return wrong_body(motion, d, center_inertia(motion.kin) @ d)


def wrong_inertia(motion, dJ):
    return wrong_body(motion, np.zeros(3), np.array([dJ[i, j] for i, j in SYMMETRIC]))


def wrong_marker(motion, node, e):
    d, dJ = (each[motion.kin.seen[:node].sum()] for each in marker_maps(motion.kin))
    return wrong_body(motion, d @ e, dJ @ e)


def wrong_shape(motion, amplitude, change):
    """Bias of shapes (shape, node, 3) that are claimed wrong by `change`, of amplitude (time, shape) m."""
    force, moment = np.zeros((2, len(amplitude), 3))
    center, spread = after_fit(motion.kin, change.reshape(len(change), -1).T)
    for k, q in enumerate(amplitude.T):
        by_center, by_spread = shape_columns(motion, q)
        force, moment = force + by_center @ center[:, k], moment + by_spread @ spread[:, k]
    return Bias(force, moment)


def found_bias(recording, solution, body, settings=SETTINGS):
    """What the estimate with another body differs by, whose mass center is believed."""
    there, _ = estimate_whole(replace(recording, body=body), settings)
    return there.force - solution.state.force, there.moment - solution.state.moment


def middle(v):
    n = len(v)
    return v[n // 8 : n - n // 8]


def agrees(found, predicted, part=0.2):
    """Whether two series (time, 3) differ by less than a part of the first, rms."""
    found, predicted = middle(found), middle(predicted)
    return cf.rms(found - predicted) < part * cf.rms(found)


def first(recording, frames):
    m = recording.motion
    return replace(recording, motion=replace(m, time=m.time[:frames], position=m.position[:frames]))


@pytest.fixture(scope="module")
def rigid():
    """A body known as a whole that spins up, and its solution."""
    body = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    recording = cf.toss(cf.clock(300), body=body, noise=2e-5, spin=(12.0, 5.0))
    return recording, solved(recording)


@pytest.fixture(scope="module")
def boomerang():
    """The flexible boomerang seen through five markers, its stiffness not known."""
    recording = first(read_motion(DATA / "flexible_boomerang_5_markers.h5"), 400)
    recording = replace(recording, body=replace(recording.body, stiffness=None))
    return recording, solved(recording)


@pytest.fixture(scope="module")
def stiff(boomerang):
    """The same taken for rigid: beside mass that may deform, priors move too."""
    recording, settings = boomerang[0], load_settings(model="rigid", load_axes="world")
    return recording, solved(recording, settings), settings


def test_wrong_mass_of_a_whole_body_scales_the_force_only(rigid):
    recording, solution = rigid
    force, moment = found_bias(recording, solution, replace(recording.body, total_mass=1.02 * cf.MASS))
    bias = Bias(*wrong_mass(motion_of(solution), 0.02))
    assert agrees(force, bias.force, 0.01)
    assert cf.rms(moment) < 1e-3 * cf.rms(solution.state.moment)
    assert not bias.moment.any()


@pytest.mark.long
def test_wrong_nodal_masses_scale_both(boomerang):
    recording, solution = boomerang
    force, moment = found_bias(recording, solution, replace(recording.body, mass=1.02 * recording.body.mass))
    bias = Bias(*wrong_mass(motion_of(solution), 0.02))
    assert agrees(force, bias.force, 0.01)
    assert agrees(moment, bias.moment, 0.01)


@pytest.mark.long
@pytest.mark.parametrize("along", ALONG)
def test_center_wrong_by_two_millimeters_costs_what_the_budget_says(rigid, along):
    recording, solution = rigid
    force, _ = found_bias(recording, solution, replace(recording.body, mass_center=2e-3 * along))
    assert agrees(force, wrong_center(motion_of(solution), 2e-3 * along).force)


@pytest.mark.long
def test_center_moved_by_wrong_masses_costs_force_and_moment():
    recording = first(read_motion(DATA / "flexible_boomerang.h5"), 250)
    solution = solved(recording)
    m, X, d = recording.body.mass, solution.kinematics.shape, np.array([2e-3, 0, 0])
    more = m * (X @ np.linalg.pinv(X.T @ (m[:, None] * X), rcond=1e-9) @ d) * m.sum()
    force, moment = found_bias(recording, solution, replace(recording.body, mass=m + more))
    bias = wrong_center(motion_of(solution), d)
    assert agrees(force, bias.force)
    assert cf.rms(middle(bias.moment)) == pytest.approx(cf.rms(middle(moment)), rel=0.2)


def test_wrong_inertia_costs_what_the_budget_says(rigid):
    recording, solution = rigid
    J = cf.INERTIA
    for dJ in (np.diag([0, 0, 0.05 * J[2, 2]]), 0.05 * J[2, 2] * np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0]])):
        _, moment = found_bias(recording, solution, replace(recording.body, inertia=J + dJ))
        assert agrees(moment, wrong_inertia(motion_of(solution), dJ).moment)


@pytest.mark.long
@pytest.mark.parametrize(("node", "along"), [(0, 1), (8, 0), (8, 2)])
def test_marker_wrong_by_a_millimeter_costs_what_the_budget_says(stiff, node, along, monkeypatch):
    recording, solution, rigid = stiff
    # the budget keeps priors as they are
    monkeypatch.setattr(tuning, "tuned_beside", lambda _, load, *__: solution.priors[load])
    place = recording.body.position.copy()
    place[node, along] += 1e-3
    force, moment = found_bias(recording, solution, replace(recording.body, position=place), rigid)
    bias = wrong_marker(motion_of(solution), node, 1e-3 * np.eye(3)[along])
    whole = cf.rms(middle(force)), cf.rms(middle(moment))
    assert (cf.rms(middle(bias.force)), cf.rms(middle(bias.moment))) == pytest.approx(whole, rel=0.2)


def test_markers_on_every_mass_may_sit_anywhere():
    recording = first(read_motion(DATA / "flexible_boomerang.h5"), 200)
    solution = solved(recording)
    d, dJ = marker_maps(solution.kinematics)
    assert np.abs(d).max() < 1e-12
    assert np.abs(dJ).max() < 1e-12


@pytest.mark.long
def test_wrong_mode_shapes_cost_what_the_budget_says(monkeypatch):
    # the budget keeps noise and priors as they are: what wrong shapes leave would count as noise of markers
    monkeypatch.setattr(tuning, "measured_errors", lambda *_: (None, None, ()))
    time = np.arange(300) / 1000
    parameters, K = (
        scene.Parameters(),
        spring_stiffness(scene.springs(scene.Parameters()), scene.rest_shape()),
    )
    modes = eigh(K, np.diag(np.repeat(scene.MASS, 3)))[1][:, 6:9].T.reshape(3, 15, 3)
    flight = scene.fly(parameters, time)
    rng = np.random.default_rng(0)
    x = scene.trajectory(parameters, time)[0] + 3e-5 * rng.standard_normal((300, 15, 3))
    x[:, [n for n in range(15) if n not in (0, 1, 2, 3, 6, 8, 9, 11, 14)]] = np.nan
    body = replace(flight.body, mode_shape=modes)
    recording = Recording(body, Motion(time, x, gravity=flight.gravity, noise_std={"position": 3e-5}))
    settings = load_settings(model="modal")
    solution = solved(recording, settings)
    kin = solution.kinematics
    assert len(kin.shapes) == 3
    change = 0.05 * np.sqrt((modes**2).mean((1, 2)))[:, None, None] * rng.standard_normal(modes.shape)
    force, moment = found_bias(recording, solution, replace(body, mode_shape=modes + change), settings)
    flat = [split_rigid(m, kin.shape, scene.MASS)[1].reshape(3, -1).T for m in (modes, modes + change)]
    mix = np.linalg.lstsq(flat[0], kin.shapes.reshape(3, -1).T, rcond=None)[0]
    off = ((flat[1] - flat[0]) @ mix).T.reshape(kin.shapes.shape)
    bias = wrong_shape(motion_of(solution), solution.deformation.amplitude, off)
    assert cf.rms(middle(bias.force)) == pytest.approx(cf.rms(middle(force)), rel=0.25)
    assert cf.rms(middle(bias.moment)) == pytest.approx(cf.rms(middle(moment)), rel=0.25)


def budget(solution, node, arm=None):
    s = solution
    return sn.body_sensitivity(s.kinematics, s.deformation, s.state, node, np.array([0.0, 0.0, -9.81]), arm)


def test_budget_is_the_worst_of_its_kind(boomerang):
    recording, solution = boomerang
    found, motion = budget(solution, recording.body.node), motion_of(solution)
    assert found.mass.force == pytest.approx(0.01 * sn.length(solution.state.force))
    rng = np.random.default_rng(0)
    for d in rng.standard_normal((20, 3)):
        bias = wrong_center(motion, 1e-3 * d / np.linalg.norm(d))
        assert sn.length(bias.force) <= found.center.force * (1 + 1e-9)
        assert sn.length(bias.moment) <= found.center.moment * (1 + 1e-9)
    node = recording.body.node.index(found.marker_name)
    bias = wrong_marker(motion, node, np.array([0, 0, 1e-3]))
    assert sn.length(bias.force) <= found.marker.force * (1 + 1e-9)
    assert set(found.numbers()) >= {"center_force_per_mm", "inertia_moment_per_percent"}
    assert any("per mm of the place of marker" in line for line in found.summary)


def test_moment_about_another_point_pays_for_the_lever(rigid):
    _, solution = rigid
    arm = np.tile([0.3, 0.0, 0.0], (300, 1))
    plain, moved = motion_of(solution), replace(motion_of(solution), arm=arm)
    d = np.array([1e-3, 0, 0])
    bias = wrong_center(moved, d)
    turned = plain.rotation @ d
    lever = np.cross(arm + turned, solution.state.force + bias.force) - np.cross(arm, solution.state.force)
    assert bias.moment == pytest.approx(lever, rel=0.02, abs=1e-4)
    assert wrong_mass(moved, 0.01)[1] == pytest.approx(0.01 * np.cross(arm, solution.state.force))


def test_body_whose_rotation_is_not_seen_has_a_budget_of_its_mass_only():
    across = ([0, 0.1, 0, 0.1], [0, -0.1, 0, 0.1])  # masses that no marker shows
    recording = cf.toss(body=cf.points([0.1, 0, 0, 0.1], [-0.1, 0, 0, 0.1], *across))
    x = recording.motion.position.copy()
    x[:, 2:] = np.nan
    recording = cf.seen_as(recording, x)
    found = budget(solved(recording), recording.body.node)
    assert set(found.numbers()) == {"mass_force_per_percent", "clock_force_per_percent"}
    assert len(found.summary) == 2


def test_clock_that_is_slow_costs_what_the_budget_says():
    """Samples a percent farther apart than stated: the true accelerations are two percent smaller."""
    recording = cf.toss()
    slow = replace(recording, motion=replace(recording.motion, time=recording.motion.time / 1.01))
    right, wrong_clock = (solved(r) for r in (recording, slow))
    found = budget(right, recording.body.node).clock
    off = wrong_clock.state.force - right.state.force
    assert cf.rms(np.linalg.norm(middle(off), axis=1)) == pytest.approx(found.force, rel=0.05)


def test_force_is_followed_up_to_where_noise_is_as_strong_as_the_prior(rigid):
    _, solution = rigid
    kin = solution.kinematics
    hertz = force_band(kin, cf.load_prior(1, 0.05, 0.05))
    w = 2 * np.pi * hertz
    density = 0.05**2 * 2 * 0.05 / (w**2 + 0.05**2)
    noise = kin.inertia.mass**2 * np.diagonal(kin.pose.cov[:, :3, :3], axis1=1, axis2=2).mean()
    assert density == pytest.approx(noise * w**4 / 200, rel=0.1)
