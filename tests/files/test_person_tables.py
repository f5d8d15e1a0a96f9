"""Persons by the name of a table: what it holds, joint centers of marker sets, and the body of both."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError
from forceid.estimation.run import estimate_recording
from forceid.files.formats.bodies.joint_centers import joint_centers
from forceid.files.formats.bodies.marker_sets import marker_set
from forceid.files.formats.bodies.person import PREFIX
from forceid.files.formats.bodies.tables import table_joints, table_segments, tables
from forceid.files.formats.sources import import_sources, settings_for
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.import_settings import ImportSettings, load_import_settings
from forceid.sections import validate

MASS, HEIGHT = 72.0, 1.76
SHIFT = np.array([1.0, -2.0, 0.5])
PLACES = {  # m, x forward, y left, z up: landmarks of somebody who stands, the left ones
    "asis": (0.1, 0.12, 1.0), "psis": (-0.1, 0.04, 1.02), "knee_lateral": (0.0, 0.14, 0.5), "knee_medial":
    (0.0, 0.04, 0.5), "ankle_lateral": (-0.02, 0.13, 0.08), "ankle_medial": (-0.02, 0.05, 0.09), "heel":
    (-0.08, 0.09, 0.03), "toe": (0.14, 0.1, 0.03), "fifth": (0.1, 0.14, 0.02), "acromion": (0.0, 0.19,
    1.48), "elbow_lateral": (-0.02, 0.27, 1.17), "elbow_medial": (-0.02, 0.2, 1.17), "radius": (0.02, 0.26,
    0.93), "ulna": (-0.02, 0.27, 0.93), "knuckle": (0.02, 0.26, 0.84), "thigh1": (0.06, 0.13, 0.75),
    "thigh2": (0.05, 0.13, 0.65), "shank1": (0.03, 0.13, 0.35), "shank2": (0.04, 0.1, 0.25), "arm1": (0.0,
    0.26, 1.33), "arm2": (0.03, 0.24, 1.28), "forearm": (0.0, 0.25, 1.05),
}  # fmt: skip
MIDDLE = {
    "c7": (-0.08, 0.0, 1.52),
    "notch": (0.06, 0.0, 1.42),
    "t10": (-0.1, 0.0, 1.25),
    "sternum": (0.1, 0.0, 1.3),
}
HEADS = {
    "LFHD": (0.1, 0.07, 1.68),
    "RFHD": (0.1, -0.07, 1.68),
    "LBHD": (-0.1, 0.07, 1.68),
    "RBHD": (-0.1, -0.07, 1.68),
}
PLUG_IN = {
    "asis": "ASI", "psis": "PSI", "knee_lateral": "KNE", "ankle_lateral": "ANK", "heel": "HEE", "toe":
    "TOE", "acromion": "SHO", "elbow_lateral": "ELB", "radius": "WRA", "ulna": "WRB", "knuckle": "FIN",
    "thigh1": "THI", "shank1": "TIB",
}  # fmt: skip
RAJAGOPAL = {
    "asis": "ASI", "psis": "PSI", "knee_lateral": "LFC", "knee_medial": "MFC", "ankle_lateral": "LMAL",
    "ankle_medial": "MMAL", "heel": "CAL", "toe": "TOE", "fifth": "MT5", "acromion": "ACR", "elbow_lateral":
    "LEL", "elbow_medial": "MEL", "radius": "FAradius", "ulna": "FAulna", "forearm": "FAsuperior", "thigh1":
    "TH1", "thigh2": "TH2", "shank1": "TB1", "shank2": "TB2", "arm1": "UA1", "arm2": "UA2",
}  # fmt: skip
HELEN_HAYES = {
    "asis": "ASIS", "knee_lateral": "Knee", "ankle_lateral": "Ankle", "heel": "Heel", "toe": "Toe",
    "acromion": "Shoulder", "elbow_lateral": "Elbow", "radius": "Wrist", "thigh1": "Thigh", "shank1":
    "Shank",
}  # fmt: skip


def standing(sided, middle, dot="", extra=None):
    """Markers of somebody who stands by their names, m."""
    found = dict(extra or {})
    for landmark, name in sided.items():
        x, y, z = PLACES[landmark]
        found[f"L{dot}{name}"], found[f"R{dot}{name}"] = (x, y, z), (x, -y, z)
    return {
        name: np.array(at, float) for name, at in (found | {n: MIDDLE[m] for m, n in middle.items()}).items()
    }


def plug_in_gait():
    return standing(PLUG_IN, {"c7": "C7", "notch": "CLAV", "t10": "T10", "sternum": "STRN"}, extra=HEADS)


def rajagopal():
    return standing(RAJAGOPAL, {"c7": "C7", "notch": "CLAV"})


def helen_hayes():
    return standing(HELEN_HAYES, {}, ".", {"V.Sacral": (-0.1, 0.0, 1.02)})


def trc(path, markers, moves=None):
    """A capture of markers that all move by (frame, 3) m, at 100 Hz."""
    moves = np.zeros((5, 3)) if moves is None else moves
    names = list(markers)
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}", "DataRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t{len(moves)}\t{len(names)}\tm", "Frame#\tTime\t" + "\t\t\t".join(names), "",
    ]  # fmt: skip
    rows = [
        f"{k}\t{k / 100:g}\t" + "\t".join(f"{v:.9g}" for n in names for v in markers[n] + move)
        for k, move in enumerate(moves)
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def settings(table="de_leva", **more):
    body = {"table": table, "mass": MASS, "height": HEIGHT} | more
    body = {k: v for k, v in body.items() if v is not None}
    return validate(ImportSettings, {"gravity": [0, 0, -9.81], "body": body}, "test:")


def imported(path, markers, moves=None, table="de_leva", **more):
    ((_, recording),) = import_sources([trc(path / "a.trc", markers, moves)], settings(table, **more))
    return recording


@pytest.mark.parametrize(("table", "sex"), [("de_leva", "female"), ("de_leva", "male"), ("de_leva", ""),
                                            ("winter", ""), ("dempster", "")])  # fmt: skip
def test_masses_of_a_table_add_up_to_the_body(table, sex):
    segments = table_segments(table, sex)
    assert abs(sum(s.mass for s in segments) - 1) < 2e-4  # two digits of a percent, rounded
    assert all(0 <= s.center <= 1 for s in segments)
    assert all(0 <= g < 0.8 for s in segments for g in s.gyration)
    assert tables()[table]["source"]


def test_parts_of_the_trunk_of_de_leva_are_its_whole_trunk():
    for sex, whole in (("female", 0.4257), ("male", 0.4346)):
        parts = [s.mass for s in table_segments("de_leva", sex) if s.name.endswith("trunk")]
        assert len(parts) == 3
        assert sum(parts) == pytest.approx(whole, abs=1e-9)


def test_joints_of_a_table_join_segments_of_it():
    for table in tables():
        names = {s.name for s in table_segments(table)}
        assert all(set(pair) <= names for pair in table_joints(table).values())


@pytest.mark.parametrize(("markers", "name"), [(plug_in_gait, "Plug-in Gait"), (helen_hayes, "Helen Hayes"),
                                               (rajagopal, "OpenSim Rajagopal")])  # fmt: skip
def test_a_marker_set_is_known_by_its_names(markers, name):
    assert marker_set([f"somebody:{one}" for one in markers()]).name == name
    assert marker_set([*list(markers())[:4], "left", "right", "tail"]) is None


def test_the_hip_of_a_pelvis_is_where_the_regression_has_it():
    """Harrington 2007: width 240 mm, depth 200 mm, spines level, y left and z up here."""
    pelvis = {
        "left_asis": (0, 0.12, 0),
        "right_asis": (0, -0.12, 0),
        "left_psis": (-0.2, 0.04, 0),
        "right_psis": (-0.2, -0.04, 0),
    }
    found = joint_centers({n: np.array([at], float) for n, at in pelvis.items()}, HEIGHT)
    expected = 1e-3 * np.array([-0.24 * 200 - 9.9, 0.33 * 240 + 7.3, -0.30 * 240 - 10.9])
    assert np.allclose(found["left_hip"][0], expected, atol=1e-12)
    assert np.allclose(found["right_hip"][0], expected * [1, -1, 1], atol=1e-12)


def test_joint_centers_move_with_the_person():
    names = list(plug_in_gait())
    here = np.array([[plug_in_gait()[n] for n in names]])
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7])
    there = turn.apply(here[0])[None] + SHIFT
    known = marker_set(names)

    def centers(x):
        shown = {k: np.mean([x[:, names.index(m)] for m in v], axis=0) for k, v in known.landmark.items()}
        return joint_centers(shown, HEIGHT)

    for name, at in centers(here).items():
        assert np.allclose(turn.apply(at) + SHIFT, centers(there)[name], atol=1e-12), name


def test_mass_center_of_named_ends_is_the_sum_of_the_table(tmp_path):
    """Dempster's by hand, of a person whose ends are markers."""
    at = {
        "hip": (0, 0.09, 0.92),
        "knee": (0, 0.09, 0.5),
        "ankle": (0, 0.09, 0.08),
        "metatarsal": (0.15, 0.09, 0.02),
        "shoulder": (0, 0.18, 1.42),
        "elbow": (0, 0.2, 1.12),
        "wrist": (0.05, 0.2, 0.87),
        "knuckle": (0.06, 0.2, 0.8),
    }
    markers, ends = {}, {}
    for name, (x, y, z) in at.items():
        for side, sign in (("left", 1), ("right", -1)):
            markers[f"m_{side}_{name}"] = np.array([x, sign * y, z])
            ends[f"{side}_{name}"] = [f"m_{side}_{name}"]
    made = imported(tmp_path, markers, table="dempster", ends=ends)
    p = {name: np.array([x, 0, z]) for name, (x, _, z) in at.items()}  # the middle of both sides
    between = [
        ("hip", "shoulder", 0.578, 0.66),
        ("shoulder", "elbow", 0.056, 0.436),
        ("elbow", "wrist", 0.032, 0.43),
        ("wrist", "knuckle", 0.012, 0.506),
        ("hip", "knee", 0.2, 0.433),
        ("knee", "ankle", 0.093, 0.433),
        ("ankle", "metatarsal", 0.029, 0.5),
    ]
    expected = sum(m * ((1 - c) * p[a] + c * p[b]) for a, b, m, c in between)
    mass = made.body.mass
    assert mass.sum() == pytest.approx(MASS, rel=1e-9)
    assert np.allclose(mass @ made.body.position / mass.sum(), expected, atol=1e-8)


def test_a_thigh_resists_a_turn_across_it_as_the_table_says(tmp_path):
    made = imported(tmp_path, rajagopal(), table="winter")
    own = [k for k, n in enumerate(made.body.node) if n.startswith("left_thigh")]
    x, m = made.body.position[own], made.body.mass[own]
    spread = m @ ((x - m @ x / m.sum()) ** 2).sum(1)
    names = list(made.body.marker)
    hip, knee = (made.body.marker_shape[names.index(PREFIX + e)] for e in ("left_hip", "left_knee"))
    length = np.linalg.norm(hip - knee)
    assert spread == pytest.approx(0.1 * MASS * (0.323 * length) ** 2, rel=1e-6)


@pytest.mark.parametrize("table", ["de_leva", "winter", "dempster"])
@pytest.mark.parametrize("markers", [plug_in_gait, helen_hayes, rajagopal])
def test_every_table_takes_every_marker_set(tmp_path, table, markers):
    made = imported(tmp_path, markers(), table=table, sex="female")
    assert made.body.mass.sum() == pytest.approx(MASS, rel=2e-4)
    height = made.body.mass @ made.body.position / made.body.mass.sum()
    assert height[2] == pytest.approx(0.56 * HEIGHT, abs=0.05)  # of who stands: 55 to 57 % of the height
    assert abs(height[1]) < 1e-9
    assert bool(made.body.joint) == (markers is rajagopal)  # the others have two markers on most segments
    write_motion(tmp_path / "a.h5", made)
    assert read_motion(tmp_path / "a.h5").body.marker == made.body.marker


def test_a_person_who_is_lifted_is_pushed_as_hard_as_that_takes(tmp_path):
    rng, t = np.random.default_rng(4), np.arange(150) / 100
    lift = 0.05 * np.sin(2 * np.pi * 1.2 * t)
    made = imported(
        tmp_path, plug_in_gait(), np.outer(lift, [0, 0, 1]) + 2e-4 * rng.standard_normal((150, 3))
    )
    found = estimate_recording(made, load_settings(model="rigid"))
    inner, push = slice(20, -20), MASS * (9.81 - lift * (2 * np.pi * 1.2) ** 2)
    error = (found.force[:, 2] - push)[inner]
    assert np.sqrt((error**2).mean()) < 0.02 * np.ptp(push)


def test_a_person_is_proposed_where_the_markers_are_of_a_known_set(tmp_path):
    text = settings_for([trc(tmp_path / "a.trc", plug_in_gait())])
    assert "Plug-in Gait" in text
    (tmp_path / "a.toml").write_text(
        text.replace("mass = nan", "mass = 70.0").replace("height = nan", "height = 1.7")
    )
    ((_, made),) = import_sources([tmp_path / "a.trc"], load_import_settings(tmp_path / "a.toml"))
    assert made.body.mass.sum() == pytest.approx(70.0, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"height": None}, "without height"),
        ({"mass": None}, "without mass"),
        ({"ends": {"left_hipp": ["LASI"]}}, "did you mean 'left_hip'"),
        ({"ends": {"left_hip": ["LASS"]}}, "did you mean 'LASI'"),
        ({"cluster": {"left_thig": ["LKNE", "LTHI", "LTIB"]}}, "did you mean 'left_thigh'"),
        ({"sex": "other"}, "sex"),
        ({"table": "winters"}, "table"),
        ({"height": 176.0}, "height"),
    ],
)
def test_what_is_not_said_of_a_person_is_asked_for(tmp_path, more, said):
    with pytest.raises(ConfigError, match=said):
        imported(tmp_path, plug_in_gait(), **more)


def test_a_point_that_no_marker_shows_is_named(tmp_path):
    markers = {n: at for n, at in plug_in_gait().items() if n != "LANK"}
    with pytest.raises(
        ConfigError, match=r"no marker that shows left_ankle .*Plug-in Gait.*left_ankle = \[MARKER"
    ):
        imported(tmp_path, markers)
    with pytest.raises(ConfigError, match="no marker set of Plug-in Gait, Helen Hayes"):
        imported(tmp_path, {"a": np.zeros(3), "b": np.ones(3)})
