"""Files too large to hold: the mean motion by blocks is that of the whole, and goes on where it stopped."""

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation import streaming
from forceid.estimation.run import estimate_recording
from forceid.estimation.streaming import read_recording
from forceid.files import blocks
from forceid.files.hdf5 import read_motion, write_motion
from forceid.motion.pose import fit_rotation
from forceid.records import Body, Motion, Recording

FRAMES, NODES, NOISE = 240, 40, 1e-3


@pytest.fixture(autouse=True)
def little(monkeypatch):
    """Everything is large here."""
    monkeypatch.setattr(blocks, "MANY", 8)
    monkeypatch.setattr(blocks, "BLOCK", 24 * NODES * 7)


def throw(gaps=True, bend=0.0, seed=0):
    """A body that turns under a constant force, its markers with noise."""
    rng = np.random.default_rng(seed)
    X, mass, t = rng.standard_normal((NODES, 3)), rng.random(NODES) + 0.1, np.arange(FRAMES) / 200
    X -= mass @ X / mass.sum()
    center = np.stack([t, 2 * t**2, -4.905 * t**2], 1)
    R = Rotation.from_rotvec(np.outer(t, [1.0, 2.0, 3.0])).as_matrix()
    x = center[:, None] + np.einsum("tab,tnb->tna", R, X * (1 + bend * np.sin(40 * t)[:, None, None]))
    x += NOISE * rng.standard_normal(x.shape)
    if gaps:
        x[rng.random((FRAMES, NODES)) < 0.05] = np.nan
        x[17] = np.nan
        x[18, 2:] = np.nan  # two nodes do not fix a turn
    body = Body(tuple(f"n{k}" for k in range(NODES)), X, mass)
    gravity = np.array([0.0, 0.0, -9.81])
    return Recording(body, Motion(t, x, gravity=gravity, noise_std={"position": NOISE}), {}, "a throw")


def written(path, recording, edit=None):
    write_motion(path, recording)
    if edit is not None:
        with h5py.File(path, "r+") as f:
            x, attrs = f["motion/position"][...], {"noise_std": f["motion/position"].attrs["noise_std"]}
            del f["motion/position"]
            edit(f, x, attrs)
    return path


def chunked(f, x, attrs):
    made = f.create_dataset("motion/position", data=x, chunks=(11, 9, 3), compression="gzip")
    made.attrs.update(attrs)


def tall(f, x, attrs):
    made = f.create_dataset("motion/position", data=x, chunks=(FRAMES, 1, 3))
    made.attrs.update(attrs)


def packed(f, x, attrs):
    """Millimeters in float32, with a fill value of its own and that of netCDF."""
    x = 1e3 * x
    lost = np.argwhere(np.isnan(x).all(2))
    for k, (frame, node) in enumerate(lost):
        x[frame, node] = -9999.0 if k % 2 else blocks.NC_FILL
    made = f.create_dataset("motion/position", data=x.astype("f4"))
    made.attrs.update({"units": "mm", "_FillValue": np.float32(-9999.0), "noise_std": 1e3 * NOISE})


@pytest.mark.parametrize(("edit", "digits"), [(None, 1e-12), (chunked, 1e-12), (tall, 1e-12), (packed, 1e-6)])
def test_blocks_of_every_layout_give_the_mean_motion_of_the_whole(tmp_path, edit, digits):
    recording = throw()
    found, left_out = read_recording(written(tmp_path / "a.h5", recording, edit), load_settings())
    body, motion = recording.body, recording.motion
    center, R = fit_rotation(motion.position, body.position, body.mass)
    whole = np.isfinite(motion.position).all(2).sum(1) > 2
    assert left_out is None
    assert not whole[17]
    assert not whole[18]
    assert found.motion.position is None
    assert np.isnan(found.motion.center[~whole]).all()
    assert np.isnan(found.motion.orientation[~whole]).all()
    assert np.abs(found.motion.center[whole] - center[whole]).max() < digits
    turned = Rotation.from_quat(found.motion.orientation[whole]).as_matrix()
    assert np.abs(turned - R[whole]).max() < digits
    assert found.body.total_mass == pytest.approx(body.mass.sum())
    assert found.motion.noise_std["center"] == pytest.approx(
        NOISE * np.sqrt((body.mass**2).sum()) / body.mass.sum()
    )
    assert found.title == "a throw"
    assert "mean motion of 40 nodes" in found.history


def test_stated_noise_of_the_mean_motion_is_what_it_has(tmp_path):
    errors = []
    for seed in range(12):
        path = written(tmp_path / "a.h5", throw(gaps=False, seed=seed))
        found, _ = read_recording(path, load_settings())
        t = found.motion.time
        center = np.stack([t, 2 * t**2, -4.905 * t**2], 1)
        turn = (
            Rotation.from_quat(found.motion.orientation) * Rotation.from_rotvec(np.outer(t, [1, 2, 3])).inv()
        )
        stated = found.motion.noise_std
        errors.append(
            [
                np.std(found.motion.center - center) / stated["center"],
                np.std(turn.as_rotvec()) / stated["orientation"],
            ]
        )
    assert np.mean(errors, axis=0) == pytest.approx([1.0, 1.0], rel=0.05)


def test_force_by_blocks_is_that_of_the_whole_within_its_claim(tmp_path, monkeypatch):
    path, settings = written(tmp_path / "a.h5", throw(gaps=False)), load_settings(model="rigid")
    whole = estimate_recording(read_motion(path), settings)
    found, _ = read_recording(path, settings)
    reduced = estimate_recording(found, settings)
    assert reduced.verdict.level != "refused"
    assert reduced.deformation.size == 0
    off = (reduced.force - whole.force) / whole.force_std
    assert np.sqrt((off[20:-20] ** 2).mean()) < 1.0


def test_a_pass_that_was_stopped_goes_on_from_its_checkpoint_to_the_same_bits(tmp_path, monkeypatch):
    path, kept = written(tmp_path / "a.h5", throw()), tmp_path / ".a.kept"
    at_once, _ = read_recording(path, load_settings())
    monkeypatch.setattr(streaming, "KEEP", 0.0)
    calls, plain = [], streaming.add

    def stopped(*args):
        calls.append(args[1])
        if len(calls) == 20:
            raise KeyboardInterrupt
        plain(*args)

    monkeypatch.setattr(streaming, "add", stopped)
    with pytest.raises(KeyboardInterrupt):
        read_recording(path, load_settings(), kept)
    assert (kept / streaming.SUMS).exists()
    later, _ = read_recording(path, load_settings(), kept)
    again, _ = read_recording(path, load_settings(), kept)  # nothing is left to do
    assert calls[20] == calls[19]  # the block that was not finished
    assert len(calls) == 1 + len(set(map(str, calls)))
    for name in ("center", "orientation"):
        assert np.array_equal(getattr(later.motion, name), getattr(at_once.motion, name), equal_nan=True)
        assert np.array_equal(getattr(again.motion, name), getattr(at_once.motion, name), equal_nan=True)


def test_a_checkpoint_of_another_file_or_a_torn_one_is_not_used(tmp_path):
    path, kept = written(tmp_path / "a.h5", throw()), tmp_path / ".a.kept" / streaming.SUMS
    kept.parent.mkdir()
    sums = streaming.Sums(np.ones((FRAMES, 4, 3)), np.ones((FRAMES, 4)))
    streaming.keep(kept, "another", 5, sums)
    assert streaming.restored(kept, "another", FRAMES)[0] == 5
    at_once, _ = read_recording(path, load_settings())
    for spoil in (lambda: None, lambda: kept.write_bytes(b"PK torn")):
        spoil()
        found, _ = read_recording(path, load_settings(), kept.parent)
        assert np.array_equal(found.motion.center, at_once.motion.center, equal_nan=True)


def test_a_body_that_deforms_is_told_of(tmp_path):
    _, left_out = read_recording(written(tmp_path / "a.h5", throw(bend=0.02)), load_settings())
    assert "beside a rigid body, their noise is 1 mm" in left_out


@pytest.mark.parametrize("settings", [{"model": "affine"}, {"model": "modal"}])
def test_a_model_that_deforms_is_refused_for_a_file_that_is_not_held(tmp_path, settings):
    path = written(tmp_path / "a.h5", throw())
    with pytest.raises(ConfigError, match="only its mean motion is estimated"):
        read_recording(path, load_settings(**settings))


def test_what_is_wrong_with_the_positions_is_told(tmp_path):
    def shape(f, x, attrs):
        f.create_dataset("motion/position", data=x[:, :-1])

    def infinite(f, x, attrs):
        x[3, 4] = np.inf
        f.create_dataset("motion/position", data=x)

    def lost(f, x, attrs):
        f.create_dataset("motion/position", data=np.full_like(x, np.nan))

    def noise(f, x, attrs):
        f.create_dataset("motion/position", data=x).attrs["noise_std"] = -1.0

    for edit, says in (
        (shape, r"/motion/position has shape \(240, 39, 3\)"),
        (infinite, "/motion/position holds infinite values"),
        (lost, "/motion/position shows no frame"),
        (noise, "/motion/position has noise_std -1"),
    ):
        with pytest.raises(DataError, match=says):
            read_recording(written(tmp_path / f"{edit.__name__}.h5", throw(), edit), load_settings())


def test_a_file_that_is_not_large_comes_with_every_node(tmp_path, monkeypatch):
    path = written(tmp_path / "a.h5", throw())
    monkeypatch.setattr(blocks, "MANY", NODES)
    found, left_out = read_recording(path, load_settings())
    assert found.motion.position.shape == (FRAMES, NODES, 3)
    assert left_out is None
