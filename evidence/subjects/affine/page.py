"""Affine bodies on the page of the chart: sentences that follow from the numbers, and a table a case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evidence.chart.front import Point, front
from evidence.subjects.affine.chart import points_of
from evidence.subjects.parts.page import beaters, best_of, milli

READING = (
    "Polar factors are known to eighty digits, motions by DOP853 near rounding on forces that are no part of "
    "forceid. Errors are lengths over that of the truth, of all samples together, of the frames or bodies of "
    "which the truth was worked out. Time is process CPU time of the whole case, {}; peers that follow "
    "bodies one by one do a fiftieth of them, and their time is multiplied. A line is one way from coarse "
    "to fine: steps in s of forceid's, relative tolerances of scipy's, absolute ones a thousandth of them. "
    "Where det F = 1 is imposed, verlet, suzuki_4 and kahan_li_8 are compositions of RATTLE, and peers "
    "integrate the index-reduced equations. Memory is the peak of what Python and numpy allocate."
)
LEVELS = (1e-3, 1e-6, 1e-9)  # relative errors at which the fastest are compared


def section(cases: Sequence[Mapping[str, Any]], timing: str) -> list[str]:
    """The section in markdown, in paragraphs; none for no cases. timing: how often, in words."""
    if not cases:
        return []
    parts = ["## Affine bodies", READING.format(timing), overview(cases)]
    for case in cases:
        picture = f"![{case['name']}](chart_{case['name']}.png)"
        parts += [f"### {case['title']}", picture, *sentences(case), table(case)]
    return parts


def overview(cases: Sequence[Mapping[str, Any]]) -> str:
    """One line a case and error: who is fastest to it of ours and of peers, in the first quantity."""
    rows = [
        "| case | error of | at most | fastest of ours | fastest peer | peer over ours |",
        "|---|---|---|---|---|---|",
    ]
    for case in cases:
        what = case["quantities"][0]
        points = points_of(case, what)
        for level in (1e-13,) if case["kind"] == "factors" else LEVELS:
            own, peer = (fastest([p for p in points if p.ours is ours], level) for ours in (True, False))
            over = f"{peer.seconds / own.seconds:.3g}" if own and peer else "-"
            rows.append(f"| {case['name']} | {what} | {level:.0e} | {named(own)} | {named(peer)} | {over} |")
    return "\n".join(rows)


def fastest(points: Sequence[Point], level: float) -> Point | None:
    """The fastest whose error is small enough."""
    return min((p for p in points if p.error <= level), key=lambda p: p.seconds, default=None)


def named(point: Point | None) -> str:
    """A point with its error and time."""
    return "none" if point is None else f"{point.name} ({point.error:.1e}, {milli(point.seconds)} ms)"


def sentences(case: Mapping[str, Any]) -> list[str]:
    """What the picture of a case says of each quantity."""
    found = []
    for what in case["quantities"]:
        points = points_of(case, what)
        if not any(p.ours for p in points):
            continue
        best, beaten = best_of([p for p in points if p.ours]), beaters(points)
        text = f"**Error of {what}.** Front: {', '.join(named(p) for p in front(points))}. "
        if beaten:
            text += f"Faster than our best point, {named(best)}, and no less accurate: "
            text += (
                ", ".join(f"{p.name} ({best.seconds / p.seconds:.2g} times as fast)" for p in beaten) + "."
            )
        else:
            text += f"No peer is faster than our best point, {named(best)}, and as accurate."
        found.append(text)
    return found


def table(case: Mapping[str, Any]) -> str:
    """Every way of a case."""
    first, second = case["quantities"]
    rows = [f"| | error of {first} | of {second} | CPU ms | range | peak MB |", "|---|---|---|---|---|---|"]
    for r in case["rows"]:
        if "failed" in r:
            rows.append(f"| {r['name']} | no answer: {r['failed']} |" + " |" * 4)
            continue
        low, high = r["seconds_range"]
        peak = "-" if r["peak_MB"] is None else f"{r['peak_MB']:.3g}"
        errors = f"{r['error'][first]:.1e} | {r['error'][second]:.1e}"
        times = f"{milli(r['seconds'])} | {milli(low)} to {milli(high)}"
        rows.append(f"| {r['name']}{', of a part' if r['part'] else ''} | {errors} | {times} | {peak} |")
    return "\n".join(rows)
