from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.deformation_residual import errors_beyond
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.run import estimate_recording
from forceid.motion.frames import fit_pose, through_fit
from forceid.motion.pose import log
from forceid.records import Body, Motion, Recording

MASS, GRAVITY = 2.0, np.array([0.0, -9.81, 0.0])
RECORDS = 3


def thrown(seed, third):
    """A mass center that moves in the plane under drawn loads, noise on the third axis times `third`."""
    rng = np.random.default_rng(seed)
    rate, sigma = rng.uniform(60, 400), 1e-3 * rng.uniform(0.1, 2.0)
    time = np.arange(150) / rate
    w = 2 * np.pi * rng.uniform(0.1, 3.0, (2, 4)) / time[-1]
    size, phase = rng.uniform(5, 50, (2, 4)), rng.uniform(0, 6, (2, 4))
    wave = size * np.cos(w * time[:, None, None] + phase)
    center = np.zeros((len(time), 3))
    center[:, :2] = -(wave / w**2).sum(2)
    center += sigma * np.array([1.0, 1.0, third]) * rng.standard_normal(center.shape)
    force = MASS * (wave.sum(2) - GRAVITY[:2])
    return Recording(Body((), total_mass=MASS), Motion(time, center=center, gravity=GRAVITY)), force


def in_plane(third):
    """Error of the force in the plane (record,), and that over its claim; the verdicts."""
    rms, over, said = [], [], []
    for seed in range(RECORDS):
        recording, force = thrown(seed, third)
        found = estimate_recording(recording, load_settings())
        rms.append(np.sqrt(np.mean((found.force[:, :2] - force) ** 2)))
        over.append(rms[-1] / np.sqrt(np.mean(found.force_std[:, :2] ** 2)))
        said.append(found.verdict.level)
    return np.array(rms), np.array(over), said


@pytest.mark.long
def test_an_axis_that_is_flat_or_loud_leaves_force_and_claim_in_the_plane_as_they_are():
    equal, honest, said = in_plane(1.0)
    for third in (0.0, 10.0):
        rms, over, verdict = in_plane(third)
        assert np.sqrt(np.mean((rms / equal) ** 2)) < 1.2
        assert np.sqrt(np.mean((over / honest) ** 2)) == pytest.approx(1, abs=0.25)
        assert verdict == said


@pytest.mark.parametrize("seed", range(RECORDS))
def test_an_axis_louder_than_the_noise_that_is_stated_for_all_costs_the_others_and_is_said(seed):
    sigma = 1e-3 * np.random.default_rng(seed).uniform([60, 0.1], [400, 2.0])[1]  # as it is drawn
    errors, said = [], []
    for third in (1.0, 10.0):
        recording, force = thrown(seed, third)
        motion = replace(recording.motion, noise_std={"center": sigma})
        found = estimate_recording(replace(recording, motion=motion), load_settings())
        errors.append(np.sqrt(np.mean((found.force[:, :2] - force) ** 2)))
        said.append(any(code.startswith("innovations") for code in found.verdict.codes))
    assert errors[1] > 1.5 * errors[0]
    assert said == [False, True]


def bending(seed, sigma):
    """A flat body told by its whole inertia and two shapes, in which it sways by 20 times the noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(160) / 200
    X = np.column_stack([rng.uniform(-0.2, 0.2, (6, 2)), 0.02 * rng.standard_normal(6)])
    X -= X.mean(0)
    shapes = np.zeros((2, 6, 3))
    shapes[:, :, 2] = [X[:, 0] ** 2 - X[:, 1] ** 2, X[:, 0] * X[:, 1]]
    shapes /= np.abs(shapes).max((1, 2))[:, None, None]
    sway = 20 * sigma * np.cos(2 * np.pi * rng.uniform(10, 20, 2) * time[:, None] + rng.uniform(0, 6, 2))
    R = Rotation.from_rotvec(np.outer(time, rng.uniform(-2, 2, 3))).as_matrix()
    x = np.einsum("tab,tnb->tna", R, X + np.einsum("tk,kna->tna", sway, shapes))
    x += np.outer(time**2, [0.0, 0.5, 0.0])[:, None] + sigma * rng.standard_normal(x.shape)
    whole = {"total_mass": 1.0, "mass_center": np.zeros(3), "inertia": 0.01 * np.diag([1.0, 1.0, 1.8])}
    return Recording(Body(tuple("abcdef"), X, mode_shape=shapes, **whole), Motion(time, x))


@pytest.mark.long
def test_noise_of_a_body_that_bends_is_found_where_no_shape_moves_it():
    """High-order differences of its markers hold the bending, and how smooth its pose is says nothing."""
    sigma = 3e-4
    for seed in range(3):
        recording = bending(seed, sigma)
        by_markers = kinematics(recording.body, recording.motion, load_settings(model="modal"))
        assert by_markers.deforms
        assert not by_markers.apart
        assert errors_beyond(by_markers, recording.motion)[0].std == pytest.approx(sigma, rel=0.2)
        found = estimate_recording(recording, load_settings(model="modal", lines="none"))
        assert found.tuned["noise_std_position"] == pytest.approx(sigma, rel=0.2)


def test_poses_under_noise_that_differs_by_axis_scatter_as_they_claim():
    rng = np.random.default_rng(3)
    X, std = rng.uniform(-0.2, 0.2, (5, 3)), 1e-4 * np.array([1.0, 0.1, 5.0])
    x = X + std * rng.standard_normal((4000, 5, 3))
    alike = np.mean(std**2)
    pose = fit_pose(x, X, np.ones(5), alike * np.eye(15), uneven=np.diag(std**2) - alike * np.eye(3))
    off = np.concatenate([pose.center, log(pose.rotation)], 1)
    np.testing.assert_allclose(np.sqrt(np.diag(pose.cov[0])), off.std(0), rtol=0.05)


def test_equal_noise_through_a_fit_is_its_covariance():
    rng = np.random.default_rng(4)
    gain = rng.standard_normal((6, 12))
    turned = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    both = np.kron(np.eye(2), turned)
    expected = both @ gain @ gain.T @ both.T
    np.testing.assert_allclose(through_fit(gain, turned[None], np.eye(3))[0], expected, atol=1e-12)


@pytest.mark.long
def test_a_planar_record_is_not_said_to_share_errors_nor_to_stick():
    """A rigid body that turns in the plane; heights are constant, and the noise of the others is stated."""
    rng = np.random.default_rng(6)
    time, sigma = np.arange(150) / 100, 1e-3
    X = rng.uniform(-0.2, 0.2, (5, 3))
    X -= X.mean(0)
    R = Rotation.from_rotvec(np.outer(2 * time + 0.5 * np.sin(3 * time), [0.0, 0.0, 1.0])).as_matrix()
    x = np.einsum("tab,nb->tna", R, X)
    x[..., :2] += 0.3 * np.sin(4 * time)[:, None, None] + sigma * rng.standard_normal((len(time), 5, 2))
    body = Body(tuple("abcde"), X, np.full(5, 0.2))
    settings = load_settings(internal_momentum=(0, 0, 0))
    for told in ({"position": sigma}, {}):
        found = estimate_recording(Recording(body, Motion(time, x, noise_std=told)), settings)
        assert found.verdict.level == "ok", found.verdict.reasons
