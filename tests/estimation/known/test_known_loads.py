"""Loads that are known, beside which others are found: flights by scipy's DOP853, loads of sines drawn."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.drawn.records.known_load import flown
from evidence.vectors import GRAVITY
from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.run import estimate_recording
from forceid.files import read_motion, recording_from_tree, write_motion
from forceid.files.tree import tree_from_recording
from forceid.records import Body, KnownLoads, Motion, Recording


def central(values):
    n = len(values) // 8
    return values[n:-n]


def off(estimate, force, moment):
    """Rms error and claim of force and moment over the central three quarters, and rms error over claim."""
    errors = [np.sqrt(np.mean(central(a) ** 2)) for a in (estimate.force - force, estimate.moment - moment)]
    claims = [np.sqrt(np.mean(central(a) ** 2)) for a in (estimate.force_std, estimate.moment_std)]
    return np.array(errors), np.array(errors) / claims


@pytest.mark.parametrize("on_body", [False, True])
@pytest.mark.parametrize("method", ["smoother", "savgol"])
@pytest.mark.long
def test_other_loads_are_found_beside_a_known_one_within_their_claims(on_body, method):
    for seed in (31,) if method == "smoother" else (31, 32):
        recording, force, moment, settings = flown(seed, on_body)
        estimate = estimate_recording(recording, settings.model_copy(update={"method": method}))
        _, ratio = off(estimate, force, moment)
        assert (ratio < 2).all(), (seed, ratio)


@pytest.mark.long
def test_knowing_a_load_beforehand_is_better_than_taking_it_off_afterwards():
    recording, force, moment, _ = flown(33)
    settings = load_settings(method="savgol")
    beside = estimate_recording(recording, settings)
    whole = estimate_recording(replace(recording, known_loads=None), settings)
    known = [beside.known_force, beside.known_moment]
    after = replace(whole, force=whole.force - known[0], moment=whole.moment - known[1])
    errors = off(beside, force, moment)[0] / off(after, force, moment)[0]
    assert errors[0] < 1.0
    assert errors[1] < 0.5  # the plate makes most of the moment


def test_motion_and_momentum_are_those_of_all_loads():
    recording, settings = flown(42)[0], load_settings(method="savgol")
    beside = estimate_recording(recording, settings)
    whole = estimate_recording(replace(recording, known_loads=None), settings)
    std = recording.motion.noise_std["position"]
    assert np.abs(beside.center - whole.center).max() < 3 * std
    apart = central(beside.angular_momentum - whole.angular_momentum)
    assert np.sqrt(np.mean(apart**2)) < 0.02 * np.sqrt(np.mean(whole.angular_momentum**2))


@pytest.mark.long
def test_a_constant_known_force_is_as_much_gravity():
    recording, _, _, _ = flown(35)
    recording = replace(recording, known_loads=None)
    mass = recording.body.mass.sum()
    setting = {"name": "pull", "force": (3.0, 0.0, -2.0)}
    known = estimate_recording(recording, load_settings(known_load=[setting], method="savgol"))
    gravity = GRAVITY + np.array(setting["force"]) / mass
    fallen = estimate_recording(recording, load_settings(gravity=tuple(gravity), method="savgol"))
    assert np.abs(known.force - fallen.force).max() < 1e-6 * np.abs(fallen.force).max()
    assert np.abs(known.moment - fallen.moment).max() < 1e-6 * np.abs(fallen.moment).max()
    assert (known.gravity == GRAVITY).all()
    assert "beside-known" in known.verdict.codes
    assert known.verdict.reasons[known.verdict.codes.index("beside-known")].startswith(
        "force and moment are those of all loads but the known ones, pull, of 3.61 N and 0 N m rms"
    )


@pytest.mark.long
def test_what_is_not_known_of_a_known_load_is_claimed_of_the_others():
    recording, _, _, _ = flown(36)
    recording, known = replace(recording, known_loads=None), {"name": "a", "force": (1.0, 0, 0)}
    sure, unsure = (
        estimate_recording(recording, load_settings(method="savgol", known_load=[{**known, **more}]))
        for more in ({}, {"force_std": 2.0})
    )
    added = unsure.wrench_cov - sure.wrench_cov
    assert np.allclose(added[:, :3, :3], 4.0 * np.eye(3), rtol=1e-9, atol=1e-9)
    assert np.allclose(unsure.force, sure.force)


def test_forces_on_nodes_act_by_their_resultant():
    recording, _, _, _ = flown(37)
    clock, body = np.array([0.0, 2.0]), recording.body
    forces = np.zeros((2, 6, 3))
    forces[:, 0], forces[:, 3] = (2.0, 0, 0), (0, 0, 5.0)
    by_nodes = replace(recording, known_loads=KnownLoads(clock, nodal_force=forces))
    one_each = [
        {"name": "first", "force": (2.0, 0, 0), "point": body.node[0]},
        {"name": "second", "force": (0, 0, 5.0), "point": body.node[3]},
    ]
    by_name = load_settings(known_load=one_each, method="savgol")
    a = estimate_recording(by_nodes, load_settings(method="savgol"))
    b = estimate_recording(replace(recording, known_loads=None), by_name)
    assert np.allclose(a.known_moment, b.known_moment, atol=1e-9)
    assert np.allclose(a.force, b.force)
    assert np.allclose(a.moment, b.moment)


def test_known_loads_come_back_from_a_file_as_they_were(tmp_path):
    recording, _, _, _ = flown(38)
    write_motion(tmp_path / "stood.h5", recording)
    again = read_motion(tmp_path / "stood.h5")
    tree = recording_from_tree(tree_from_recording(recording))
    for read in (again.known_loads, tree.known_loads):
        assert read.name == ("plate",)
        for name in ("time", "force", "moment", "point"):
            assert (getattr(read, name) == getattr(recording.known_loads, name)).all()


def told(**changed):
    """What is said of a file whose known loads are changed."""
    recording, _, _, _ = flown(39)
    known = replace(recording.known_loads, **changed)
    tree = tree_from_recording(replace(recording, known_loads=known))
    with pytest.raises(DataError) as error:
        recording_from_tree(tree)
    return str(error.value)


@pytest.mark.long
def test_a_covariance_that_is_none_is_refused():
    known = flown(39)[0].known_loads
    said = told(wrench_cov=np.broadcast_to(-np.eye(6), (len(known.time), 1, 6, 6)))
    assert "/load_known/wrench_cov" in said
    assert "negative variance" in said


def test_a_clock_that_does_not_cover_the_record_is_refused():
    known = flown(39)[0].known_loads
    cut = {name: getattr(known, name)[:1500] for name in ("time", "force", "moment", "point")}
    said = told(**cut)
    assert "/load_known/time" in said
    assert "-0.01 to 1.489 s" in said
    assert "0 to 1.995 s" in said


def test_a_gap_in_a_known_load_is_refused():
    force = flown(39)[0].known_loads.force.copy()
    force[10] = np.nan
    said = told(force=force)
    assert "/load_known/force" in said
    assert "3 values that are not finite" in said


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ({"name": "hand"}, "no force and no moment"),
        ({"name": "plate", "force": (1.0, 0, 0)}, "holds as a series"),
        ({"name": "hand", "force": (1.0, 0, 0), "point": "elbow"}, "names the point 'elbow'"),
    ],
)
def test_settings_that_state_no_known_load_are_refused(setting, said):
    recording, _, _, _ = flown(39)
    with pytest.raises(ConfigError, match=said):
        estimate_recording(recording, load_settings(known_load=[setting]))


def test_sensors_alone_take_no_known_load():
    gyro = Motion(np.arange(50) / 100, angular_velocity=np.zeros((50, 1, 3)))
    body = Body(("a",), total_mass=1.0, mass_center=np.zeros(3), inertia=np.eye(3))
    with pytest.raises(ConfigError, match="shows where the body is"):
        estimate_recording(
            Recording(body, gyro), load_settings(known_load=[{"name": "a", "force": (1, 0, 0)}])
        )
    stored = KnownLoads(gyro.time, ("a",), np.zeros((50, 1, 3)))
    with pytest.raises(DataError, match=r"/load_known.* shows where the body is"):
        estimate_recording(Recording(body, gyro, known_loads=stored), load_settings())
