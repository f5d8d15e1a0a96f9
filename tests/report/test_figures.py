"""The figures: units on every axis, gaps and unknowns shown as such, no peak lost."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from forceid.records import Loads
from forceid.report import whiteness
from forceid.report.plots import figures, path, style

UNIT = re.compile(r"\((m|mm|m/s|rad/s|s|N|N m|kg m²/s|1|sigma|samples)\)$")


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for ax in figure.axes for text in ax.texts]


def with_loads(estimate):
    load = np.stack([estimate.force[:, 0], estimate.moment[:, 1]], axis=-1)
    cov = np.broadcast_to(np.diag([0.05**2, 0.003**2]), (len(load), 2, 2))
    loads = Loads(("tip", "hinge"), load, cov, np.zeros((2, 0)), np.eye(2), np.ones(len(load)), 4)
    return replace(estimate, loads=loads, settings='[[load]]\nname = "hinge"\nkind = "moment"\n')


@pytest.mark.parametrize(
    "draw",
    [
        path.draw_path,
        figures.draw_wrench,
        figures.draw_motion,
        figures.draw_deformation,
        whiteness.draw_innovations,
        lambda e: figures.draw_loads(with_loads(e), with_loads(e).loads),
    ],
    ids=["path", "wrench", "motion", "deformation", "innovations", "loads"],
)
def test_every_axis_states_its_unit(thrown, draw):
    figure = draw(thrown[0])
    for ax in figure.axes:
        names = [ax.get_ylabel(), *([ax.get_zlabel()] if hasattr(ax, "get_zlabel") else [])]
        shared_below = not ax.get_subplotspec().is_last_row() if ax.get_subplotspec() else False
        names += [ax.get_xlabel()] if ax.get_xlabel() or not shared_below else []
        for name in names:
            assert UNIT.search(name), name


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, -9.81, 0), (9.81, 0, 0), (0, 0, 0)])
def test_path_is_drawn_at_equal_scale_and_upright(thrown, gravity):
    ax = path.draw_path(replace(thrown[0], gravity=np.array(gravity, float))).axes[0]
    origin, *ends = path.project(ax, np.concatenate([np.zeros((1, 3)), np.eye(3)]))
    meter = np.stack([end - origin for end in ends], axis=-1)
    # an orthographic view of orthonormal axes at scale s has P P^T = s^2 I
    scale = meter @ meter.T
    np.testing.assert_allclose(scale, scale[0, 0] * np.eye(2), atol=1e-9 * scale[0, 0])
    down = meter @ np.array(gravity) if any(gravity) else -meter[:, 2]
    assert down[1] < 0
    assert down[0] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (0.01, 0.01, 10), (10, 0.01, 0.01), (0, 0, 0)])
def test_path_stays_inside_its_figure_whatever_its_shape(thrown, stretch):
    estimate = replace(thrown[0], center=thrown[0].center * stretch)
    ax = path.draw_path(estimate).axes[0]
    inches = path.project(ax, estimate.center)
    assert (inches >= 0.3).all()
    assert (inches <= [path.WIDTH - 0.3, path.HEIGHT - 0.3]).all()


def test_peak_of_one_sample_gets_an_arrow_and_force_below_two_sigma_none(thrown):
    estimate, _ = thrown
    force = estimate.force.copy()
    force[333] = [90.0, 0.0, 0.0]
    assert 333 in path.strongest(replace(estimate, force=force))
    assert len(path.strongest(estimate)) == path.ARROWS
    assert len(path.strongest(replace(estimate, force=0.01 * force))) == 1


def test_arrows_are_as_dense_where_the_body_is_slow_as_where_it_is_fast(thrown):
    estimate, _ = thrown
    way = np.linspace(0.0, 1.0, 600) ** 4  # of its first tenth, more than half of the time
    center = np.stack([way, 0 * way, 0 * way], axis=-1)
    gaps = np.diff(center[path.strongest(replace(estimate, center=center, force=np.ones((600, 3)))), 0])
    assert len(gaps) == path.ARROWS - 1
    assert gaps.max() < 1.5 * gaps.min()


def test_moment_of_a_particle_is_called_not_identifiable(thrown):
    estimate = replace(thrown[0], moment=np.full_like(thrown[0].moment, np.nan))
    assert texts(figures.draw_wrench(estimate)).count("not identifiable") == 3


def test_band_is_two_sigma_wide(thrown):
    estimate, _ = thrown
    exact = replace(estimate, force=np.zeros_like(estimate.force))
    band = figures.draw_wrench(exact).axes[0].collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(2 * 0.05)
    assert band[:, 1].min() == pytest.approx(-2 * 0.05)


def test_truth_is_drawn_only_where_there_is_one(thrown):
    estimate, truth = thrown
    assert len(figures.draw_wrench(estimate, truth).axes[0].lines) == 2
    assert len(figures.draw_wrench(estimate, {}).axes[0].lines) == 1


def test_thinning_keeps_a_peak_of_one_sample():
    ax = Figure().subplots()
    values = np.zeros(100_000)
    values[77_777] = 5.0
    style.draw_line(ax, np.arange(100_000.0), values)
    drawn = ax.lines[0].get_ydata()
    assert len(drawn) == 2 * style.BINS
    assert drawn.max() == 5.0


def test_gap_stays_a_gap_when_thinned():
    ax = Figure().subplots()
    values = np.ones(100_000)
    values[40_000:60_000] = np.nan
    style.draw_line(ax, np.arange(100_000.0), values)
    assert np.mean(np.isnan(ax.lines[0].get_ydata())) == pytest.approx(0.2, abs=2 / style.BINS)


def test_colored_innovations_leave_the_bounds_and_white_ones_do_not():
    white = np.random.default_rng(3).normal(size=4000)
    colored = np.convolve(white, np.ones(5) / np.sqrt(5), mode="same")
    bound = 2 / np.sqrt(4000)
    assert np.mean(np.abs(whiteness.correlogram(white)) > bound) < 0.15
    # a moving average over five samples correlates its neighbors by 4/5
    assert whiteness.correlogram(colored)[0] == pytest.approx(0.8, abs=0.05)


def test_rigid_body_has_no_deformation_to_draw(thrown):
    rigid = replace(thrown[0], deformation=np.zeros((600, 8, 3)), mode_amplitude=None)
    assert figures.deforms(thrown[0])
    assert not figures.deforms(rigid)


def test_innovation_of_an_impact_leaves_the_others_readable(thrown):
    estimate, _ = thrown
    hit = estimate.innovation.copy()
    hit[300] = 200.0
    series = whiteness.draw_innovations(replace(estimate, innovation=hit)).axes[0]
    low, two, top = series.transAxes.inverted().transform(
        series.transData.transform([[0, 0], [0, 2], [0, 200]])
    )
    assert two[1] - low[1] > 0.1
    assert top[1] < 1


def test_many_channels_are_thinned_to_twelve():
    assert whiteness.channels(np.zeros((10, 300))).shape[1] <= 12
    assert whiteness.channels(np.full((10, 3), np.nan)).shape[1] == 0
