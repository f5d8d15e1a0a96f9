from pathlib import Path

import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from matplotlib.figure import Figure

import forceid
from forceid.errors import ConfigError, DataError, EstimationError

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"


@pytest.fixture(scope="module")
def motion():
    return forceid.open_motion(SYNTHETIC / "spin_synchronous.h5")


@pytest.fixture(scope="module")
def result(motion):
    return forceid.estimate(motion, method="difference")


def shown(value):
    return DisplayFormatter().format(value)[0]


def test_a_notebook_shows_the_wrench_as_a_picture(result):
    figure = forceid.plot_wrench(result)
    assert shown(figure)["image/png"].startswith(b"\x89PNG")
    assert [axes.get_ylabel() for axes in figure.axes[:2]] == ["F$_x$ (N)", "M$_x$ (N m)"]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["estimate", "two sigma", "plain route", "truth"]


def test_the_truth_is_that_of_the_result_or_the_one_given_or_none(result, motion):
    own, given = forceid.summarize(result), forceid.summarize(result, motion["truth"])
    assert np.isfinite(own.force_error).all()
    assert np.array_equal(own.force_error, given.force_error)
    assert np.isnan(forceid.summarize(result, {}).force_error).all()
    shifted = motion["truth"].to_dataset().assign(force=motion["truth/force"] + 1.0)
    assert (forceid.summarize(result, shifted).force_error > 0.9).all()


def test_numbers_of_a_tree_are_those_of_its_file(result, tmp_path):
    result.to_netcdf(tmp_path / "r.h5", engine="h5netcdf")
    from_tree, from_file = forceid.summarize(result).as_dict(), forceid.summarize(tmp_path / "r.h5").as_dict()
    assert from_tree == from_file
    assert from_tree["samples"] == len(result["estimate/time"])


@pytest.mark.long
def test_the_page_is_that_of_the_command_and_stands_in_a_frame(result, tmp_path):
    page = forceid.show_report(result)
    assert page.startswith("<!DOCTYPE html>")
    frame = shown(page)["text/html"]
    assert frame.startswith("<iframe")
    assert frame.count('"') == 6  # nothing of the page ends its attribute
    assert page.save(tmp_path / "page.html").read_text("utf-8") == page
    with pytest.raises(ConfigError, match="cannot be written"):
        page.save(tmp_path / "nowhere" / "page.html")


def test_a_result_that_is_refused_is_shown_as_such(motion):
    unseen = motion.copy(deep=True)
    unseen["motion/position"][:, :-2] = np.nan  # two markers: a turn about them is not seen
    result = forceid.estimate(unseen)
    assert result["estimate"].attrs["verdict"] == "refused"
    assert "not identifiable" in [
        text.get_text() for axes in forceid.plot_wrench(result).axes for text in axes.texts
    ]
    assert "Refused" in forceid.show_report(result)


def test_what_is_no_result_is_refused(motion, tmp_path):
    with pytest.raises(DataError, match="is missing, expected in a result file"):
        forceid.plot_wrench(motion)
    with pytest.raises(DataError, match="cannot be read"):
        forceid.show_report(tmp_path / "no.h5")


def test_a_notebook_shows_the_verdict_of_a_result_before_what_it_holds(result, motion):
    html = shown(result)["text/html"]
    assert "<b>Accurate.</b>" in html
    assert html.index("Typical force") < html.index("All it holds") < html.index("xr-wrap")
    assert "Accurate" not in shown(motion)["text/html"]
    assert "Accurate" not in shown(result["estimate"])["text/html"]
    assert type(result.copy(deep=True)) is type(result)


@pytest.mark.long
def test_every_plot_draws_in_axes_that_are_given(result):
    for plot, rows, columns in (
        (forceid.plot_wrench, 3, 2), (forceid.plot_motion, 2, 2), (forceid.plot_load, 1, 1),
    ):  # fmt: skip
        own = Figure()
        axes = own.subplots(rows, columns)
        assert plot(result, ax=axes) is own
        assert all(ax.lines for ax in own.axes)
    own = Figure()
    space = own.add_subplot(projection="3d")
    assert forceid.plot_path(result, ax=space) is own
    assert space.lines
    with pytest.raises(ConfigError, match="are 1 axes, expected 6"):
        forceid.plot_wrench(result, ax=Figure().subplots())


def test_two_results_in_one_panel_are_told_apart_by_name_and_color(result):
    ax = Figure().subplots()
    for name in ("one", "two"):
        forceid.plot_load(result, "force", "z", ax=ax, name=name)
    assert [line.get_label() for line in ax.lines] == ["one z", "two z"]
    assert len({line.get_color() for line in ax.lines}) == 2
    assert len(ax.collections) == 2


def test_a_path_that_no_frame_shows_is_refused(motion):
    unseen = motion.copy(deep=True)
    unseen["motion/position"][:, :-2] = np.nan
    with pytest.raises(EstimationError, match="no frame shows the mass center"):
        forceid.plot_path(forceid.estimate(unseen))
