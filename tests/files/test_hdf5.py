import importlib.util
import os
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from recordings import differences, markers, mean_motion

from forceid.errors import ConfigError, DataError
from forceid.files.schema import BODY, ESTIMATE, HIDDEN, IMPULSE, INTERFACE, KNOWN_LOADS, LOAD, MODAL, MOTION
from forceid.files.stored import hdf5
from forceid.files.stored.atomic import atomic
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Body, Motion, Recording

CONTRACT = Path(__file__).parents[3] / "shared" / "contract_files.py"


@pytest.fixture(params=[markers, mean_motion], ids=["markers", "mean_motion"])
def recording(request):
    return request.param()


def test_a_recording_comes_back_as_it_was_written(tmp_path, recording):
    path = tmp_path / "a.h5"
    write_motion(path, recording)
    back = read_motion(path)
    assert differences(recording, back) == ["sha256"]
    assert back.sha256 == sha256(path.read_bytes()).hexdigest()
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


TEXT = st.characters(exclude_characters="\0", codec="utf-8")  # HDF5 strings end at a zero


@settings(deadline=None, derandomize=True, max_examples=30)
@given(
    data=st.data(),
    n=st.integers(3, 8),
    nodes=st.lists(st.text(TEXT, min_size=1), min_size=1, max_size=5, unique=True),
)
def test_any_numbers_that_can_be_and_names_survive(tmp_path_factory, data, n, nodes):
    finite = st.floats(-1e9, 1e9)
    m = len(nodes)
    recording = Recording(
        Body(tuple(nodes), data.draw(arrays(float, (m, 3), elements=finite)), np.ones(m)),
        Motion(np.arange(n) * 0.1, data.draw(arrays(float, (n, m, 3), elements=finite))),
        title=data.draw(st.text(TEXT)),
    )
    path = tmp_path_factory.mktemp("any") / "a.h5"
    write_motion(path, recording)
    assert differences(recording, read_motion(path)) == ["sha256"]


def test_truth_without_a_time_takes_that_of_the_motion(tmp_path):
    recording = replace(markers(), truth={"force": np.ones((20, 3)), "stretch": np.ones((20, 3, 3))})
    write_motion(tmp_path / "a.h5", recording)
    truth = read_motion(tmp_path / "a.h5").truth
    assert list(truth) == ["time", "force", "stretch"]
    assert np.array_equal(truth["time"], recording.motion.time)


@pytest.mark.parametrize("group", ["body", "motion", "truth"])
def test_h5py_xarray_and_netcdf4_see_the_same(tmp_path, group):
    path = tmp_path / "a.h5"
    write_motion(path, replace(mean_motion(), truth={"force": np.zeros((20, 3))}))
    with h5py.File(path) as f, netCDF4.Dataset(path) as d, xr.open_datatree(path, engine="h5netcdf") as t:
        assert f.attrs["Conventions"] == d.Conventions == t.attrs["Conventions"] == "CF-1.11"
        for name, variable in t[group].data_vars.items():
            item = f[group][name]
            assert len(variable.attrs["units"]) > 0
            assert len(variable.attrs["long_name"]) > 0
            assert all(len(dim) == 1 for dim in item.dims), f"{name} lacks a dimension scale"
            assert d[group][name].dimensions == variable.dims
            assert np.array_equal(item[()], variable.values)
            assert np.array_equal(np.asarray(d[group][name][...]), variable.values)
        assert t[group]["axis"].values.tolist() == d[group]["axis"][:].tolist() == ["x", "y", "z"]
        assert t[group]["axis"].dtype.kind == "U"
    with netCDF4.Dataset(path, "a") as d:  # only a file with creation order tracked can be added to
        d[group].createVariable("note", "f8", ("axis",))[:] = 1.0


def test_units_that_are_not_si_are_converted_with_their_noise(tmp_path):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    with h5py.File(path, "r+") as f:
        f["motion/position"].attrs["units"] = "mm"
        f["body/mass"].attrs["units"] = "g"
        f["motion/time"].attrs["units"] = np.bytes_(b"ms")
        del f["body/position"].attrs["units"]
    a, b = markers(), read_motion(path)
    assert np.allclose(b.motion.position, a.motion.position / 1000, rtol=1e-15, equal_nan=True)
    assert np.allclose(b.body.mass, a.body.mass / 1000, rtol=1e-15)
    assert np.allclose(b.motion.time, a.motion.time / 1000, rtol=1e-15)
    assert np.array_equal(b.body.position, a.body.position)
    assert b.motion.noise_std["position"] == pytest.approx(1e-6, rel=1e-15)


def test_packed_integers_and_fill_values_are_unpacked_as_netcdf_says(tmp_path):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    with netCDF4.Dataset(path, "a") as d:
        d["motion"].renameVariable("position", "old")
        packed = d["motion"].createVariable("position", "i2", ("time", "node", "axis"), fill_value=-9)
        packed.set_auto_maskandscale(False)
        packed[:] = 200
        packed[2, 1] = -9
        packed.setncatts({"scale_factor": 0.01, "add_offset": 1.0, "units": "m"})
    position = read_motion(path).motion.position
    assert np.isnan(position[2, 1]).all()
    assert np.nanmin(position) == np.nanmax(position) == pytest.approx(3.0)


def test_quaternions_come_out_with_unit_norm_and_w_positive(tmp_path):
    path, recording = tmp_path / "a.h5", mean_motion()
    q = recording.motion.orientation
    write_motion(path, replace(recording, motion=replace(recording.motion, orientation=-1.004 * q)))
    assert np.allclose(read_motion(path).motion.orientation, q, rtol=0, atol=1e-15)


def test_gravity_of_the_call_overrides_and_supplies_that_of_the_file(tmp_path):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    assert read_motion(path, (0.0, 0.0, -1.62)).motion.gravity.tolist() == [0, 0, -1.62]
    with h5py.File(path, "r+") as f:
        del f["motion"].attrs["gravity"]
    assert read_motion(path, (0, -9.8, 0)).motion.gravity.tolist() == [0, -9.8, 0]
    with pytest.raises(DataError, match=r"/motion lacks the attribute gravity.*`gravity`"):
        read_motion(path)


def test_nothing_is_left_of_a_write_that_fails(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("before")
    with pytest.raises(UnicodeEncodeError), atomic(path) as partial:
        partial.write_text("half, then \udcff", encoding="utf-8")
    assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]
    with pytest.raises(DataError, match="/foo is no variable of the contract"):
        write_motion(tmp_path / "b.h5", replace(markers(), truth={"foo": np.zeros(20)}))
    with pytest.raises(ConfigError, match="cannot be written"):
        write_motion(tmp_path / "nowhere" / "b.h5", markers())
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_a_file_that_changes_while_it_is_read_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    write_motion(path, markers())
    parse = hdf5.parse_recording

    def meddle(*args):
        os.utime(path, ns=(1, 1))
        return parse(*args)

    monkeypatch.setattr(hdf5, "parse_recording", meddle)
    with pytest.raises(DataError, match=r"a\.h5 changed while it was read"):
        read_motion(path)


@pytest.mark.skipif(not CONTRACT.exists(), reason="the contract's own writer is not beside the repository")
def test_files_written_with_h5py_alone_by_the_contract_are_read(tmp_path):
    spec = importlib.util.spec_from_file_location("contract_files", CONTRACT)
    contract = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(contract)
    for name, path in contract.samples(tmp_path).items():
        recording = read_motion(path)
        write_motion(tmp_path / "again.h5", recording)
        assert differences(recording, read_motion(tmp_path / "again.h5")) == ["sha256"], name


@pytest.mark.parametrize(
    "table", [BODY, MOTION, KNOWN_LOADS, ESTIMATE | HIDDEN | MODAL | IMPULSE, LOAD, INTERFACE]
)
def test_a_variable_with_the_name_of_a_dimension_measures_that_dimension_alone(table):
    dims = {dim for variable in table.values() for dim in variable.dims}
    assert all(table[name].dims == (name,) for name in dims & set(table))
