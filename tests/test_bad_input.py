"""Bad input through the real command line: exit code 3, one line that helps, and nothing written."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from forceid.cli.app import main
from forceid.errors import DataError
from forceid.files.stored import hdf5
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Body, Motion, Recording

CORNERS = np.array([[0.1, 0, 0], [-0.1, 0.1, 0], [0, -0.1, 0.1], [0, 0, -0.1]])


def thrown(position=CORNERS, mass=None, stiffness=None, frames=40):
    """Markers of a body that falls without turning."""
    t = np.arange(frames)[:, None, None] / 100
    mass = np.full(len(position), 0.05) if mass is None else np.array(mass)
    body = Body(
        node=tuple(f"m{k}" for k in range(len(position))), position=position, mass=mass, stiffness=stiffness
    )
    x = position + t * [2.0, 0, 3.0] + 0.5 * t**2 * [0, 0, -9.81]
    x = x + 1e-4 * np.random.default_rng(0).standard_normal(x.shape)
    motion = Motion(t[:, 0, 0], x, gravity=np.array([0, 0, -9.81]), noise_std={"position": 1e-4})
    return Recording(body, motion)


def put(name, data):
    """Replace the values of a variable, and keep its units."""

    def edit(path):
        with h5py.File(path, "r+") as f:
            units = f[name].attrs["units"]
            del f[name]
            f[name] = data
            f[name].attrs["units"] = units

    return edit


def change(name, index, value):
    def edit(path):
        with h5py.File(path, "r+") as f:
            data = f[name][()]
            data[index] = value
            f[name][...] = data

    return edit


def units(name, value):
    def edit(path):
        with h5py.File(path, "r+") as f:
            f[name].attrs["units"] = value

    return edit


def drop(name):
    def edit(path):
        with h5py.File(path, "r+") as f:
            del f[name]

    return edit


def spring(path):
    """One spring between two of four nodes: a mechanism."""
    pull = np.zeros((4, 3))
    pull[1] = (CORNERS[1] - CORNERS[0]) / np.linalg.norm(CORNERS[1] - CORNERS[0])
    pull[0] = -pull[1]
    write_motion(path, thrown(stiffness=np.outer(pull, pull)))


CASES = {
    "not HDF5": (lambda path: path.write_text("frame,x,y,z\n"), "", "is not an HDF5 file"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-500]), "", "is cut short"),
    "a unit off by a thousand": (units("motion/position", "mm"), ":/motion/position", "spans 0.001 times"),
    "missing variable": (drop("motion/time"), ":/motion/time", "is missing"),
    "wrong shape": (put("motion/position", np.zeros((40, 12))), ":/motion/position", "has shape (40, 12)"),
    "no length": (units("motion/position", "kg"), ":/motion/position", "has units 'kg', expected 'm'"),
    "no unit at all": (units("motion/position", "stone"), ":/motion/position", "has units 'stone'"),
    "clock that turns back": (
        change("motion/time", 7, 0.02),
        ":/motion/time",
        "expected strictly increasing",
    ),
    "clock that stops": (change("motion/time", 7, 0.06), ":/motion/time", "expected strictly increasing"),
    "clock with NaN": (change("motion/time", 7, np.nan), ":/motion/time", "not finite, first at index 7"),
    "all markers lost": (change("motion/position", ..., np.nan), ":/motion/position", "every marker is lost"),
    "no mass": (change("body/mass", ..., 0.0), ":/body/mass", "has total mass 0 kg"),
    "negative mass": (change("body/mass", 2, -0.05), ":/body/mass", "is -0.05 kg at node 'm2'"),
    "mechanism": (spring, "/body/stiffness", "(a mechanism)"),
    "complex numbers": (
        put("motion/position", np.zeros((40, 4, 3), complex)),
        ":/motion/position",
        "holds co",
    ),
    "text": (put("motion/time", np.array([b"0.1"] * 40)), ":/motion/time", "holds text"),
}


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_motion("toss.h5", thrown())
    return Path("toss.h5")


def refused(words, capsys):
    """Exit code, and the one line on stderr; nothing on stdout, and no file more than before."""
    before = sorted(Path().iterdir())
    code = main(words)
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.count("\n") == 1
    assert streams.err.startswith("forceid: error: ")
    assert sorted(Path().iterdir()) == before
    return code, streams.err


@pytest.mark.parametrize("command", ["estimate", "inspect"])
@pytest.mark.parametrize("case", CASES)
def test_bad_file_exits_3_with_one_line_on_what_where_and_what_next(file, command, case, capsys):
    spoil, variable, words = CASES[case]
    spoil(file)
    code, line = refused([command, str(file)], capsys)
    assert code == 3
    assert variable + " " in line
    assert words in line
    assert "; " in line, "the next step"
    if case != "mechanism":
        assert line.startswith(f"forceid: error: toss.h5{variable} ")


def test_line_on_a_mechanism_names_the_file(file, capsys):
    spring(file)
    assert "toss.h5:/body/stiffness" in refused(["estimate", str(file)], capsys)[1]


@pytest.mark.parametrize("options", [["--json"], ["--method", "savgol"], ["-o", "other.h5"]])
def test_no_option_makes_a_bad_file_say_more_or_leave_more(file, options, capsys):
    change("motion/time", 7, 0.02)(file)
    assert refused(["estimate", str(file), *options], capsys)[0] == 3


def test_earlier_result_stays_when_the_input_turned_bad(file, capsys):
    assert main(["estimate", str(file), "--method", "savgol"]) == 0
    earlier = Path("toss.result.h5").read_bytes()
    capsys.readouterr()
    drop("motion/time")(file)
    assert refused(["estimate", str(file)], capsys)[0] == 3
    assert Path("toss.result.h5").read_bytes() == earlier


def test_file_that_changes_under_way_is_refused(file, monkeypatch):
    parse = hdf5.parse_recording

    def slow(*arguments):
        recording = parse(*arguments)
        with open(file, "ab") as f:  # what a recorder does that still writes
            f.write(b"more")
        return recording

    monkeypatch.setattr(hdf5, "parse_recording", slow)
    with pytest.raises(DataError, match=r"toss\.h5 changed while it was read; wait"):
        read_motion(file)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("metod = 'savgol'\n", "unknown key 'metod'; did you mean 'method'?"),
        ("[noise-std]\nposition = 1e-4\n", "unknown key 'noise-std'; did you mean 'noise_std'?"),
        ("[[load]]\nname = 'p'\ndirecton = [0, 0, 1]\n", "did you mean 'direction'?"),
    ],
)
def test_unknown_key_exits_2_and_names_the_nearest(file, text, words, capsys):
    Path("c.toml").write_text(text)
    code, line = refused(["estimate", str(file), "-c", "c.toml"], capsys)
    assert code == 2
    assert line.startswith("forceid: error: c.toml ")
    assert words in line


@pytest.mark.parametrize("setting", ["moment_about = 'tip'", "[[load]]\nname = 'p'\ndirection = [0, 0, 0]"])
def test_settings_that_the_body_cannot_meet_exit_2(file, setting, capsys):
    Path("c.toml").write_text(setting)
    assert refused(["estimate", str(file), "-c", "c.toml"], capsys)[0] == 2


@pytest.mark.parametrize(
    ("position", "words"),
    [
        (CORNERS[:1], "particle"),
        (CORNERS[:2], "the 2 markers lie on a line"),
        (np.outer([0.0, 0.1, 0.3], [1.0, 2.0, 3.0]), "the 3 markers lie on a line"),
    ],
    ids=["single particle", "two markers", "collinear"],
)
def test_few_markers_are_no_error(file, position, words, capsys):
    recording = thrown(position=position)
    center, tensor = position.mean(0), 1e-3 * np.eye(3)
    body = replace(recording.body, mass=None, total_mass=0.1, mass_center=center, inertia=tensor)
    write_motion(file, replace(recording, body=body))
    assert main(["estimate", str(file)]) == 0
    streams = capsys.readouterr()
    assert streams.out.startswith("verdict  degraded")
    assert words in " ".join(streams.out.split())
    assert streams.err == ""
    with h5py.File("toss.result.h5") as f:
        assert np.isfinite(f["estimate/force"][()]).all()
        assert np.isnan(f["estimate/moment"][()]).all()


def test_gap_is_no_error(file, capsys):
    recording = thrown()
    x = recording.motion.position.copy()
    x[10:18] = np.nan
    write_motion(file, replace(recording, motion=replace(recording.motion, position=x)))
    assert main(["estimate", str(file)]) == 0
    assert "8 of 40 frames show no pose" in capsys.readouterr().out
