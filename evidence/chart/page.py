"""The page of the chart: what it says, in sentences that are worked out from the numbers, and every table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evidence.chart.front import Point, ahead, front, most_accurate, over_best
from evidence.subjects.affine import page as chart_affine_page
from evidence.subjects.flights.methods import DEFAULT
from evidence.subjects.parts.page import section

UNITS = {"force": "N", "moment": "N m"}
NEAR = 1.25  # times the error of the best point: where default settings are to be
READING = (
    "Errors are rms per axis over the central three quarters of the record{seeds}. Time is process CPU time "
    "from raw markers to the wrench, {timing}. *Told* methods chose their "
    "parameters on the truth: nobody can do that on a record of his own, and they do not count for the "
    "front. The bound is the posterior deviation of the smoother under a Matern prior fitted to the true "
    "load, with the noise as stated: on one smooth record an error may be below it, and where the load "
    "holds a line it is too large. *Covered* is the share of the truth inside the 95 % interval claimed. "
    "Memory is the peak of what Python and numpy allocate."
)


def points_of(case: Mapping[str, Any], load: str) -> list[Point]:
    """The contestants of a case that have an error in a load, as points."""
    return [
        Point(r["name"], r["seconds_a_sample"], r["error"][load], r["kind"] != "peer", r["told"], r["kind"])
        for r in case["rows"]
        if "failed" not in r and np.isfinite(r["error"][load])
    ]


def page(result: Mapping[str, Any]) -> str:
    """The page in markdown."""
    parts = ["# Accuracy against speed", preamble(result)]
    if result["cases"]:
        parts += ["## What the charts say", overview(result["cases"])]
    for case in result["cases"]:
        parts += [
            f"## {case['title'] or case['name']}",
            facts(case),
            f"![{case['name']}](chart_{case['name']}.png)",
        ]
        parts += [*sentences(case), table(case), *remarks(case)]
    if result["simplifications"]:
        parts += ["## What simplifications save and lose", simpler(result["simplifications"])]
    if result["cost"]:
        parts += ["## How cost grows", grown(result["cost"]), "![cost](chart_cost.png)"]
    parts += section(result.get("bodies_in_parts", []), timing(result["extent"]))
    parts += chart_affine_page.section(result.get("affine_bodies", []), timing(result["extent"]))
    return "\n\n".join(part for part in parts if part) + "\n"


def preamble(result: Mapping[str, Any]) -> str:
    """What was run, where, and how to read it."""
    extent = result["extent"]
    versions = ", ".join(f"{name} {number}" for name, number in result["versions"].items())
    lines = [
        f"`{result['command']}`, {result['date']}: forceid {result['forceid']}, engine {result['engine']}, "
        f"Python {result['python']}, {versions}; {result['processor']}."
    ]
    if result["cases"]:
        seeds = f", over {extent['seeds']} seeds of the noise" if extent["seeds"] > 1 else ""
        lines.append(READING.format(seeds=seeds, timing=timing(extent)))
    if result["missing"]:
        lines.append(f"Not installed here, and left out: {', '.join(result['missing'])}.")
    return "\n\n".join(lines)


def timing(extent: Mapping[str, Any]) -> str:
    """How often everything was timed."""
    if not extent["rounds"]:
        return "one run each"
    return (
        f"median of {extent['rounds']} rounds in which everyone takes a turn (who takes long sits some out)"
    )


def overview(cases: Sequence[Mapping[str, Any]]) -> str:
    """One line a case and load: who is best, who is ahead, and where the default is."""
    rows = [
        "| case | | best of ours | best peer | peers faster and more accurate than our best "
        "| default over best point |",
        "|---|---|---|---|---|---|",
    ]
    clear, near, count = 0, 0, 0
    for case in cases:
        for load, unit in UNITS.items():
            points = points_of(case, load)
            honest = [p for p in points if not p.told]
            own, peer = [p for p in honest if p.ours], [p for p in honest if not p.ours]
            if not own or not peer or DEFAULT not in {p.name for p in own}:
                continue
            best, other = most_accurate(own), most_accurate(peer)
            faster = ahead(points, told=False)
            ratio, who = over_best(points, DEFAULT)
            count, clear, near = count + 1, clear + (not faster), near + (ratio <= NEAR)
            rows.append(
                f"| {case['name']} | {load} | {best.name} {best.error:.3g} {unit} "
                f"| {other.name} {other.error:.3g} {unit} | {', '.join(p.name for p in faster) or 'none'} "
                f"| {ratio:.2f} ({who}) |"
            )
    said = (
        f"In {clear} of {count} charts no peer that is told nothing is both faster and more accurate than "
        f"our best point. Default settings are within {NEAR:g} times the error of the best point in {near} "
        f"of {count}."
    )
    return said + "\n\n" + "\n".join(rows)


def facts(case: Mapping[str, Any]) -> str:
    """What was recorded, and how large loads and bounds are."""
    known = [
        f"{load} {case['load'][load]:.3g} {unit} rms, bound {case['bound'][load]:.3g} {unit}"
        for load, unit in UNITS.items()
        if np.isfinite(case["load"][load])
    ]
    noise = ", ".join(f"{name} {value:g}" for name, value in case["noise_std"].items()) or "not stated"
    kind = "measured, truth from an instrument" if case["measured"] else f"synthetic, {case['seeds']} seeds"
    caution = (
        " Errors of measured tracks are not white: the bound is what white noise of that size would allow."
        if case["measured"]
        else ""
    )
    return (
        f"{case['samples']} samples at {case['rate_Hz']:.4g} Hz, {case['markers']} markers, noise {noise}; "
        f"{kind}. {'; '.join(known)}.{caution}"
    )


def sentences(case: Mapping[str, Any]) -> list[str]:
    """What the chart of a case says of each load."""
    found = []
    for load, unit in UNITS.items():
        points = points_of(case, load)
        own = [p for p in points if p.ours and not p.told]
        if not own:
            continue
        best = most_accurate(own)
        on = ", ".join(f"{p.name} ({p.error:.3g} {unit}, {micro(p.seconds)})" for p in front(points))
        faster, told = ahead(points, told=False), ahead(points, told=True)
        text = f"**{load.capitalize()}.** Front: {on}. "
        if faster:
            names = ", ".join(f"{p.name} ({p.error:.3g} {unit})" for p in faster)
            mine = f"{best.name}, {best.error:.3g} {unit}"
            text += f"Faster and more accurate than our best point ({mine}): {names}. "
        else:
            text += f"No peer is both faster and more accurate than our best point, {best.name}. "
        if told:
            text += f"Only with the truth told: {', '.join(f'{p.name} {p.error:.3g} {unit}' for p in told)}. "
        if DEFAULT in {p.name for p in own}:
            ratio, who = over_best(points, DEFAULT)
            text += f"Default settings: {ratio:.2f} times the error of the best point ({who})."
        found.append(text)
    return found


def table(case: Mapping[str, Any]) -> str:
    """Every contestant of a case."""
    rows = [
        "| | force error (N) | over bound | covered | moment error (N m) | over bound | covered "
        "| us a sample | times default | peak MB | verdict | chose |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in case["rows"]:
        if "failed" in r:
            rows.append(f"| {r['name']} | no answer: {r['failed']} |" + " |" * 10)
            continue
        cells = [r["name"]]
        for load in UNITS:
            covered = r["coverage"][load]
            cells += [
                number(r["error"][load]),
                number(r["over_bound"][load]),
                f"{100 * covered:.0f} %" if np.isfinite(covered) else "-",
            ]
        peak = r["peak_MB"]
        said = ", ".join(v if n == case["seeds"] else f"{v} {n}" for v, n in r["verdict"].items())
        cells += [
            f"{1e6 * r['seconds_a_sample']:.3g}",
            f"{r['times_default']:.3g}",
            number(peak),
            said or "-",
        ]
        rows.append(f"| {' | '.join([*cells, r['chosen'] or '-'])} |")
    return "\n".join(rows)


def remarks(case: Mapping[str, Any]) -> list[str]:
    """Why a verdict of the default settings is not `ok`."""
    reasons: list[str] = next((r.get("reasons", []) for r in case["rows"] if r["name"] == DEFAULT), [])
    return ["The default settings say: " + "; ".join(reasons) + "."] if reasons else []


def simpler(rows: Sequence[Mapping[str, Any]]) -> str:
    """The simplifications."""
    out = [
        "Same flight, same prior (that of the true load), both in turns.\n",
        "| | on | CPU ms | simpler, ms | saved | force error (N) | simpler | moment error (N m) | simpler |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        errors = [number(e) for load in UNITS for e in r["error"][load]]
        times = f"{1e3 * r['exact_s']:.3g} | {1e3 * r['simple_s']:.3g} | {r['saved']:.2g} times"
        out.append(f"| {r['name']}: {r['about']} | {r['case']} | {times} | {' | '.join(errors)} |")
    return "\n".join(out)


def grown(costs: Sequence[Mapping[str, Any]]) -> str:
    """Exponents of cost."""
    out = [
        "Slope of log time over log size, over the larger half of the sizes.\n",
        "| over | sizes | | exponent | CPU s at the largest |",
        "|---|---|---|---|---|",
    ]
    for cost in costs:
        for name, exponent in cost["exponents"].items():
            sizes = f"{cost['sizes'][0]} to {cost['sizes'][len(cost['seconds'][name]) - 1]}"
            out.append(
                f"| {cost['over']} | {sizes} | {name} | {exponent:.2f} | {cost['seconds'][name][-1]:.3g} |"
            )
    return "\n".join(out)


def number(value: float | None) -> str:
    """Three figures, or a dash.

    >>> number(0.012345), number(float("nan")), number(None)
    ('0.0123', '-', '-')
    """
    return f"{value:.3g}" if value is not None and np.isfinite(value) else "-"


def micro(seconds: float) -> str:
    """Seconds as microseconds.

    >>> micro(1.234e-3)
    '1230 us'
    """
    return f"{float(f'{1e6 * seconds:.3g}'):g} us"
