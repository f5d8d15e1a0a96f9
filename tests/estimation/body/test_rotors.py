"""Bodies with rotors inside, integrated by themselves: the moment is that from outside alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.body.rotors import momentum_inside, with_rotors
from forceid.estimation.run import estimate_recording
from forceid.files.formats.sources import import_sources
from forceid.files.schema import motion_groups
from forceid.files.stored.hdf5 import read_motion
from forceid.files.stored.netcdf import write_groups
from forceid.import_settings import load_import_settings
from forceid.records import Body, Motion, Recording

J = np.diag([2.0e-3, 2.6e-3, 3.1e-3])  # kg m2, rotors held
X = 0.15 * np.array([[1, 0, 0], [-1, 0.3, 0], [0, 1, 0.2], [0.1, -1, 0], [0, 0.2, 1.0]])
AXES = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 0.0] / np.sqrt(2)])
INERTIA = np.array([1.5e-5, 2.0e-5])  # kg m2
RATE, NOISE = 200.0, 3e-4  # Hz, m
GRAVITY = np.array([0.0, 0.0, -9.81])
EXACT = {"mass_center": 1e-9, "inertia": 1e-9}  # told as it is


def speeds(t):
    """Speeds (time, rotor) rad/s: one is spun up by 300 rad/s, one wavers."""
    return np.stack([250 + 150 * np.tanh(3 * (t - 0.6)), 200 * np.sin(4 * t + 0.3)], -1)


def moment(t):
    """Moment (3,) N m from outside, world axes."""
    return 0.02 * np.array([np.sin(5 * t), np.cos(4 * t + 0.5), np.sin(3 * t + 1.0)])


def flown(seed=0, samples=240, varying=True):
    """Markers of the gyrostat by Euler's equations, DOP853: J w' = R^T M - w x (J w + h) - h'."""
    t = np.arange(samples) / RATE

    def turning(s):
        return speeds(s) if varying else speeds(np.zeros_like(s))

    def rate(s, y):
        R, w = Rotation.from_quat(y[:4]), y[4:]
        h = (INERTIA * turning(s)) @ AXES
        dh = (INERTIA * (turning(s + 1e-5) - turning(s - 1e-5)) / 2e-5) @ AXES
        dw = np.linalg.solve(J, R.inv().apply(moment(s)) - np.cross(w, J @ w + h) - dh)
        x, y_, z, r = y[:4]
        dq = 0.5 * np.array([[r, -z, y_], [z, r, -x], [-y_, x, r], [-x, -y_, -z]]) @ w
        return np.concatenate([dq, dw])

    path = solve_ivp(rate, (0, t[-1]), [0, 0, 0, 1, 3.0, -2.0, 4.0], "DOP853", t, rtol=1e-11, atol=1e-12)
    R = Rotation.from_quat(path.y[:4].T).as_matrix()
    center = np.outer(t, [1.0, 0.5, 2.0]) + 0.5 * np.outer(t**2, GRAVITY)
    x = center[:, None] + np.einsum("tab,nb->tna", R, X)
    x = x + NOISE * np.random.default_rng(seed).standard_normal(x.shape)
    body = Body(tuple("abcde"), X, total_mass=1.0, mass_center=np.zeros(3), inertia=J)
    return Recording(body, Motion(t, x, gravity=GRAVITY, noise_std={"position": NOISE})), turning(t)


def with_speeds(recording, s, gaps=False):
    s = s.copy()
    if gaps:
        s[50:53, 0] = np.nan
    body, motion = recording.body, recording.motion
    names = ("wheel", "flywheel")
    body = Body(**{**body.__dict__, "rotor": names, "rotor_axis": 2.0 * AXES, "rotor_inertia": INERTIA})
    return Recording(body, Motion(**{**motion.__dict__, "rotor_speed": s}))


def score(found, inner=slice(30, -30)):
    """Rms of the error of the moment over its claim, and of the error over the moment."""
    true = np.array([moment(s) for s in found.time])
    error = (found.moment - true)[inner]
    return np.sqrt(np.mean((error / found.moment_std[inner]) ** 2)), np.sqrt(
        (error**2).mean() / (true**2).mean()
    )


@pytest.mark.long
def test_what_spins_a_rotor_up_is_no_moment_from_outside():
    recording, s = flown()
    found = estimate_recording(with_speeds(recording, s), load_settings(model="rigid", body_std=EXACT))
    over_claim, relative = score(found)
    assert 0.4 < over_claim < 1.5
    assert relative < 0.25
    assert found.verdict.level == "ok"
    blind = score(
        estimate_recording(
            recording, load_settings(model="rigid", body_std=EXACT, internal_momentum=(0, 0, 0))
        )
    )
    assert blind[1] > 4 * relative


@pytest.mark.long
def test_gaps_of_a_speed_and_other_methods_and_models_take_rotors():
    recording, s = flown(1)
    recording = with_speeds(recording, s, gaps=True)
    for settings in ({"method": "savgol"}, {"method": "filter"}, {"model": "auto"}):
        found = estimate_recording(
            recording, load_settings(**{"model": "rigid", "body_std": EXACT} | settings)
        )
        assert score(found)[1] < 0.6, settings


@pytest.mark.long
def test_rotors_of_constant_speed_are_their_momentum():
    recording, s = flown(varying=False)
    rotors = [
        {"name": str(k), "axis": tuple(3 * AXES[k]), "inertia": INERTIA[k], "speed": float(s[0, k])}
        for k in (0, 1)
    ]
    h = (INERTIA * s[0]) @ AXES
    by_rotors = estimate_recording(recording, load_settings(model="rigid", body_std=EXACT, rotor=rotors))
    stated = estimate_recording(
        recording, load_settings(model="rigid", body_std=EXACT, internal_momentum=tuple(h.tolist()))
    )
    assert np.allclose(by_rotors.moment, stated.moment, rtol=0, atol=1e-6 * np.abs(stated.moment).max())
    assert score(by_rotors)[0] < 1.5


def test_rotors_come_through_a_file_and_an_import(tmp_path):
    recording, s = flown(samples=60)
    recording = with_speeds(recording, s)
    write_groups(tmp_path / "a.h5", motion_groups(recording))
    found = read_motion(tmp_path / "a.h5")
    assert found.body.rotor == ("wheel", "flywheel")
    assert np.array_equal(
        momentum_inside(found.body, found.motion), momentum_inside(recording.body, recording.motion)
    )
    head = "t,x,y,z,rpm\n"
    (tmp_path / "b.csv").write_text(head + "".join(f"{k / 100},0,0,{k},{60 * k}\n" for k in range(5)))
    (tmp_path / "b.toml").write_text(
        """[import]
gravity = [0.0, 0.0, -9.81]
body = { mass = { a = 2.0 } }
[import.csv]
time = "t"
position = { a = ["x", "y", "z"] }
rotor_speed = ["rpm"]
units = { rotor_speed = "rpm" }
[[import.rotor]]
name = "wheel"
axis = [0.0, 0.0, 1.0]
inertia = 0.5
[[import.rotor]]
name = "fan"
axis = [1.0, 0.0, 0.0]
inertia = 0.1
speed = 3.0
"""
    )
    ((_, made),) = import_sources([tmp_path / "b.csv"], load_import_settings(tmp_path / "b.toml"))
    h = momentum_inside(made.body, made.motion)
    wheel, fan = np.outer(np.arange(5), [0, 0, np.pi]), np.array([0.3, 0, 0])  # rpm of 60 k: 2 pi k rad/s
    assert np.allclose(h, wheel + fan)


def test_rotors_of_the_settings_take_the_place_of_those_of_the_file_by_name():
    recording, s = flown(samples=20)
    recording = with_speeds(recording, s)
    settings = load_settings(rotor=[{"name": "wheel", "axis": (1, 0, 0), "inertia": 2.0}])
    h = momentum_inside(*with_rotors(recording.body, recording.motion, settings.rotor))
    assert np.allclose(h, np.outer(2.0 * s[:, 0], [1, 0, 0]) + np.outer(INERTIA[1] * s[:, 1], AXES[1]))


def test_what_is_not_known_of_a_rotor_is_asked_for():
    recording, s = flown(samples=20)
    with pytest.raises(ConfigError, match=r"rotor fan.*has no speed.*rotor of the file \(none\)"):
        with_rotors(
            recording.body,
            recording.motion,
            load_settings(rotor=[{"name": "fan", "axis": (1, 0, 0), "inertia": 1}]).rotor,
        )
    with pytest.raises(ConfigError, match="is zero, expected a direction"):
        load_settings(rotor=[{"name": "fan", "axis": (0, 0, 0), "inertia": 1.0}])
    for lost in ("rotor_axis", "rotor_inertia"):
        half = with_speeds(recording, s).body
        half = Body(**{**half.__dict__, lost: None})
        with pytest.raises(DataError, match="knows rotors in part"):
            momentum_inside(half, with_speeds(recording, s).motion)
