import numpy as np
import pytest
from recordings import differences

import forceid
from forceid.errors import ConfigError, DataError
from forceid.files import read_result

TOP = "data/synthetic/top.h5"


@pytest.fixture(scope="module")
def tree():
    return forceid.open_motion(TOP)


@pytest.fixture(scope="module")
def result(tree):
    return tree.forceid.estimate(method="difference")


def test_a_tree_is_estimated_inspected_and_drawn_by_its_accessor(tree, result):
    same = forceid.estimate(tree, method="difference")
    assert np.array_equal(result["estimate/force"].values, same["estimate/force"].values, equal_nan=True)
    assert str(tree.forceid.inspect()).startswith("holds ")
    assert tree.forceid.inspect().nodes == tree.sizes.get("node", len(tree["body/node"]))
    assert len(result.forceid.plot().axes) == 6
    assert result.forceid.report().startswith("<!DOCTYPE html>")
    assert (result.forceid.summarize().force_error < 1e-3).all()


def test_a_motion_is_not_drawn_before_it_is_estimated(tree):
    with pytest.raises(DataError, match=r"is a motion, expected a result; .*tree.forceid.estimate\(\)"):
        tree.forceid.plot()


def test_a_table_of_a_result_has_its_numbers(result):
    table = result.forceid.to_dataframe()
    assert np.array_equal(table["moment_y"], result["estimate/moment"].values[:, 1], equal_nan=True)
    assert np.array_equal(table.index, result["estimate/time"])
    assert table.index.name == "time"
    assert not any(name.startswith("wrench_cov") for name in table.columns)
    cov = result.forceid.to_dataframe(variables=["wrench_cov"])
    wanted = result["estimate/wrench_cov"].values[:, 0, 5]
    assert np.array_equal(cov.iloc[:, 5], wanted, equal_nan=True)
    assert cov.shape[1] == 36


def test_a_table_of_a_motion_makes_the_same_motion(tree):
    tree = forceid.open_motion("data/synthetic/spinning_block.h5")
    table = tree.forceid.to_dataframe(variables=["position"])
    node = [str(name) for name in tree["body/node"].values]
    again = forceid.motion(
        table, columns="position_{name}_{axis}", mass=tree["body/mass"], shape=tree["body/position"],
        gravity=tree["motion"].attrs["gravity"],
    )  # fmt: skip
    assert list(again["body/node"].values) == node
    assert np.array_equal(again["motion/position"].values, tree["motion/position"].values, equal_nan=True)


def test_a_group_or_variable_that_is_not_there_is_named(result):
    with pytest.raises(DataError, match="no group 'motion'"):
        result.forceid.to_dataframe("motion")
    with pytest.raises(DataError, match=r"no variable 'forse' over time.*'force'"):
        result.forceid.to_dataframe(variables=["forse"])


def test_what_is_saved_is_read_as_it_was(tree, result, tmp_path):
    assert forceid.save(tree, tmp_path / "m.h5") == tmp_path / "m.h5"
    assert forceid.open_motion(tmp_path / "m.h5").identical(tree)
    result["estimate"].attrs["log_likelihood"] = 1.5  # NaN is not equal to itself
    result.forceid.save(tmp_path / "r.h5")
    result.to_netcdf(tmp_path / "x.h5", engine="h5netcdf")
    assert differences(read_result(tmp_path / "r.h5"), read_result(tmp_path / "x.h5")) == []
    with pytest.raises(ConfigError, match="cannot be written"):
        forceid.save(tree, tmp_path / "nowhere" / "m.h5")


def test_files_of_laboratories_are_imported_in_memory(tmp_path):
    rows = [f"{k / 100},{k},0,0,{k},1,0,{k},0,1" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["t,a x,a y,a z,b x,b y,b z,c x,c y,c z", *rows]))
    motions = forceid.import_(
        tmp_path / "a.csv", gravity=[0, 0, -9.81], csv={"time": "t", "position": "{name} {axis}"},
        body={"mass": {"a": 0.1, "b": 0.1, "c": 0.1}},
    )  # fmt: skip
    assert list(motions) == ["a"]
    assert motions["a"]["motion/position"].values[3].tolist() == [[3, 0, 0], [3, 1, 0], [3, 0, 1]]
    with pytest.raises(ConfigError, match="key 'gravity' is missing"):
        forceid.import_(tmp_path / "a.csv", title="x")
