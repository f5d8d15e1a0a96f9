"""A body that burns, integrated by itself: thrust and moment on what is left of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.changing_mass import share_of_mass
from forceid.estimation.run import estimate_recording
from forceid.estimation.simulated import fly_again
from forceid.files.formats.sources import import_sources
from forceid.files.result import read_result, write_result
from forceid.files.schema import motion_groups
from forceid.files.stored.hdf5 import read_motion
from forceid.files.stored.netcdf import write_groups
from forceid.import_settings import load_import_settings
from forceid.records import Body, Motion, Recording
from forceid.report.numbers import wrench_numbers

FULL, BURNT = 2.0, 0.6  # kg, and share of it that burns
J = np.diag([2.0e-2, 2.2e-2, 4e-3])  # kg m2, of the full body
X = np.array([[0.05, 0, 0.3], [-0.05, 0.02, 0.3], [0, 0.05, -0.3], [0.03, -0.05, -0.25], [0, 0.05, 0.1]])
GRAVITY = np.array([0.0, 0.0, -9.81])
RATE, NOISE = 200.0, 2e-4  # Hz, m


def mass(t):
    return FULL * (1 - BURNT / 2 * (1 + np.tanh(4 * (t - 0.6))))


def thrust(t):
    """N, along the axis of the body."""
    return 40 + 10 * np.sin(4 * t)


def moment(t):
    """N m, axes of the body."""
    return 0.1 * np.stack([np.sin(5 * t), np.cos(4 * t), 0.2 * np.sin(3 * t)], -1)


def flown(seed=0, samples=240, course=mass):
    """Markers of a rocket by DOP853: m a = F + m g, and J w' = M - w x J w, J with the mass."""
    t = np.arange(samples) / RATE

    def rate(s, y):
        R, w, share = Rotation.from_quat(y[6:10]), y[10:], course(s) / FULL
        a = R.apply([0, 0, thrust(s)]) / course(s) + GRAVITY
        x, y_, z, r = y[6:10]
        dq = 0.5 * np.array([[r, -z, y_], [z, r, -x], [-y_, x, r], [-x, -y_, -z]]) @ w
        dw = np.linalg.solve(share * J, moment(s) - np.cross(w, share * J @ w))
        return np.concatenate([y[3:6], a, dq, dw])

    start = [0, 0, 0, 1, 0, 2, 0, 0, 0, 1, 0.3, -0.2, 2.0]
    path = solve_ivp(rate, (0, t[-1]), start, "DOP853", t, rtol=1e-11, atol=1e-12).y.T
    R = Rotation.from_quat(path[:, 6:10])
    x = path[:, None, :3] + np.einsum("tab,nb->tna", R.as_matrix(), X)
    x = x + NOISE * np.random.default_rng(seed).standard_normal(x.shape)
    body = Body(tuple("abcde"), X, total_mass=FULL, mass_center=np.zeros(3), inertia=J)
    force = R.apply(np.stack([0 * t, 0 * t, thrust(t)], -1))
    truth = {"force": force, "moment": R.apply(moment(t))}
    return Recording(body, Motion(t, x, gravity=GRAVITY, noise_std={"position": NOISE}), truth)


def estimated(recording, **settings):
    exact = {"mass_center": 1e-6, "inertia": 1e-6}  # the body is told as it is, and nothing turns inside
    settings = {"model": "rigid", "body_std": exact, "internal_momentum": (0, 0, 0)} | settings
    return estimate_recording(recording, load_settings(**settings))


def scores(found, truth, inner=slice(20, -20)):
    """Rms of error over claim, and of error over load, of force and moment."""
    out = []
    for load in ("force", "moment"):
        error = (getattr(found, load) - truth[load])[inner]
        out += [np.sqrt(np.mean((error / getattr(found, f"{load}_std")[inner]) ** 2))]
        out += [np.sqrt((error**2).mean() / (truth[load][inner] ** 2).mean())]
    return out


@pytest.mark.long
def test_thrust_is_told_on_what_is_left_of_the_mass(tmp_path):
    recording = flown()
    burning = replace(recording, motion=replace(recording.motion, current_mass=mass(recording.motion.time)))
    found = estimated(burning)
    force_score, force_off, moment_score, moment_off = scores(found, recording.truth)
    assert 0.4 < force_score < 1.5
    assert 0.4 < moment_score < 1.5
    assert force_off < 0.05
    assert moment_off < 0.35
    constant = scores(estimated(recording), recording.truth)
    assert constant[1] > 0.3  # on average 0.3 of the mass is gone
    write_result(tmp_path / "a.result.h5", found)
    again = fly_again(read_result(tmp_path / "a.result.h5"))
    assert np.nanmax(np.abs(again.off[:, :3])) < 5 * NOISE
    numbers = wrench_numbers(found, recording.truth)
    assert (numbers.force_closure < 3 * numbers.force_closure_limit + 1e-9).all()


@pytest.mark.long
def test_a_rate_of_the_mass_is_that_course():
    recording = flown(1, course=lambda s: FULL - 0.9 * s)
    burning = replace(recording, body=replace(recording.body, mass_rate=-0.9))
    by_body, by_settings = estimated(burning), estimated(recording, mass_rate=-0.9)
    assert np.array_equal(by_body.force, by_settings.force)
    assert 0.4 < scores(by_body, recording.truth)[0] < 1.5


def test_mass_comes_through_a_file_and_an_import(tmp_path):
    recording = flown(samples=30)
    m = mass(recording.motion.time)
    motion = replace(recording.motion, current_mass=m)
    write_groups(
        tmp_path / "a.h5",
        motion_groups(replace(recording, body=replace(recording.body, mass_rate=-0.1), motion=motion)),
    )
    found = read_motion(tmp_path / "a.h5")
    assert np.array_equal(found.motion.current_mass, m)
    assert found.body.mass_rate == -0.1
    (tmp_path / "b.csv").write_text(
        "t,x,y,z,grams\n" + "".join(f"{k / 100},0,0,{k},{2000 - k}\n" for k in range(5))
    )
    (tmp_path / "b.toml").write_text(
        "[import]\ngravity = [0.0, 0.0, -9.81]\nbody = { mass = { a = 2.0 }, mass_rate = -1.0 }\n"
        "[import.csv]\n"
        'time = "t"\nposition = { a = ["x", "y", "z"] }\n'
        'current_mass = "grams"\nunits = { current_mass = "g" }\n'
    )
    ((_, made),) = import_sources([tmp_path / "b.csv"], load_import_settings(tmp_path / "b.toml"))
    assert np.allclose(made.motion.current_mass, 2.0 - 1e-3 * np.arange(5))


def test_gaps_of_the_mass_are_bridged_and_none_left_is_refused():
    motion = Motion(np.arange(3.0), current_mass=np.array([2.0, np.nan, 1.0]))
    assert share_of_mass(Body(), motion, 4.0).tolist() == [0.5, 0.375, 0.25]
    with pytest.raises(DataError, match="leaves 0 kg at 2 s"):
        share_of_mass(Body(mass_rate=-1.0), Motion(np.arange(3.0)), 2.0)


@pytest.mark.parametrize(
    ("beside", "name"),
    [
        ({"internal_momentum": (0.0, 0.0, 1.0)}, "what turns inside"),
        ({"aero": {"area": 0.1}}, "aero"),
        ({"known_load": [{"name": "rope", "force": (0.0, 0.0, 1.0)}]}, "known loads"),
    ],
)
def test_mass_that_changes_beside_what_needs_a_constant_one_is_refused(beside, name):
    with pytest.raises(ConfigError, match=f"changes beside {name}"):
        estimated(flown(samples=40), mass_rate=-0.1, **beside)
