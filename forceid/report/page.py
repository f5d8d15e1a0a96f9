"""One self-contained HTML page of a result: verdict, numbers, figures, settings, provenance."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from forceid.errors import ForceIdError
from forceid.estimation import Simulated, fly_again
from forceid.records import Array, Estimate, Witness
from forceid.report.first_screen import NAMES, headline
from forceid.report.joint_section import joint_section
from forceid.report.numbers import Numbers, digits, wrench_numbers
from forceid.report.plots.chart import Chart, as_json
from forceid.report.plots.charts import (
    deformation_chart,
    first_moments_chart,
    hidden_chart,
    innovations_chart,
    loads_chart,
    motion_chart,
    wrench_chart,
)
from forceid.report.plots.feet import draw_feet, feet_chart
from forceid.report.plots.figures import (
    deforms,
    draw_deformation,
    draw_first_moments,
    draw_hidden_load,
    draw_loads,
    draw_motion,
    draw_wrench,
)
from forceid.report.plots.flown import aero_chart, again_chart, draw_aero, draw_again
from forceid.report.plots.path import draw_path, path_chart
from forceid.report.plots.picture import pictured
from forceid.report.template import named_numbers, render, titled
from forceid.report.whiteness import draw_innovations

_WORDS = tomllib.loads((files("forceid.report") / "captions.toml").read_text("utf-8"))
_SECTIONS = (  # what is folded, in order: name, title, and what one finds there
    ("path", "Path", "where the body went, and the force along it"),
    ("motion", "Motion", "center, velocity, rotation"),
    ("again", "Flown again", "the motion that the load found produces, beside the measured one"),
    ("deformation", "Deformation", "how far the body left its shape"),
    ("loads", "Loads", "the loads that were asked for"),
    ("feet", "Feet", "what the ground gives each of them"),
    ("first_moments", "First moments of force", "what stretches the body, and what turns it"),
    ("joints", "Forces between parts", ""),
    ("coefficients", "Coefficients", "of lift, drag and moment"),  # where `drawings` or `tables` has one
    ("innovations", "Innovations", "does the model fit the measurement"),
    ("hidden", "Hidden load", "what may act and not show"),
    ("sensitivity", "Sensitivity", "what a wrong input would cost"),
    ("tuning", "Model and tuning", "why this model, and which priors"),
)


def render_page(
    estimate: Estimate, truth: Mapping[str, Array] | None = None, title: str = "", source: str = ""
) -> str:
    """The page as HTML text; it refers to no other file and no host. source: the name of the result file."""
    drawn = drawings(estimate, truth)
    joints = joint_section(estimate, truth)
    charts = {name: chart for name, (_, chart) in drawn.items()} | (joints.charts if joints else {})
    return render(
        "page.html.j2",
        title=title or "forceid result",
        source=source,
        e=estimate,
        first=headline(estimate),
        names=NAMES,
        rows=wrench_rows(wrench_numbers(estimate, truth), estimate.witness),
        joints=joints,
        sections=_SECTIONS,
        pictures={
            name: pictured(figure, _WORDS[name][0], _WORDS[name][1], name)
            for name, (figure, _) in drawn.items()
        },
        charts=as_json(charts) if charts else "",
        tables=tables(estimate),
    )


def drawings(
    estimate: Estimate, truth: Mapping[str, Array] | None
) -> dict[str, tuple[Figure, Chart | dict[str, Any]]]:
    """Every figure of the page by name, with the chart that a script draws; none where nothing is known."""
    e = estimate
    if not (np.isfinite(e.force).any() or np.isfinite(e.moment).any() or np.isfinite(e.center).any()):
        return {}
    found: dict[str, tuple[Figure, Chart | dict[str, Any]]] = {
        "wrench": (draw_wrench(e, truth), wrench_chart(e, truth))
    }
    if np.isfinite(e.center).any():  # sensors alone show no place
        found |= {"path": (draw_path(e), path_chart(e)), "motion": (draw_motion(e), motion_chart(e))}
    if deforms(e):
        found["deformation"] = draw_deformation(e), deformation_chart(e)
    if e.loads is not None:
        found["loads"] = draw_loads(e, e.loads), loads_chart(e, e.loads)
    if e.feet is not None:
        found["feet"] = draw_feet(e.time, e.feet), feet_chart(e.time, e.feet)
    if e.first_moment is not None and e.first_moment_cov is not None:
        moments = e.first_moment, e.first_moment_cov
        found["first_moments"] = (
            draw_first_moments(e, *moments, truth),
            first_moments_chart(e, *moments, truth),
        )
    if (again := flown_again(e)) is not None:
        found["again"] = draw_again(e, again), again_chart(again)
    if e.aero is not None:
        found["coefficients"] = draw_aero(e.time, e.aero), aero_chart(e.time, e.aero)
    if e.hidden is not None:
        found["hidden"] = draw_hidden_load(e.hidden), hidden_chart(e.hidden)
    if np.isfinite(e.innovation).any():
        found["innovations"] = draw_innovations(e), innovations_chart(e)
    return found


def tables(estimate: Estimate) -> dict[str, list[tuple[str, list[tuple[str, str]]]]]:
    """Sections that are tables of names and values: each with its heads; what is empty is left out."""
    e = estimate
    choice = [("Why this model", e.model_choice)] if e.model_choice else []
    found = {
        "sensitivity": [
            ("What a wrong input would cost", budget(e)),
            ("Leakage between rigid motion and deformation", named_numbers(e.leakage)),
        ],
        "tuning": [
            ("Levels of the model, looked at on this record", choice + named_numbers(e.ladder)),
            ("Chosen by tuning on this record", tuned(e)),
        ],
    }
    return {name: [part for part in parts if part[1]] for name, parts in found.items()}


def flown_again(estimate: Estimate) -> Simulated | None:
    """The flight under the loads found, None where there is none to compare with, or where it is too long."""
    if len(estimate.time) > FLOWN_FRAMES:
        return None
    try:
        return fly_again(estimate)
    except ForceIdError:
        return None


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


FLOWN_FRAMES = 4000  # frames of a flight that is flown again for the page: a few seconds
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
