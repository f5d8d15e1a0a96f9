"""Errors of segments as the gaps at their joints show them, on drawn persons."""

import numpy as np
import pytest

from evidence.drawn.records.person import Skin, person
from forceid.estimation.body.segments.joint_gaps import joint_gaps, segment_poses
from forceid.estimation.body.segments.segment_noise import covariance, segment_noise

STILL = Skin(shared=0.0, own=0.0, white=0.0)


def test_segments_without_errors_have_no_gaps_though_their_joints_are_misplaced():
    recording = person(0, "walk", skin=STILL)
    gaps = joint_gaps(recording.body, segment_poses(recording.body, recording.motion))
    assert np.abs(gaps).max() < 1e-3
    assert np.sqrt((gaps**2).mean()) < 2e-4


def test_variances_and_what_neighbors_have_in_common_are_found_from_gaps():
    rng = np.random.default_rng(1)
    sides = np.array([[-1.0, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]])
    for _ in range(20):
        own = np.diag(rng.uniform(1, 9, 4))
        own[1, 2] = own[2, 1] = rng.uniform(0, 0.8)
        assert np.allclose(covariance(sides, sides @ own @ sides.T), own, rtol=0.02, atol=0.05)


def test_a_segment_without_a_joint_errs_as_the_mean_of_the_others():
    sides = np.array([[-1.0, 1, 0]])
    found = covariance(sides, np.array([[4.0]]))
    assert np.isclose(found[2, 2], (found[0, 0] + found[1, 1]) / 2)


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
