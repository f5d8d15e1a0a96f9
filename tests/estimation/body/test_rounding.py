"""Coordinates on a grid: found however few readings meet, and never where nothing was rounded."""

import numpy as np
import pytest
from closed_forms import NOISE, clock, rms, seen_as, toss

from forceid.estimation.body.tracks.rounding import beside_rounding, grid_step


def flying(seed, nodes=3, frames=200, far=5.0):
    """Tracks (time, node, 3) that pass a distance m in all, of which hardly two readings are alike."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, frames)[:, None, None]
    return rng.standard_normal((nodes, 3)) + far * t * rng.standard_normal(3) + 1e-3 * rng.standard_normal(
        (frames, nodes, 3)
    )  # fmt: skip


@pytest.mark.parametrize("step", [1e-4, 1e-3, 0.0254])
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_a_grid_is_found_where_hardly_two_readings_meet(step, kind):
    for seed in range(5):
        x = (step * np.round(flying(seed, far=2e3 * step) / step)).astype(kind).astype(float)
        assert len(np.unique(x)) > 0.2 * x.size
        assert grid_step(x) == pytest.approx(step, rel=1e-3)


def test_no_grid_is_seen_in_what_was_not_rounded_nor_in_what_rests_on_one():
    for seed in range(50):
        x = flying(seed, nodes=1, frames=16)
        assert grid_step(x) == 0.0
        x[..., 2] = 0.25
        assert grid_step(x) == 0.0
        x[:2, 0] = [[0.0], [5e-324]]  # the least difference that two numbers have
        assert grid_step(x) == 0.0


def test_a_noise_stated_below_the_rounding_is_counted_with_it():
    x = 1e-3 * np.round(flying(0) / 1e-3)
    assert beside_rounding(1e-4, grid_step(x)) == pytest.approx(np.hypot(1e-4, 1e-3 / np.sqrt(12)))
    assert beside_rounding(1e-3, grid_step(x)) == 1e-3
    assert beside_rounding(1e-4, grid_step(flying(0))) == 1e-4


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_loads_from_rounded_tracks_are_right_though_the_noise_is_stated_without(seed, estimated):
    recording = toss(clock(150, 150.0), seed=seed, spin=(15.0, 4.0), noise=NOISE / 3)
    found = estimated(seen_as(recording, 1e-3 * np.round(recording.motion.position / 1e-3)))
    assert found.verdict.level == "ok"
    for load in ("force", "moment"):
        error = getattr(found, load) - recording.truth[load]
        assert rms(error / getattr(found, f"{load}_std")) < 1.5
