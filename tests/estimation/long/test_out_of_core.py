"""Files too large to hold: the first moments by blocks is that of the whole, and goes on where it stopped."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.long import out_of_core as streaming
from forceid.estimation.long.out_of_core import estimate_source, read_recording
from forceid.estimation.run import estimate_recording
from forceid.files.stored import blocks
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.motion.pose import fit_rotation
from forceid.principal.mass import mass_properties
from forceid.records import Body, Motion, Recording

FRAMES, NODES, NOISE = 240, 40, 1e-3


@pytest.fixture(autouse=True)
def little(monkeypatch):
    """Everything is large here."""
    monkeypatch.setattr(blocks, "STRETCH_BYTES", 24 * 8)
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
def test_four_markers_move_as_all_nodes_do_whatever_the_layout(tmp_path, edit, digits):
    recording = throw()
    found, left_out = read_recording(written(tmp_path / "a.h5", recording, edit), load_settings())
    body, x, four = recording.body, recording.motion.position, found.motion.position
    whole = np.isfinite(x).all((1, 2))
    center, R = fit_rotation(x, body.position, body.mass)
    assert left_out == ()
    assert four.shape == (FRAMES, 4, 3)
    assert np.isnan(four[[17, 18]]).all()  # nothing is seen, and two nodes
    assert np.isfinite(np.delete(four, [17, 18], axis=0)).all()
    for read, expected in zip(
        fit_rotation(four, found.body.position, found.body.mass), (center, R), strict=True
    ):
        assert np.abs(read - expected)[whole].max() < digits
        assert np.abs(read - expected)[19:].max() < 2 * NOISE  # other frames miss some nodes
    assert found.title == "a throw"
    assert "first moments of 40 nodes" in found.history


def test_four_markers_have_mass_center_inertia_and_first_moments_of_the_body(tmp_path):
    recording = throw(gaps=False, bend=0.02)  # whatever nodes do
    found, _ = read_recording(written(tmp_path / "a.h5", recording), load_settings())
    here, there = (mass_properties(r.body.mass, r.body.position) for r in (recording, found))
    assert there.mass == pytest.approx(here.mass)
    assert there.center == pytest.approx(here.center, abs=1e-12)
    assert there.inertia == pytest.approx(here.inertia)
    first = [
        np.einsum("n,tna,nb->tab", r.body.mass, r.motion.position, r.body.position)
        for r in (recording, found)
    ]
    assert np.abs(first[1] - first[0]).max() < 1e-11


def test_a_plane_body_keeps_its_plane_and_a_body_known_as_a_whole_its_inertia(tmp_path):
    recording = throw(gaps=False)
    plane = replace(recording.body, position=recording.body.position * [1.0, 1.0, 0.0])
    x = recording.motion.position[:, :1] + 0.0 * plane.position + plane.position
    flat = replace(recording, body=plane, motion=replace(recording.motion, position=x))
    found, _ = read_recording(written(tmp_path / "a.h5", flat), load_settings())
    assert np.abs(found.body.position[:, 2]).max() < 1e-12
    assert np.isfinite(found.motion.position).all()
    tensor = np.diag([3.0, 4.0, 5.0])
    body = replace(recording.body, mass=None, total_mass=7.0, inertia=tensor, mass_center=np.ones(3))
    found, _ = read_recording(written(tmp_path / "b.h5", replace(recording, body=body)), load_settings())
    inertia = inertia_of(found.body)
    assert inertia.mass == 7.0
    assert np.array_equal(inertia.tensor, tensor)
    assert np.array_equal(inertia.center, np.ones(3))


def test_stated_noise_of_the_four_markers_is_what_they_have(tmp_path):
    errors = []
    for seed in range(12):
        path = written(tmp_path / "a.h5", throw(gaps=False, seed=seed))
        found, _ = read_recording(path, load_settings())
        t = found.motion.time
        center = np.stack([t, 2 * t**2, -4.905 * t**2], 1)
        R = Rotation.from_rotvec(np.outer(t, [1, 2, 3])).as_matrix()
        true = center[:, None] + np.einsum("tab,kb->tka", R, found.body.position)
        errors.append(np.std(found.motion.position - true) / found.motion.noise_std["position"])
    assert np.mean(errors) == pytest.approx(1.0, rel=0.02)


@pytest.mark.long
def test_force_by_blocks_is_that_of_the_whole_within_its_claim(tmp_path, monkeypatch):
    path, settings = written(tmp_path / "a.h5", throw(gaps=False)), load_settings(model="rigid")
    whole = estimate_recording(read_motion(path), settings)
    found, _ = read_recording(path, settings)
    reduced = estimate_recording(found, settings)
    assert reduced.verdict.level != "refused"
    assert reduced.node == ("corner 1", "corner 2", "corner 3", "corner 4")
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
    assert np.array_equal(later.motion.position, at_once.motion.position, equal_nan=True)
    assert np.array_equal(again.motion.position, at_once.motion.position, equal_nan=True)


def test_a_checkpoint_of_another_file_or_a_torn_one_is_not_used(tmp_path):
    path, kept = written(tmp_path / "a.h5", throw()), tmp_path / ".a.kept" / streaming.SUMS
    kept.parent.mkdir()
    sums = streaming.Sums(np.ones((FRAMES, 4, 3)), np.ones((FRAMES, 4, 4)))
    streaming.keep(kept, "another", 5, sums)
    assert streaming.restored_sums(kept, "another", FRAMES)[0] == 5
    at_once, _ = read_recording(path, load_settings())
    for spoil in (lambda: None, lambda: kept.write_bytes(b"PK torn")):
        spoil()
        found, _ = read_recording(path, load_settings(), kept.parent)
        assert np.array_equal(found.motion.position, at_once.motion.position, equal_nan=True)


@pytest.mark.long
def test_a_body_that_stretches_is_followed_and_one_that_bends_is_told_of(tmp_path):
    path = written(tmp_path / "a.h5", throw(gaps=False, bend=0.02))
    estimate, _ = estimate_source(path, load_settings())
    assert estimate.model != "rigid"
    estimate, _ = estimate_source(path, load_settings(model="affine"))
    assert np.isfinite(estimate.first_moment).all()
    recording = throw()
    bent = recording.motion.position + 0.02 * (recording.body.position**2)[:, [1, 2, 0]]
    bending = replace(recording, motion=replace(recording.motion, position=bent))
    path = written(tmp_path / "b.h5", bending)
    _, left_out = read_recording(path, load_settings())
    assert "beside an affine body, with noise of 1 mm" in left_out[0].text
    estimate, _ = estimate_source(path, load_settings(method="savgol"))
    assert estimate.verdict.level == "degraded"
    assert left_out[0] in estimate.verdict.findings


def test_modes_are_refused_for_a_file_that_is_not_held(tmp_path):
    path = written(tmp_path / "a.h5", throw())
    with pytest.raises(ConfigError, match="too large to be held as single nodes"):
        read_recording(path, load_settings(model="modal"))


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
    monkeypatch.setattr(blocks, "STRETCH_BYTES", 24 * NODES * FRAMES)
    found, left_out = read_recording(path, load_settings())
    assert found.motion.position.shape == (FRAMES, NODES, 3)
    assert left_out == ()
