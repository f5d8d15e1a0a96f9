"""Several results on one page: whether they agree, in numbers, and in which settings they differ."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forceid.cli.report import names
from forceid.report.comparison import (
    Named,
    agreement,
    comparison_chart,
    differing_settings,
    render_comparison,
    within,
)


@pytest.fixture(scope="module")
def pair(throw):
    """Two estimates of one throw whose errors are independent."""
    return tuple(Named(f"seed {seed}", throw(seed=seed)[0]) for seed in (1, 2))


def test_independent_errors_lie_within_two_joint_sigma_as_often_as_normal_ones(pair):
    share, apart = within(pair[0].estimate, pair[1].estimate, "force")
    assert share == pytest.approx(0.9545, abs=3 * np.sqrt(0.9545 * 0.0455 / 1800))
    sigma = np.linalg.norm([0.05, 0.04, 0.06])
    assert apart == pytest.approx(np.sqrt(2) * sigma, rel=0.1)


def test_a_load_beyond_its_sigma_is_named_as_what_differs(pair):
    first, other = pair
    moved = replace(other.estimate, moment=other.estimate.moment + 0.05)
    assert agreement(first, Named("moved", moved)).startswith("seed 1 and moved differ in the moment: 9")
    same = Named("same", replace(first.estimate))
    assert agreement(first, same) == (
        "seed 1 and same agree: 100 % of the force and 100 % of the moment lie within two joint sigma."
    )


@pytest.mark.long
def test_recordings_that_share_no_time_are_drawn_from_their_own_start(pair):
    first, other = pair
    late = Named("late", replace(other.estimate, time=other.estimate.time + 100.0))
    assert "share no time" in render_comparison([first, late])
    assert "share no time" not in render_comparison(pair)


def test_curves_of_two_clocks_keep_their_values(pair):
    first, other = pair
    half = Named("half", replace(other.estimate, time=other.estimate.time + 0.0025))
    panel = comparison_chart([first, half]).panels[0]
    k = panel.at.index(min(panel.at, key=lambda t: abs(t - first.estimate.time[100])))
    assert panel.curves[0].y[k] == pytest.approx(first.estimate.force[100, 0], rel=1e-3)


def test_settings_that_differ_are_told_and_no_others(pair):
    first, other = pair
    smooth = 'method = "savgol"\nmodel = "auto"\n[noise_std]\nposition = 1e-3\n'
    found = differing_settings([first, Named("b", replace(other.estimate, settings=smooth))])
    assert found == [("method", ["smoother", "savgol"]), ("noise_std.position", ["–", "0.001"])]


def test_every_result_has_a_name_of_its_own():
    assert names([Path("a/x.result.h5"), Path("a/x.result.h5")]) == ["a/x (1)", "a/x (2)"]
