"""Strangers beside peers: the error of forceid over that of the best peer that is told nothing, by kind.

    python -m evidence.strangers.beside_peers -o docs [--seeds 1 2] [--only REGEX] [--jobs 1]

Peers are those of the chart that choose nothing on the truth.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.judged import LOADS, rms
from evidence.strangers.kinds import KINDS, drawn
from evidence.subject import Contestant
from evidence.subjects.flights.cases import Case, case_of
from evidence.subjects.flights.peers.entrants import peers
from evidence.written import asked, each, paged, pictured
from forceid.config import load_settings
from forceid.errors import ForceIdError
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.records import Array

OURS = "forceid"
LEAST_SHOWN = 0.01  # ratio: less is drawn there
LEAST, MOST = 1.0, 1.2  # times the error of the best peer, which nine of ten and all are to keep below
ABOUT = """\
`{command}`: records of [strangers](strangers.md) of every kind and seed, each met by {count} peers that are
told the recording alone. They are {names}. Rms errors over the central three quarters are told over those of
the best peer by kind and load: nobody knows it beforehand. Over seeds they are geometric means."""


@dataclass(frozen=True)
class Met:
    """A record of a kind: errors of force and moment by who met it, NaN where none is given."""

    kind: str
    error: Mapping[str, tuple[float, ...]]


def met(job: tuple[str, int]) -> Met | None:
    """A record, met by forceid and by every peer; None where the simulator lost it."""
    kind, seed = job
    try:
        scene, _, recording = drawn(kind, seed)
    except FloatingPointError:
        return None
    case, error = case_of(kind, recording, False), {}
    try:
        found = estimate_of_any_length(case.blind, load_settings(**scene.settings))
        error[OURS] = errors(case, found.force, found.moment)
    except ForceIdError:
        error[OURS] = np.nan, np.nan
    for peer in told_nothing():
        try:
            error[peer.name] = errors(case, *peer.prepare(case)().found)
        except (ForceIdError, ValueError, np.linalg.LinAlgError):  # a peer that cannot do it
            error[peer.name] = np.nan, np.nan
    return Met(kind, error)


def told_nothing() -> list[Contestant]:
    """The peers that choose nothing on the truth."""
    return [peer for peer in peers()[0] if not peer.told]


def errors(case: Case, *found: Array) -> tuple[float, ...]:
    """Rms errors of force and moment, of the axes that are given throughout."""
    of = []
    for load, own in zip(found, (slice(0, 3), slice(3, 6)), strict=True):
        off = load - case.wrench[:, own]
        known = np.isfinite(off).all(0)
        of.append(float(rms(off[:, known])) if known.any() else float("nan"))
    return tuple(of)


def means(of: Sequence[Met], who: str) -> Array:
    """Geometric means of the errors of force and moment; NaN where one of the records has none."""
    return np.asarray(np.exp(np.mean(np.log([record.error[who] for record in of]), axis=0)))


def over_best(of: Sequence[Met]) -> list[tuple[float, str]]:
    """Errors of force and moment over those of the best peer, with its name; NaN where one is not known."""
    names = [name for name in of[0].error if name != OURS]
    ours, theirs = means(of, OURS), np.array([means(of, name) for name in names])
    found = []
    for own, others in zip(ours, theirs.T, strict=True):
        best = int(np.argmin(np.where(np.isfinite(others), others, np.inf)))
        found.append((float(own / others[best]), names[best]))
    return found


def figure_of(found: Mapping[str, Sequence[tuple[float, str]]]) -> Any:
    """Ratios of every kind, force and moment, on a logarithmic axis, with the names of the best peers."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8.0, 0.42 * len(found) + 1.4), layout="constrained")
    for k, (load, mark) in enumerate(zip(LOADS, "os", strict=True)):
        shown = [(max(pairs[k][0], LEAST_SHOWN), n) for n, pairs in enumerate(found.values())]
        x, y = np.array(shown).T
        axes.plot(x, y + 0.17 * (2 * k - 1), mark, label=load)
        for n, pairs in enumerate(found.values()):
            axes.annotate(
                pairs[k][1],
                (x[n], y[n] + 0.17 * (2 * k - 1)),
                (6, -3),
                textcoords="offset points",
                fontsize=7,
            )
    axes.axvline(1.0, color="0.3", linewidth=1)
    axes.set(
        xscale="log",
        xlim=(0.7 * LEAST_SHOWN, 4.0),
        xlabel="error of forceid over that of the best peer, named beside it",
    )
    axes.set_yticks(range(len(found)), list(found))
    axes.invert_yaxis()
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="lower left")
    return figure


def main() -> None:
    """Simulate, let all meet every record, and write the page."""
    given = asked("evidence.strangers.beside_peers", __doc__, seeds=(1, 2), only=".", jobs=1)
    kinds = [kind for kind in KINDS if re.search(given.only, kind)]
    jobs = [(kind, seed) for kind in kinds for seed in given.seeds]
    found = [one for one in each(met, jobs, given.jobs) if one is not None]
    each_kind = {kind: over_best([one for one in found if one.kind == kind]) for kind in kinds}
    ratios = [ratio for pairs in each_kind.values() for ratio, _ in pairs if np.isfinite(ratio)]
    pictured(given.output, "strangers_peers", figure_of(each_kind))
    said = (
        f"At most {LEAST:g} of the best peer in {sum(r <= LEAST for r in ratios)} of {len(ratios)} kinds and "
        f"loads, at most {MOST:g} in {sum(r <= MOST for r in ratios)}; the most: {max(ratios):.2f}."
    )
    names = ", ".join(peer.name for peer in told_nothing())
    about = ABOUT.format(command=given.command, count=len(told_nothing()), names=names)
    title = "Strangers beside peers"
    picture = "![Error over that of the best peer, by kind of scene](strangers_peers.png)"
    paged(given.output, "strangers_peers", title, about, picture, said)


if __name__ == "__main__":
    main()
