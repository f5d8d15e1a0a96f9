"""One self-contained HTML page of a result: verdict, numbers, figures, settings, provenance."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files

import numpy as np

from forceid.records import Array, Estimate, Witness
from forceid.report.joint_section import joint_section
from forceid.report.numbers import Numbers, digits, wrench_numbers
from forceid.report.plots.figures import (
    draw_first_moments,
    draw_hidden_load,
    draw_loads,
    draw_motion,
    draw_wrench,
)
from forceid.report.plots.path import draw_path
from forceid.report.plots.picture import Picture, pictured
from forceid.report.template import render, titled
from forceid.report.whiteness import draw_innovations

_WORDS = tomllib.loads((files("forceid.report") / "captions.toml").read_text("utf-8"))


def render_page(
    estimate: Estimate, truth: Mapping[str, Array] | None = None, title: str = "", source: str = ""
) -> str:
    """The page as HTML text; it refers to no other file and no host. source: the name of the result file."""
    quoted = wrench_numbers(estimate, truth)
    return render(
        "page.html.j2",
        title=title or "forceid result",
        source=source,
        e=estimate,
        quoted=quoted,
        rows=wrench_rows(quoted, estimate.witness),
        joints=joint_section(estimate, truth),
        pictures=pictures(estimate, truth),
        tuned=tuned(estimate),
        budget=budget(estimate),
    )


def pictures(estimate: Estimate, truth: Mapping[str, Array] | None) -> list[Picture]:
    """Every figure of the page, in reading order; none where nothing is known."""
    if not np.isfinite(estimate.center).any():
        return []
    drawn = {"path": draw_path(estimate), "wrench": draw_wrench(estimate, truth)}
    if estimate.loads is not None:
        drawn["loads"] = draw_loads(estimate, estimate.loads)
    if estimate.first_moment is not None and estimate.first_moment_cov is not None:
        moments = estimate.first_moment, estimate.first_moment_cov
        drawn["first_moments"] = draw_first_moments(estimate, *moments, truth)
    drawn["motion"] = draw_motion(estimate)
    if estimate.hidden is not None:
        drawn["hidden"] = draw_hidden_load(estimate.hidden)
    if np.isfinite(estimate.innovation).any():
        drawn["innovations"] = draw_innovations(estimate)
    return [pictured(figure, *_WORDS[name]) for name, figure in drawn.items()]


def wrench_rows(quoted: Numbers, witness: Witness | None) -> list[tuple[str, str, list[str]]]:
    """Rows of the table of numbers: name, unit, one text an axis; rows that nobody knows are left out.

    Behind those of the estimate, how far it is from the plain route, and the cut-off of that.
    """
    rows = []
    for name, unit, momentum in (("force", "N", "momentum"), ("moment", "N m", "angular momentum")):
        title = name.capitalize()
        rows += [
            (f"{title}, mean", unit, getattr(quoted, f"{name}_mean")),
            (f"{title}, rms", unit, getattr(quoted, f"{name}_rms")),
            (f"{title}, mean sigma", unit, getattr(quoted, f"{name}_std")),
            (f"{title}, rms error against truth", unit, getattr(quoted, f"{name}_error")),
            (f"{title}, rms of error over sigma", "1", getattr(quoted, f"{name}_score")),
            (f"Change of {momentum} less impulse", f"{unit} s", getattr(quoted, f"{name}_closure")),
            ("Sigma of that impulse at most", f"{unit} s", getattr(quoted, f"{name}_closure_limit")),
        ]
    for load, unit in () if witness is None else (("force", "N"), ("moment", "N m")):
        rows += [
            (f"{load.capitalize()}, cut-off of the plain route", "Hz", getattr(witness, f"cutoff_{load}")),
            ("Apart from it, rms", unit, getattr(witness, f"apart_{load}")),
            ("Apart from it, in joint errors", "1", getattr(witness, f"difference_{load}")),
            ("By chance at most", "1", getattr(witness, f"limit_{load}")),
        ]
    known = [row for row in rows if np.isfinite(row[2]).any()]
    return [(name, unit, [digits(v) for v in values]) for name, unit, values in known]


UNITS = {
    "noise_std_orientation": "rad",
    "noise_std": "m",
    "force_std": "N",
    "moment_std": "N m",
    "rate": "1/s",
}


LOAD_ROUNDING = 1e-12  # N or N m: rounding


def tuned(estimate: Estimate) -> list[tuple[str, str]]:
    """What tuning chose, as name and value with its unit."""
    rows = []
    for name, value in estimate.tuned.items():
        unit = " s" if name.endswith("_s") else next((f" {u}" for key, u in UNITS.items() if key in name), "")
        rows.append((titled(name.removesuffix("_s")), f"{digits(value)}{unit}"))
    return rows


def budget(estimate: Estimate) -> list[tuple[str, str]]:
    """What a wrong body would cost, as name and value with its unit; nothing where it costs nothing."""
    return [
        (titled(name), f"{digits(value)} {'N' if '_force_' in name else 'N m'}")
        for name, value in estimate.sensitivity.items()
        if value > LOAD_ROUNDING
    ]
