"""Force and moment of a flexible body, part of whose masses carry no marker, from its stiffness."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.deformation import smooth_deformation
from forceid.estimation.body.deforming.modes import elastic_modes
from forceid.estimation.body.kinematics import kinematics, shape_at
from forceid.estimation.run import estimate_recording
from forceid.kalman.engines import engine
from forceid.scenes.recipe import SceneRecipe, fly, measure

FIVE = ("hub_1", "arm_a_1_lead", "arm_a_3_trail", "arm_b_1_trail", "arm_b_3_lead")
RECIPE = SceneRecipe(scene="flexible_boomerang", duration=0.6, sample_rate=1000.0)
FRAMES = 600


@cache
def flight(frames=FRAMES):
    return fly(RECIPE, np.arange(frames) / 1000.0)


def record(noise, markers, seed=1, frames=FRAMES):
    recipe = RECIPE.model_copy(update={"noise_std": noise, "markers": markers, "seed": seed})
    return measure(flight(frames), recipe, np.arange(frames) / 1000.0, np.random.default_rng(seed))


def without_stiffness(recording):
    return replace(recording, body=replace(recording.body, stiffness=None))


def true_shape():
    """Nodes about the mass center in the mean axes of the truth, (time, node, 3)."""
    R = Rotation.from_quat(flight().truth["orientation"]).as_matrix()
    return np.einsum("tab,tna->tnb", R, flight().position - flight().truth["center"][:, None])


def errors(recording):
    estimate = estimate_recording(recording, load_settings(lines="none"))
    inner = slice(75, -75)
    return [
        float(np.sqrt(np.mean((getattr(estimate, name) - recording.truth[name])[inner] ** 2)))
        for name in ("force", "moment")
    ]


@pytest.mark.long
def test_five_markers_and_a_stiffness_give_force_and_moment_of_fifteen_masses():
    force, moment = errors(record(3e-4, FIVE))
    assert force <= 0.045
    assert moment <= 0.0105  # 0.07 where the other ten masses are taken for rigid


@pytest.mark.long
def test_stiffness_takes_nothing_from_a_body_marked_on_every_mass():
    recording = record(1e-4, "all")
    plain = errors(without_stiffness(recording))
    assert (np.array(errors(recording)) <= 1.05 * np.array(plain)).all()


@pytest.mark.long
def test_masses_without_marker_bend_as_the_spin_bends_them():
    recording = record(3e-4, FIVE)
    hidden = np.array([name not in FIVE for name in recording.body.node])
    true = true_shape()
    kin = kinematics(recording.body, recording.motion, load_settings())
    rest = recording.body.position - kin.inertia.center
    assert np.linalg.norm(true.mean(0) - rest, axis=1).max() > 1.5e-3
    assert np.linalg.norm(kin.shape - true.mean(0), axis=1).max() < 0.2e-3
    assert not kin.unfollowed.any()
    smooth = smooth_deformation(kin, engine())
    moved = shape_at(kin, smooth.amplitude)[75:-75, hidden] - true[75:-75, hidden]
    assert np.sqrt((moved**2).sum(2).mean()) < 0.15e-3  # of 0.53 mm that they move
    assert np.abs(shape_at(kin, smooth.amplitude).swapaxes(1, 2) @ kin.inertia.weight).max() < 1e-9


@pytest.mark.long
def test_mode_shapes_serve_as_the_stiffness_does():
    recording = record(3e-4, FIVE, frames=300)
    body = recording.body
    modes = elastic_modes(body.mass, body.stiffness, body.position)
    frequency = 1 / (2 * np.pi * np.sqrt(modes.compliance))
    given = replace(body, stiffness=None, mode_shape=7.0 * modes.shape, mode_frequency=frequency)
    shapes = [kinematics(b, recording.motion, load_settings()) for b in (body, given)]
    np.testing.assert_allclose(shapes[0].shape, shapes[1].shape, atol=1e-9)
    np.testing.assert_allclose(shapes[0].amplitude, shapes[1].amplitude, atol=1e-9)
