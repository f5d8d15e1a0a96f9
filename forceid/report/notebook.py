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
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from forceid.files import read_result, read_title, read_truth
from forceid.files.stored.atomic import write_whole
from forceid.records import Array, Estimate
from forceid.report.numbers import Numbers, wrench_numbers
from forceid.report.page import render_page
from forceid.report.plots.figures import draw_wrench
from forceid.report.plots.picture import png

if TYPE_CHECKING:
    import xarray


def plot_wrench(result: xarray.DataTree | str | Path, truth: Mapping[str, Any] | None = None) -> Figure:
    """Force (N) and moment (N m) over time with two-sigma bands, and the truth where there is one.

    A matplotlib figure; a notebook shows it as the last line of a cell. DataError: no result.

    >>> import forceid
    >>> result = forceid.estimate(forceid.open_motion("data/synthetic/top.h5"), method="difference")
    >>> figure = forceid.plot_wrench(result)
    >>> len(figure.axes)
    6
    """
    estimate, known, _ = contents(result, truth)
    figure = draw_wrench(estimate, known)
    # without pyplot, Jupyter knows no picture of a figure
    vars(figure)["_repr_png_"] = partial(png, figure, 110)
    return figure


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
