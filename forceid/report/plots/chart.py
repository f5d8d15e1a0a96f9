"""A chart as the script of the page draws it: panels and curves as plain numbers, thinned with every peak."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forceid.records import AXES, Array

POINTS = 1500  # samples that a curve keeps: about one for each pixel of a wide screen
FIGURES = 4  # digits of a number: more than a screen shows


@dataclass(frozen=True)
class Curve:
    """One curve of a panel: y over the panel's x, None where it is not known.

    name: what its button switches, as x; layer: estimate, truth or plain route; half: of its band, on either
    side; kind: line, dots or bars.
    """

    name: str
    y: list[float | None]
    half: list[float | None] | None = None
    layer: str = "estimate"
    kind: str = "line"
    color: str = ""


@dataclass(frozen=True)
class Panel:
    """Curves over one x; both axes are named with their units.

    log: which axes are logarithmic, of "xy"; levels: dashed lines across; shaded: ranges of x; edges: lines
    upright; say: a remark in place of curves.
    """

    title: str
    y: str
    x: str
    at: list[float]
    curves: list[Curve]
    log: str = ""
    levels: tuple[float, ...] = ()
    shaded: tuple[tuple[float, float], ...] = ()
    edges: tuple[float, ...] = ()
    say: str = ""


@dataclass(frozen=True)
class Chart:
    """Panels that share their buttons and, over time, their zoom; hidden: layers that begin switched off."""

    panels: list[Panel]
    hidden: tuple[str, ...] = ()


def as_json(charts: dict[str, Any]) -> str:
    """The charts as JSON that can stand inside a page: no letter of it ends or begins markup."""
    plain = {name: asdict(chart) if isinstance(chart, Chart) else chart for name, chart in charts.items()}
    return json.dumps(plain, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def kept(values: Array, most: int = POINTS) -> NDArray[np.intp]:
    """The samples of values (time, column) that are drawn: of each bin the least and the greatest.

    >>> peak = np.zeros((100_000, 1))
    >>> peak[77_777] = 5.0
    >>> at = kept(peak)
    >>> len(at) <= POINTS, 77_777 in at
    (True, True)
    """
    samples, columns = values.shape
    if samples <= most:
        return np.arange(samples)
    count = max(1, (most - 2) // (2 * max(columns, 1)))
    edges = np.linspace(0, samples, count + 1).astype(np.intp)
    low, high = np.nan_to_num(values, nan=np.inf), np.nan_to_num(values, nan=-np.inf)
    found = [
        a + f(part[a:b], axis=0)
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        for f, part in ((np.argmin, low), (np.argmax, high))
    ]
    return np.unique([0, samples - 1, *np.concatenate(found).tolist()])


def numbers(values: Array) -> list[float | None]:
    """Values at the digits that are drawn, None where they are not known."""
    return [float(f"{v:.{FIGURES}g}") if np.isfinite(v) else None for v in values.tolist()]


def clock(time: Array) -> list[float]:
    """Times with as many digits as tell samples apart.

    >>> clock(np.array([0.0, 0.0010000001, 0.0019999999]))
    [0.0, 0.001, 0.002]
    """
    step = float(np.min(np.diff(time), initial=np.inf))
    digits = 6 if not np.isfinite(step) or step <= 0 else max(0, 2 - int(np.floor(np.log10(step))))
    return [round(t, digits) for t in time.tolist()]


def over_time(
    title: str,
    y: str,
    time: Array,
    values: Array,
    half: Array | None = None,
    names: Sequence[str] = AXES,
    others: Iterable[tuple[str, Array]] = (),
    **more: Any,
) -> Panel:
    """A panel of values (time, name) with bands of half-width `half`, and the same of other layers beside."""
    at = kept(values)
    known = np.isfinite(values).any()
    curves = [
        Curve(name, numbers(values[at, k]), None if half is None else numbers(half[at, k]), color=name)
        for k, name in enumerate(names)
    ] + [
        Curve(name, numbers(other[at, k]), layer=layer, color=name)
        for layer, other in others
        if np.isfinite(other).any()
        for k, name in enumerate(names)
    ]
    say = "" if known else "not identifiable"
    return Panel(title, y, "time (s)", clock(time[at]), curves if known else [], say=say, **more)
