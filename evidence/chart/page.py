"""The page of the chart: what it says, in sentences that are worked out from the numbers, and every table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from evidence.chart.charted import Charted
from evidence.chart.front import Point, ahead, front, most_accurate, over_best
from evidence.chart.front import points_of as points_in_order
from evidence.written import tabled

NEAR = 1.25  # times the error of the best point: where default settings are to be
FEW_CASES = 2  # cases: of more, what is said of each and its table are left to the pictures and to chart.json
MEMORY_NOTE = "Memory is the peak of what Python and numpy allocate."

ChartCase = Mapping[str, Any]


def page(result: Mapping[str, Any], subjects: Iterable[Charted]) -> str:
    """The page in markdown."""
    extent = result["extent"]
    versions = ", ".join(f"{name} {number}" for name, number in result["versions"].items())
    present = {case["subject"] for case in result["cases"]}
    shown = [subject for subject in subjects if subject.name in present]
    titles = ", ".join(subject.title.lower() for subject in shown)
    parts = [
        f"# Accuracy against speed: {titles}",
        f"`{result['command']}`, {result['date']}: forceid {result['forceid']}, engine {result['engine']}, "
        f"Python {result['python']}, {versions}; {result['processor']}.",
    ]
    if result["missing"]:
        parts.append(f"Not installed here, and left out: {', '.join(result['missing'])}.")
    for subject in shown:
        if cases := [case for case in result["cases"] if case["subject"] == subject.name]:
            reading = f"{subject.reading.format(timing(extent))} {MEMORY_NOTE}"
            few = len(result["cases"]) <= FEW_CASES
            parts += [f"## {subject.title}", reading, overview(subject, cases, few)]
            parts += [part for case in cases for part in of_case(subject, case, few)]
    if len(result["cases"]) > FEW_CASES:
        parts.append("`chart.json` beside this page has everyone's error, claim, time and verdict.")
    return "\n\n".join(part for part in parts if part) + "\n"


def timing(extent: Mapping[str, Any]) -> str:
    """How often everything was timed."""
    if not extent["rounds"]:
        return "one run each"
    return (
        f"median of {extent['rounds']} rounds in which everyone takes a turn (who takes long sits some out)"
    )


def of_case(subject: Charted, case: ChartCase, full: bool = True) -> list[str]:
    """A case: title, what it is, picture, what that says, everyone in a table; in brief the picture."""
    picture = f"![{case['name']}](chart_{case['name']}.png)"
    if not full:
        return [picture]
    brief = [f"### {case['title']}", subject.described(case), picture]
    return [*brief, *sentences(subject, case), *reasons(subject, case), case_table(subject, case)]


def reasons(subject: Charted, case: ChartCase) -> list[str]:
    """Why the verdict of the default settings is not `ok`."""
    found: list[str] = next((r.get("reasons", []) for r in case["rows"] if r["name"] == subject.default), [])
    return [f"The default settings say: {'; '.join(found)}."] if found else []


def overview(subject: Charted, cases: Sequence[ChartCase], full: bool = True) -> str:
    """What the cases of a subject say together: who is fastest to an error, or who is most accurate."""
    return to_levels(subject, cases, full) if subject.levels(cases[0]) else most(subject, cases)


def sorted_points(subject: Charted, case: ChartCase, what: str) -> list[Point]:
    """Points of a case, our default first, or by time where rounding is the end."""
    found = points_in_order(case, what)
    return sorted(found, key=lambda p: p.seconds) if subject.levels(case) else found


def to_levels(subject: Charted, cases: Sequence[ChartCase], full: bool = True) -> str:
    """One line a case, quantity and error: who is fastest to it, of ours and of peers.

    In brief the first quantity alone, to the error in the middle.
    """
    rows = []
    for case in cases:
        levels = subject.levels(case)
        for what in case["quantities"] if full else case["quantities"][:1]:
            points = sorted_points(subject, case, what)
            for level in levels if full else [levels[len(levels) // 2]]:
                own, peer = (quickest([p for p in points if p.ours is ours], level) for ours in (True, False))
                over = f"{peer.seconds / own.seconds:.3g}" if own and peer else "-"
                named = ["none" if p is None else point_words(subject, case, what, p) for p in (own, peer)]
                rows.append([case["name"], what, f"{level:.0e}", *named, over])
    return tabled(("case", "error of", "at most", "fastest of ours", "fastest peer", "peer over ours"), rows)


def quickest(points: Sequence[Point], level: float) -> Point | None:
    """The fastest whose error is small enough."""
    return min((p for p in points if p.error <= level), key=lambda p: p.seconds, default=None)


def most(subject: Charted, cases: Sequence[ChartCase]) -> str:
    """One line a case and quantity: who is most accurate, who is ahead, and where the default is."""
    rows, clear, near = [], 0, 0
    for case in cases:
        for what in case["quantities"]:
            points = sorted_points(subject, case, what)
            honest = [p for p in points if not p.told]
            own, peer = [p for p in honest if p.ours], [p for p in honest if not p.ours]
            if not own or not peer or subject.default not in {p.name for p in own}:
                continue
            faster = ", ".join(p.name for p in ahead(honest, subject.margin)) or "none"
            ratio, who = over_best(points, subject.default)
            clear, near = clear + (faster == "none"), near + (ratio <= NEAR)
            named = [f"{p.name} {error(case, what, p)}" for p in map(most_accurate, (own, peer))]
            rows.append([case["name"], what, *named, faster, f"{ratio:.2f} ({who})"])
    said = (
        f"In {clear} of {len(rows)} charts no peer that is told nothing is both faster and {subject.better} "
        f"than our best point. Default settings are within {NEAR:g} times the error of the best point in "
        f"{near} of {len(rows)}."
    )
    ahead_of_us = f"peers faster and {subject.better} than our best"
    heads = ["case", "", "best of ours", "best peer", ahead_of_us, "default over best point"]
    if clear == len(rows):  # nobody to name
        heads, rows = [h for h in heads if h != ahead_of_us], [[*row[:4], row[5]] for row in rows]
    return said + "\n\n" + tabled(heads, rows)


def sentences(subject: Charted, case: ChartCase) -> list[str]:
    """What the picture of a case says of each quantity."""
    found = []
    for what in case["quantities"]:
        points = sorted_points(subject, case, what)
        if not (own := [p for p in points if p.ours and not p.told]):
            continue
        best = most_accurate(own)
        mine, on = (
            point_words(subject, case, what, best),
            (point_words(subject, case, what, p) for p in front(points)),
        )
        text = f"**{what[0].upper()}{what[1:]}.** Front: {', '.join(on)}. "
        if beaten := ahead([p for p in points if not p.told], subject.margin):
            names = (
                f"{p.name} ({error(case, what, p)}, {figures(best.seconds / p.seconds)} times as fast)"
                for p in beaten
            )
            text += f"Faster and {subject.better} than our best point, {mine}: {', '.join(names)}."
        else:
            text += f"No peer is both faster and {subject.better} than our best point, {mine}."
        if with_truth := ahead([best, *(p for p in points if p.told and not p.ours)], subject.margin):
            names = (f"{p.name} {error(case, what, p)}" for p in with_truth)
            text += f" Only with the truth told: {', '.join(names)}."
        if not subject.levels(case) and subject.default in {p.name for p in own}:
            ratio, who = over_best(points, subject.default)
            text += f" Default settings: {ratio:.2f} times the error of the best point ({who})."
        found.append(text)
    return found


def point_words(subject: Charted, case: ChartCase, what: str, point: Point) -> str:
    """A contestant with its error and its time."""
    unit, many = subject.clock
    return f"{point.name} ({error(case, what, point)}, {figures(many * point.seconds)} {unit})"


def error(case: ChartCase, what: str, point: Point) -> str:
    """An error with its unit, or one that is relative, where that is more than rounding."""
    if case["units"]:
        return f"{point.error:.3g} {case['units'][case['quantities'].index(what)]}"
    return f"{point.error:.1e}" if point.error > case["resolved"] else f"below {case['resolved']:.0e}"


def case_table(subject: Charted, case: ChartCase) -> str:
    """Every contestant of a case; a column in which nobody has anything is left out."""
    unit, many = subject.clock
    heads = ["", *subject.heads(case), f"CPU {unit}", "range", "times default", "peak MB", "verdict"]
    rows = []
    for r in case["rows"]:
        if "failed" in r:
            rows.append([r["name"], f"no answer: {r['failed']}"])
            continue
        low, high = (figures(many * s) for s in r["seconds_range"])
        said = ", ".join(v if n == case.get("seeds", 1) else f"{v} {n}" for v, n in r["verdict"].items())
        time = figures(many * r["seconds"]), f"{low} to {high}" if low != high else "-"
        cost = number_or_dash(r["times_default"]), number_or_dash(r["peak_MB"]), said or "-"
        rows.append([r["name"] + ", of a part" * r["part"], *subject.cells(case, r), *time, *cost])
    full = [row for row in rows if len(row) == len(heads)]
    kept = [i for i in range(len(heads)) if i < 2 or any(row[i] != "-" for row in full)]
    return tabled([heads[i] for i in kept], [[row[i] for i in kept if i < len(row)] for row in rows])


def number_or_dash(value: float | None) -> str:
    """Three figures, or a dash.

    >>> number_or_dash(0.012345), number_or_dash(float("nan")), number_or_dash(None)
    ('0.0123', '-', '-')
    """
    return f"{value:.3g}" if value is not None and np.isfinite(value) else "-"


def figures(value: float) -> str:
    """Three figures, without an exponent where that can be.

    >>> figures(1234.56), figures(0.00123456)
    ('1230', '0.00123')
    """
    return f"{float(f'{value:.3g}'):g}"
