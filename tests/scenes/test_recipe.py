"""What a recipe promises: seeds, gaps, instants, errors that name the nearest word, files made again."""

import ast
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import forceid.scenes
from forceid.errors import ConfigError
from forceid.files.stored.hdf5 import read_motion
from forceid.scenes.flights import flexible_boomerang
from forceid.scenes.recipe import SCENES, SceneRecipe, load_recipe, simulate

STORED = sorted((Path(__file__).parents[2] / "data/synthetic").glob("*.toml"))
RING = SceneRecipe(scene="spinner", duration=0.2, sample_rate=500.0, noise_std=1e-3, seed=7)


def varied(**changes):
    return SceneRecipe.model_validate({**RING.model_dump(by_alias=True), **changes})


def assert_alike(found, expected, name):
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), name
        for key in expected:
            assert_alike(found[key], expected[key], f"{name}/{key}")
    elif isinstance(expected, np.ndarray | float):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9, err_msg=name)
    else:
        assert found == expected, name


@pytest.mark.long
@pytest.mark.parametrize("path", STORED, ids=lambda p: p.stem)
def test_stored_file_is_made_again_from_its_recipe(path, throw, monkeypatch):
    # one integration of the throw, at four times the rate, serves both boomerang files
    def sampled(parameters, time):
        assert parameters == flexible_boomerang.Parameters()
        np.testing.assert_array_equal(throw[0][: 4 * len(time) : 4], time)
        return tuple(states[: 4 * len(time) : 4] for states in throw[1:])

    monkeypatch.setattr(flexible_boomerang, "trajectory", sampled)
    made, stored = simulate(load_recipe(path)), read_motion(path.with_suffix(".h5"))
    for part in ("body", "motion"):
        assert_alike(vars(getattr(made, part)), vars(getattr(stored, part)), part)
    assert_alike(made.truth, stored.truth, "truth")
    assert made.title == stored.title


def test_eleven_recipes_are_stored_and_small():
    assert len(STORED) == 11
    assert max(path.with_suffix(".h5").stat().st_size for path in STORED) < 1.5e6


def test_recipe_shipped_in_the_package_is_the_stored_one():
    shipped = files("forceid.scenes") / "flexible_boomerang.toml"
    stored = next(path for path in STORED if path.stem == "flexible_boomerang")
    assert shipped.read_bytes() == stored.read_bytes()


def test_same_seed_same_recording_and_another_seed_other_noise_only():
    first, again, other = simulate(RING), simulate(RING), simulate(varied(seed=8))
    np.testing.assert_array_equal(first.motion.position, again.motion.position)
    assert np.abs(first.motion.position - other.motion.position).min() > 0.0
    np.testing.assert_array_equal(first.truth["force"], other.truth["force"])


def test_seed_given_beside_the_file_overrides_that_of_the_recipe():
    path = next(p for p in STORED if p.stem == "top")
    assert load_recipe(path).seed == 3
    assert load_recipe(path, seed=11).seed == 11


def test_noise_has_the_stated_standard_deviation():
    noisy, exact = simulate(varied(duration=2.0)), simulate(varied(duration=2.0, noise_std=0.0))
    noise = noisy.motion.position - exact.motion.position
    assert noise.std() == pytest.approx(1e-3, rel=0.02)
    assert noisy.motion.noise_std == {"position": 1e-3}
    assert exact.motion.noise_std == {}
    assert simulate(varied(stated_noise=False)).motion.noise_std == {}


def test_dropout_is_nan_for_its_marker_and_its_time_only():
    gap = {"node": "marker_2", "from": 0.1, "to": 0.15}
    motion = simulate(varied(dropout=[gap])).motion
    lost = np.isnan(motion.position)
    expected = np.zeros_like(lost)
    expected[(motion.time >= 0.1) & (motion.time <= 0.15), 1] = True
    np.testing.assert_array_equal(lost, expected)
    assert lost.sum() == 26 * 3
    assert not (motion.position == 0.0).any()


def test_random_dropouts_lose_whole_markers_at_the_stated_rate():
    lost = np.isnan(simulate(varied(duration=4.0, dropout_fraction=0.1)).motion.position)
    np.testing.assert_array_equal(lost.any(-1), lost.all(-1))
    assert lost.mean() == pytest.approx(0.1, abs=0.01)


def test_nodes_without_marker_are_never_seen_and_the_others_unchanged():
    few, all_of_them = simulate(varied(markers=["marker_1", 4])).motion, simulate(RING).motion
    assert np.isnan(few.position[:, [1, 2, 3, 5]]).all()
    np.testing.assert_array_equal(few.position[:, [0, 4]], all_of_them.position[:, [0, 4]])


def test_jittered_clock_moves_the_instants_and_the_truth_with_them():
    recording = simulate(varied(jitter=0.9, noise_std=0.0))
    time = recording.motion.time
    regular = np.arange(100) / 500.0
    assert np.diff(time).min() > 0.0
    assert np.ptp(np.diff(time)) > 1e-3
    assert ((time >= regular) & (time < regular + 0.9 / 500.0)).all()
    np.testing.assert_allclose(recording.truth["force"][:, 0], np.sin(2.0 * np.pi * 0.7 * time), atol=1e-12)


def test_mean_motion_channels_carry_their_own_noise():
    recording = simulate(varied(measure="mean_motion", orientation_noise_std=2e-3, duration=4.0))
    motion = recording.motion
    tilt = Rotation.from_quat(motion.orientation) * Rotation.from_quat(recording.truth["orientation"]).inv()
    assert motion.position is None
    assert motion.noise_std == {"center": 1e-3, "orientation": 2e-3}
    assert tilt.as_rotvec().std() == pytest.approx(2e-3, rel=0.05)
    assert (motion.center - recording.truth["center"]).std() == pytest.approx(1e-3, rel=0.05)
    assert (motion.orientation[:, 3] >= 0.0).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene": "frisby"}, "unknown scene 'frisby'; did you mean 'frisbee'"),
        ({"parameters": {"radus": 1.0}}, "unknown key 'radus'; did you mean 'radius'"),
        ({"markers": ["marker_9"]}, "unknown node 'marker_9'; did you mean 'marker_"),
        ({"dropout": [{"node": 6, "from": 0.0, "to": 1.0}]}, "node 6 is not among the 6 nodes"),
        ({"scene": "particle", "measure": "mean_motion", "parameters": {}}, "'particle' has no orientation"),
    ],
)
def test_wrong_word_names_the_nearest_right_one(changes, message):
    with pytest.raises(ConfigError, match=message):
        simulate(varied(**changes))


def test_wrong_key_of_a_file_names_file_and_key(tmp_path):
    path = tmp_path / "toss.toml"
    path.write_text('scene = "top"\nduration = 1.0\nsample_rat = 100\n')
    with pytest.raises(ConfigError, match=r"toss\.toml unknown key 'sample_rat'; did you mean 'sample_rate'"):
        load_recipe(path)
    path.write_text('scene = "top"\nduration = 1.0\nsample_rate = 100\n[parameters]\nspinn = 1\n')
    with pytest.raises(ConfigError, match=r"\[parameters\] unknown key 'spinn'; did you mean 'spin'"):
        load_recipe(path)


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_has_unit_quaternions_and_a_finite_truth(scene):
    short = 0.01 if scene == "flexible_boomerang" else 0.1
    recording = simulate(SceneRecipe(scene=scene, duration=short, sample_rate=1000.0))
    assert all(np.isfinite(values).all() for values in recording.truth.values())
    assert len(recording.truth["force"]) == len(recording.motion.time) == round(short * 1000)
    if "orientation" in recording.truth:
        np.testing.assert_allclose(np.linalg.norm(recording.truth["orientation"], axis=1), 1.0)
        assert (recording.truth["orientation"][:, 3] >= 0.0).all()


def test_truth_shares_no_code_with_the_estimators():
    allowed = tuple(
        f"forceid.{name}" for name in ("config", "errors", "face", "records", "scenes", "sections")
    )
    for module in Path(forceid.scenes.__file__).parent.rglob("*.py"):
        for statement in ast.walk(ast.parse(module.read_text())):
            if isinstance(statement, ast.ImportFrom) and (statement.module or "").startswith("forceid"):
                assert statement.module.startswith(allowed), module.name
