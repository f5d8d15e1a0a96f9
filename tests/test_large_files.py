"""A file too large to hold, on the command line: estimated in blocks and stretches, and stopped there."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.cli.app import main
from forceid.cli.estimate import kept_of
from forceid.estimation.long import out_of_core as streaming
from forceid.estimation.long import windows as stretches
from forceid.files.stored import blocks, heap
from forceid.files.stored.hdf5 import write_motion
from forceid.records import Body, Motion, Recording

FRAMES, NODES, NOISE = 400, 30, 1e-3
FORCE = np.array([0.0, 4.0, -0.5])
QUICK = ["--method", "savgol"]


@pytest.fixture
def large(tmp_path, monkeypatch):
    """A recording that counts as large here, of a body under a constant force."""
    monkeypatch.setattr(blocks, "STRETCH_BYTES", 24 * 8)
    monkeypatch.setattr(blocks, "BLOCK", 24 * NODES * 50)
    monkeypatch.setattr(stretches, "LONG", 270)
    monkeypatch.setattr(stretches, "MARGIN", 60)
    rng = np.random.default_rng(0)
    X, t = rng.standard_normal((NODES, 3)), np.arange(FRAMES) / 200
    X -= X.mean(0)
    gravity = np.array([0.0, 0.0, -9.81])
    R = Rotation.from_rotvec(np.outer(t, [1.0, 2.0, 3.0])).as_matrix()
    x = 0.5 * np.outer(t**2, FORCE / 2.0 + gravity)[:, None] + np.einsum("tab,nb->tna", R, X)
    x += NOISE * rng.standard_normal(x.shape)
    body = Body(tuple(f"n{k}" for k in range(NODES)), X, np.full(NODES, 2.0 / NODES))
    path = tmp_path / "long.h5"
    write_motion(path, Recording(body, Motion(t, x, gravity=gravity, noise_std={"position": NOISE})))
    return path


def test_it_is_estimated_by_the_same_command_and_says_how_far_it_is(large, monkeypatch, capsys):
    monkeypatch.setattr(heap, "GIGABYTE", 20_000)
    monkeypatch.setattr(streaming, "GIGABYTE", 20_000)
    monkeypatch.setattr(heap, "_BLOCK", 5_000)
    assert main(["estimate", str(large), *QUICK]) == 0
    said = capsys.readouterr()
    gigabytes = large.stat().st_size // 20_000
    assert f"forceid: {gigabytes - 1} of {gigabytes} GB checked" in said.err
    assert "forceid: 7 of 8 blocks" in said.err
    assert "forceid: 2 of 3 stretches" in said.err
    with h5py.File(large.with_suffix(".result.h5")) as f:
        force = f["estimate/force"][...]
        assert "first moments of 30 nodes, in blocks" in f.attrs["history"]
    assert np.nanmean(force, axis=0) == pytest.approx(FORCE, abs=0.05)
    assert sorted(p.name for p in large.parent.iterdir()) == ["long.h5", "long.result.h5"]


def test_a_pose_beside_the_markers_is_said_to_be_left_out(large, capsys):
    with h5py.File(large, "r+") as f:
        t, x = f["motion/time"][...], f["motion/position"][...]
        turn = Rotation.from_rotvec(np.outer(t, [1.0, 2.0, 3.0])).as_quat(canonical=True)
        for name, value, unit in (("center", x.mean(1), "m"), ("orientation", turn, "1")):
            f[f"motion/{name}"] = value
            f[f"motion/{name}"].attrs["units"] = unit
    assert main(["estimate", str(large), *QUICK]) == 0
    with h5py.File(large.with_suffix(".result.h5")) as f:
        assert "pose-not-compared" in np.atleast_1d(f["estimate"].attrs["reason_codes"])


@pytest.mark.long
def test_stopped_in_the_pass_or_in_the_smoother_it_goes_on_to_the_same_bits(large, monkeypatch, capsys):
    output = large.with_suffix(".result.h5")
    assert main(["estimate", str(large), *QUICK]) == 0
    with h5py.File(output) as f:
        at_once = f["estimate/force"][...], f["estimate/wrench_cov"][...]
    output.unlink()
    monkeypatch.setattr(streaming, "KEEP", 0.0)
    done: dict[str, int] = {"add": 0, "estimate_recording": 0}
    for room, name, stop in ((streaming, "add", 5), (stretches, "estimate_recording", 2)):
        plain = getattr(room, name)

        def stopped(*args, name=name, stop=stop, plain=plain):
            done[name] += 1
            if done[name] == stop:
                raise KeyboardInterrupt
            return plain(*args)

        monkeypatch.setattr(room, name, stopped)
    for _ in range(2):
        assert main(["estimate", str(large), *QUICK]) == 130
        assert kept_of(output).is_dir()
        assert not output.exists()
    assert main(["estimate", str(large), *QUICK]) == 0
    assert done == {"add": 8 + 1, "estimate_recording": 3 + 1}  # what was stopped, and nothing else, twice
    with h5py.File(output) as f:
        later = f["estimate/force"][...], f["estimate/wrench_cov"][...]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(at_once, later, strict=True))
    assert not kept_of(output).exists()
    assert "Traceback" not in capsys.readouterr().err


def test_what_is_wrong_with_it_leaves_nothing_behind(large, capsys):
    with h5py.File(large, "r+") as f:
        f["motion/position"][3, 4] = np.inf
    assert main(["estimate", str(large), *QUICK]) == 3
    assert "/motion/position holds infinite values" in capsys.readouterr().err
    assert [p.name for p in large.parent.iterdir()] == ["long.h5"]


def test_a_folder_that_is_not_there_is_one_line(large, tmp_path, capsys):
    assert main(["estimate", str(large), "-o", str(tmp_path / "no" / "r.h5"), *QUICK]) == 2
    assert "cannot be made (No such file or directory)" in capsys.readouterr().err


def test_frames_too_many_to_be_smoothed_at_once_are_taken_by_stretches(large, monkeypatch, capsys):
    monkeypatch.setattr(blocks, "STRETCH_BYTES", 24 * NODES * FRAMES)
    assert main(["estimate", str(large), *QUICK]) == 0
    said = capsys.readouterr()
    assert "blocks" not in said.err
    assert "forceid: 2 of 3 stretches" in said.err
    with h5py.File(large.with_suffix(".result.h5")) as f:
        assert f["estimate/deformation"].shape == (FRAMES, NODES, 3)
        assert np.nanmean(f["estimate/force"], axis=0) == pytest.approx(FORCE, abs=0.05)
