"""Bodies that crush, each with an accelerometer: forces of wall and joints beside a truth that was flown."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forceid.cli.app import main
from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.run import estimate_recording
from forceid.files.result import read_result
from forceid.files.stored.hdf5 import write_motion
from forceid.records import Body, Motion, Recording

NAMES, NOISE = ("front", "cell", "rear"), 0.3  # m/s2
JOINTS = [
    {"name": "crush", "parts": ["front", "cell"], "at": [-1.0, 0.0, 0.0]},
    {"name": "rail", "parts": ["cell", "rear"], "at": [-2.5, 0.0, 0.0]},
]


def crushed(seed):
    """Three wagons in a row against a wall, springs and dampers between: recording, settings, true forces.

    Forces (time, 3) along x: of the wall, and of front on cell and cell on rear.
    """
    rng = np.random.default_rng(seed)
    mass, stiff = rng.uniform(200, 1000, 3), rng.uniform(1e5, 4e5, 3)
    brake = rng.uniform(0.02, 0.1, 3) * stiff / 20

    def pushes(s):
        x, v = s[:3], s[3:]
        wall = max(0.0, stiff[0] * x[0] + brake[0] * v[0]) if x[0] > 0 else 0.0
        return np.array([-wall, *(stiff[1:] * (x[:2] - x[1:]) + brake[1:] * (v[:2] - v[1:]))])

    def rates(t, s):
        push = np.append(pushes(s), 0.0)
        return np.concatenate([s[3:], (push[:3] - push[1:]) / mass])

    time = np.arange(0, 0.25, 1e-3)
    start = [-0.02] * 3 + [rng.uniform(3, 8)] * 3
    s = solve_ivp(rates, (0, time[-1]), start, "DOP853", t_eval=time, rtol=1e-10, atol=1e-12).y.T
    y = np.zeros((len(time), 3, 3))
    y[..., 0], y[..., 2] = [rates(0, one)[3:] for one in s], 9.81
    y += NOISE * rng.standard_normal(y.shape)
    at = np.array([[0.0, 0, 0], [-2.0, 0, 0], [-3.0, 0, 0]])
    body = Body(
        total_mass=mass.sum(), mass_center=np.zeros(3), inertia=100 * np.eye(3), sensor_position=at,
        sensor_rotation=np.tile([0.0, 0, 0, 1], (3, 1)),
    )  # fmt: skip
    motion = Motion(
        time, specific_force=y, gravity=np.array([0, 0, -9.81]), noise_std={"specific_force": NOISE}
    )
    part = [
        {"name": name, "sensors": [k], "mass": mass[k], "external": k == 0} for k, name in enumerate(NAMES)
    ]
    return Recording(body, motion), {"part": part, "joint": JOINTS}, np.array([pushes(one) for one in s])


@pytest.mark.parametrize("seed", range(5))
def test_wall_and_crush_forces_of_three_wagons_err_by_what_they_claim(seed):
    recording, asked, true = crushed(seed)
    found = estimate_recording(recording, load_settings(**asked))
    between = found.interface
    assert found.verdict.level == "degraded"  # one accelerometer a body leaves nothing to check it by
    assert {f.code for f in found.verdict.findings if f.level == "degraded"} == {"array-unchecked"}
    off = np.column_stack([found.force[:, 0], between.force[..., 0]]) - true
    var = np.column_stack([found.wrench_cov[:, 0, 0], between.wrench_cov[..., 0, 0]])
    assert np.all(np.abs(np.mean(off**2 / var, axis=0) - 1) < 6 * np.sqrt(2 / len(off)))
    assert between.parts == (("front", "cell"), ("cell", "rear"))
    assert found.mass == pytest.approx(sum(part["mass"] for part in asked["part"]))
    assert np.isnan(found.moment).all()
    assert np.isnan(between.moment).all()


def test_forces_of_bodies_in_a_ring_are_not_told():
    recording, asked, _ = crushed(0)
    ring = [*JOINTS, {"name": "strut", "parts": ["front", "rear"], "at": [-1.5, 0.0, 1.0]}]
    found = estimate_recording(recording, load_settings(**asked | {"joint": ring})).interface
    assert not found.determined.any()
    assert np.isnan(found.force).all()
    assert found.verdict.level == "refused"


@pytest.mark.long
def test_the_command_finds_them_and_draws_them(tmp_path, capsys):
    recording, asked, true = crushed(7)
    write_motion(tmp_path / "crash.h5", recording)
    words = ["mass = {mass}", "sensors = {sensors}", 'name = "{name}"', "external = {external}"]
    lines = [
        "[[part]]\n" + "\n".join(words).format(**{k: str(v).lower() for k, v in part.items()})
        for part in asked["part"]
    ]
    lines += ['[[joint]]\nname = "crush"\nparts = ["front", "cell"]\nat = [-1.0, 0.0, 0.0]']
    lines += ['[[joint]]\nname = "rail"\nparts = ["cell", "rear"]\nat = [-2.5, 0.0, 0.0]']
    (tmp_path / "crash.toml").write_text("\n".join(lines))
    config = ["-c", str(tmp_path / "crash.toml")]
    assert main(["estimate", str(tmp_path / "crash.h5"), *config, "-o", str(tmp_path / "crash.r.h5")]) == 0
    assert "crush" in capsys.readouterr().out
    kept = read_result(tmp_path / "crash.r.h5")
    assert np.sqrt(np.mean((kept.interface.force[..., 0] - true[:, 1:]) ** 2)) < 0.02 * np.abs(true).max()
    assert main(["report", str(tmp_path / "crash.r.h5"), "-o", str(tmp_path / "crash.html")]) == 0
    with h5py.File(tmp_path / "crash.r.h5") as f:
        assert "interface" in f


def test_nodes_beside_sensors_and_a_joint_at_a_node_without_a_place_are_refused():
    recording, asked, _ = crushed(0)
    both = [asked["part"][0] | {"nodes": ["a"]}, *asked["part"][1:]]
    with pytest.raises(ConfigError, match="front has nodes and sensors, expected one of them"):
        load_settings(**asked | {"part": both})
    with pytest.raises(ConfigError, match="is at node 'a', which has no place"):
        estimate_recording(recording, load_settings(**asked | {"joint": [JOINTS[0] | {"at": "a"}]}))


def test_a_gyro_that_is_of_no_part_is_refused():
    recording, asked, _ = crushed(0)
    turned = replace(recording.motion, angular_velocity=np.zeros((len(recording.motion.time), 3, 3)))
    with pytest.raises(ConfigError, match="angular_velocity stands beside accelerometers that are of parts"):
        estimate_recording(replace(recording, motion=turned), load_settings(**asked))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sensors": [3]}, "part rear names accelerometer 3, of 3"),
        ({"sensors": [0]}, "part name accelerometer 0 more than once"),
        ({"mass": None}, "part rear has no mass"),
        ({"sensors": []}, "part rear has no markers here"),
    ],
)
def test_accelerometers_that_do_not_fit_the_parts_are_refused(change, says):
    recording, asked, _ = crushed(0)
    part = [*asked["part"][:2], asked["part"][2] | change]
    with pytest.raises(ConfigError) as error:
        estimate_recording(recording, load_settings(**asked | {"part": part}))
    assert says in str(error.value).replace(":", "")
