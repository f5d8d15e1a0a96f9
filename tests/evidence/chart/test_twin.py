"""Twins of recordings: their motion is what their loads make, and they rank methods as the truth does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.stats import kendalltau
from spinning_body import spinning

from evidence.subjects.flights import twin as flights_twin
from evidence.subjects.flights.bodies import Setup, fly
from evidence.subjects.flights.cases import case_of, shipped
from evidence.subjects.flights.chart import contestants, rms_by_load, scored_by_axis
from evidence.subjects.flights.twin import surrogate, twin
from forceid.errors import DataError
from forceid.records import Motion, Recording
from forceid.scenes.recipe import load_recipe, simulate

BLIND = replace(spinning(6, 300), truth={})


def test_momenta_of_the_masses_of_a_twin_change_as_its_loads_and_weight_say():
    flown, noise = fly(Setup(), np.random.default_rng(8)), 1e-7
    x = flown.position + noise * np.random.default_rng(9).standard_normal(flown.position.shape)
    motion = Motion(flown.time, x, gravity=flown.gravity, noise_std={"position": noise})
    found = twin(Recording(flown.body, motion), np.random.default_rng(3))
    m, masses = found.body.mass, make_interp_spline(flown.time, found.motion.position, k=5)
    a = masses(flown.time, 2)
    arm = found.motion.position - found.truth["center"][:, None]
    made = {
        "force": np.einsum("n,tna->ta", m, a - flown.gravity),
        "moment": np.einsum("n,tna->ta", m, np.cross(arm, a)),
    }
    for load, values in made.items():
        off, truth = (values - found.truth[load])[20:-20], found.truth[load]
        assert np.sqrt((off**2).mean()) < 0.02 * np.sqrt((truth**2).mean())


def test_another_seed_is_another_twin_of_the_same_gaps():
    x = BLIND.motion.position.copy()
    x[40:60, 2] = np.nan
    gappy = replace(BLIND, motion=replace(BLIND.motion, position=x))
    one, other = (twin(gappy, np.random.default_rng(seed)) for seed in (1, 2))
    np.testing.assert_array_equal(np.isnan(one.motion.position), np.isnan(x))
    assert np.nanmax(np.abs(one.motion.position - other.motion.position)) > 0
    assert np.abs(one.truth["force"] - other.truth["force"]).max() > 0


def test_a_long_recording_has_a_twin_of_the_stretch_in_its_middle(monkeypatch):
    monkeypatch.setattr(flights_twin, "LONG", 200)
    found = twin(BLIND, np.random.default_rng(1))
    np.testing.assert_array_equal(found.motion.time, BLIND.motion.time[50:250])
    assert found.motion.position.shape[0] == len(found.truth["force"]) == 200


def test_a_surrogate_has_the_spectrum_of_its_noise():
    rng = np.random.default_rng(5)
    noise = np.cumsum(rng.standard_normal((256, 4)), axis=0)
    drawn = surrogate(noise, rng)
    np.testing.assert_allclose(
        np.abs(np.fft.rfft(drawn, axis=0))[1:-1], np.abs(np.fft.rfft(noise, axis=0))[1:-1], rtol=1e-9
    )
    assert np.abs(np.corrcoef(drawn[:, 0], noise[:, 0])[0, 1]) < 0.9


def test_a_recording_without_markers_has_no_twin():
    center = BLIND.motion.position.mean(1)
    bare = replace(BLIND, motion=replace(BLIND.motion, position=None, center=center))
    with pytest.raises(DataError, match=r"mine.h5 holds no markers alone"):
        twin(bare, np.random.default_rng(0), "mine.h5")


@pytest.mark.long
@pytest.mark.parametrize("name", ["spinning_block", "two_blocks", "wobbling_drop", "top", "frisbee"])
def test_methods_rank_on_a_twin_as_on_the_truth(name):
    """Of all quick contestants that are told nothing, ours and peers: force and moment."""
    case = case_of(name, simulate(load_recipe(shipped()[name])), False)
    other = case_of(name, twin(case.blind, np.random.default_rng(11), name), False)
    asked = [c for c in contestants(case)[0] if not (c.slow or c.told)]

    def errors(one):
        return np.array([rms_by_load(scored_by_axis(one, c.prepare(one)())["error"]) for c in asked])

    for truth, twins in zip(errors(case).T, errors(other).T, strict=True):
        assert kendalltau(truth, twins).statistic >= 0.7
