"""Lost markers are bridged beside their neighbors, and their error is claimed as gaps made elsewhere tell."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.estimation.body.tracks import bridging
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


@pytest.mark.long
def test_where_many_markers_are_lost_those_that_swing_claim_their_own_errors():
    """Of 40 markers on a tumbling body the last ten swing; all are lost for one to four samples at a time."""
    rng, off, claimed = np.random.default_rng(6), [], []
    t = np.arange(300) / 200
    X = rng.uniform(-0.2, 0.2, (40, 3))
    x = np.tile(X, (len(t), 1, 1))
    x[:, 30:] += 0.05 * np.sin(2 * np.pi * 2 * t)[:, None, None] * np.array([0.6, 0.0, 0.8])
    x = np.einsum("tab,tnb->tna", Rotation.from_rotvec(np.outer(t, [4.0, -18.0, 3.0])).as_matrix(), x)
    gaps = np.zeros(x.shape[:2], bool)
    for k in range(40):
        for first in rng.choice(np.arange(10, 285), 6, replace=False):
            gaps[first : first + rng.integers(1, 5), k] = True
    lost = np.where(gaps[..., None], np.nan, x + SIGMA * rng.standard_normal(x.shape))
    found = bridged(t, lost, np.ones(40, bool))
    for part in (slice(0, 30), slice(30, 40)):
        off.append(((found.position - x)[:, part][gaps[:, part]] ** 2).mean())
        claimed.append(found.error_var[:, part][gaps[:, part]].mean())
    assert np.sqrt(off[0]) < 1.2 * SIGMA
    assert np.sqrt(off[1]) < 1.5 * SIGMA
    # claimed by gaps made elsewhere, whose readings have noise of their own
    assert all(0.4 < ratio < 1.3 for ratio in np.sqrt(np.array(off) / claimed))


def test_all_bridges_are_tried_at_few_of_many_lost_markers(monkeypatch):
    """Tracks without noise on a rigid body: what is best at one is as good at all."""
    rng, tried = np.random.default_rng(9), []
    t, X = np.arange(200) / 200, rng.uniform(-0.2, 0.2, (30, 3))
    turn = Rotation.from_rotvec(np.outer(t, [1.0, 4.0, 0.5])).as_matrix()
    x = np.einsum("tab,nb->tna", turn, X)
    lost = x.copy()
    for k in range(30):
        lost[5 * k + 20 : 5 * k + 23, k] = np.nan
    plain = bridging.rank_bridges

    def counted(shown, length, ways):
        tried.append(len(ways))
        return plain(shown, length, ways)

    monkeypatch.setattr(bridging, "rank_bridges", counted)
    found = bridged(t, lost, np.ones(30, bool))
    assert np.abs(found.position - x).max() < 1e-9
    assert len(tried) >= 30
    assert sum(n > bridging.JUDGED for n in tried) == bridging.JUDGED
