"""Bodies in parts on the page of the chart: sentences that follow from the numbers, and a table a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evidence.chart.front import Point, ahead, front, most_accurate
from evidence.subjects.parts.chart import QUANTITIES, RESOLVED, points_of

ENOUGH = 1e-6  # relative error at which the fastest are compared
READING = (
    "The truth is manufactured: a smooth displacement is chosen, its load is K u, and the forces on the "
    "interface are what loads, in equal shares, and stiffness leave of each other in a part. Errors are "
    "lengths over that of the truth: of displacements of all parts, so that gaps between them count, "
    "and of interface forces; peers on the assembled matrix get those as f - K u of each part. Errors below "
    f"{RESOLVED:.0e} are rounding and count as equal. Time is process CPU time from the matrices, of the "
    "parts or assembled, to the solution, {}; *second load* is what of it another load would cost again, the "
    "rest is setup. Iterations stop at their tolerance of the residual as each solver defines it; those of a "
    "correction are not counted. Forceid tells its own error, and that is timed with it. Memory is the "
    "peak of what Python and numpy allocate; sparse factors are not in it."
)


def section(cases: Sequence[Mapping[str, Any]], timing: str) -> list[str]:
    """The section in markdown, in paragraphs; none for no bodies. timing: how often, in words."""
    if not cases:
        return []
    parts = ["## Bodies in parts", READING.format(timing), overview(cases)]
    for case in cases:
        parts += [
            f"### {case['title']}",
            f"{case['parts']} parts, {case['unknowns']} unknowns, {case['multipliers']} multipliers.",
            f"![{case['name']}](chart_{case['name']}.png)",
            *sentences(case),
            table(case),
        ]
    return parts


def overview(cases: Sequence[Mapping[str, Any]]) -> str:
    """One line a body: who is fastest to an error that is small enough, and who is ahead of our best."""
    rows = [
        f"| body | | fastest of ours to {ENOUGH:.0e} | fastest peer to {ENOUGH:.0e} | ours over peer "
        "| our best point | peers faster and at least as accurate |",
        "|---|---|---|---|---|---|---|",
    ]
    for case in cases:
        for what in QUANTITIES:
            points = points_of(case, what)
            own, peer = ([p for p in points if p.ours is ours] for ours in (True, False))
            if not own:
                continue
            best, fast, other = best_of(own), fastest(own), fastest(peer)
            over = f"{fast.seconds / other.seconds:.2g}" if fast and other else "-"
            rows.append(
                f"| {case['name']} | {what} | {named(fast)} | {named(other)} | {over} | {named(best)} "
                f"| {', '.join(p.name for p in beaters(points)) or 'none'} |"
            )
    return "\n".join(rows)


def best_of(points: Sequence[Point]) -> Point:
    """The most accurate, of those alike the fastest."""
    return most_accurate(sorted(points, key=lambda p: p.seconds))


def fastest(points: Sequence[Point]) -> Point | None:
    """The fastest whose error is small enough."""
    return min((p for p in points if p.error <= ENOUGH), key=lambda p: p.seconds, default=None)


def beaters(points: Sequence[Point]) -> list[Point]:
    """Peers that are faster than our best point and no less accurate."""
    best = best_of([p for p in points if p.ours])
    return [p for p in points if not p.ours and p.seconds < best.seconds and p.error <= best.error]


def named(point: Point | None) -> str:
    """A point with its time."""
    return "none" if point is None else f"{point.name}, {milli(point.seconds)} ms"


def resolved(point: Point) -> str:
    """Its error, where that is more than rounding."""
    return f"{point.error:.1e}" if point.error > RESOLVED else f"below {RESOLVED:.0e}"


def sentences(case: Mapping[str, Any]) -> list[str]:
    """What the picture of a body says of each quantity."""
    found = []
    for what in QUANTITIES:
        points = points_of(case, what)
        if not any(p.ours for p in points):
            continue
        best = best_of([p for p in points if p.ours])
        on = ", ".join(f"{p.name} ({resolved(p)}, {milli(p.seconds)} ms)" for p in front(points))
        text = f"**{what.capitalize()}.** Front: {on}. "
        mine = f"{best.name} ({resolved(best)}, {milli(best.seconds)} ms)"
        beaten, better = beaters(points), {p.name for p in ahead(points, told=False)}
        if beaten:
            names = ", ".join(
                f"{p.name} ({'more accurate' if p.name in better else 'as accurate'}, "
                f"{best.seconds / p.seconds:.2g} times as fast)"
                for p in beaten
            )
            text += f"Faster than our best point, {mine}, and no less accurate: {names}."
        else:
            text += f"No peer is faster than our best point, {mine}, and as accurate."
        found.append(text)
    return found


def table(case: Mapping[str, Any]) -> str:
    """Every solver on a body."""
    rows = [
        "| | error of u | claimed | error of lambda | claimed | iterations | CPU ms | range "
        "| second load, ms | setup | times default | peak MB | verdict |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in case["rows"]:
        if "failed" in r:
            rows.append(f"| {r['name']} | no answer: {r['failed']} |" + " |" * 11)
            continue
        low, high = r["seconds_range"]
        cells = [
            r["name"], *errors(r),
            "-" if r["iterations"] is None else str(r["iterations"]),
            milli(r["seconds"]), f"{milli(low)} to {milli(high)}", milli(r["again"]),
            f"{100 * r['setup_share']:.0f} %", f"{r['times_default']:.2g}",
            "-" if r["peak_MB"] is None else f"{r['peak_MB']:.3g}", r["verdict"] or "-",
        ]  # fmt: skip
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def errors(row: Mapping[str, Any]) -> list[str]:
    """Errors, each with what is claimed of it."""
    claimed = row["claimed"] or (None, None)
    found = []
    for what, said in zip(QUANTITIES, claimed, strict=True):
        found += [f"{row['error'][what]:.1e}", "-" if said is None else f"{said:.1e}"]
    return found


def milli(seconds: float) -> str:
    """Seconds as milliseconds, three figures.

    >>> milli(1.23456), milli(0.00123456)
    ('1230', '1.23')
    """
    return f"{float(f'{1e3 * seconds:.3g}'):g}"
