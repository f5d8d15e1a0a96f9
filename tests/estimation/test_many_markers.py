"""Bodies that carry more markers than a marker set: meshes that cameras match, nodes of finite elements."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.deformation_residual import beyond_rigid, looks
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.tracks.marker_errors import marker_errors
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

MEGA, MASS, NOISE, FORCE = 1e6, 1.0, 3e-4, np.array([2.0, -1.0, 0.5])


def flown(nodes, frames, seed, marked=None):
    """A body of many nodes that turns under a steady force, without weight; all or so many carry markers."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(-0.15, 0.15, (nodes, 3))
    at -= at.mean(0)
    time = np.arange(frames) / 100
    R = Rotation.from_rotvec(time[:, None] * np.array([0.0, 0.0, 3.0])).as_matrix()
    center = 0.5 * time[:, None] ** 2 * FORCE / MASS
    x = np.einsum("tab,nb->tna", R, at) + center[:, None] + NOISE * rng.standard_normal((frames, nodes, 3))
    if marked is not None:
        x[:, marked:] = np.nan
    names = tuple(f"n{k}" for k in range(nodes))
    body = Body(names, at, np.full(nodes, MASS / nodes))
    return Recording(body, Motion(time, x, gravity=np.zeros(3), noise_std={"position": NOISE}))


@pytest.mark.long
@pytest.mark.parametrize("marked", [None, 20])
def test_memory_grows_as_the_number_of_nodes_and_not_as_its_square(marked):
    peak = {}
    for nodes in (500, 1500):
        recording = flown(nodes, 40, 1, marked)
        tracemalloc.start()
        estimate_recording(recording, load_settings())
        peak[nodes] = tracemalloc.get_traced_memory()[1] / MEGA
        tracemalloc.stop()
    assert peak[1500] < 3.5 * peak[500]
    assert peak[1500] < 8 * (4500**2) / MEGA  # of one matrix of its coordinates


@pytest.mark.parametrize("seed", range(3))
def test_many_markers_tell_the_mass_center_by_the_root_of_their_number(seed):
    recordings = [flown(nodes, 60, seed) for nodes in (20, 500)]
    for recording in recordings:
        found = estimate_recording(recording, load_settings())
        over = (found.force - FORCE) / np.sqrt(np.diagonal(found.wrench_cov, axis1=1, axis2=2)[:, :3])
        assert np.sqrt((over[6:-6] ** 2).mean()) < 2.0
    few, many = (kinematics(r.body, r.motion, load_settings()).pose.cov[:, :3, :3] for r in recordings)
    np.testing.assert_allclose(few, 25 * many, atol=1e-3 * few.max())


@pytest.mark.parametrize("nodes", [4, 64, 65, 500, 4096])
def test_looks_take_every_marker_once_and_none_is_a_line_of_a_grid(nodes):
    groups = looks(np.ones(nodes, bool))
    assert (np.sum(groups, 0) == 1).all()
    assert max(int(g.sum()) for g in groups) < 72
    side = int(np.sqrt(nodes))
    grid = np.stack(np.divmod(np.arange(nodes), side), 1).astype(float)
    for group in groups:
        spread = np.linalg.svd(grid[group] - grid[group].mean(0), compute_uv=False)
        assert spread[1] > 0.1 * spread[0] or nodes < 6


def test_a_look_shows_the_errors_that_all_markers_have():
    recording = flown(400, 200, 7)
    kin = kinematics(recording.body, recording.motion, load_settings())
    for group in looks(kin.seen)[:3]:
        shown = beyond_rigid(kin.time, recording.motion.position, kin, group)
        errors = marker_errors(shown.time, shown.y)
        assert errors.std == pytest.approx(NOISE, rel=4 * errors.relative)
        assert errors.color is None
