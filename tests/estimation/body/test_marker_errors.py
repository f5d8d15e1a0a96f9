"""Errors of markers from what no motion makes, and estimates of bodies whose markers have such errors."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import butter, lfilter, sosfiltfilt
from scipy.stats import multivariate_t

from forceid.config import load_settings
from forceid.estimation.body.tracks.marker_errors import FREEDOMS, loudness, marker_errors, sphericity
from forceid.estimation.run import estimate_recording
from forceid.flight.color import Color, LowPassed
from forceid.records import Body, Motion, Recording

STEP = 0.004


def following(rng, samples, numbers, r):
    """Errors of unit variance that follow themselves by r a sample."""
    e = rng.standard_normal((samples + 300, numbers))
    return lfilter([np.sqrt(1 - r**2)], [1.0, -r], e, axis=0)[300:]


@pytest.mark.parametrize("r", [0.0, 0.3, 0.6, 0.9])
def test_size_and_memory_are_found_within_their_errors(r):
    size, forgets = [], []
    for seed in range(12):
        rng = np.random.default_rng([7, seed])
        found = marker_errors(STEP * np.arange(500), 2.0 * following(rng, 500, 9, r))
        assert found.alike
        size.append(found.std / 2.0)
        forgets.append(1.0 if found.color is None else found.color.slow)
    assert np.mean(size) == pytest.approx(1.0, abs=0.05)
    assert np.mean(forgets) == pytest.approx((1 + r) / (1 - r), rel=0.25)


def test_white_errors_are_hardly_ever_said_to_have_a_memory():
    said = 0
    for seed in range(60):
        rng = np.random.default_rng([8, seed])
        said += marker_errors(STEP * np.arange(200), rng.standard_normal((200, 6))).color is not None
    assert said <= 1


@pytest.mark.parametrize(("samples", "numbers"), [(40, 4), (60, 45), (120, 45), (400, 12), (1000, 30)])
def test_variances_that_are_alike_are_so_within_their_deviation(samples, numbers):
    """With fewer samples than numbers as well."""
    n, found = samples, []
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n)[:, None] ** 2
    for seed in range(300):
        y = np.random.default_rng([16, seed]).standard_normal((n, numbers))
        apart, off = sphericity(np.fft.rfft(y * taper, axis=0)[2:-1])
        found.append(apart / off)
    assert np.mean(found) == pytest.approx(0.0, abs=0.6)  # as few samples leave it
    assert np.std(found) == pytest.approx(1.0, abs=0.25)


@pytest.mark.long
@pytest.mark.parametrize("louder", [0.0, 0.2, 0.5])
def test_errors_are_alike_where_some_markers_are_twice_as_noisy_and_a_small_motion_is_no_error(louder):
    """A fifth of the size of the errors in one of 24 numbers, at a few frequencies."""
    alike, moved = 0, 0
    for seed in range(40):
        rng = np.random.default_rng([17, seed])
        y = rng.standard_normal((600, 24)) * np.where(np.arange(24) < 24 * louder, 2.0, 1.0)
        alike += marker_errors(STEP * np.arange(600), y).alike
        y[:, -1] += 0.4 * np.cumsum(rng.standard_normal(600))
        moved += not marker_errors(STEP * np.arange(600), y).alike
    assert alike >= 32  # of 40: where some are noisier, frames may pass for louder
    assert moved >= 32


def test_a_motion_in_one_of_the_numbers_is_no_error_of_markers():
    rng = np.random.default_rng(9)
    y = rng.standard_normal((400, 9))
    y[:, 3] += 5 * np.sin(2 * np.pi * 6 * STEP * np.arange(400))
    assert not marker_errors(STEP * np.arange(400), y).alike


def test_gaps_leave_the_longest_run():
    rng = np.random.default_rng(10)
    y = following(rng, 600, 6, 0.8)
    y[::100] = np.nan
    y[101:300] = np.nan
    assert marker_errors(STEP * np.arange(600), y).std == pytest.approx(1.0, rel=0.35)
    assert marker_errors(STEP * np.arange(10), y[:10]) is None


@pytest.mark.parametrize("r", [0.4, 0.9])
@pytest.mark.long
def test_force_and_moment_beside_errors_with_a_memory_are_known_as_claimed(r):
    """A body under a slow force; 5 records, told nothing of the errors."""
    time, mass, J = STEP * np.arange(300), 2.0, np.diag([0.02, 0.03, 0.04])
    inside, said, over = [], [], []
    for seed in range(5):
        rng = np.random.default_rng([11, seed])
        X = rng.uniform(-0.2, 0.2, (7, 3))
        rate, size, phase = rng.uniform(4, 12, 3), rng.uniform(1, 5, 3), rng.uniform(0, 6, 3)
        force = size * np.cos(rate * time[:, None] + phase)
        center = -force / mass / rate**2
        x = center[:, None] + X + 5e-4 * following(rng, 300, 21, r).reshape(-1, 7, 3)
        body = Body(tuple("abcdefg"), X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
        found = estimate_recording(Recording(body, Motion(time, x, gravity=np.zeros(3))), load_settings())
        off = (found.force - force)[40:-40]
        over.append(np.sqrt(np.mean(off**2) / np.mean(found.force_std[40:-40] ** 2)))
        inside.append(np.mean(np.abs(off) < 1.96 * found.force_std[40:-40]))
        said.append(found.verdict.level)
    assert 0.5 < np.median(over) < 1.3
    assert np.mean(inside) > 0.9
    assert said.count("ok") >= 4


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("part", [0.1, 0.2, 0.35])
def test_a_filter_at_the_source_is_found_with_the_density_below_its_cut(order, part):
    """Errors through a Butterworth filter both ways, of a cut that is a part of the sampling rate."""
    cut, density, cuts = part / STEP, [], []
    for seed in range(8):
        rng = np.random.default_rng([12, seed])
        white = 2.0 * rng.standard_normal((700, 9))
        y = sosfiltfilt(butter(order, cut, fs=1 / STEP, output="sos"), white, axis=0)[100:-100]
        found = marker_errors(STEP * np.arange(500), y)
        assert found.alike
        assert isinstance(found.color, LowPassed)
        density.append(found.std**2 * found.color.slow / 4.0)
        cuts.append(found.color.cut / cut)
    assert np.mean(density) == pytest.approx(1.0, abs=0.06)
    assert np.mean(cuts) == pytest.approx(1.0, abs=0.15)


def test_errors_that_walk_are_not_taken_for_filtered():
    for seed in range(12):
        rng = np.random.default_rng([13, seed])
        found = marker_errors(STEP * np.arange(500), following(rng, 500, 9, 0.95))
        assert isinstance(found.color, Color)


@pytest.mark.long
@pytest.mark.parametrize("cut", [40.0, *(pytest.param(cut, marks=pytest.mark.long) for cut in (20.0, 10.0))])
def test_tracks_low_passed_at_the_source_are_estimated_as_well_as_raw_ones(cut):
    """A body under forces below 2 Hz, told nothing of its errors nor of the filter."""
    step, mass, J, over, ratio = 0.005, 2.0, np.diag([0.02, 0.03, 0.04]), [], []
    time = step * np.arange(-60, 360)
    for seed in range(4):
        rng = np.random.default_rng([14, seed])
        X = rng.uniform(-0.2, 0.2, (7, 3))
        rate, size, phase = rng.uniform(4, 12, 3), rng.uniform(1, 5, 3), rng.uniform(0, 6, 3)
        force = size * np.cos(rate * time[:, None] + phase)
        x = (-force / mass / rate**2)[:, None] + X + 5e-4 * rng.standard_normal((420, 7, 3))
        filtered = sosfiltfilt(butter(4, cut, fs=1 / step, output="sos"), x, axis=0)
        body = Body(tuple("abcdefg"), X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
        error, kept = [], slice(60, -60)
        for tracks in (x, filtered):
            motion = Motion(time[kept] - time[60], tracks[kept], gravity=np.zeros(3))
            found = estimate_recording(Recording(body, motion), load_settings())
            off = (found.force - force[kept])[40:-40]
            error.append(np.sqrt(np.mean(off**2)))
        assert found.verdict.level == "ok"
        assert "smoothed-at-source" in found.verdict.codes
        over.append(np.mean(off**2) / np.mean(found.force_std[40:-40] ** 2))
        ratio.append(error[1] / error[0])
    assert np.mean(ratio) < 1.15
    assert 0.5 < np.sqrt(np.mean(over)) < 1.5


@pytest.mark.long
def test_an_oscillation_of_low_passed_tracks_that_may_be_a_mirror_image_is_not_called_ok():
    """Frames that tell anything new come at 87 Hz here, so 45 Hz look like 42 Hz in them."""
    step, mass, J, rng = 1 / 260, 0.6, np.diag([2e-3, 3e-3, 4e-3]), np.random.default_rng(21)
    time, X = step * np.arange(-60, 230), rng.uniform(-0.1, 0.1, (8, 3))
    force = np.array([57.0, 10.0, -20.0]) * np.cos(2 * np.pi * 45.6 * time)[:, None]
    x = (-force / mass / (2 * np.pi * 45.6) ** 2)[:, None] + X + 1.5e-4 * rng.standard_normal((290, 8, 3))
    filtered = sosfiltfilt(butter(2, 45.0, fs=1 / step, output="sos"), x, axis=0)
    kept = slice(60, -60)
    motion = Motion(time[kept] - time[60], filtered[kept], gravity=np.zeros(3))
    body = Body(tuple("abcdefgh"), X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
    found = estimate_recording(Recording(body, motion), load_settings())
    off = np.sqrt(np.mean((found.force - force[kept])[20:-20] ** 2))
    assert off > 2 * np.sqrt(np.mean(found.force_std[20:-20] ** 2))  # wrong, as frames so rare leave it
    assert found.verdict.level == "degraded"
    assert "smoothed-at-source" in found.verdict.codes


def of_cosines(seed, errors, samples=300):
    """A body under forces below 2 Hz that does not turn, with errors(rng, x) of its markers; force."""
    time, mass, J = STEP * np.arange(samples), 2.0, np.diag([0.02, 0.03, 0.04])
    rng = np.random.default_rng([15, seed])
    X = rng.uniform(-0.2, 0.2, (7, 3))
    rate, size, phase = rng.uniform(4, 12, 3), rng.uniform(1, 5, 3), rng.uniform(0, 6, 3)
    force = size * np.cos(rate * time[:, None] + phase)
    x = (rng.uniform(-2, 2, 3) * time[:, None] - force / mass / rate**2)[:, None] + X
    body = Body(tuple("abcdefg"), X, total_mass=mass, mass_center=np.zeros(3), inertia=J)
    return Recording(body, Motion(time, errors(rng, x), gravity=np.zeros(3))), force


HEAVY = {
    "a Student distribution of three": lambda rng, x: x + 3e-4 * rng.standard_t(3, x.shape),
    "bursts in one frame of ten": lambda rng, x: (
        x + 5e-4 * np.where(rng.random((len(x), 1, 1)) < 0.1, 4.0, 1.0) * rng.standard_normal(x.shape)
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", HEAVY)
def test_errors_that_are_not_normal_are_claimed_by_their_size(kind):
    over, said = [], []
    for seed in range(12):
        recording, force = of_cosines(seed, HEAVY[kind])
        found = estimate_recording(recording, load_settings())
        off = (found.force - force)[40:-40]
        over.append(np.mean(off**2) / np.mean(found.force_std[40:-40] ** 2))
        said.append(found.verdict.level)
    assert 0.6 < np.sqrt(np.mean(over)) < 1.4
    assert np.sqrt(np.max(over)) < 2.0
    assert said.count("ok") >= 10


def test_a_deformation_that_ends_at_a_frequency_is_no_filter():
    """Six strains below 9 Hz in eighteen numbers, as an affine body has them, far above the noise."""
    for seed in range(10):
        rng = np.random.default_rng([16, seed])
        strains = sosfiltfilt(butter(4, 9.0, fs=500.0, output="sos"), rng.standard_normal((800, 6)), axis=0)
        y = strains[100:-100] @ rng.standard_normal((6, 18)) + 1e-3 * rng.standard_normal((600, 18))
        assert not marker_errors(0.002 * np.arange(600), y).alike


@pytest.mark.parametrize("seed", range(4))
def test_frames_are_as_loud_as_under_the_likeliest_t_distribution(seed):
    rng = np.random.default_rng([11, seed])
    y = rng.standard_normal((200, 9)) * np.exp(rng.uniform(0.5, 3.0) * rng.standard_normal((200, 1)))
    square, d, each = (y**2).sum(1), y.shape[1], []
    for nu in FREEDOMS:

        def slope(log_scale, nu=nu):
            return (nu + d) / d * np.mean(square / (nu * np.exp(log_scale) + square)) - 1

        scale = np.exp(brentq(slope, -80, 80, xtol=1e-13))
        likely = multivariate_t(np.zeros(d), scale * np.eye(d), df=nu).logpdf(y).sum()
        each.append((likely, (nu * scale + square) / (nu + d - 2)))
    np.testing.assert_allclose(loudness(y), max(each, key=lambda one: one[0])[1], rtol=1e-9)
