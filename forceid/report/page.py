"""One self-contained HTML page of a result: verdict, numbers, figures, settings, provenance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from forceid import __version__
from forceid.records import Array, Estimate, Witness
from forceid.report.joint_section import joint_section
from forceid.report.numbers import Numbers, digits, plain, plus_minus, typeset, wrench_numbers
from forceid.report.plots.figures import (
    draw_first_moments,
    draw_hidden_load,
    draw_loads,
    draw_motion,
    draw_wrench,
)
from forceid.report.plots.path import draw_path
from forceid.report.plots.picture import Picture, pictured
from forceid.report.template import render
from forceid.report.whiteness import draw_innovations

PAGE_HEADLINE = {
    "ok": "Accurate: force, moment and their sigma can be believed.",
    "degraded": "Degraded: usable with the cautions below.",
    "refused": "Refused: no estimate can be defended from these data.",
}


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
        headline=PAGE_HEADLINE[estimate.verdict.level],
        facts=facts(estimate, quoted),
        rows=wrench_rows(quoted, estimate.witness),
        joints=joint_section(estimate, truth),
        pictures=pictures(estimate, truth),
        tuned=tuned(estimate),
        budget=budget(estimate),
        ladder=[(titled(name), digits(v)) for name, v in estimate.ladder.items()],
        leakage=[(titled(name), digits(v)) for name, v in estimate.leakage.items()],
        provenance=provenance(estimate),
    )


def pictures(estimate: Estimate, truth: Mapping[str, Array] | None) -> list[Picture]:
    """Every figure of the page, in reading order; none where nothing is known."""
    if not np.isfinite(estimate.center).any():
        return []
    drawn = [
        (
            draw_path(estimate),
            "Path and force",
            "Arrows show the applied force, weight excluded, in world axes; all arrows share one scale.",
        ),
        (
            draw_wrench(estimate, truth),
            "Applied force and moment",
            "World axes, weight excluded. The band is two sigma on either side as the estimate claims it; "
            "the plain route is the low-passed rate of momentum and angular momentum.",
        ),
        (
            draw_motion(estimate),
            "Motion",
            "World axes; the deformation, where the model has any, is about the mean shape in body axes.",
        ),
    ]
    if estimate.first_moment is not None and estimate.first_moment_cov is not None:
        figure = draw_first_moments(estimate, estimate.first_moment, estimate.first_moment_cov, truth)
        caption = (
            "First moments f rᵀ of all forces, those in the body too, about the mass center: what is "
            "antisymmetric in them is the moment. A row is of a force, a column of its arm."
        )
        drawn.insert(2, (figure, "First moments of force", caption))
    if estimate.loads is not None:
        caption = "Loads p of f = B p with their two-sigma bands; what the motion cannot see has no band."
        drawn.insert(2, (draw_loads(estimate, estimate.loads), "Applied loads", caption))
    if estimate.hidden is not None:
        caption = (
            "The amplitude of an oscillating load that half of all records like this one would not show. "
            "Shaded: the band in which a load is followed and the claimed sigma holds; dotted: its end on "
            "each axis. Beyond it the estimate says nothing of loads below the curve."
        )
        drawn.append((draw_hidden_load(estimate.hidden), "What may hide", caption))
    if np.isfinite(estimate.innovation).any():
        caption = (
            "If the model is right, whitened innovations are unit normal and uncorrelated: about 95 % of the "
            "points lie within two sigma, and the NIS is near one."
        )
        drawn.append((draw_innovations(estimate), "Innovations", caption))
    return [pictured(figure, name, caption) for figure, name, caption in drawn]


def facts(estimate: Estimate, quoted: Numbers) -> list[tuple[str, str]]:
    """What a reader wants to know first, as name and value."""
    return [
        ("Force, rms", typeset(plus_minus(quoted.force_rms, quoted.force_std, "N"))),
        ("Moment, rms", typeset(plus_minus(quoted.moment_rms, quoted.moment_std, "N m"))),
        ("Record", f"{quoted.duration_s:.4g} s, {quoted.samples} samples"),
        ("Method, model", f"{estimate.method}, {estimate.model}"),
    ]


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


def titled(name: str) -> str:
    """The name of a number as a row of a table has it."""
    return name.replace("_", " ").capitalize()


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


def provenance(estimate: Estimate) -> list[tuple[str, str]]:
    """Where the result came from and how it was made, as name and value."""
    e = estimate
    likelihood = f"{e.log_likelihood:.6g}" if np.isfinite(e.log_likelihood) else "none"
    gravity = ", ".join(plain(float(g), 4) for g in e.gravity)
    return [
        ("forceid", __version__),
        ("Input, SHA-256", e.input_sha256 or "none"),
        ("Method", e.method),
        ("Model", e.model),
        ("Engine", e.engine),
        ("Mass", f"{digits(e.mass)} kg" if np.isfinite(e.mass) else "not known"),
        ("Gravity", typeset(f"({gravity}) m/s²")),
        ("Moment about", e.moment_about.replace("_", " ")),
        ("Log-likelihood", likelihood),
        ("Run time", f"{e.runtime_s:.3g} s"),
    ]
