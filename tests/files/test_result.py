import importlib.util
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from recordings import differences, estimate, markers

from forceid.errors import DataError
from forceid.files.result import read_result, read_truth, write_result
from forceid.files.stored.hdf5 import write_motion
from forceid.files.tree import tree_from_estimate
from forceid.records import Verdict

CONTRACT = Path(__file__).parents[3] / "shared" / "contract_files.py"


@pytest.mark.parametrize(
    "result",
    [
        estimate(),
        estimate(nodes=0, modes=0, loads=False),
        replace(
            estimate(), verdict=Verdict(), tuned={}, settings="", log_likelihood=float("nan"), stretch=None
        ),
    ],
    ids=["full", "no nodes", "bare"],
)
def test_an_estimate_comes_back_as_it_was_written(tmp_path, result):
    write_result(tmp_path / "a.h5", result, markers())
    back = read_result(tmp_path / "a.h5")
    assert [
        n for n in differences(result, back) if not (n == "log_likelihood" and np.isnan(back.log_likelihood))
    ] == []


def test_the_truth_of_the_input_stands_in_the_result(tmp_path):
    write_result(tmp_path / "a.h5", estimate(), markers())
    truth = read_truth(tmp_path / "a.h5")
    assert np.array_equal(truth["force"], markers().truth["force"])
    assert np.array_equal(truth["time"], markers().truth["time"])
    write_result(tmp_path / "b.h5", estimate())
    assert read_truth(tmp_path / "b.h5") == {}


def test_xarray_and_netcdf4_open_every_group_of_a_result(tmp_path):
    path = tmp_path / "a.h5"
    write_result(path, estimate(), markers())
    with xr.open_datatree(path, engine="h5netcdf") as t, netCDF4.Dataset(path) as d:
        assert t.identical(tree_from_estimate(estimate(), markers()))
        assert set(d.groups) == {"estimate", "load", "truth"}
        assert t["estimate"].attrs["verdict"] == d["estimate"].verdict == "degraded"
        assert t["estimate"].attrs["tuned_noise"] == 1e-3
        assert t["estimate/force_std"].dims == ("time", "axis")
        assert t["load/load"].sel(load_name="drag").shape == (20,)
        assert d["estimate"]["wrench_cov"].dimensions == ("time", "wrench", "wrench_2")


def test_a_result_whose_clock_goes_back_is_refused(tmp_path):
    result = estimate()
    write_result(tmp_path / "a.h5", replace(result, time=result.time[::-1]))
    with pytest.raises(DataError, match=r"/estimate/time goes from .* expected strictly increasing"):
        read_result(tmp_path / "a.h5")


def test_a_result_with_rotations_that_are_none_is_refused(tmp_path):
    result = estimate()
    write_result(tmp_path / "a.h5", replace(result, orientation=1e300 * result.orientation))
    with pytest.raises(DataError, match=r"/estimate/orientation has .* quaternions off unit norm"):
        read_result(tmp_path / "a.h5")


def test_a_motion_file_is_no_result(tmp_path):
    write_motion(tmp_path / "a.h5", markers())
    with pytest.raises(DataError, match=r"a\.h5:/estimate is missing.*`forceid estimate`"):
        read_result(tmp_path / "a.h5")


@pytest.mark.skipif(not CONTRACT.exists(), reason="the contract's own checker is not beside the repository")
def test_the_checker_of_the_contract_has_no_complaint(tmp_path):
    spec = importlib.util.spec_from_file_location("contract_files", CONTRACT)
    contract = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(contract)
    write_result(tmp_path / "a.h5", estimate(), markers())
    assert contract.check_result(tmp_path / "a.h5") == []
