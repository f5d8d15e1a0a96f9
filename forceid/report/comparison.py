"""Two or more results on one page: their curves in one chart, their numbers, and whether they agree."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.records import AXES, Array, Estimate
from forceid.report.numbers import digits, plain, plus_minus, resampled, rms, typeset
from forceid.report.plots.chart import Chart, Panel, as_json, over_time
from forceid.report.plots.picture import pictured
from forceid.report.plots.style import CYCLE, STYLE, draw_band, draw_line, label, panels
from forceid.report.template import render

SHARED = 0.95  # of values within two joint sigma, as of normal errors: results that agree
LOADS = (("force", "N"), ("moment", "N m"))
CAPTION = "World axes, weight excluded; bands are two sigma on either side. A button takes a result away."


@dataclass(frozen=True)
class Named:
    """A result and the name that it has on the page; truth is not drawn here."""

    name: str
    estimate: Estimate


def render_comparison(results: Sequence[Named], title: str = "") -> str:
    """The page as HTML text; it refers to no other file and no host. The first result is what others face."""
    together = share_time([r.estimate for r in results])
    shown = results if together else [Named(r.name, from_start(r.estimate)) for r in results]
    picture = pictured(draw_comparison(shown), "Force and moment of all", CAPTION, "comparison")
    return render(
        "comparison.html.j2",
        title=title or " beside ".join(r.name for r in results),
        results=results,
        worst=max((r.estimate.verdict.level for r in results), key=("ok", "degraded", "refused").index),
        sentences=[agreement(shown[0], other) for other in shown[1:]],
        together=together,
        picture=picture,
        rows=rows(shown),
        settings=differing_settings(results),
        charts=as_json({"comparison": comparison_chart(shown)}),
    )


def share_time(estimates: Sequence[Estimate]) -> bool:
    """Whether some time is in all of the records."""
    return max(float(e.time[0]) for e in estimates) < min(float(e.time[-1]) for e in estimates)


def from_start(estimate: Estimate) -> Estimate:
    """The same with its clock from the first sample on."""
    return replace(estimate, time=estimate.time - estimate.time[0])


def within(first: Estimate, other: Estimate, name: str) -> tuple[float, float]:
    """Share of values (time, axis) of a load within two joint sigma, and the rms of their difference.

    At the times of the first, NaN where nothing is known of both. Results of one recording share its noise
    and agree better than chance.
    """
    values, std = (resampled(first.time, other.time, getattr(other, n)) for n in (name, f"{name}_std"))
    apart = getattr(first, name) - values
    joint = np.hypot(getattr(first, f"{name}_std"), std)
    known = np.isfinite(apart / joint)
    if not known.any():
        return np.nan, np.nan
    return float(np.mean(np.abs(apart[known]) <= 2 * joint[known])), float(np.linalg.norm(rms(apart)))


def agreement(first: Named, other: Named) -> str:
    """Whether another result says the same as the first, in one sentence."""
    found = {name: within(first.estimate, other.estimate, name)[0] for name, _ in LOADS}
    known = {name: share for name, share in found.items() if np.isfinite(share)}
    if not known:
        return f"{first.name} and {other.name} have no value in common."
    said = " and ".join(f"{100 * share:.0f} % of the {name}" for name, share in known.items())
    off = [name for name, share in known.items() if share < SHARED]
    verb = f"differ in the {' and the '.join(off)}" if off else "agree"
    return f"{first.name} and {other.name} {verb}: {said} lie within two joint sigma."


def rows(results: Sequence[Named]) -> list[tuple[str, list[str]]]:
    """The table: what it is, and a text a result."""
    all_of = [r.estimate for r in results]
    first = all_of[0]
    table: list[tuple[str, list[str]]] = [
        ("Verdict", [e.verdict.level for e in all_of]),
        ("Method", [e.method for e in all_of]),
        ("Model", [e.model for e in all_of]),
        ("Samples", [str(len(e.time)) for e in all_of]),
        ("Duration", [f"{plain(float(np.ptp(e.time)), 3)} s" for e in all_of]),
    ]
    for name, unit in LOADS:
        sizes = [(rms(getattr(e, name)), rms(getattr(e, f"{name}_std"))) for e in all_of]
        table.append(
            (f"{name.capitalize()}, rms ± sigma", [typeset(plus_minus(*size, unit)) for size in sizes])
        )
        apart = [within(first, e, name) for e in all_of[1:]]
        table.append(
            (
                f"{name.capitalize()} apart, rms",
                ["–", *(f"{digits(d, 3)} {unit}" if np.isfinite(d) else "–" for _, d in apart)],
            )
        )
        shares = [f"{100 * share:.0f} %" if np.isfinite(share) else "–" for share, _ in apart]
        table.append((f"{name.capitalize()} within two joint sigma", ["–", *shares]))
    bands = [np.nan if e.hidden is None else float(np.max(np.nan_to_num(e.hidden.band))) for e in all_of]
    table.append(("Changes followed up to", [f"{digits(b, 2)} Hz" if np.isfinite(b) else "–" for b in bands]))
    table.append(("Run time", [f"{plain(e.runtime_s, 2)} s" for e in all_of]))
    table.append(("Input, SHA-256", [e.input_sha256[:12] or "none" for e in all_of]))
    return table


def differing_settings(results: Sequence[Named]) -> list[tuple[str, list[str]]]:
    """Settings in which the results differ: the key, and the value of each."""
    flat = [flattened(tomllib.loads(r.estimate.settings)) for r in results]
    keys = sorted({key for one in flat for key in one})
    found = [(key, [str(one.get(key, "–")) for one in flat]) for key in keys]
    return [(key, values) for key, values in found if len(set(values)) > 1]


def flattened(table: dict[str, Any], before: str = "") -> dict[str, Any]:
    """A nested table as one level with dotted keys.

    >>> flattened({"a": 1, "b": {"c": 2}})
    {'a': 1, 'b.c': 2}
    """
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= flattened(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return found


def comparison_chart(results: Sequence[Named]) -> Chart:
    """A panel a component, a curve a result."""
    found: list[Panel] = []
    for k, axis in enumerate(AXES):
        for name, unit in LOADS:
            own = [one_of(r, name, k) for r in results]
            title = f"{name.capitalize()} along {axis}" if name == "force" else f"Moment about {axis}"
            clocks: list[Array] = [r.estimate.time for r in results]
            time = np.unique(np.concatenate(clocks))
            values = np.stack([resampled(time, t, v) for t, (v, _) in zip(clocks, own, strict=True)], -1)
            half = np.stack([resampled(time, t, h) for t, (_, h) in zip(clocks, own, strict=True)], -1)
            found.append(
                over_time(title, f"{name} ({unit})", time, values, half, names=[r.name for r in results])
            )
    return Chart(found)


def one_of(result: Named, name: str, k: int) -> tuple[Array, Array]:
    """A component (time,) of a load and the half-width of its band."""
    e = result.estimate
    return getattr(e, name)[:, k], 2 * getattr(e, f"{name}_std")[:, k]


@rc_context(STYLE)
def draw_comparison(results: Sequence[Named]) -> Figure:
    """The same as a figure, for paper and where no script runs."""
    figure, axes = panels(3, 2, (10.0, 6.4), sharex=True)
    for column, (name, unit) in enumerate(LOADS):
        for k, axis in enumerate(AXES):
            ax = axes[k, column]
            head = "" if k else name.capitalize()
            label(ax, head, f"{name[0].upper()}$_{axis}$ ({unit})", "time (s)" if k == 2 else "")
            for order, result in enumerate(results):
                color = CYCLE[order % len(CYCLE)]
                values, half = one_of(result, name, k)
                draw_band(ax, result.estimate.time, values - half, values + half, color=color, alpha=0.2)
                draw_line(ax, result.estimate.time, values, color=color, label=result.name)
            ax.margins(x=0.01)
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4)
    figure.align_ylabels()
    return figure
