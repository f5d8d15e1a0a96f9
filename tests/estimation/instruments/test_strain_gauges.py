"""Strain gauges: what they tell of the deformation, what they cannot, and what is refused."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest

from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.files.validate import check_recording

BREATH, BIAS, FINE = 0.05, 4e-3, 2e-5


def between(position, *pairs):
    """Strain shapes (gauge, node, 3) of gauges that run from one node to another."""
    shape = np.zeros((len(pairs), *position.shape))
    for g, (a, b) in enumerate(pairs):
        along = position[b] - position[a]
        shape[g, b], shape[g, a] = along / (along @ along), -along / (along @ along)
    return shape


def gauged(breath=BREATH, read=None, seed=0):
    """A breathing star with gauges through its center, each with a bias; read: what they read instead."""
    recording = cf.toss(breath=breath, noise=3e-3, seed=seed)
    time = recording.motion.time
    strain = np.tile(cf.size_at(time, breath)[:, None] - 1, 3) if read is None else read
    strain = (
        strain
        + BIAS * np.arange(1, 4)
        + FINE * np.random.default_rng(seed + 1).standard_normal((len(time), 3))
    )
    X = recording.body.position
    body = replace(recording.body, mode_shape=X[None], strain_shape=between(X, (3, 0), (4, 1), (5, 2)))
    motion = replace(recording.motion, strain=strain, noise_std=recording.motion.noise_std | {"strain": FINE})
    return replace(recording, body=body, motion=motion)


def bare(recording):
    return replace(recording, motion=replace(recording.motion, strain=None))


def breathing_error(recording, estimate):
    """Rms error of the size of the body about its mean."""
    X = recording.body.position
    size = np.einsum("tna,na->t", estimate.deformation, X) / (X**2).sum()
    wanted = cf.size_at(recording.motion.time, BREATH)
    return cf.rms((size - size.mean()) - (wanted - wanted.mean()))


def solved(recording, **settings):
    return estimate_recording(recording, load_settings(model="modal", **settings))


@pytest.fixture(scope="module")
def pair():
    recording = gauged()
    return recording, solved(recording), solved(bare(recording))


def test_gauges_show_the_deformation_that_noisy_markers_hide(pair):
    recording, with_gauges, without = pair
    assert breathing_error(recording, with_gauges) < 0.2 * breathing_error(recording, without)
    assert not [code for code in with_gauges.verdict.codes if code.startswith("strain-")]


def test_wrench_with_gauges_is_no_worse_and_as_good_as_claimed(pair):
    recording, with_gauges, without = pair
    for name in ("force", "moment"):
        error, other = (getattr(e, name) - recording.truth[name] for e in (with_gauges, without))
        assert cf.rms(error[15:-15]) < 1.05 * cf.rms(other[15:-15])
        assert np.mean(np.abs(error) < 2.6 * getattr(with_gauges, f"{name}_std")) > 0.95


def test_gauges_that_read_what_no_mode_does_are_said():
    noise = 1e-3 * np.random.default_rng(8).standard_normal((120, 3))
    assert "strain-innovations" in solved(gauged(read=noise)).verdict.codes


def test_gauges_without_their_shape_or_on_a_rigid_body_are_said_to_be_of_no_use():
    recording = gauged()
    lost = replace(recording, body=replace(recording.body, strain_shape=None))
    assert "strain-shape-missing" in solved(lost).verdict.codes
    stiff = estimate_recording(recording, load_settings(model="rigid"))
    assert "strain-without-modes" in stiff.verdict.codes


@pytest.mark.parametrize("rigid", ["translation", "rotation"])
def test_gauge_that_reads_a_rigid_motion_is_refused(rigid):
    recording = gauged()
    shape = recording.body.strain_shape.copy()
    if rigid == "translation":
        shape[1, 1] *= 1.01
    else:
        turned = np.cross([0.0, 0.0, 0.01], recording.body.position[4] - recording.body.position[1])
        shape[1, 4] += turned
        shape[1, 1] -= turned
    with pytest.raises(DataError, match=f"gauge 1 read a {rigid}"):
        check_recording(replace(recording, body=replace(recording.body, strain_shape=shape)))


def test_strain_and_its_shape_live_in_a_file(tmp_path):
    recording = gauged()
    write_motion(tmp_path / "gauged.h5", recording)
    back = read_motion(tmp_path / "gauged.h5")
    np.testing.assert_array_equal(back.body.strain_shape, recording.body.strain_shape)
    np.testing.assert_array_equal(back.motion.strain, recording.motion.strain)
