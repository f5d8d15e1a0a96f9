"""Bodies that are stated wrong by errors drawn from what is stated of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.scenes.recipe import SceneRecipe, simulate

STD = {"mass": 0.03, "mass_center": 0.004, "inertia": 0.05}


def recorded():
    """A top in free fall of which no gravity is told: its weight is the force."""
    recipe = SceneRecipe(scene="top", duration=0.6, sample_rate=250.0, noise_std=1e-4, seed=11)
    fallen = simulate(recipe)
    weight = fallen.body.total_mass * fallen.motion.gravity
    truth = fallen.truth | {"force": fallen.truth["force"] + weight}
    return replace(fallen, motion=replace(fallen.motion, gravity=np.zeros(3)), truth=truth)


def wrong_body(body, rng):
    """The body with errors of its mass, its mass center, and its inertia about each principal axis."""
    values, axes = np.linalg.eigh(body.inertia)
    inertia = axes * (values * (1 + STD["inertia"] * rng.normal(size=3))) @ axes.T
    return replace(
        body, total_mass=body.total_mass * (1 + STD["mass"] * rng.normal()), inertia=inertia,
        mass_center=body.mass_center + STD["mass_center"] * rng.normal(size=3),
    )  # fmt: skip


def of_one_sample(recording, body_std, k):
    settings = load_settings(model="rigid", body_std=body_std, internal_momentum=(0, 0, 0))
    found = estimate_recording(recording, settings)
    return found.force[k], found.moment[k], found.wrench_cov[k], found.center[k]


@pytest.mark.long
def test_force_and_moment_of_bodies_stated_wrong_are_as_far_off_as_claimed():
    recording, rng, k = recorded(), np.random.default_rng(5), 75
    truth = recording.truth
    squares = []
    for _ in range(12):
        told = replace(recording, body=wrong_body(recording.body, rng))
        force, moment, cov, center = of_one_sample(told, STD, k)
        arm = center - truth["center"][k]  # the moment is about the mass center as stated
        true = np.concatenate([truth["force"][k], truth["moment"][k] - np.cross(arm, truth["force"][k])])
        error = np.concatenate([force, moment]) - true
        squares.append(error @ np.linalg.solve(cov, error))
    low, high = chi2.ppf([0.001, 0.999], 6 * len(squares))
    assert low < np.sum(squares) < high


def test_a_body_without_doubt_claims_what_it_did():
    recording = recorded()
    _, _, plain, _ = of_one_sample(recording, {}, 75)
    _, _, told, _ = of_one_sample(recording, {"mass": 0.0}, 75)
    np.testing.assert_array_equal(plain, told)


def test_the_mass_alone_widens_the_force_along_itself_by_its_share():
    recording = recorded()
    force, _, cov, _ = of_one_sample(recording, {"mass": 0.1}, 75)
    _, _, plain, _ = of_one_sample(recording, {}, 75)
    np.testing.assert_allclose((cov - plain)[:3, :3], 0.01 * np.outer(force, force), rtol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", list(STD))
def test_each_doubt_adds_to_the_claim(name):
    recording = recorded()
    _, _, cov, _ = of_one_sample(recording, {name: STD[name]}, 75)
    _, _, plain, _ = of_one_sample(recording, {}, 75)
    added = cov - plain
    assert np.linalg.eigvalsh(added).min() > -1e-9 * np.abs(added).max()
    assert np.trace(added[3:, 3:]) > 0 or name == "mass"
