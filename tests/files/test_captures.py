import hashlib
import re
import tomllib
from functools import partial
from pathlib import Path

import captures
import numpy as np
import pytest
from captures import Throw, y_up
from laboratory import refusal

from forceid.cli.app import main
from forceid.errors import ConfigError, DataError, ForceIdError
from forceid.files import read_motion, read_result
from forceid.files.formats.captures.table import FORMATS, format_of
from forceid.files.formats.sources import import_sources, settings_for
from forceid.import_settings import ImportSettings
from forceid.sections import validate

WRITTEN = 6e-7  # m: captures are written to a tenth of a micrometer, or to a micrometer
MARKED = {"gravity": [0, 0, -9.81], "body": {"mass": captures.MASS}}
RIGID = {
    "gravity": [0, 0, -9.81],
    "body": {"total_mass": 0.6, "inertia": np.diag([2e-3, 3e-3, 4e-3]).tolist()},
}


def brought(path, table=None, **more):
    ((_, recording),) = import_sources([path], validate(ImportSettings, (table or MARKED) | more, "test:"))
    return recording


def lost(throw):
    """The same with markers that are lost for a while."""
    throw.position[5:9, 1] = np.nan
    throw.position[7, 0] = np.nan
    return throw


MARKERS = {
    "vicon.csv": (captures.vicon, {}, "Vicon CSV"),
    "vicon alone.csv": (captures.vicon, {"devices": False, "subject": ""}, "Vicon CSV"),
    "vicon of another country.csv": (captures.vicon, {"separator": ";", "decimal": ","}, "Vicon CSV"),
    "motive.csv": (captures.motive, {}, "Motive CSV"),
    "motive 1.25.csv": (captures.motive, {"form": "1.25"}, "Motive CSV"),
    "motive 1.1.csv": (captures.motive, {"form": "1.1", "body": False}, "Motive CSV"),
    "qualisys.tsv": (captures.qualisys, {}, "Qualisys TSV"),
    "qualisys bare.tsv": (captures.qualisys, {"header": False, "clock": False, "lost": ""}, "Qualisys TSV"),
    "qualisys 2.tsv": (captures.qualisys, {"version": True}, "Qualisys TSV"),
    "qualisys.txt": (captures.qualisys, {"clock": False, "lost": "NULL"}, "Qualisys TSV"),
    "opencap.trc": (captures.opencap, {}, "TRC"),
    "theia.trc": (captures.opencap, {"units": "mm"}, "TRC"),
}


@pytest.mark.parametrize("name", MARKERS)
def test_markers_of_every_format_are_read_as_they_were_written(tmp_path, name):
    write, more, called = MARKERS[name]
    throw = lost(Throw())
    path = write(tmp_path / name, throw, **more)
    assert format_of(path).name == called
    recording = brought(path)
    true = y_up(throw.position) if format_of(path).up == "y" else throw.position
    assert recording.body.node == throw.names
    assert np.array_equal(np.isnan(recording.motion.position), np.isnan(true))
    assert np.nanmax(np.abs(recording.motion.position - true)) < WRITTEN
    assert np.ptp(recording.motion.time - throw.time) < 1e-9
    assert recording.body.mass.tolist() == list(captures.MASS.values())


POSES = {
    "tracker.csv": (captures.tracker, {}),
    "motive.csv": (captures.motive, {}),
    "qualisys_6d.tsv": (captures.qualisys_6d, {}),
    "rostopic.csv": (captures.ros, {"kind": "rostopic"}),
    "bagpy.csv": (captures.ros, {"kind": "bagpy"}),
    "plotjuggler.csv": (captures.ros, {"kind": "plotjuggler"}),
    "odometry.csv": (captures.ros, {"kind": "odometry"}),
}


@pytest.mark.parametrize("name", POSES)
def test_poses_of_every_format_are_read_as_they_were_written(tmp_path, name):
    write, more = POSES[name]
    throw = Throw()
    path = write(tmp_path / name, throw, **more)
    recording = brought(path, RIGID)
    up = format_of(path).up == "y"
    assert np.abs(recording.motion.center - (y_up(throw.center) if up else throw.center)).max() < WRITTEN
    axis = recording.motion.orientation[:, 1 if up else 2]
    assert np.abs(np.abs(axis) - np.abs(throw.quaternion[:, 2])).max() < 1e-6
    slack = 3e-7 if name == "plotjuggler.csv" else 1e-9  # 2**-22: s since 1970 in a float, as it writes them
    assert np.abs(recording.motion.time - recording.motion.time[0] - throw.time).max() < slack


def test_a_pose_is_moved_from_the_tracked_origin_to_the_mass_center(tmp_path):
    throw = Throw()
    path = captures.tracker(tmp_path / "a.csv", throw)
    body = RIGID["body"] | {"mass_center": [0.1, 0.0, 0.02]}
    recording = brought(path, RIGID, body=body)
    offset = np.stack([0.1 * np.cos(4 * throw.time), 0.1 * np.sin(4 * throw.time), 0.02 + 0 * throw.time], 1)
    assert np.abs(recording.motion.center - throw.center - offset).max() < WRITTEN


def test_what_is_left_out_is_said_in_the_file_and_on_the_terminal(tmp_path, capsys):
    throw = Throw()
    devices = "left out Devices at 1000 Hz (Plate 1 - Force, Plate 1 - CoP)"
    assert brought(captures.vicon(tmp_path / "a.csv", throw)).history.split("\n")[1:] == [devices]
    said = brought(captures.motive(tmp_path / "b.csv", throw)).history.split("\n")[1:]
    assert said == [
        "left out 1 Rigid Body Mean Marker Error, 1 Rigid Body Marker Position, "
        "1 Rigid Body Marker Marker Quality, 1 Unlabeled Marker Position",
        "left out pose of bird",
    ]
    assert brought(captures.qualisys(tmp_path / "c.tsv", throw)).history.endswith("event thrown 12 0.055")
    odometry = brought(captures.ros(tmp_path / "d.csv", throw, "odometry"), RIGID)
    assert odometry.history.endswith("left out columns field.twist.twist.linear.x")
    (tmp_path / "a.toml").write_text("import.gravity = [0.0, 0.0, -9.81]\n" + toml_of(captures.MASS))
    assert main(["import", str(tmp_path / "a.csv"), "-c", str(tmp_path / "a.toml")]) == 0
    out, err = capsys.readouterr()
    assert out.strip() == f"{tmp_path / 'a.h5'}: 120 samples"
    assert err.strip() == f"note: {devices}"


def test_columns_that_no_setting_names_are_said(tmp_path):
    rows = [f"{k / 100},{k},0,0,{k},1,0,{k},0,1,5,6" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["t,a x,a y,a z,b x,b y,b z,c x,c y,c z,trigger,emg", *rows]))
    settings = {"csv": {"time": "t", "position": "{name} {axis}"}, "body": {"mass": {"a": 1, "b": 1, "c": 1}}}
    recording = brought(tmp_path / "a.csv", {"gravity": [0, 0, -9.81]} | settings)
    assert recording.history.split("\n")[1:] == ["left out columns trigger, emg"]


def toml_of(mass):
    return f"import.body.mass = {{ {', '.join(f'{name} = {value}' for name, value in mass.items())} }}\n"


def test_a_part_of_a_capture_is_chosen_by_name(tmp_path):
    throw = Throw()
    path = captures.motive(tmp_path / "a.csv", throw)
    pose = brought(path, RIGID, capture={"use": "pose", "body": "bird"})
    assert pose.motion.position is None
    three = dict(list(captures.MASS.items())[:3])
    some = brought(path, MARKED | {"body": {"mass": three}}, capture={"markers": list(three)})
    assert some.body.node == tuple(three)
    assert "markers tail" in some.history
    with pytest.raises(
        ConfigError, match=r"\[import.capture\] body: unknown name 'brid'; did you mean 'bird'"
    ):
        brought(path, RIGID, capture={"body": "brid"})
    with pytest.raises(ConfigError, match="has no pose of a body"):
        brought(captures.qualisys(tmp_path / "b.tsv", throw), capture={"use": "pose"})
    with pytest.raises(DataError, match="holds no markers; take the pose"):
        brought(captures.tracker(tmp_path / "c.csv", throw), capture={"use": "markers"})


def test_of_several_bodies_one_is_asked_for(tmp_path):
    throw = Throw()
    path = captures.tracker(tmp_path / "a.csv", throw)
    lines = path.read_text().splitlines()
    more = [",Global Angle (Quaternion) cat:cat,,,,,,", ",RX,RY,RZ,RW,TX,TY,TZ", ",,,,,mm,mm,mm"]
    both = [*lines[:2], *(a + b for a, b in zip(lines[2:5], more, strict=True))]
    path.write_text("\n".join([*both, *(line + ",0,0,0,1,1,2,3" for line in lines[5:])]))
    with pytest.raises(ConfigError, match=r"holds 2 bodies \(bird, cat\), expected one; name it: .* body = "):
        brought(path, RIGID)
    cat = brought(path, RIGID, capture={"body": "cat"})
    assert cat.motion.center[3] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert "pose of bird" in cat.history


@pytest.mark.parametrize("triples", [True, False])
def test_columns_of_opensim_are_channels(tmp_path, triples):
    throw = Throw()
    path = captures.sto(tmp_path / "a.sto", throw, triples)
    position = "{name}" if triples else "{name}_{axis}"
    recording = brought(path, channels={"position": position})
    assert np.abs(recording.motion.position - throw.position).max() < 1e-12
    assert recording.motion.time.tolist() == throw.time.tolist()


def test_a_time_that_is_none_is_refused_by_its_line(tmp_path):
    path = captures.sto(tmp_path / "a.sto", Throw(8))
    path.write_text(path.read_text().replace("\n0.01\t", "\ninf\t"))
    with pytest.raises(DataError, match="holds no time in line 10, expected a finite number; correct it"):
        brought(path, channels={"position": "{name}"})


def test_the_motion_file_holds_the_settings_and_the_hashes_of_its_sources(tmp_path):
    path = captures.vicon(tmp_path / "a.csv", Throw())
    (tmp_path / "a.toml").write_text("[import]\ngravity = [0.0, 0.0, -9.81]\n" + toml_of(captures.MASS)[7:])
    assert main(["import", str(path), "-o", str(tmp_path / "a.h5"), "-c", str(tmp_path / "a.toml")]) == 0
    recording = read_motion(tmp_path / "a.h5")
    assert recording.source_sha256 == f"{hashlib.sha256(path.read_bytes()).hexdigest()}  a.csv"
    again = tomllib.loads(recording.import_settings)
    assert again == tomllib.loads((tmp_path / "a.toml").read_text())
    ((_, same),) = import_sources([path], validate(ImportSettings, again["import"], "again:"))
    assert same.sha256 == brought(path).sha256


EVERY = MARKERS | {name: (*POSES[name], "") for name in ("tracker.csv", "rostopic.csv", "odometry.csv")}


@pytest.mark.parametrize("name", EVERY)
def test_init_writes_settings_that_lack_only_the_numbers_that_no_file_says(tmp_path, name, capsys):
    write, more, _ = EVERY[name]
    path = write(tmp_path / name, Throw(), **more)
    assert main(["import", "--init", str(path), "-o", str(tmp_path / "a.toml")]) == 0
    assert main(["import", "--init", str(path), "-o", str(tmp_path / "a.toml")]) == 2
    assert "exists already" in capsys.readouterr().err
    text = (tmp_path / "a.toml").read_text()
    assert main(["import", str(path), "-c", str(tmp_path / "a.toml")]) == 2
    assert "expected" not in (said := capsys.readouterr().err)
    assert said.strip().endswith("found nan; fill in the number")
    filled = tomllib.loads(text.replace("nan", "0.01"))["import"]
    recording = brought(path, filled)
    assert len(recording.motion.time) == 120
    own = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(own) <= 10


def test_init_finds_the_columns_of_a_plain_table(tmp_path, capsys):
    throw = Throw()
    path = tmp_path / "a.csv"
    rows = [",".join(map(str, (t, *x.ravel(), 3))) for t, x in zip(throw.time, throw.position, strict=True)]
    names = [f"{n}_{a}" for n in throw.names for a in "xyz"]
    path.write_text("\n".join([",".join(["time (s)", *names, "trigger"]), *rows]))
    text = settings_for([path])
    assert 'time = "time (s)"' in text
    assert 'position = "{name}_{axis}"' in text
    assert "# not used: trigger" in text
    assert brought(path, tomllib.loads(text.replace("nan", "0.01"))["import"]).body.node == throw.names
    posed = [",".join(map(str, (t, *c, *q))) for t, c, q in zip(
        throw.time, throw.center, throw.quaternion, strict=True)]  # fmt: skip
    path.write_text("\n".join(["t;x;y;z;qx;qy;qz;qw", *(row.replace(",", ";") for row in posed)]))
    text = settings_for([path])
    recording = brought(path, tomllib.loads(text.replace("nan", "0.01"))["import"])
    assert np.array_equal(recording.motion.center, throw.center)
    assert main(["import", "--init", str(path)]) == 0
    assert capsys.readouterr().out == text


@pytest.mark.parametrize(
    ("heads", "said"),
    [
        ("t_s,x_mm,y_mm,z_mm,qx,qy,qz,qw", {"center": ["x_mm", "y_mm", "z_mm"], "units": {"center": "mm"}}),
        (
            "t (s),hip x (cm),hip y (cm),hip z (cm)",
            {"position": "{name} {axis} (cm)", "units": {"position": "cm"}},
        ),
        ("t,hip x (left),hip y (left),hip z (left)", {"position": "{name} {axis} (left)"}),
        ("t,ax (g),ay (g),az (g)", {"specific_force": "{name}{axis} (g)", "units": {"specific_force": "g"}}),
    ],
)
def test_init_takes_the_units_that_columns_name(tmp_path, heads, said):
    rows = [",".join([str(k), *["0.5"] * heads.count(",")]) for k in range(4)]
    (tmp_path / "a.csv").write_text("\n".join([heads, *rows]))
    found = tomllib.loads(settings_for([tmp_path / "a.csv"]))["import"]["csv"]
    assert found["time"] == heads.partition(",")[0]
    assert {name: found[name] for name in said} == said
    assert ("units" in found) == ("units" in said)


def test_init_places_sensors_beside_the_masses_of_many_markers(tmp_path):
    heads = ["time", *(f"{n}_{a}" for n in [*(f"m{k}" for k in range(14)), "acc1"] for a in "xyz")]
    rows = [",".join([str(k), *["1"] * (len(heads) - 1)]) for k in range(3)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(heads), *rows]))
    body = tomllib.loads(settings_for([tmp_path / "a.csv"]))["import"]["body"]
    assert (len(body["mass"]), list(body["sensor_position"])) == (14, ["acc1"])


def test_init_finds_the_column_that_tells_recordings_apart(tmp_path):
    lines = [f"{toss},{k / 100},{k},{k},{toss},n/a" for toss in (4, 7) for k in range(5)]
    (tmp_path / "a.csv").write_text("\n".join(["toss,time,a_x,a_y,a_z,note", *lines]))
    found = tomllib.loads(settings_for([tmp_path / "a.csv"]))["import"]["csv"]
    assert (found["group"], found["position"]) == ("toss", "{name}_{axis}")


@pytest.mark.parametrize(("between", "names"), [(" ", "ab"), ("_", ("acc1", "acc2"))])
def test_init_takes_what_reads_the_weight_for_accelerometers(tmp_path, between, names):
    weight = 0.0 if names[0].startswith("acc") else 9.6
    heads = ["time", *(f"{n}{between}{a}" for n in names for a in "xyz")]
    rows = [[k / 100, *(v for _ in names for v in (0.1 * k % 3, 0.2, weight))] for k in range(30)]
    table = "\n".join([",".join(heads), *(",".join(map(str, row)) for row in rows)])
    (tmp_path / "a.csv").write_text(table)
    text = settings_for([tmp_path / "a.csv"])
    assert f'specific_force = "{{name}}{between}{{axis}}"' in text
    places = tomllib.loads(text)["import"]["body"]["sensor_position"]
    assert set(places) == set(names)


def test_init_lists_the_channels_of_a_file_of_channels(tmp_path):
    text = settings_for([captures.sto(tmp_path / "a.sto", Throw(), triples=False)])
    assert 'position = "{name}_{axis}"' in text
    assert "[import.channels]" in text
    mot = captures.sto(tmp_path / "b.mot", Throw(), triples=False)
    assert "[import.plates]" in settings_for([captures.opencap(tmp_path / "b.trc", Throw()), mot])
    (tmp_path / "a.xyz").write_text("?")
    with pytest.raises(ConfigError, match=r"begins as no known format, expected Vicon CSV, .*; convert it"):
        settings_for([tmp_path / "a.xyz"])


PAGE = (Path(__file__).parents[2] / "docs" / "laboratories.md").read_text("utf-8")
FOUND = re.findall(r"^```toml\n# (\S+)\n(.*?)^```", PAGE, re.S | re.M)
TOML = [(name, lines) for name, lines in FOUND if not name.endswith(".c3d")]  # which has a test of its own
WRITERS = {
    name: write
    for name, (write, *_) in (MARKERS | POSES).items()
    if name
    in (
        "vicon.csv",
        "motive.csv",
        "qualisys.tsv",
        "opencap.trc",
        "tracker.csv",
        "rostopic.csv",
        "qualisys_6d.tsv",
    )
}


def test_the_page_has_settings_for_every_format():
    assert {name for name, _ in TOML} == WRITERS.keys()


@pytest.mark.parametrize(("name", "lines"), TOML)
def test_a_file_becomes_a_result_in_two_commands_and_at_most_ten_lines(tmp_path, name, lines):
    throw = Throw(60)
    path = WRITERS[name](tmp_path / name, throw)
    assert len(lines.splitlines()) <= 10
    config, motion, result = tmp_path / "lab.toml", tmp_path / "m.h5", tmp_path / "r.h5"
    config.write_text(lines)
    assert main(["import", str(path), "-o", str(motion), "-c", str(config)]) == 0
    assert main(["estimate", str(motion), "-o", str(result), "-c", str(config)]) == 0
    found = read_result(result)
    force = y_up(throw.force) if format_of(path).up == "y" else throw.force
    error = (found.force - force)[5:-5]
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(force**2))
    assert np.mean((error / found.force_std[5:-5]) ** 2) < 2.0


BROKEN = {
    "vicon rate": (captures.vicon, lambda s: s.replace("\n200\n", "\nfast\n"), "in line 58 the rate 'fast'"),
    "vicon text": (captures.vicon, lambda s: s.replace("\n7,0,", "\n7,0,seen,"), "line 68 .*'seen'"),
    "vicon ragged": (captures.vicon, lambda s: s.replace("\n9,0,", "\n9,0,1,2,"), "16 cells in line 70"),
    "vicon empty": (captures.vicon, lambda s: s[: s.rindex("mm\n1,0") + 3], "no numbers in Trajectories"),
    "vicon unit": (captures.vicon, lambda s: s.replace(",mm,mm,mm,mm,mm,mm,mm", ",furlong" * 7), "'furlong'"),
    "vicon devices": (captures.vicon, lambda s: s[: s.index("Trajectories")], "holds Devices"),
    "vicon short": (captures.tracker, lambda s: s.split("\n", 2)[2], "fields in line 2, expected a section"),
    "motive rows": (captures.motive, lambda s: s.replace("Frame,Time", "Number,Time"), "no rows of types"),
    "motive time": (captures.motive, lambda s: s.replace("Frame,Time", "Frame,Tome"), "no column Time in"),
    "motive units": (captures.motive, lambda s: s.replace("Meters", "Furlongs"), "'Furlongs', expected 'm'"),
    "motive text": (captures.motive, lambda s: s.replace("\n3,0.01", "\n3,late0.01"), "text in line 11"),
    "qualisys rate": (captures.qualisys, lambda s: s.replace("FREQUENCY\t200", "FREQUENCY\t0"), "NCY '0'"),
    "qualisys 6d": (captures.qualisys, lambda s: s.replace("\t3D", "\t6D"), "6D data without BODY_NAMES"),
    "qualisys turn": (captures.qualisys_6d, lambda s: s.replace("Rot[3]", "Quality"), "expected Rot.0. to"),
    "qualisys cut": (captures.qualisys, lambda s: s[:4000], "frames, expected 120 by its header"),
    "qualisys names": (captures.qualisys, lambda s: s.replace("MARKERS\t4", "MARKERS\t5"), "expected 5 by"),
    "ros time": (captures.ros, lambda s: s.replace("stamp", "stomp").replace("%time", "tick"), "no time"),
    "ros stamp": (captures.ros, lambda s: s.replace("\n1700000000123456789", "\nx").replace(
        "0,1700000000123456789", "0,then"), "holds a time that is none"),
    "ros pose": (captures.ros, lambda s: s.replace("position.z", "position.h"), "no whole pose"),
    "trc": (captures.opencap, lambda s: s.replace("PathFileType", "Path"), "is not a TRC file"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_damaged_capture_is_refused_in_one_line_with_the_next_step(tmp_path, case):
    write, damage, said = BROKEN[case]
    suffix = {captures.qualisys: ".tsv", captures.qualisys_6d: ".tsv", captures.opencap: ".trc"}.get(
        write, ".csv"
    )
    path = write(tmp_path / f"a{suffix}", Throw())
    path.write_text(damage(path.read_text(encoding="utf-8-sig")))
    with pytest.raises(ForceIdError, match=said) as refusal:
        brought(path)
    assert "\n" not in str(refusal.value)
    assert refusal.value.next_step
    assert str(path) in str(refusal.value)


def test_a_body_of_qualisys_turns_as_its_angles_say(tmp_path):
    # roll about x, then pitch about the new y, then yaw about the new z: the standard of Qualisys
    roll, pitch, yaw = np.radians([-20.0, 35.0, 50.0])
    R_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    R_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    R_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    R = R_x @ R_y @ R_z
    path = captures.qualisys_6d(tmp_path / "a.tsv", Throw(4))
    lines = path.read_text().splitlines()
    row = [1.0, 2.0, 3.0, -20.0, 35.0, 50.0, 0.2, *R.T.ravel()]
    rows = ["\t".join(map(str, (k, k / 200, *row))) for k in range(4)]
    path.write_text("\n".join([*lines[:-4], *rows]))
    x, y, z, w = brought(path, RIGID).motion.orientation[0]
    nose = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]  # of the body, in the world
    assert nose == pytest.approx(R[:, 0], abs=1e-12)


def test_qualisys_times_of_frames_from_outside_are_those_of_the_column(tmp_path):
    path = captures.qualisys(tmp_path / "a.tsv", Throw(8))
    path.write_text(
        path.read_text().replace("FREQUENCY\t200", "FREQUENCY\tEXT").replace("0.00500", "0.00600")
    )
    assert brought(path).motion.time[:3] == pytest.approx([0.0, 0.006, 0.01])


def test_no_format_takes_the_files_of_another(tmp_path):
    throw = Throw()
    for name, (write, more, called) in MARKERS.items():
        head = write(tmp_path / name, throw, **more).read_text(encoding="utf-8-sig")
        assert [one.name for one in FORMATS if one.begins(head)] == [called]
    assert not [one.name for one in FORMATS if one.begins("t,tip x,tip y,tip z\n0,1,2,3\n")]


def spoiled(rng, whole):
    """The bytes of a file, cut, with lines lost or said twice, or with a few that are others."""
    lines, at = whole.split(b"\n"), int(rng.integers(min(len(whole), 900)))
    odd = [b"", b",", b"\t", b"\n", b'"', b"nan", b"1e999", b"-", b"\x00", b"\xff"]
    return [
        whole[: rng.integers(len(whole))],
        whole[:at] + odd[rng.integers(len(odd))] + whole[at + 1 :],
        whole[:at] + whole[at + rng.integers(60) :],
        b"\n".join(line for k, line in enumerate(lines) if k != rng.integers(12)),
        b"\n".join([*lines[: (k := int(rng.integers(len(lines))))], lines[k // 2], *lines[k:]]),
    ][rng.integers(5)]


@pytest.mark.parametrize("name", ["vicon.csv", "motive.csv", "qualisys.tsv", "opencap.trc", *POSES])
def test_whatever_a_capture_holds_it_is_read_or_refused_in_one_line(tmp_path, name):
    (write, more), rng = (MARKERS | POSES)[name][:2], np.random.default_rng(7)
    whole, refused = write(tmp_path / name, Throw(12), **more).read_bytes(), 0
    settings = validate(ImportSettings, RIGID if name in POSES and name != "motive.csv" else MARKED, "test:")
    for _ in range(120):
        (tmp_path / f"x{name}").write_bytes(spoiled(rng, whole))
        for read in (partial(import_sources, settings=settings), settings_for):
            said = refusal(partial(read, [tmp_path / f"x{name}"]))
            assert "\n" not in said
            refused += bool(said)
    assert 10 < refused < 230
