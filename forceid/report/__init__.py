"""The report: the numbers, the figures and one self-contained page.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

_HOMES = {
    "plain": "forceid.report.numbers",
    "plus_minus": "forceid.report.numbers",
    "wrench_numbers": "forceid.report.numbers",
    "render_page": "forceid.report.page",
    "render_batch": "forceid.report.batch_page",
    "find_outliers": "forceid.report.outliers",
    "plot_wrench": "forceid.report.notebook",
    "show_stages": "forceid.report.stages",
    "show_report": "forceid.report.notebook",
    "summarize": "forceid.report.notebook",
}
__all__ = [*_HOMES]

if TYPE_CHECKING:
    from forceid.report.batch_page import render_batch as render_batch
    from forceid.report.notebook import plot_wrench as plot_wrench
    from forceid.report.notebook import show_report as show_report
    from forceid.report.notebook import summarize as summarize
    from forceid.report.numbers import plain as plain
    from forceid.report.numbers import plus_minus as plus_minus
    from forceid.report.numbers import wrench_numbers as wrench_numbers
    from forceid.report.outliers import find_outliers as find_outliers
    from forceid.report.page import render_page as render_page
    from forceid.report.stages import show_stages as show_stages


__getattr__ = on_first_use(__name__, _HOMES)
