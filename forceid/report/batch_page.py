"""One self-contained HTML page over the files of a batch: who failed and why, who is far off, all results."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from forceid.records import Array, Finding
from forceid.report.multiples import multiples
from forceid.report.numbers import digits, plus_minus, typeset
from forceid.report.outliers import Outlier, find_outliers, magnitude
from forceid.report.plots.picture import Picture, pictured
from forceid.report.plots.style import BLUE, STYLE, VERMILION, label, panels
from forceid.report.template import render

VERDICTS = ("failed", "refused", "degraded", "ok")
NAMED_MARKS = 12  # marks that get a name in the picture


@dataclass(frozen=True)
class Cause:
    """One reason, and the files that give it, numbers in it apart; failed: no result came of it."""

    level: str
    text: str
    files: tuple[str, ...]


def render_batch(records: Sequence[Mapping[str, Any]], folder: Path, undone: int = 0) -> str:
    """The page as HTML text, for DIR/index.html; it refers to no host. undone: files not reached."""
    outliers = find_outliers(records)
    rows = sorted(
        (row_of(record, folder, outliers) for record in records),
        key=lambda r: (VERDICTS.index(r["level"]), r["file"]),
    )
    counts = Counter(row["level"] for row in rows)
    level = next((name for name in VERDICTS if counts[name]), "ok")
    return render(
        "batch.html.j2",
        rows=rows,
        counts=[(name, counts[name]) for name in reversed(VERDICTS) if counts[name]],
        kept=sum(row["kept"] for row in rows),
        undone=undone,
        level=level,
        causes=causes(records),
        outliers=[(os.path.basename(outlier.file), typeset(str(outlier))) for outlier in outliers],
        picture=picture(records, outliers),
        small=multiples([row for row in rows if row["result"]]),
    )


def row_of(record: Mapping[str, Any], folder: Path, outliers: Sequence[Outlier]) -> dict[str, Any]:
    """What the table says of one file; links are relative to the folder."""
    output, known = Path(record["output"]), record["status"] != "failed"
    page = output.with_suffix(".html")
    level, numbers = "failed", [""] * 5
    if known:
        joints = record.get("interface", {}).get("verdict", "ok")
        level = min(record["verdict"], joints, key=VERDICTS.index)  # the worse of the two
        sizes = [
            plus_minus(numbers_of(record, f"{name}_rms"), numbers_of(record, f"{name}_std"), unit)
            for name, unit in (("force", "N"), ("moment", "N m"))
        ]
        numbers = [
            *map(typeset, sizes),
            digits(float(numbers_of(record, "nis_mean"))),
            f"{record.get('samples', '–')}",
            f"{float(numbers_of(record, 'runtime_s')):.2g} s",
        ]
    return {
        "file": str(record["file"]),
        "level": level,
        "output": output,
        "kept": record["status"] == "skipped",
        "result": link(output, folder) if known else "",
        "page": link(page, folder) if page.exists() else "",
        "numbers": numbers,
        "far": [str(outlier) for outlier in outliers if outlier.file == record["file"]],
    }


def link(path: Path, folder: Path) -> str:
    """A relative address of a file of the folder."""
    return quote(os.path.relpath(path, folder).replace(os.sep, "/"))


def numbers_of(record: Mapping[str, Any], name: str) -> Array:
    """One number of a record, or three, NaN where they are not known."""
    return np.asarray(record.get(name), float)


def causes(records: Sequence[Mapping[str, Any]]) -> list[Cause]:
    """Reasons for failures and verdicts, worst and most frequent first; the first wording stands for all."""
    found: dict[tuple[str, ...], list[tuple[str, str]]] = {}
    for record in records:
        name = os.path.basename(str(record["file"]))
        for level, cause, reason in reasons_of(record):
            plain = reason.replace(str(record["file"]), name)
            found.setdefault((level, *cause), []).append((name, plain))
    listed = [
        Cause(level, said[0][1], tuple(dict.fromkeys(n for n, _ in said)))
        for (level, *_), said in found.items()
    ]
    return sorted(listed, key=lambda cause: (VERDICTS.index(cause.level), -len(cause.files)))


def reasons_of(record: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Level, cause and text of every reason that a record gives."""
    if "error" in record:
        yield "failed", (record["error_cause"],), record["error"]
    for where, said in (("", record), ("joints: ", record.get("interface", {}))):
        lines = zip(*(said.get(f"reason{name}", ()) for name in ("s", "_codes", "_values")), strict=True)
        for text, code, values in lines:
            cause = Finding(code, said["verdict"], values, text).cause
            yield said["verdict"], (where, *cause), where + text


def picture(records: Sequence[Mapping[str, Any]], outliers: Sequence[Outlier]) -> Picture | None:
    """NIS and run time of every file, those far off named; None where fewer than two have any."""
    from matplotlib import rc_context
    from matplotlib.ticker import LogFormatter

    known = [record for record in records if record["status"] != "failed"]
    names = [str(record["file"]) for record in sorted(known, key=lambda r: str(r["file"]))]
    drawn = []
    for quantity, title, unit in (("nis_mean", "Mean NIS", "1"), ("runtime_s", "Run time", "s")):
        by_file = {str(record["file"]): magnitude(record.get(quantity)) for record in known}
        values = np.array([by_file[name] for name in names])
        if np.isfinite(values).sum() > 1:
            drawn.append((quantity, title, unit, values))
    if not drawn:
        return None
    with rc_context(STYLE):
        figure, axes = panels(1, len(drawn), (4.6 * len(drawn), 2.8))
        for ax, (quantity, title, unit, values) in zip(axes[0], drawn, strict=True):
            far = {o.file for o in outliers if o.quantity == quantity}
            odd = np.array([name in far for name in names])
            at = np.arange(1, len(names) + 1)
            ax.plot(at[~odd], values[~odd], "o", ms=3, color=BLUE, alpha=0.7)
            ax.plot(at[odd], values[odd], "D", ms=5, color=VERMILION)
            ax.set_yscale("log")
            for axis_part in (ax.yaxis.set_major_formatter, ax.yaxis.set_minor_formatter):
                axis_part(LogFormatter(minor_thresholds=(1.0, 0.4)))
            for k in np.flatnonzero(odd)[:NAMED_MARKS]:
                ax.annotate(
                    os.path.basename(names[k]),
                    (at[k], values[k]),
                    xytext=(5 if k < len(names) / 2 else -5, 4),
                    textcoords="offset points",
                    ha="left" if k < len(names) / 2 else "right",
                    fontsize=7,
                    color=VERMILION,
                )
            label(ax, title, f"({unit})", "file, in the order of the names")
    caption = "A dot a file; diamonds with a name stand far from the others, on a logarithmic scale."
    return pictured(figure, "NIS and run time of every file", caption)
