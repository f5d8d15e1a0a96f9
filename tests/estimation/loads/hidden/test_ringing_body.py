"""Soft bodies that ring: pairs of nets on a joint, each estimated alone, and bodies that do not ring."""

import numpy as np
import pytest

from evidence.drawn.joints import MASSES, nets_on_a_ball
from evidence.drawn.records.joined_nets import joined_nets
from forceid.config import Settings
from forceid.estimation.body.deforming.resonance import RINGING_SIZES, Spectrum, by_size
from forceid.estimation.joints.parts import parts_of
from forceid.estimation.loads.hidden.inner_wheel import STRONG
from forceid.estimation.loads.hidden.ringing_body import Shape, shape_spectrum
from forceid.estimation.run import estimate_whole

SOFT, STIFF, NOISE = (6.0, 12.0), (400.0, 400.0), 3e-4
TIME, COLUMNS, FREEDOMS = np.arange(200) / 200.0, 27, 21


def shape_gain(y, frequency):
    """What a resonance at a frequency gains of the shape, over all its sizes."""
    spectrum = shape_spectrum(TIME, Shape(y, FREEDOMS, None))
    ordinate = np.fft.rfftfreq(len(TIME), TIME[1])[1:-1]
    near = np.flatnonzero(np.abs(ordinate - frequency) < 5)
    line = 1 / (1 + (ordinate[near] - frequency) ** 2)
    return np.logaddexp.reduce(by_size(spectrum, near, line).sum(1)) - np.log(len(RINGING_SIZES))


def test_a_shape_that_rings_gains_where_it_rings_and_one_of_noise_does_not():
    rng = np.random.default_rng(71)
    fit = np.linalg.qr(rng.standard_normal((COLUMNS, FREEDOMS)))[0]
    noise = NOISE * rng.standard_normal((len(TIME), FREEDOMS)) @ fit.T
    ring = 6e-4 * np.exp(-TIME) * np.sin(2 * np.pi * 9.0 * TIME)
    ringing = noise + ring[:, None] * fit[:, 0]
    assert shape_gain(ringing, 9.0) > np.log(STRONG)
    assert shape_gain(ringing, 30.0) < 0
    assert shape_gain(noise, 9.0) < 0


def test_sizes_of_a_resonance_are_weighed_as_the_likelihood_of_their_spectra_says():
    power, noise, line = np.full((3, 2), 5.0), np.full((3, 2), 0.5), np.array([0.2, 1.0, 0.2])
    found = by_size(Spectrum(power, noise, 1.0), np.arange(3), line)
    for size, gained in zip(RINGING_SIZES, found, strict=True):
        density = 1 + size * line[:, None] * noise
        each = (-np.log(density) - power / density + power).sum(0)
        np.testing.assert_allclose(gained, each, rtol=1e-12)


def scores(seed, frequency):
    """Of each part of a pair alone: verdict, and error over claim of force and moment."""
    recording, clean = (joined_nets(seed, frequency, noise) for noise in (NOISE, 0.0))
    for k, part in enumerate(parts_of(recording, nets_on_a_ball())[0]):
        x = clean.motion.position[:, k * MASSES : (k + 1) * MASSES]
        force = (2 * k - 1) * recording.truth["joint_force"][:, 0]
        arm = x[:, -1] - np.average(x, axis=1, weights=part.recording.body.mass)
        found, _ = estimate_whole(part.recording, Settings())
        inner = slice(len(TIME) // 8, -(len(TIME) // 8))
        off = np.stack([found.force - force, found.moment - np.cross(arm, force)])[:, inner]
        std = np.stack([found.force_std, found.moment_std])[:, inner]
        yield found.verdict, np.sqrt((off**2).mean((1, 2)) / (std**2).mean((1, 2)))


@pytest.mark.long
def test_a_soft_part_that_is_seen_to_ring_says_so_and_its_claims_hold():
    verdict, score = next(iter(scores(7018, SOFT)))
    assert "body-rings" in verdict.codes
    assert score.max() < 1.3


@pytest.mark.long
def test_most_parts_that_are_seen_to_ring_hold_their_claims_in_force_and_moment():
    """At all frequencies, of 15 parts; all are degraded. Axes of the body or of the world are a toss-up."""
    found = [each for seed in range(8101, 8151) for each in scores(seed, SOFT)]
    ringing = np.array([score for verdict, score in found if "body-rings" in verdict.codes])
    assert len(ringing) > 8
    assert ((ringing < 2.0).mean(0) > 0.7).all()
    assert (np.median(ringing, 0) < 1.2).all()


@pytest.mark.long
def test_stiff_parts_are_not_said_to_ring():
    found = [each for seed in range(8101, 8103) for each in scores(seed, STIFF)]
    assert not any("body-rings" in verdict.codes for verdict, _ in found)
