import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.motion.noise_axes import through_fit
from forceid.motion.pose import fit_pose, log
from forceid.records import Body, Motion, Recording

MASS, GRAVITY = 2.0, np.array([0.0, -9.81, 0.0])
RECORDS = 4


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


def test_an_axis_that_is_flat_or_loud_leaves_force_and_claim_in_the_plane_as_they_are():
    equal, honest, said = in_plane(1.0)
    for third in (0.0, 10.0):
        rms, over, verdict = in_plane(third)
        assert np.sqrt(np.mean((rms / equal) ** 2)) < 1.2
        assert np.sqrt(np.mean((over / honest) ** 2)) == pytest.approx(1, abs=0.25)
        assert verdict == said


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
