"""An output takes the place of nothing that this program did not make, unless it is told to."""

import os

import h5py
import pytest
from recordings import estimate, markers

from forceid.errors import ConfigError, DataError
from forceid.files.result import write_result
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.files.stored.outputs import check_output, kind_of_file


def test_what_this_program_made_is_known_by_what_it_holds(tmp_path):
    write_motion(tmp_path / "m.h5", markers())
    write_result(tmp_path / "r.h5", estimate())
    (tmp_path / "t.h5").write_text("estimate")
    with h5py.File(tmp_path / "hand.h5", "w") as f:
        f.create_group("motion")
    names = ("m.h5", "r.h5", "t.h5", "hand.h5")
    assert [kind_of_file(tmp_path / name) for name in names] == ["motion", "result", "", ""]


def test_a_result_may_replace_a_result_and_force_may_replace_any_file(tmp_path):
    path = tmp_path / "r.h5"
    check_output(path, "result")
    write_result(path, estimate())
    check_output(path, "result")
    path.write_text("hours of work")
    with pytest.raises(ConfigError, match="exists already and is another file, expected a result of forceid"):
        check_output(path, "result")
    check_output(path, "result", force=True)


def test_no_force_makes_an_input_or_a_device_an_output(tmp_path):
    path, other = tmp_path / "m.h5", tmp_path / "same.h5"
    write_motion(path, markers())
    os.link(path, other)
    with pytest.raises(ConfigError, match="is both input and output"):
        check_output(other, "motion", [path], force=True)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(ConfigError, match="is a device, a pipe or a socket"):
        check_output(tmp_path / "fifo", "result", force=True)
    with pytest.raises(ConfigError, match="is a folder"):
        check_output(tmp_path, "result", force=True)
    with pytest.raises(ConfigError, match="is no file that could be replaced"):
        write_motion(tmp_path / "fifo", markers())


def test_a_name_longer_than_the_system_takes_is_told_as_such(tmp_path):
    with pytest.raises(ConfigError, match="cannot be written"):
        write_motion(tmp_path / f"{'m' * 300}.h5", markers())


def test_a_link_is_replaced_only_by_force_and_what_it_names_stays(tmp_path):
    (tmp_path / "link.h5").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ConfigError, match="is a link"):
        check_output(tmp_path / "link.h5", "motion")
    check_output(tmp_path / "link.h5", "motion", force=True)


@pytest.mark.parametrize("target", [h5py.ExternalLink("other.h5", "/motion"), h5py.SoftLink("/hop")])
def test_a_group_that_lies_in_another_file_is_refused(tmp_path, target):
    write_motion(tmp_path / "other.h5", markers())
    write_motion(tmp_path / "m.h5", markers())
    with h5py.File(tmp_path / "m.h5", "r+") as f:
        del f["motion"]
        f["hop"] = h5py.ExternalLink("other.h5", "/motion")
        f["motion"] = target
    with pytest.raises(DataError, match="/motion is a link to another file"):
        read_motion(tmp_path / "m.h5")


def test_a_link_to_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    write_motion(tmp_path / "m.h5", markers())
    with h5py.File(tmp_path / "m.h5", "r+") as f:
        del f["motion/position"]
        f["motion/position"] = h5py.ExternalLink(str(tmp_path / "fifo"), "/x")
    with pytest.raises(DataError, match="/motion/position is a link to another file"):
        read_motion(tmp_path / "m.h5")
