"""forceid stress: where each method breaks, and what forceid says there."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evidence.completion import failures
from forceid.cli.boundary.output import finite_or_none, to_json
from forceid.cli.crew.progress import progress
from forceid.cli.estimate import Json

if TYPE_CHECKING:
    from evidence.stress.run import Map, StressJob

SEEDS = 5


def run(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the maps.")],
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE...]",
            help="Failures by name, or groups of them; or all. Motion files: faults on twins of each.",
            autocompletion=failures,
        ),
    ] = None,
    short: Annotated[
        bool,
        typer.Option("--short", help="Three levels, one seed, the default method: about two minutes."),
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(metavar="N", min=1, help=f"Records of a cell; {SEEDS} if not given, or 1.")
    ] = None,
    jobs: Annotated[
        int, typer.Option("-j", "--jobs", metavar="N", min=1, help="Processes at a time.")
    ] = os.cpu_count() or 1,
    json: Json = False,
) -> None:
    """Sweep failures from healthy to hopeless, and map where each method is right, says so, or is wrong.

    Writes DIR/stress.md, stress.json and a picture a failure. What is finished is kept in DIR/stress.jsonl:
    started again after an interruption, or with more of them, the command goes on from there.

    Of a motion file, twins with a known load meet faults instead: how far the recording is from breaking, in
    DIR/stress_NAME.md.

    Example: forceid stress outliers jitter -o stress --short

    Example: forceid stress squats1.h5 -o stress --short
    """
    own = [Path(word) for word in scenes or [] if word.endswith(".h5")]
    for path in own:
        from evidence.stress.own_file import told

        words = ["forceid stress", path.name, "-o", output.name, *(["--short"] if short else [])]
        print(told(path, output, seeds or 1, short, " ".join(words)))
    scenes = [word for word in scenes or [] if not word.endswith(".h5")]
    if own and not scenes:
        return
    from evidence.journal import Journal
    from evidence.stress.failure_table import failures_named
    from evidence.stress.run import as_plain, key_of, maps_of, plan

    chosen = failures_named(scenes)
    count = seeds or (1 if short else SEEDS)
    todo = plan(chosen, count, short)
    journal, keys = Journal.opened(output / "stress.jsonl"), {job: key_of(job) for job in todo}
    left = [job for job in todo if keys[job] not in journal.lines]
    with progress(len(left), "records") as advance:
        for job, record in done(left, jobs):
            journal.once(keys[job], partial(finite_or_none, record))
            advance()
    maps = maps_of([journal.lines[key] for key in keys.values()], chosen, short)
    write_map(maps, output, count, short)
    print(to_json(as_plain(maps, count, short)) if json else color_counts(maps, output))


def done(todo: Sequence[StressJob], workers: int) -> Iterator[tuple[StressJob, dict[str, Any]]]:
    """Each job with its record as it comes, from processes with one BLAS thread each."""
    import sys
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    from evidence.stress.run import do
    from forceid.cli.crew.pool import ignore_interrupt
    from forceid.errors import EstimationError

    if not todo:
        return
    pool = ProcessPoolExecutor(min(workers, len(todo)), get_context("spawn"), initializer=ignore_interrupt)
    try:
        pending = {pool.submit(do, job): job for job in todo}
        for found in as_completed(pending):
            yield pending[found], found.result()
    except BrokenProcessPool as error:
        raise EstimationError(
            "lost a process, perhaps for want of memory",
            "stress",
            "run again with -j 1: what is done is kept",
        ) from error
    except KeyboardInterrupt:
        print("forceid: finishing the records under way", file=sys.stderr)
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def write_map(maps: Sequence[Map], folder: Path, seeds: int, short: bool) -> None:
    """The pictures, stress.json and stress.md."""
    from evidence.stress.figures import draw_map, draw_overview
    from evidence.stress.page import page_of
    from evidence.stress.run import as_plain
    from evidence.written import pictured, written

    for m in maps:
        pictured(folder, m.failure.name, draw_map(m))
    pictured(folder, "overview", draw_overview(maps))
    written(folder, "stress.json", to_json(as_plain(maps, seeds, short)) + "\n")
    written(folder, "stress.md", page_of(maps, seeds))


def color_counts(maps: Sequence[Map], folder: Path) -> str:
    """The count of each color, and where to read on."""
    from evidence.stress.run import counts

    total = counts(row for m in maps for row in m.rows)
    colors = ", ".join(f"{total[color]} {color}" for color in ("green", "pale", "amber", "grey", "red"))
    return (
        f"cells    {total['cells']}: {colors}\n"
        f"amber    {total['needless amber']} needless\n"
        f"page     {folder / 'stress.md'}, numbers in {folder / 'stress.json'}"
    )
