import sys
import tomllib

import numpy as np
import pytest

from forceid.errors import ConfigError, DataError
from forceid.files.formats.mocap import read_c3d, read_columns, read_mot, read_trc
from forceid.files.formats.plates import plate_settings
from forceid.files.formats.sources import import_sources
from forceid.import_settings import ImportSettings, PlateSetting
from forceid.sections import validate

TIME = np.arange(5) / 100


def write_trc(path, position, names, units="mm", frames=None):
    rows = [
        f"{k + 1}\t{t:g}\t" + "\t".join("" if np.isnan(v) else f"{v:.9g}" for v in frame.ravel())
        for k, (t, frame) in enumerate(zip(TIME, position, strict=True))
    ]
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t100\t{frames or len(rows)}\t{len(names)}\t{units}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{a}{k + 1}" for k in range(len(names)) for a in "XYZ"),
        "",
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


COLUMNS = ["time"] + [f"ground_force_1_{kind}{axis}" for kind in "vpm" for axis in "xyz"]


def write_mot(path, data, names=COLUMNS, rows=None):
    head = [f"nColumns={len(names)}", f"nRows={rows or len(data)}", "endheader", "\t".join(names)]
    path.write_text("\n".join([*head, *("\t".join(f"{v:.12g}" for v in row) for row in data)]) + "\n")
    return path


def settings(**more):
    table = {
        "gravity": [0, -9.81, 0],
        "body": {"total_mass": 4.0},
        "segment": [
            {"name": "upper", "mass_fraction": 0.75, "markers": {"hip": 0.5, "knee": 0.5}},
            {"name": "lower", "mass": 1.0, "markers": {"ankle": 1.0}},
        ],
    }
    return validate(ImportSettings, table | more, "test:")


@pytest.fixture
def position():
    rng = np.random.default_rng(0)
    position = rng.standard_normal((5, 4, 3)) * 1000
    position[0, 3] = position[2, 0] = np.nan
    return position


NAMES = ["hip", "knee", "ankle", "C 7"]


def test_trc_markers_come_in_meters_with_blanks_as_gaps(tmp_path, position):
    for units, factor in (("mm", 1e-3), ("m", 1.0)):
        markers = read_trc(write_trc(tmp_path / "a.trc", position, NAMES, units))
        assert markers.name == tuple(NAMES)
        assert np.allclose(markers.position, factor * position, rtol=1e-8, equal_nan=True)
        assert np.allclose(markers.time, TIME)


def test_segments_are_fixed_combinations_of_markers_and_carry_their_mass(tmp_path, position):
    path = write_trc(tmp_path / "a.trc", position, NAMES)
    ((name, recording),) = import_sources([path], settings())
    x = recording.motion.position
    assert name == "a"
    assert recording.body.node == ("upper", "lower")
    assert recording.body.mass.tolist() == [3.0, 1.0]
    assert np.allclose(x[[0, 1, 3, 4], 0], 5e-4 * (position[:, 0] + position[:, 1])[[0, 1, 3, 4]], rtol=1e-8)
    assert np.isnan(x[2, 0]).all()
    assert np.isfinite(x[:, 1]).all(), "a lost marker leaves the segments that do not use it"
    assert np.array_equal(recording.body.position, x[0])


def test_plates_become_the_moment_about_the_mass_center_on_their_own_time(tmp_path):
    c = np.array([0.1, 1.0, -0.2]) + TIME[:, None] * [1.0, 2.0, 3.0]
    rng = np.random.default_rng(1)
    t = np.linspace(0, 0.04, 9)
    v, p, m = rng.standard_normal((3, 9, 3))
    trc = write_trc(tmp_path / "a.trc", np.stack([c, c, c], 1), NAMES[:3], "m")
    mot = write_mot(tmp_path / "a_grf.mot", np.c_[t, v, p, m])
    ((_, recording),) = import_sources([mot, trc], settings())
    truth = recording.truth
    arm = p - (np.array([0.1, 1.0, -0.2]) + t[:, None] * [1.0, 2.0, 3.0])
    assert np.allclose(truth["time"], t)
    assert np.allclose(truth["force"], v)
    assert np.allclose(truth["moment"], np.cross(arm, v) + m, atol=1e-8)
    ((_, cut),) = import_sources([mot, trc], settings(start=0.01, stop=0.03))
    assert cut.truth["time"].tolist() == pytest.approx(t[2:7])
    assert len(cut.motion.time) == 3


def test_a_plate_that_is_known_is_a_load_beside_which_others_are_found(tmp_path, position):
    rows = np.c_[TIME, np.tile(np.arange(1.0, 10.0), (5, 1))]
    trc, mot = write_trc(tmp_path / "a.trc", position, NAMES), write_mot(tmp_path / "a_grf.mot", rows)
    ((_, recording),) = import_sources([trc, mot], settings(plates={"known": ["1"]}))
    known = recording.known_loads
    assert recording.truth == {}
    assert known.name == ("plate_1",)
    assert known.force[0].tolist() == [[1.0, 2.0, 3.0]]
    assert known.point[0].tolist() == [[4.0, 5.0, 6.0]]
    assert known.moment[0].tolist() == [[7.0, 8.0, 9.0]]
    with pytest.raises(ConfigError, match="known"):
        import_sources([trc, mot], settings(plates={"known": ["2"]}))


@pytest.mark.parametrize(
    "plates",
    [
        {"1": ("ground_force_1_v", "ground_force_1_p", "ground_force_1_m")},
        {"": ("ground_force_v", "ground_force_p", "ground_torque_")},
        {n: (f"{n}_ground_force_v", f"{n}_ground_force_p", f"{n}_ground_torque_") for n in "12"},
        {n: (f"{n}ground_force_v", f"{n}ground_force_p", f"{n}ground_torque_") for n in ("", "1_")},
        {n: (f"ground_force_{n}_v", f"ground_force_{n}_p", f"ground_moment_{n}_") for n in ("left", "right")},
    ],
)
def test_init_finds_every_plate_that_a_mot_file_has(tmp_path, plates):
    names = ["time", *(name + axis for of in plates.values() for name in of for axis in "xyz")]
    data = np.arange(3.0)[:, None] + 10 * np.arange(len(names))
    mot = write_mot(tmp_path / "a.mot", data, names)
    proposed = tomllib.loads(plate_settings(read_columns(mot)[0]))["import"]["plates"]
    found = read_mot(mot, validate(PlateSetting, proposed, "test:"))
    assert len(found.name) == len(plates)
    for k in range(len(plates)):
        own = data[:, 1 + 9 * k : 10 + 9 * k]
        assert np.array_equal(np.hstack([found.force[:, k], found.point[:, k], found.moment[:, k]]), own)


def test_plates_go_to_the_capture_whose_name_theirs_begins_with(tmp_path, position):
    rows = np.c_[TIME, np.ones((5, 9))]
    captures = [write_trc(tmp_path / f"{n}.trc", position, NAMES) for n in ("squat1", "squat10", "other")]
    plates = [
        write_mot(tmp_path / f"{n}_grf.mot", rows * np.r_[1, [k] * 9])
        for k, n in ((1, "squat1"), (2, "squat10"))
    ]
    found = dict(import_sources([*captures, *plates], settings()))
    assert found["squat1"].truth["force"][0, 0] == 1
    assert found["squat10"].truth["force"][0, 0] == 2
    assert found["other"].truth == {}
    with pytest.raises(ConfigError, match=r"x\.mot belongs to no capture"):
        import_sources([*captures, write_mot(tmp_path / "x.mot", rows)], settings())


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda s: s.replace("\tmm", "\tkg"), r"a\.trc:Units has units 'kg', expected 'm'"),
        (lambda s: "\n".join(s.split("\n")[:-3]), "holds 3 frames, expected 5 by its header"),
        (lambda s: s.replace("\t4\tmm", "\t9\tmm"), "holds 4 markers, expected 9 by its header"),
        (lambda s: s.replace("\t0.02\t", "\tlate\t"), "holds text in line 9 .*'late'"),
        (lambda s: s.replace("\t0.02\t", "\t0.01\t"), "/motion/time goes from 0.01 to 0.01 s"),
        (lambda s: s.replace("\t0.02\t", "\t\t"), "/motion/time holds 1 times that are not finite"),
        (lambda s: s.replace("PathFileType", "Path"), "is not a TRC file"),
        (lambda s: s[:20], "is not a TRC file"),
    ],
)
def test_a_trc_file_that_is_damaged_is_refused(tmp_path, position, edit, message):
    path = write_trc(tmp_path / "a.trc", position, NAMES)
    path.write_text(edit(path.read_text()))
    with pytest.raises(DataError, match=message):
        import_sources([path], settings())


def test_a_mot_file_that_is_damaged_is_refused(tmp_path):
    rows = np.c_[TIME, np.ones((5, 9))]
    with pytest.raises(DataError, match="holds 5 rows, expected 7"):
        read_mot(write_mot(tmp_path / "a.mot", rows, rows=7), PlateSetting())
    with pytest.raises(DataError, match=r"has no column 'ground_force_2_vx'.*\[import\.plates\]"):
        read_mot(write_mot(tmp_path / "a.mot", rows), PlateSetting(plate=("1", "2")))
    with pytest.raises(DataError, match="has no column 'time', found t, ground_force_1_vx"):
        read_mot(write_mot(tmp_path / "a.mot", rows, names=["t", *COLUMNS[1:]]), PlateSetting())
    (tmp_path / "b.mot").write_text("time\n0\n")
    with pytest.raises(DataError, match="expected a line 'endheader'"):
        read_mot(tmp_path / "b.mot", PlateSetting())
    (tmp_path / "b.mot").write_text("nRows=0\nendheader\n")
    with pytest.raises(DataError, match="has no column 'ground_force_1_vx', found no line of names"):
        read_mot(tmp_path / "b.mot", PlateSetting())


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        ({"markers": {"hip": 0.5, "knee": 0.4}, "mass": 4.0}, r"weights add up to 0\.9, expected 1"),
        ({"markers": {"hip": 1.0}}, "give either mass or mass_fraction"),
        ({"markers": {"hp": 1.0}, "mass": 4.0}, "segment s: unknown name 'hp'; did you mean 'hip'"),
        ({"markers": {"hip": 1.0}, "mass_fraction": 0.9}, "add up to 3.6 kg, expected total_mass 4 kg"),
    ],
)
def test_a_segment_table_that_cannot_be_right_is_refused(tmp_path, position, segment, message):
    path = write_trc(tmp_path / "a.trc", position, NAMES)
    with pytest.raises(ConfigError, match=message):
        import_sources([path], settings(segment=[{"name": "s"} | segment]))


def test_markers_on_a_rigid_body_known_as_a_whole_need_their_places(tmp_path, position):
    path = write_trc(tmp_path / "a.trc", position, NAMES)
    body = {"total_mass": 1.0, "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
    with pytest.raises(ConfigError, match="has no position of the markers"):
        import_sources([path], settings(segment=[], body=body))
    with pytest.raises(ConfigError, match="lacks 'C 7'"):
        import_sources(
            [path], settings(segment=[], body=body | {"position": {n: [0, 0, 0] for n in NAMES[:3]}})
        )
    whole = body | {"position": {n: [k, 0, 0] for k, n in enumerate(NAMES)}}
    ((_, recording),) = import_sources([path], settings(segment=[], body=whole))
    assert recording.body.total_mass == 1.0
    assert recording.body.position[:, 0].tolist() == [0, 1, 2, 3]


def test_c3d_markers_are_those_that_were_written(tmp_path, position):
    ezc3d = pytest.importorskip("ezc3d")
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["RATE"]["value"] = [100]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = NAMES
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 4, 5))
    points[:3] = position.transpose(2, 1, 0)
    c3d["data"]["points"] = points
    c3d.write(str(tmp_path / "a.c3d"))
    markers = read_c3d(tmp_path / "a.c3d")
    assert markers.name == tuple(NAMES)
    assert np.allclose(markers.position, position / 1000, rtol=1e-6, equal_nan=True)
    assert np.allclose(np.diff(markers.time), 0.01)
    ((_, recording),) = import_sources([tmp_path / "a.c3d"], settings())
    assert recording.body.node == ("upper", "lower")
    whole = (tmp_path / "a.c3d").read_bytes()
    head, used = whole[:2] + b"\0\0" + whole[4:], whole.index(b"USED") + 8  # damaged: no markers are counted
    assert whole[used] == len(NAMES)
    (tmp_path / "b.c3d").write_bytes(head[:used] + b"\0" + head[used + 1 :])
    assert len(read_c3d(tmp_path / "b.c3d").name) == read_c3d(tmp_path / "b.c3d").position.shape[1]
    (tmp_path / "b.c3d").write_text("not a capture")
    with pytest.raises(DataError, match=r"b\.c3d is not a C3D file"):
        read_c3d(tmp_path / "b.c3d")


def test_c3d_without_ezc3d_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(
        ConfigError, match=r"needs the package ezc3d; install it: pip install 'forceid\[c3d\]'"
    ):
        read_c3d(tmp_path / "a.c3d")
