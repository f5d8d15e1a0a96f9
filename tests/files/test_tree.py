from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from recordings import differences, markers, mean_motion

import forceid
from forceid.errors import DataError
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.files.tree import open_motion, recording_from_tree, tree_from_recording


@pytest.mark.parametrize("make", [markers, mean_motion])
def test_the_tree_is_what_xarray_shows_of_the_file(tmp_path, make):
    path = tmp_path / "a.h5"
    write_motion(path, make())
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        assert forceid.open_motion(path).identical(tree)
        assert differences(recording_from_tree(tree), make()) == ["sha256"]
    assert differences(recording_from_tree(open_motion(path)), read_motion(path)) == ["sha256"]


def test_a_tree_saved_by_xarray_is_a_motion_file(tmp_path):
    tree_from_recording(markers()).to_netcdf(tmp_path / "a.h5", engine="h5netcdf")
    assert differences(read_motion(tmp_path / "a.h5"), markers()) == ["sha256"]


def test_the_hash_of_a_tree_follows_its_numbers_and_not_its_title():
    a = recording_from_tree(tree_from_recording(markers())).sha256
    b = recording_from_tree(tree_from_recording(replace(markers(), title="other"))).sha256
    moved = tree_from_recording(markers())
    moved["motion/position"][0, 0, 0] += 1e-9
    c = recording_from_tree(moved).sha256
    d = recording_from_tree(tree_from_recording(markers()), gravity=(0, 0, -1.62)).sha256
    assert a == b
    assert len({a, c, d}) == 3


def test_a_tree_is_checked_like_a_file():
    tree = tree_from_recording(markers())
    tree["motion"].attrs.pop("gravity")
    with pytest.raises(DataError, match="tree:/motion lacks the attribute gravity"):
        recording_from_tree(tree)
    tree = tree_from_recording(markers())
    tree["motion/position"] = tree["motion/position"].astype(complex)
    with pytest.raises(DataError, match="tree:/motion/position holds complex numbers"):
        recording_from_tree(tree)
    tree = tree_from_recording(markers())
    tree["motion"] = tree["motion"].to_dataset().assign_coords(time=np.zeros(20))
    with pytest.raises(DataError, match="tree:/motion/time goes from 0 to 0 s"):
        recording_from_tree(tree)


def test_a_tree_in_other_units_stays_as_it_is_when_it_is_read():
    tree = tree_from_recording(markers())
    tree["motion/position"] = 1e3 * tree["motion/position"]
    tree["motion/position"].attrs["units"] = "mm"
    before = tree["motion/position"].values.copy()
    assert np.nanmax(np.abs(1e3 * recording_from_tree(tree).motion.position - before)) < 1e-9
    assert np.array_equal(tree["motion/position"].values, before, equal_nan=True)
