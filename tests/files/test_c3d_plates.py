"""Force plates of C3D files: what the analog channels of plates hold is what pushes the body."""

import re
from pathlib import Path

import numpy as np
import pytest

from forceid.cli.app import main
from forceid.errors import ConfigError
from forceid.files import read_motion, read_result
from forceid.files.formats.sources import import_sources, settings_for
from forceid.import_settings import ImportSettings
from forceid.sections import validate

ezc3d = pytest.importorskip("ezc3d")
RATE, TIMES, N, DEPTH = (
    100.0,
    10,
    80,
    40.0,
)  # Hz; analog frames a frame; frames; mm of the sensor below the top
MASS = {"foot": 20.0, "hip": 30.0, "head": 10.0}
SHAPE = np.array([[0.1, 0.0, 0.1], [0.0, 0.1, 0.9], [0.0, -0.1, 1.7]])
CORNERS = np.array([[[300, 300, 0], [0, 300, 0], [0, -300, 0], [300, -300, 0]],
                    [[-10, 300, 0], [-310, 300, 0], [-310, -300, 0], [-10, -300, 0]]], float)  # fmt: skip


def hop(time):
    """Mass center (time, 3) m of a person who sways and bends, and the acceleration."""
    w = 2 * np.pi * np.array([0.7, 1.1, 1.6])
    size = np.array([0.03, 0.02, 0.05])
    return size * np.sin(w * time[:, None]), -size * w**2 * np.sin(w * time[:, None])


def write(path, on_plate=True, shares=(0.7, 0.3), kind=2, y_up=False):
    """Markers in mm, and two plates of type 2, whose axes z point down, with what they feel."""
    fine = np.arange(N * TIMES) / RATE / TIMES
    center, a = hop(fine)
    m = np.array(list(MASS.values()))
    middle = m @ SHAPE / m.sum()
    force = m.sum() * (a - [0, 0, -9.81])
    channels = []
    for corners, share in zip(CORNERS, shares, strict=True):
        x, y = corners[0] - corners[1], corners[0] - corners[3]
        axes = np.stack([x / np.linalg.norm(x), y / np.linalg.norm(y)], 1)
        axes = np.column_stack([axes, np.cross(axes[:, 0], axes[:, 1])])
        felt = (-1.0 if on_plate else 1.0) * share * force
        # the line of action goes through the mass center, which turns nothing
        top = np.cross(1e3 * (center + middle) - corners.mean(0), felt)
        F, M = felt @ axes, top @ axes
        M -= np.cross([0.0, 0.0, DEPTH], F)  # about the sensor, which is below: z of the plate points down
        channels += [*F.T, *M.T]
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = list(MASS)
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 3, N))
    points[:3] = 1e3 * (hop(np.arange(N) / RATE)[0][:, None] + SHAPE).transpose(2, 1, 0)
    c3d["data"]["points"] = points
    channels.append(np.zeros(len(fine)))
    c3d["parameters"]["ANALOG"]["RATE"]["value"] = [RATE * TIMES]
    c3d["parameters"]["ANALOG"]["LABELS"]["value"] = [f"channel {k}" for k in range(len(channels))]
    c3d["data"]["analogs"] = np.array(channels)[None]
    plates = c3d["parameters"]["FORCE_PLATFORM"]
    plates["USED"]["value"], plates["TYPE"]["value"] = [2], [kind, kind]
    plates["CORNERS"]["value"] = CORNERS.transpose(2, 1, 0)
    plates["ORIGIN"]["value"] = np.array([[0.0, 0.0, -DEPTH]] * 2).T
    plates["CHANNEL"]["value"] = np.arange(1, 13).reshape(2, 6).T
    c3d.write(str(path))
    return path


TABLE = {"gravity": [0, 0, -9.81], "body": {"mass": MASS}}


def brought(path, **more):
    ((_, recording),) = import_sources([path], validate(ImportSettings, TABLE | more, "test:"))
    return recording


@pytest.mark.parametrize("on_plate", [True, False])
def test_plates_of_a_c3d_file_are_the_force_on_the_body_whichever_they_hold(tmp_path, on_plate):
    recording = brought(write(tmp_path / "a.c3d", on_plate), plates={})
    truth, (_, a) = recording.truth, hop(recording.truth["time"])
    force = 60.0 * (a - [0, 0, -9.81])
    assert len(truth["time"]) == (N - 1) * TIMES + 1
    assert np.abs(truth["force"] - force).max() < 1e-3
    # it acts at the mass center, which is interpolated between frames: w^2 h^2 / 8 of 0.05 m at 1.6 Hz
    bent = 0.05 * (2 * np.pi * 1.6 / RATE) ** 2 / 8
    assert np.abs(truth["moment"]).max() < 3 * bent * np.abs(force).max()
    assert "force plates" not in recording.history
    assert recording.history.endswith("left out 1 analog channels")


def test_plates_are_left_out_where_nobody_asks_and_some_are_taken_or_known(tmp_path):
    path = write(tmp_path / "a.c3d")
    plain = brought(path)
    assert not plain.truth
    assert plain.history.endswith("left out force plates 1, 2, which the table [import.plates] asks for")
    one = brought(path, plates={"plate": ["2"]})
    both = brought(path, plates={})
    assert one.truth["force"] == pytest.approx(0.3 * both.truth["force"], abs=1e-3)
    known = brought(path, plates={"known": ["1"]})
    assert known.known_loads.name == ("plate_1",)
    assert known.truth["force"] == pytest.approx(one.truth["force"], abs=1e-3)
    with pytest.raises(ConfigError, match=r"\[import.plates\] plate: unknown name '3'"):
        brought(path, plates={"plate": ["3"]})


def test_plates_of_a_kind_that_is_not_read_are_said(tmp_path):
    recording = brought(write(tmp_path / "a.c3d", kind=7), plates={})
    assert "left out 2 force plates (" in recording.history
    assert not recording.truth


def test_a_capture_with_plates_becomes_a_result_beside_its_truth_in_two_commands(tmp_path):
    path = write(tmp_path / "a.c3d")
    assert "# [import.plates]" in settings_for([path])
    page = (Path(__file__).parents[2] / "docs" / "laboratories.md").read_text("utf-8")
    (lines,) = re.findall(r"^```toml\n# person.c3d\n(.*?)^```", page, re.S | re.M)
    (tmp_path / "a.toml").write_text(lines)
    assert main(["import", str(path), "-c", str(tmp_path / "a.toml")]) == 0
    assert main(["estimate", str(tmp_path / "a.h5")]) in (0, 1)
    truth = read_motion(tmp_path / "a.h5").truth
    found = read_result(tmp_path / "a.result.h5")
    force = np.stack([np.interp(found.time, truth["time"], c) for c in truth["force"].T], 1)
    assert np.sqrt(np.mean((found.force - force)[5:-5] ** 2)) < 0.02 * 60 * 9.81
