"""Affine bodies beside their theory: printed values, invariants, orders, charts, paths, speed, on one page.

    OPENBLAS_NUM_THREADS=1 python -m evidence.theory.affine_bodies -o docs [--quick]

Writes affine_bodies.md, affine_bodies.png and affine_orders.png. Source: pseudo-rigid bodies.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context

from evidence.races import polar, pseudorigid_batch
from evidence.races.paired import Outcome, run
from evidence.theory import affine_evidence as evidence
from evidence.theory.affine_printed import deviation, printed
from evidence.written import asked, tabled, written
from forceid.report.style import BLUE, CYCLE, GRAY, GREEN, INK, STYLE, VERMILION, draw_line, label, panels

COMMAND = "OPENBLAS_NUM_THREADS=1 python -m evidence.theory.affine_bodies -o docs"
ROUNDS, BUDGET = 5, 0.5  # of the polar factors
MISSES = np.geomspace(1e-9, 3.0, 25)  # of near-crossings, in the change from frame to frame


def met(good: bool) -> str:
    """Whether what is asked holds."""
    return "yes" if good else "**no**"


def printed_section() -> str:
    """Section 12 of the note."""
    rows, total, missed = [], 0, 0
    for name, expected, found, allowed in printed():
        off, count = deviation(expected, found), np.size(expected)
        total, missed = total + count, missed + (off > allowed)
        rows.append([name, str(count), f"{off:.1e}", f"{allowed:.0e}"])
    text = f"{total} numbers, each against the one printed; groups beyond what is allowed: {missed}.\n\n"
    head = ("section, what", "numbers", "largest relative deviation", "allowed")
    return "## Printed values, section 12 of the note\n\n" + text + tabled(head, rows) + "\n"


def invariants_section(runs: list[evidence.Kept]) -> str:
    """What long runs keep."""
    rows = []
    for r in runs:
        good = max(r.momentum, r.circulation) <= 3e-14 and r.trend < 0.2 and (r.volume or 0.0) <= 1e-15
        rows.append(
            [r.name, f"{r.momentum:.1e}", f"{r.circulation:.1e}", f"{np.abs(r.energy).max():.1e}",
             f"{r.trend:.3f}", "" if r.volume is None else f"{r.volume:.1e}", met(good)]
        )  # fmt: skip
    head = ("run", "J", "circulation", "H", "trend of H over its spread", "det F - 1", "as asked")
    text = (
        "Largest change at any sample, every step sampled. Asked: momenta 3e-14, no trend, det F 1e-15.\n\n"
    )
    return "## Invariants\n\n" + text + tabled(head, rows) + "\n"


def orders_section(found: list[evidence.Order]) -> str:
    """Convergence."""
    rows = [
        [o.name, str(o.nominal), f"{o.measured:.3f}", f"{o.step[0]:g}, {o.step[1]:g}",
         f"{o.error[0]:.1e}, {o.error[1]:.1e}", met(abs(o.measured - o.nominal) <= 0.1)]
        for o in found
    ]  # fmt: skip
    head = ("integrator", "order", "measured", "steps, s", "errors of F", "within 0.1")
    text = "Error of F at the end, from one step to its half. DOP853, the reference, chooses its steps.\n\n"
    return (
        "## Order of every integrator\n\n"
        + text
        + tabled(head, rows)
        + "\n"
        + "\n![orders](affine_orders.png)\n"
    )


def reduced_section(found: list[evidence.Reduced]) -> str:
    """Reduced forms against the master system."""
    rows = []
    for form in evidence.FORMS:
        own = [r for r in found if r.form == form]
        drawn, led = [r for r in own if r.random], [r for r in own if not r.random]
        refused = [r for r in led if not np.isnan(r.refused)]
        nearest = min(r.nearest for r in led if np.isnan(r.refused))
        worst = max(r.deviation for r in own)
        rows.append(
            [form, f"{len(drawn)}, {sum(not np.isnan(r.refused) for r in drawn)}", f"{worst:.1e}",
             f"{nearest:.1e}", f"{len(refused)} of {len(led)}", met(worst <= 1e-10)]
        )  # fmt: skip
    head = ("form", "random bodies, refused", "largest deviation of F", "nearest stretches followed",
            "led to equal stretches, refused", "within 1e-10")  # fmt: skip
    says = next((r.reason for r in found if r.reason), "")
    text = (
        "Random bodies to T = 1.5, and bodies led to within 0.1 to 0 of equal stretches at 0.5 s, against "
        "DOP853 on the master system; of refused ones up to the refusal. Left-reduced has no such chart.\n\n"
    )
    return "## Reduced forms\n\n" + text + tabled(head, rows) + f"\n\nA refusal: `{says}`\n"


def paths_section(paths: evidence.Paths) -> str:
    """The bipolar path."""
    rows = [
        [str(n), f"{D:.1e}", f"{Q:.1e}", str(undefined), str(flagged)]
        for n, D, Q, undefined, flagged in evidence.test_path()
    ]
    head = ("frames", "error of D", "error of L", "frames without rates", "flagged")
    text = "The test path of section 2, three values crossing at t = 0:\n\n" + tabled(head, rows) + "\n"
    rows = [
        [str(n), str(flagged), f"{reach:.3f}", f"{turn:.2g}"]
        for n, flagged, reach, turn in evidence.counterexample()
    ]
    text += "\nThe C-infinity path without a limit, t from -0.5 to 0.5:\n\n"
    text += tabled(("frames", "flagged", "within t of 0", "largest turn elsewhere, rad"), rows) + "\n"
    flagged, marked = paths.flagged, paths.marked
    read = paths.crossed & ~flagged
    text += (
        f"\nRandom near-crossings, {len(paths.miss)} motions of 48 frames:\n\n"
        f"- {(~flagged & ~marked).sum()} continuous, with rates in every frame; {(~flagged & marked).sum()} "
        f"continuous through frames marked as without rates; {flagged.sum()} flagged as not shown to be "
        f"continuous. Largest turn of the bases in frames not flagged: {paths.turn.max():.2f} rad.\n"
        f"- A pass too near for the frames is read as a crossing, and told by `crossed`: {read.sum()} of "
        f"those not flagged, {(read & ~marked).sum()} of them between two frames that both have rates; the "
        f"widest missed by {paths.miss[read].max(initial=0):.2f} of the change between frames.\n"
        f"- Against eight times as many frames, where these are continuous themselves: {paths.changed.sum()} "
        f"take another turn, {(paths.changed & paths.marked).sum()} of them marked; bases that jump with "
        f"nothing marked or flagged: **{paths.silent.sum()}**.\n"
    )
    return "## Bipolar path\n\n" + text + "\n![energy, charts and paths](affine_bodies.png)\n"


def polar_section(quick: bool) -> str:
    """A million frames."""
    outcome: Outcome = run(next(iter(polar.races(quick, False))), ROUNDS, BUDGET)
    base = outcome.rows[outcome.race.base]
    rows = []
    for name, row in outcome.rows.items():
        low, middle, high = row.times_as_fast_as(base)
        errors = [f"{v:.1e}" for v in row.figures.values()]
        rows.append([name, f"{1e6 * row.median:.3g}", f"{middle:.3g} ({low:.3g} to {high:.3g})", *errors])
    figures = next(iter(outcome.rows.values())).figures
    head = ("", "us a frame", f"times {base.name}", *figures)
    text = (
        f"{outcome.race.size} frames, CPU time of one thread, {ROUNDS} rounds in turn; singular values of "
        f"the sets: {', '.join(f'{k} {v}' for k, v in polar.SETS.items())}, matrices and answers exact.\n\n"
    )
    goals = [f"{text}: {value}, {met(bool(good))}" for text, value, good in outcome.verdicts()]
    return "## Polar factors\n\n" + text + tabled(head, rows) + "\n\n" + "; ".join(goals) + ".\n"


def batch_section(quick: bool) -> str:
    """Trajectories a second."""
    found = pseudorigid_batch.ratios(200 if quick else 1000, 4 if quick else 12, 2 if quick else 3)
    least = min(r.cost[1] / r.cost[0] for r in found)
    text = (
        "1000 bodies at once against `scipy.integrate.solve_ivp` one by one, each side with its cheapest "
        "method and step that reaches the error; scipy's right-hand side written out in Python floats, or "
        f"in numpy (last column). Ratio at least {least:.0f}, asked 100: {met(least >= 100)}.\n\n"
    )
    return "## Trajectories a second\n\n" + text + pseudorigid_batch.table(found) + "\n"


def draw_orders(found: list[evidence.Order], path: Path) -> None:
    """Errors over steps, with the slopes that are nominal."""
    names = [o.name for o in found if not o.name.startswith("RATTLE")]
    colors = dict(zip(names, (*CYCLE, INK, GRAY, "#882255"), strict=True))
    with rc_context(STYLE):
        figure, axes = panels(1, 2, (10.0, 5.0), sharey=True)
        for o in found:
            held = o.name.startswith("RATTLE")
            name = o.name.removeprefix("RATTLE, ")
            seen, fill = o.error > 2e-15, "none" if name == "energy" else colors[name]
            ax = axes[0, int(held)]
            text = f"{name}, order {o.nominal}"
            ax.loglog(
                o.step[seen],
                o.error[seen],
                "o",
                color=colors[name],
                mfc=fill,
                ms=7 - 3 * (fill != "none"),
                label=text,
            )
            ax.loglog(o.step, o.error[0] * (o.step / o.step[0]) ** o.nominal, "-", color=colors[name], lw=0.9)
        for ax, title in zip(axes[0], ("free body", "RATTLE, det F = 1"), strict=True):
            ax.set_ylim(1e-15, 3e-3)
            label(ax, f"{title}: error of F, lines of the order", x="step (s)")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
        figure.savefig(path, dpi=150)


def draw_bodies(
    runs: list[evidence.Kept], reduced: list[evidence.Reduced], paths: evidence.Paths, path: Path
) -> None:
    """Energy over time, deviations over nearness, fates of near-crossings over their miss."""
    with rc_context(STYLE):
        figure, axes = panels(2, 2, (10.0, 6.6))
        for ax, r in zip(axes[0], runs[:2], strict=True):
            draw_line(ax, r.time, r.energy, color=BLUE, lw=0.4)
            label(ax, r.name, "H - H(0)", x="time (s)")
        ax = axes[1, 0]
        for form, color in zip(evidence.FORMS, (GREEN, BLUE, VERMILION), strict=True):
            for ended, mark in ((False, "o"), (True, "x")):
                own = [r for r in reduced if r.form == form and np.isnan(r.refused) != ended]
                x, y = [max(r.nearest, 1e-6) for r in own], [r.deviation for r in own]
                text = f"{form}, refused" if ended else form
                if own:
                    ax.loglog(x, y, mark, color=color, ms=5, mfc="none", label=text)
        ax.axhline(1e-10, color=GRAY, lw=0.8, ls=":")
        label(ax, "reduced against master", "deviation of F", x="nearest stretches, of the longest")
        ax.legend(loc="center right")
        fates(axes[1, 1], paths)
        figure.savefig(path, dpi=150)


def fates(ax: Any, paths: evidence.Paths) -> None:
    """Shares of near-crossings over their miss."""
    edges = MISSES[:-1]
    inside = np.digitize(paths.miss, MISSES) - 1
    kinds = {
        "continuous, rates everywhere": (~paths.flagged & ~paths.marked, GREEN),
        "continuous, some frames without rates": (~paths.flagged & paths.marked, BLUE),
        "flagged": (paths.flagged, VERMILION),
    }
    total = np.maximum(np.bincount(inside, minlength=len(edges))[: len(edges)], 1)
    below = np.zeros(len(edges))
    for name, (which, color) in kinds.items():
        share = 100 * np.bincount(inside[which], minlength=len(edges))[: len(edges)] / total
        ax.bar(edges, share, width=np.diff(MISSES), bottom=below, align="edge", color=color, label=name)
        below += share
    ax.set_xscale("log")
    ax.set_ylim(0, 135)
    ax.set_yticks([0, 25, 50, 75, 100])
    label(ax, f"{len(paths.miss)} near-crossings", "share (%)", x="miss, of the change between frames")
    ax.legend(loc="upper left", ncols=1)


def main() -> None:
    """Measure everything and write the page."""
    args = asked("evidence.theory.affine_bodies", __doc__, quick=False)
    runs, orders = evidence.invariants(), evidence.orders()
    reduced = evidence.reduced(4 if args.quick else 20)
    paths = evidence.crossings(1000 if args.quick else 10_000)
    head = f"# Affine bodies beside their theory\n\n`{COMMAND}`, {time.strftime('%Y-%m-%d')}."
    head += (
        " Stiff bodies beside their limit: [nearly_incompressible.md](nearly_incompressible.md). Loads from\n"
    )
    head += "markers: `python -m evidence.theory.affine`.\n"
    sections = [
        head, printed_section(), invariants_section(runs), orders_section(orders), reduced_section(reduced),
        paths_section(paths), polar_section(args.quick), batch_section(args.quick),
    ]  # fmt: skip
    args.output.mkdir(parents=True, exist_ok=True)
    draw_orders(orders, args.output / "affine_orders.png")
    draw_bodies(runs, reduced, paths, args.output / "affine_bodies.png")
    written(args.output, "affine_bodies.md", "\n".join(sections))
    print("\n".join(sections))


if __name__ == "__main__":
    main()
