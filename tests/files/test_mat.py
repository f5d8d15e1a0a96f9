import h5py
import numpy as np
import pytest
from laboratory import (
    MASS,
    NAMES,
    POSITION,
    RATE,
    SHAPE,
    SPECIFIC_FORCE,
    TIME,
    brought,
    refusal,
    settings,
    write_mat73,
)
from scipy.io import savemat

from forceid.errors import ConfigError, DataError
from forceid.files.formats.mat import read_mat
from forceid.files.formats.sources import import_sources

MARKERS = {name: POSITION[:, k] for k, name in enumerate(NAMES)}
CAPTURE = {"t": TIME, "fs": RATE, "trial": {"markers": MARKERS, "names": NAMES, "all": POSITION}}


def write(path, variables, version="5"):
    if version == "7.3":
        return write_mat73(path, variables)
    if version == "4":  # has no structs
        variables = {"t": TIME, **MARKERS}
    given = {
        k: v | {"names": np.array(NAMES, object)} if isinstance(v, dict) else v for k, v in variables.items()
    }
    savemat(path, given, format="4" if version == "4" else "5", do_compression=version == "7.2")
    return path


@pytest.mark.parametrize("version", ["4", "5", "7.2", "7.3"])
def test_markers_of_every_version_are_those_that_were_written(tmp_path, version):
    path = write(tmp_path / "a.mat", CAPTURE, version)
    pattern = "{name}" if version == "4" else "trial.markers.{name}"
    table = {"time": "t", "position": dict(zip(NAMES, NAMES, strict=True)) if version == "4" else pattern}
    recording = brought(path, table)
    order = [recording.body.node.index(name) for name in NAMES]  # v7.3 keeps fields by the alphabet
    assert np.array_equal(recording.motion.position[:, order], POSITION)
    assert np.array_equal(recording.motion.time, TIME)


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_one_array_of_all_nodes_takes_names_from_a_cell_and_the_clock_from_a_rate(tmp_path, version):
    path = write(tmp_path / "a.mat", CAPTURE, version)
    table = {"rate": "fs", "position": "trial.all", "nodes": "trial.names"}
    recording = brought(path, table)
    assert recording.body.node == NAMES
    assert np.array_equal(recording.motion.position, POSITION)
    assert np.allclose(recording.motion.time, TIME, rtol=1e-15)


def test_axes_of_an_array_are_put_in_order_and_a_fourth_coordinate_is_left(tmp_path):
    frames = np.concatenate([1000 * POSITION, np.ones((*POSITION.shape[:2], 1))], 2).transpose(1, 2, 0)
    savemat(tmp_path / "a.mat", {"labeled": frames})
    table = {
        "rate": RATE, "position": "labeled", "nodes": NAMES, "dims": ["node", "axis", "time"],
        "units": {"position": "mm"},
    }  # fmt: skip
    assert np.allclose(brought(tmp_path / "a.mat", table).motion.position, POSITION, rtol=1e-15)


def test_columns_and_structs_are_named_as_matlab_names_them(tmp_path):
    w_first = np.tile([0.6, 0.0, 0.8, 0.0], (len(TIME), 1))
    run = np.array([{"c": POSITION[:, 0]}, {"c": POSITION[:, 1]}])
    savemat(tmp_path / "a.mat", {"t": TIME[:, None], "q": w_first, "run": run})
    table = {"time": "t", "center": "run(2).c", "orientation": ["q(:,2)", "q(:,3)", "q(:,4)", "q(:,1)"]}
    body = {"total_mass": 1.0, "inertia": np.eye(3).tolist()}
    recording = brought(tmp_path / "a.mat", table, body=body)
    assert np.array_equal(recording.motion.center, POSITION[:, 1])
    assert recording.motion.orientation[0].tolist() == [0, 0.8, 0, 0.6]


def test_sensors_of_both_kinds_are_put_in_one_order_and_stand_either_way_up(tmp_path):
    turn = POSITION[:, :2]
    savemat(
        tmp_path / "a.mat", {"a1": SPECIFIC_FORCE.T, "a2": SPECIFIC_FORCE, "w1": turn[:, 0], "w2": turn[:, 1]}
    )
    table = {
        "rate": RATE,
        "specific_force": "a{name}",
        "angular_velocity": {"2": "w2", "1": "w1"},
        "units": {"angular_velocity": "deg/s"},
    }
    whole = {"total_mass": 1.0, "inertia": np.eye(3).tolist()}
    places = {"sensor_position": {"1": [0, 0, 0], "2": [1, 0, 0]}}
    motion = brought(tmp_path / "a.mat", table, body=whole | places).motion
    assert np.array_equal(motion.specific_force[:, 0], motion.specific_force[:, 1])
    assert np.allclose(motion.angular_velocity, np.deg2rad(turn), rtol=1e-14)


def test_a_magnetic_field_in_microtesla_comes_in_tesla(tmp_path):
    savemat(tmp_path / "a.mat", {"m": SPECIFIC_FORCE})
    table = {"rate": RATE, "magnetic_field": {"top": "m"}, "units": {"magnetic_field": "uT"}}
    motion = brought(
        tmp_path / "a.mat", table, body={"total_mass": 1.0, "inertia": np.eye(3).tolist()}
    ).motion
    assert np.allclose(motion.magnetic_field[:, 0], 1e-6 * SPECIFIC_FORCE, rtol=1e-14)


def test_displacements_start_from_the_places_of_the_body(tmp_path):
    savemat(tmp_path / "a.mat", {"t": TIME, **{f"u_{k}": v for k, v in MARKERS.items()}})
    places = {name: place.tolist() for name, place in zip(NAMES, SHAPE, strict=True)}
    table = {"time": "t", "displacement": "u_{name}"}
    recording = brought(tmp_path / "a.mat", table, body={"mass": MASS, "position": places})
    assert np.allclose(recording.motion.position, SHAPE + POSITION, rtol=1e-15)
    assert np.array_equal(recording.body.position, SHAPE)
    with pytest.raises(DataError, match=r"has no place of node 'nose' in m.*\[import\.body\] position"):
        brought(tmp_path / "a.mat", table)


TABLE = {"time": "t", "position": "trial.markers.{name}"}


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"time": "T"}, r"a\.mat has no variable 'T'; did you mean '"),
        ({"time": "trial.marker"}, "has no variable 'trial.marker'; did you mean 'trial.markers"),
        (
            {"position": "trial.marks.{name}"},
            r"has no variable like 'trial\.marks\.\{name\}'; did you mean 'trial",
        ),
        ({"position": "trial.{name}_{axis}"}, "has no variable like"),
        ({"time": "fs"}, "a.mat:fs has 1 samples, expected 40 as 'trial.markers"),
        ({"time": "trial.all"}, "trial.all is 40 x 4 x 3, expected one time a sample"),
        ({"time": None}, r"says no times of the samples; add import\.channels\.time = .* or rate"),
        ({"time": None, "rate": "t"}, "a.mat:t holds 40 numbers, expected one positive rate"),
        ({"position": {"nose": "t"}}, "a.mat:t is 40, expected 3 columns"),
        ({"position": {"nose": "trial.markers.nose(:,7)"}}, r"nose\(:,7\) is no part of an array of 40 x 3"),
        ({"position": "trial.all", "nodes": ["a"]}, "trial.all holds 4 nodes, expected 1"),
        (
            {"position": "trial.all", "nodes": "trial.name"},
            "has no list of names 'trial.name'; did you mean 'trial.names'",
        ),
        ({"position": "trial.all", "dims": ["time", "axis", "node"], "nodes": NAMES[:3]}, None),
        ({"position": "t"}, r"a\.mat:t is 40, expected time x node x axis"),
        ({"units": {"position": "furlong"}}, "has units 'furlong', expected 'm'"),
    ],
)
def test_settings_that_do_not_fit_the_variables_are_refused_in_one_line(tmp_path, version, more, message):
    path = write(tmp_path / "a.mat", CAPTURE, version)
    if message is None:  # four coordinates of three nodes: they fit, and are wrong only for whoever knows
        assert brought(path, TABLE | more, body={"mass": {"nose": 1.0}}).motion.position.shape == (40, 3, 3)
        return
    with pytest.raises(DataError, match=message) as error:
        brought(path, TABLE | more)
    assert "\n" not in str(error.value)


def test_settings_that_clash_are_refused(tmp_path):
    path = write(tmp_path / "a.mat", CAPTURE)
    with pytest.raises(ConfigError, match="unknown variable 'positon'; did you mean 'position'"):
        settings(TABLE | {"units": {"positon": "mm"}})
    with pytest.raises(ConfigError, match="expected time, node and axis, each once"):
        settings(TABLE | {"dims": ["time", "time", "axis"]})
    with pytest.raises(ConfigError, match=r"needs the table \[import\.channels\]"):
        import_sources([path], settings(None))
    with pytest.raises(ConfigError, match="names no variable, expected position"):
        brought(path, {"time": "t"})
    with pytest.raises(ConfigError, match="has position and displacement"):
        brought(path, TABLE | {"displacement": "trial.markers.{name}"})
    both = {"specific_force": {"a": "trial.markers.top"}, "angular_velocity": {"b": "trial.markers.top"}}
    with pytest.raises(ConfigError, match="has sensors a of specific_force but b of angular_velocity"):
        brought(path, TABLE | both)


def test_sparse_complex_and_text_variables_are_left_out(tmp_path):
    from scipy.sparse import eye_array

    savemat(
        tmp_path / "a.mat", {"s": eye_array(3).tocsc(), "z": np.array([1j]), "name": "toss", "n": np.int8(3)}
    )
    found = read_mat(tmp_path / "a.mat")
    assert list(found.values) == ["n"]
    assert found.label == {"name": ("toss",)}
    savemat(tmp_path / "b.mat", {"name": "toss"})
    with pytest.raises(DataError, match=r"b\.mat holds no variable of numbers"):
        brought(tmp_path / "b.mat", TABLE)


@pytest.mark.parametrize("version", ["4", "5", "7.2", "7.3"])
def test_a_mat_file_that_is_damaged_never_ends_in_another_error(tmp_path, version):
    whole = write(tmp_path / "whole.mat", CAPTURE, version).read_bytes()
    assert read_mat(tmp_path / "whole.mat").values
    rng = np.random.default_rng(0)
    path = tmp_path / "a.mat"
    refused = 0
    for k in range(40):
        data = bytearray(whole)
        if k % 2:
            del data[int(rng.integers(1, len(data))) :]
        else:
            data[int(rng.integers(min(len(data), 3000)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        said = refusal(lambda: read_mat(path))
        refused += said != ""
        assert not said or said.startswith(str(path))
    assert refused >= 10


@pytest.mark.parametrize("said", [None, b"", b"doublf", "double of another kind"])
def test_an_array_that_matlab_did_not_write_is_refused_for_its_axes_may_be_in_any_order(tmp_path, said):
    write(tmp_path / "a.mat", {"t": TIME, "all": POSITION}, "7.3")
    table = {"time": "t", "position": "all", "nodes": NAMES}
    assert np.array_equal(brought(tmp_path / "a.mat", table).motion.position, POSITION)
    with h5py.File(tmp_path / "a.mat", "r+") as f:
        del f["all"].attrs["MATLAB_class"]
        if said is not None:
            f["all"].attrs["MATLAB_class"] = np.bytes_(said) if isinstance(said, bytes) else said
    with pytest.raises(DataError, match=r"a\.mat:/all does not say that MATLAB wrote it"):
        brought(tmp_path / "a.mat", table)


def test_a_file_that_is_no_mat_file_is_refused(tmp_path):
    (tmp_path / "a.mat").write_text("t,x,y,z\n1,2,3,4\n" * 40)
    with pytest.raises(DataError, match=r"a\.mat is not a whole MAT file"):
        read_mat(tmp_path / "a.mat")
    with pytest.raises(
        DataError, match=r"no\.mat cannot be read \(no such file\); give the path of a MAT file"
    ):
        read_mat(tmp_path / "no.mat")


def test_a_v73_file_cannot_reach_out_swell_or_go_in_circles(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w") as f:
        f.create_dataset("t", data=TIME)
        f["out"] = h5py.ExternalLink("/etc/passwd", "/")
    with pytest.raises(DataError, match="is a link to another file"):
        read_mat(tmp_path / "a.mat")
    with h5py.File(tmp_path / "b.mat", "w") as f:
        f.create_dataset("t", (10**12,), "f8", chunks=(10**6,), fillvalue=1.0)
    with pytest.raises(DataError, match=r"b\.mat.*/t"):
        read_mat(tmp_path / "b.mat")
    with h5py.File(tmp_path / "c.mat", "w") as f:
        f["s/again"] = h5py.SoftLink("/s")
    with pytest.raises(DataError, match="nests structs more than 16 deep"):
        read_mat(tmp_path / "c.mat")
