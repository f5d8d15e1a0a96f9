"""What a notebook shows of a result: the wrench as a figure, the whole page, the numbers one quotes.

A result is the tree that `forceid.estimate` returns, or the path of a result file. The truth is the one that
it carries, unless another is given: the node /truth of a motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.figure import Figure

from forceid.errors import EstimationError
from forceid.files import read_result, read_title, read_truth
from forceid.files.stored.atomic import write_whole
from forceid.records import Array, Estimate
from forceid.report.first_screen import Headline
from forceid.report.first_screen import headline as read_headline
from forceid.report.numbers import Numbers, wrench_numbers
from forceid.report.page import render_page
from forceid.report.plots.figures import draw_load, draw_motion, draw_wrench
from forceid.report.plots.path import draw_path
from forceid.report.plots.picture import png

if TYPE_CHECKING:
    import xarray


def plot_wrench(
    result: xarray.DataTree | str | Path, truth: Mapping[str, Any] | None = None, ax: Any = None
) -> Figure:
    """Force (N) and moment (N m) over time with two-sigma bands, and the truth where there is one.

    A matplotlib figure; a notebook shows it as the last line of a cell. ax: three rows of two axes for it.
    DataError: no result. ConfigError: another number of axes.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> figure = forceid.plot_wrench(result)
    >>> len(figure.axes)
    6
    """
    estimate, known, _ = contents(result, truth)
    return in_notebook(draw_wrench(estimate, known, ax), ax)


def plot_load(
    result: xarray.DataTree | str | Path,
    load: Literal["force", "moment"] = "force",
    axes: str = "xyz",
    ax: Any = None,
    name: str = "",
) -> Figure:
    """The force (N) or the moment (N m) along some axes in one panel, with two-sigma bands.

    ax: the axes to draw in, which may hold other curves; name: of this result in the legend. DataError: no
    result.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> [line.get_label() for line in forceid.plot_load(result, "moment", "xz").axes[0].lines]
    ['x', 'z']
    """
    return in_notebook(draw_load(contents(result, None)[0], load, axes, ax, name), ax)


def plot_motion(result: xarray.DataTree | str | Path, ax: Any = None) -> Figure:
    """Center (m), velocity (m/s), angular velocity (rad/s) and momentum (kg m2/s) over time, world axes.

    ax: two rows of two axes to draw in. DataError: no result. ConfigError: another number of axes.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> len(forceid.plot_motion(result).axes)
    4
    """
    return in_notebook(draw_motion(contents(result, None)[0], ax), ax)


def plot_path(result: xarray.DataTree | str | Path, ax: Any = None) -> Figure:
    """The path of the mass center in space, world axes (m), with arrows for the force.

    ax: axes with projection "3d" to draw in. DataError: no result. EstimationError: no frame shows it.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> forceid.plot_path(result).axes[0].name
    '3d'
    """
    estimate = contents(result, None)[0]
    if not np.isfinite(estimate.center).any():
        what = "no frame shows the mass center, and so there is no path"
        raise EstimationError(what, "result", "add markers until they fix the body")
    return in_notebook(draw_path(estimate, ax), ax)


def in_notebook(figure: Figure, ax: Any) -> Figure:
    """A figure such that Jupyter shows it also without pyplot; one of the user stays as it is."""
    if ax is None:
        vars(figure)["_repr_png_"] = partial(png, figure, 110)
    return figure


def headline(result: xarray.DataTree | str | Path) -> Headline:
    """Verdict in one sentence, three numbers and what to do next; a notebook shows it. DataError: no result.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> forceid.headline(result).level
    'ok'
    """
    return read_headline(contents(result, None)[0])


def summarize(result: xarray.DataTree | str | Path, truth: Mapping[str, Any] | None = None) -> Numbers:
    """Means, rms, claims and, where the truth is known, errors of force (N) and moment (N m), by axis.

    DataError: no result.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> bool((forceid.summarize(result).force_error < 1e-3).all())
    True
    """
    estimate, known, _ = contents(result, truth)
    return wrench_numbers(estimate, known)


class Page(str):
    """One self-contained HTML page, which a notebook shows in a frame of its own."""

    def save(self, path: str | Path) -> Path:
        """Write the page; it appears whole or not at all. ConfigError: not writable."""
        write_whole(path, self)
        return Path(path)

    def _repr_html_(self) -> str:
        frame = 'title="forceid report" style="width:100%;height:720px"'
        return f'<iframe {frame} srcdoc="{escape(self)}"></iframe>'


def show_report(result: xarray.DataTree | str | Path, truth: Mapping[str, Any] | None = None) -> Page:
    """The page of `forceid report`: a notebook shows it, its `save` writes it. DataError: no result.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> forceid.show_report(result)[:15]
    '<!DOCTYPE html>'
    """
    estimate, known, title = contents(result, truth)
    return Page(
        render_page(estimate, known, title, "" if hasattr(result, "children") else Path(str(result)).name)
    )


def contents(
    result: xarray.DataTree | str | Path, truth: Mapping[str, Any] | None
) -> tuple[Estimate, dict[str, Array], str]:
    """Estimate, truth and title of a result; a tree is read as the file that it would be."""
    if isinstance(result, (str, Path)):
        known = read_truth(result) if truth is None else truth
        return read_result(result), truth_arrays(known), read_title(result)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "result.h5"
        result.to_netcdf(path, engine="h5netcdf")
        return contents(path, truth)


def truth_arrays(truth: Mapping[str, Any]) -> dict[str, Array]:
    """The variables of a truth as arrays, its time among them."""
    found = {str(name): np.asarray(values) for name, values in truth.items()}
    time = getattr(truth, "coords", {}).get("time")
    return found if time is None else {"time": np.asarray(time), **found}
