"""Import of captures whose segments have clusters of markers."""

import numpy as np
import pytest

from forceid.errors import ConfigError
from forceid.files.formats.segments import marker_clusters, mass_points, resting_markers
from forceid.files.formats.sources import import_sources
from forceid.files.schema import motion_groups
from forceid.files.stored.hdf5 import read_motion
from forceid.files.stored.netcdf import write_groups
from forceid.import_settings import ImportSettings
from forceid.sections import validate

NAMES = ("hip", "knee", "ankle", "t1", "t2", "s1", "s2")
THIGH = {"name": "thigh", "mass": 6.0, "markers": {"hip": 0.6, "knee": 0.4}, "cluster": ["knee", "t1", "t2"]}
SHANK = {
    "name": "shank",
    "mass": 3.0,
    "markers": {"knee": 0.6, "ankle": 0.4},
    "cluster": ["ankle", "s1", "s2"],
}
JOINT = {"knee": {"segments": ["thigh", "shank"], "markers": {"knee": 1.0}}}


def settings(**more):
    table = {"gravity": [0, 0, -9.81], "segment": [THIGH, SHANK], "joint": JOINT}
    return validate(ImportSettings, table | more, "test:")


@pytest.fixture
def position():
    return np.random.default_rng(0).standard_normal((6, len(NAMES), 3))


def trc(path, position):
    rows = [
        f"{k}\t{k / 100:g}\t" + "\t".join(f"{v:.9g}" for v in frame.ravel())
        for k, frame in enumerate(position)
    ]
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}", "DataRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t{len(position)}\t{len(NAMES)}\tm", "Frame#\tTime\t" + "\t\t\t".join(NAMES), "", "",
    ]  # fmt: skip
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def test_every_marker_stays_in_the_file_beside_the_mass_points(tmp_path, position):
    ((_, made),) = import_sources([trc(tmp_path / "a.trc", position)], settings())
    write_groups(tmp_path / "a.h5", motion_groups(made))
    found = read_motion(tmp_path / "a.h5")
    body, motion = found.body, found.motion
    assert body.marker == NAMES
    assert body.joint == ("knee",)
    assert np.allclose(motion.marker_position, position, rtol=1e-8)
    assert np.allclose(np.einsum("nm,tma->tna", body.marker_weight, motion.marker_position), motion.position)
    assert body.marker_segment.tolist() == [-1, 0, 1, 0, 0, 1, 1]
    assert body.joint_segment.tolist() == [[0, 1]]


def test_joints_are_placed_in_the_static_capture_where_there_is_one(tmp_path, position):
    trc(tmp_path / "still.trc", position[::-1] + 2.0)
    ((_, made),) = import_sources([trc(tmp_path / "a.trc", position)], settings(static="still.trc"))
    assert np.allclose(made.body.joint_shape[0], np.median(position[:, 1] + 2.0, axis=0), rtol=1e-8)


def test_without_a_static_capture_joints_are_placed_in_the_first_frame_that_shows_all(position):
    position[0, 3] = np.nan
    found = marker_clusters(NAMES, position, settings(), "test")
    assert np.array_equal(found["joint_shape"][0], position[1, 1])


def test_markers_that_a_static_capture_lacks_are_not_known_in_it(position):
    assert np.isnan(resting_markers(("hip", "toe"), NAMES, position)[1]).all()


def test_two_points_of_a_segment_have_its_mass_center_and_its_gyration(position):
    spread = THIGH | {"gyration": {"hip": -0.3, "knee": 0.3}}
    found = mass_points(NAMES, position, settings(segment=[spread, SHANK]), "test")
    assert found.name == ("thigh", "thigh_2", "shank")
    assert found.mass.tolist() == [3.0, 3.0, 3.0]
    plain = mass_points(NAMES, position, settings(), "test")
    assert np.allclose(found.position[:, :2].mean(1), plain.position[:, 0])
    along = position[:, 1] - position[:, 0]
    assert np.allclose(found.position[:, 1] - found.position[:, 0], 0.6 * along)


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ({"segment": [THIGH | {"cluster": ["knee", "t1"]}, SHANK]}, "2 markers"),
        ({"segment": [THIGH, SHANK | {"cluster": ["ankle", "s1", "t1"]}]}, "in the clusters of"),
        ({"segment": [THIGH, SHANK | {"cluster": ["ankle", "s1", "s3"]}]}, "unknown name 's3'"),
        ({"joint": {"knee": JOINT["knee"] | {"segments": ["thigh", "foot"]}}}, "unknown name 'foot'"),
    ],
)
def test_clusters_that_do_not_fit_the_markers_are_told(position, more, word):
    with pytest.raises(ConfigError, match=word):
        marker_clusters(NAMES, position, settings(**more), "test")
