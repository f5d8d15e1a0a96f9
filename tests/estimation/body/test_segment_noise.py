"""Errors of segments as the gaps at their joints show them, on drawn persons."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.drawn.records.person import Skin, person
from forceid.estimation.body.segment_noise import joint_gaps, segment_noise, segment_poses

STILL = Skin(shared=0.0, own=0.0, white=0.0)


def test_segments_without_errors_have_no_gaps_though_their_joints_are_misplaced():
    recording = person(0, "walk", skin=STILL)
    gaps = joint_gaps(recording.body, segment_poses(recording.body, recording.motion))
    assert np.abs(gaps).max() < 1e-3
    assert np.sqrt((gaps**2).mean()) < 2e-4


def test_segments_that_err_alike_are_told_their_variance_though_one_joint_is_badly_placed():
    recording = person(2, "walk", skin=Skin(neighbor=0.0, burst=0.0))
    poses = segment_poses(recording.body, recording.motion)
    plain = segment_noise(recording.body, recording.motion.time, poses)
    shape = recording.body.joint_shape.copy()
    shape[0] += 0.1
    off = segment_noise(replace(recording.body, joint_shape=shape), recording.motion.time, poses)
    assert np.allclose(off.var, plain.var, rtol=0.5)
    assert off.most > plain.most > 1


def test_errors_are_larger_where_a_landing_shakes_the_skin():
    recording = person(1, "jump", skin=Skin(burst=0.95))
    noise = segment_noise(
        recording.body, recording.motion.time, segment_poses(recording.body, recording.motion)
    )
    push = np.linalg.norm(recording.truth["force"], axis=1)
    shaken, quiet = push > np.quantile(push, 0.9), push < np.median(push)
    assert noise.size[shaken].mean() > noise.size[quiet].mean()


@pytest.mark.long
@pytest.mark.parametrize("task", ["walk", "run", "squat", "jump"])
def test_a_filter_that_tracks_went_through_is_told_by_their_gaps_to_a_third_of_its_cut(task):
    """Butterworth's of order 2, both ways, which let half of the power pass at `cut`; raw ones none."""

    def source(seed, cut):
        drawn = person(seed, task, skin=Skin(cut=cut))
        return segment_noise(drawn.body, drawn.motion.time, segment_poses(drawn.body, drawn.motion)).source

    for seed, cut in ((740, 6.0), (741, 12.0)):
        assert source(seed, cut).cut == pytest.approx(cut / 0.802, rel=1 / 3)
        assert source(seed, 0.0) is None


@pytest.mark.long
@pytest.mark.parametrize("task", ["walk", "run", "squat", "jump"])
def test_the_error_of_the_mass_center_is_told_to_a_half(task):
    """From 2 to 15 Hz, in the geometric mean over persons and axes, neighbors alike in part or not."""
    ratios = []
    for seed in range(8):
        for neighbor in (0.0, 0.3):
            shaken = person(seed, task, skin=Skin(neighbor=neighbor))
            plain = person(seed, task, skin=STILL)
            mass, n = shaken.body.mass, len(shaken.motion.time)
            off = np.einsum("n,tna->ta", mass / mass.sum(), shaken.motion.position - plain.motion.position)
            noise = segment_noise(shaken.body, shaken.motion.time, segment_poses(shaken.body, shaken.motion))
            f = np.fft.rfftfreq(n, 0.01)
            band = (f > 2) & (f < 15)
            power = 2 * (np.abs(np.fft.rfft(off, axis=0)[band]) ** 2).sum(0) / n**2
            claim = np.diag(noise.of_center(mass)) * 2 * noise.color.density(2 * np.pi * f[band]).sum() / n
            ratios.append(np.sqrt(power / claim))
    assert 0.67 < np.exp(np.log(ratios).mean()) < 1.5
