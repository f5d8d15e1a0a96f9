"""A mass center told wrong, on flights that nothing pushes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.drawn.records.hidden_bodies import SUBSTEPS, rotations_under
from evidence.judged import judged_part
from forceid.config import load_settings
from forceid.estimation.loads.hidden.body_told import BALANCED
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

RATE, FRAMES, NOISE, MARKERS = 200.0, 400, 3e-4, 8  # Hz, frames, m
EDGES = np.array([0.6, 0.4, 0.2])  # m, of a box of 1 kg


def thrown(seed, off):
    """A box without weight that tumbles, its mass center told `off` (m, standard deviation) beside itself."""
    rng = np.random.default_rng(seed)
    square = EDGES**2 / 12
    J = np.diag(square.sum() - square)
    t = np.arange(FRAMES) / RATE
    fine = np.arange(2 * SUBSTEPS * (FRAMES - 1) + 1) / (2 * SUBSTEPS * RATE)
    spin = np.exp(rng.uniform(*np.log([0.5, 10]))) * (d := rng.standard_normal(3)) / np.linalg.norm(d)
    R = rotations_under(
        fine, Rotation.identity(), np.tile(J @ spin, (len(fine), 1)), J, np.zeros((len(fine), 3))
    )
    X = EDGES * rng.uniform(-0.5, 0.5, (MARKERS, 3))
    x = np.outer(t, rng.standard_normal(3))[:, None] + np.einsum("tab,nb->tna", R, X)
    x = x + NOISE * rng.standard_normal(x.shape)
    told = off * rng.standard_normal(3)
    names = tuple(f"m{k}" for k in range(MARKERS))
    body = Body(names, X, total_mass=1.0, mass_center=told, inertia=J)
    return Recording(body, Motion(t, x, gravity=np.zeros(3), noise_std={"position": NOISE}))


def over_claims(off, seeds):
    """Rms error of the force over its rms claim, of each flight; what is found is all error."""
    over = []
    for seed in seeds:
        found = estimate_recording(thrown(seed, off), load_settings(model="rigid"))
        error, claim = judged_part(found.force), judged_part(found.force_std)
        over.append(np.sqrt((error**2).mean() / (claim**2).mean()))
    return np.array(over)


@pytest.mark.long
def test_a_force_that_a_wrong_center_makes_is_within_its_claim():
    length = float(np.sqrt((EDGES**2).sum()))
    over = over_claims(BALANCED * length, range(24))
    assert over.max() < 1.5
    assert 0.8 < np.sqrt((over**2).mean()) < 1.2


@pytest.mark.long
def test_a_right_center_is_claimed_as_well_as_the_record_shows_it():
    over = over_claims(0.0, range(4))
    assert 0.1 < np.sqrt((over**2).mean()) < 1.3
