"""Lost markers are bridged beside their neighbors, and their error is claimed as gaps made elsewhere tell."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.estimation.body.tracks.bridging import bridged

SIGMA = 1e-3


def tumbling(rng, swing):
    """Tracks (time, node, 3) of six markers on a body that turns thrice a second; the last two swing."""
    t = np.arange(300) / 200
    X = rng.uniform(-0.2, 0.2, (6, 3))
    x = np.tile(X, (len(t), 1, 1))
    x[:, 4:] += swing * np.sin(2 * np.pi * 2 * t)[:, None, None] * np.array([0.6, 0.0, 0.8])
    turn = Rotation.from_rotvec(np.outer(t, [4.0, -18.0, 3.0])).as_matrix()
    return t, np.einsum("tab,tnb->tna", turn, x) + np.outer(t, [2.0, 0, 3.0])[:, None]


@pytest.mark.parametrize(("swing", "most"), [(0.0, 1.5), (0.05, 2.5)])
def test_a_marker_lost_on_a_tumbling_body_is_found_to_about_its_noise(swing, most):
    """A straight line across such a gap is off by centimeters."""
    rng = np.random.default_rng(3)
    off, claimed = [], []
    for _ in range(4):
        t, x = tumbling(rng, swing)
        lost = x + SIGMA * rng.standard_normal(x.shape)
        gaps = np.zeros(x.shape[:2], bool)
        for first in (40, 120, 200):
            gaps[first : first + 15, rng.integers(6)] = True
        found = bridged(t, np.where(gaps[..., None], np.nan, lost), np.ones(6, bool))
        off.append(((found.position - x)[gaps] ** 2).mean())
        claimed.append(found.error_var[gaps].mean())
    assert np.sqrt(np.mean(off)) < most * SIGMA
    assert 0.4 < np.sqrt(np.mean(off) / np.mean(claimed)) < 1.3


def test_what_was_measured_stays_and_a_sample_that_shows_nothing_stays_empty():
    t, x = tumbling(np.random.default_rng(4), 0.05)
    x[50:55] = np.nan
    x[100:110, 2] = np.nan
    found = bridged(t, x, np.ones(6, bool))
    seen = np.isfinite(x)
    assert (found.position[seen] == x[seen]).all()
    assert np.isnan(found.position[50:55]).all()
    assert np.isnan(found.error_var[50:55]).all()
    assert np.isfinite(found.position[100:110, 2]).all()
    assert (found.error_var[100:110, 2] > 0).all()


def test_a_marker_lost_at_an_end_is_held_beside_its_neighbors():
    t, x = tumbling(np.random.default_rng(5), 0.0)
    lost = x.copy()
    lost[:20, 0] = np.nan
    assert np.abs(bridged(t, lost, np.ones(6, bool)).position - x).max() < 1e-9
