"""First moments of force in the result of an affine body: they agree with its moment, and with the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.affine.loads import MOMENT, affine_loads, moment_of
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.first_moments import with_moment
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion

STORED = Path(__file__).parents[2] / "data/synthetic/spinning_block.h5"
MIDDLE = slice(75, -75)


@pytest.fixture(scope="module")
def block():
    return read_motion(STORED)


@pytest.fixture(scope="module")
def result(block):
    return estimate_recording(block, load_settings(model="affine"))


def rms(x):
    return np.sqrt(np.mean(x[MIDDLE] ** 2))


def std_of(cov):
    return np.sqrt(np.diagonal(cov, axis1=1, axis2=2))


def test_what_is_antisymmetric_in_the_first_moments_is_the_moment_of_the_result(result):
    assert np.abs(moment_of(result.first_moment) - result.moment).max() < 1e-12
    cov = MOMENT @ result.first_moment_cov @ MOMENT.T
    assert np.abs(cov - result.wrench_cov[:, 3:, 3:]).max() < 1e-15


def test_the_moment_of_the_flight_makes_all_first_moments_better(block, result):
    alone, true = affine_loads(block), block.truth["first_moment"]
    assert rms(result.first_moment - true) < 0.95 * rms(alone.first_moment - true)
    assert rms(std_of(result.first_moment_cov)) < rms(std_of(alone.first_moment_cov))


def test_the_truth_lies_within_the_claims(block, result):
    off = (result.first_moment - block.truth["first_moment"]).reshape(-1, 9)
    inside = np.abs(off) <= 1.959964 * std_of(result.first_moment_cov)
    assert 0.92 <= inside[MIDDLE].mean() <= 0.98


def test_a_moment_that_is_not_known_changes_nothing(block):
    loads = affine_loads(block)
    lost = np.full_like(loads.force, np.nan)
    same = with_moment(loads, lost, np.full((len(lost), 3, 3), np.nan))
    assert same is loads


def test_a_moment_known_as_before_changes_nothing(block):
    loads = affine_loads(block)
    same = with_moment(loads, loads.moment, loads.moment_cov)
    assert np.abs(same.first_moment - loads.first_moment).max() < 1e-12
    assert np.abs(same.first_moment_cov - loads.first_moment_cov).max() < 1e-15


def test_stretch_is_that_of_the_map_from_the_reference(block, result):
    x, X = block.motion.position, block.body.position
    F = np.einsum("tna,bn->tab", x - x.mean(1, keepdims=True), np.linalg.pinv(X - X.mean(0)))
    assert rms(result.stretch @ result.stretch - F.mT @ F) < 0.01  # of one frame: noise of 2 sigma / size


@pytest.mark.long
def test_rigid_and_filtered_flights_have_none(block):
    rigid = estimate_recording(block, load_settings(model="rigid", method="savgol"))
    assert rigid.first_moment is rigid.first_moment_cov is rigid.stretch is None
    filtered = estimate_recording(block, load_settings(model="affine", method="filter"))
    assert filtered.first_moment is None
    assert filtered.stretch is not None


@pytest.mark.long
def test_a_rejected_spike_does_not_enter_the_first_moments(block, result):
    x = block.motion.position.copy()
    x[300, 2] += 0.05
    spiked = replace(block, motion=replace(block.motion, position=x))
    found = estimate_recording(spiked, load_settings(model="affine"))
    assert "spikes" in found.verdict.codes
    assert np.abs(found.first_moment - result.first_moment).max() < 0.1 * np.abs(result.first_moment).max()


@pytest.mark.long
def test_a_body_known_as_a_whole_has_the_loads_of_the_same_body_known_by_its_masses(block, result):
    known = inertia_of(block.body)
    body = replace(
        block.body, mass=None, total_mass=known.mass, mass_center=known.center, inertia=known.tensor
    )
    whole = estimate_recording(replace(block, body=body), load_settings(model="affine"))
    assert np.abs(whole.moment - result.moment).max() < 1e-6 * np.abs(result.moment).max()
    assert np.abs(whole.first_moment - result.first_moment).max() < 1e-6 * np.abs(result.first_moment).max()
