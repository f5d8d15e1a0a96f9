"""forceid chart: accuracy against speed, every method and every peer, measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evidence.completion import scenes as complete_scenes
from forceid.cli.boundary.output import finite_or_none, to_json
from forceid.cli.estimate import Json

if TYPE_CHECKING:
    from rich.progress import Progress


def run(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the charts.")],
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE...]",
            help="Shipped scenes, bodies in parts and affine ones by name, recipes, motion files; or all.",
            autocompletion=complete_scenes,
        ),
    ] = None,
    short: Annotated[
        bool, typer.Option("--short", help="One seed, one round, no slow contestants, no memory.")
    ] = False,
    json: Json = False,
) -> None:
    """Measure error, claim, time and memory of every method and of every peer installed, on every SCENE.

    Writes DIR/chart.md, chart.json and a picture a scene. What is finished is kept in DIR/chart.jsonl: after
    an interruption, or with more scenes, the command goes on from there.

    Bodies in parts are scenes too, and solvers methods: plate_16, plate_64, strips, checkerboard, solid_8.
    So are affine bodies: polar_1e2, polar_1e6, polar_1e12, ball, balls_1000, stiff_ball, held_block.

    A motion file without truth is charted on its twins: the same body, markers, clock, gaps and noise, under
    a load that is known, drawn from what the estimate leaves open. So it tells which method is for your data.

    Example: forceid chart flexible_boomerang squats1.h5 -o charts --short
    """
    from evidence.chart.page import overview
    from evidence.chart.run import FULL, SHORT
    from evidence.chart.run import run as chart
    from evidence.chart.subjects import CHARTED
    from evidence.subjects.affine.cases import CASES
    from evidence.subjects.flights.cases import sources
    from evidence.subjects.parts.cases import GRIDS

    words = scenes or []
    asked: list[tuple[Any, Any]] = [(CHARTED["flights"], path) for path in sources(words, [*GRIDS, *CASES])]
    for subject, names in (("parts", GRIDS), ("affine", CASES)):
        asked += [(CHARTED[subject], name) for name in words or names if name in names]
    command = " ".join(["forceid chart", *words, "-o", output.name, *(["--short"] if short else [])])
    output.mkdir(parents=True, exist_ok=True)
    with progress_bar_of() as bar:
        task = bar.add_task("", total=1.0)
        result = chart(
            asked, output, SHORT if short else FULL, command,
            lambda what, part: bar.update(task, description=what, completed=part),
        )  # fmt: skip
    written, pictures = write_chart(output, result)
    if json:
        print(to_json(result))
        return
    for name, charted in CHARTED.items():
        if cases := [case for case in result["cases"] if case["subject"] == name]:
            print(overview(charted, cases), end="\n\n")
    print(f"{written} and {len(pictures)} pictures beside it")


def write_chart(folder: Path, result: dict[str, Any]) -> tuple[Path, list[str]]:
    """The page, the numbers and the pictures; returns the page, and the names of the pictures."""
    import json

    from evidence.chart.figures import draw_case
    from evidence.chart.page import page
    from evidence.chart.subjects import CHARTED
    from evidence.written import pictured, written

    pictures = {
        f"chart_{case['name']}": draw_case(CHARTED[case["subject"]], case) for case in result["cases"]
    }
    for name, figure in pictures.items():
        pictured(folder, name, figure)
    written(folder, "chart.json", json.dumps(finite_or_none(result), indent=1, allow_nan=False) + "\n")
    return written(folder, "chart.md", page(result, CHARTED.values())), list(pictures)


def progress_bar_of() -> Progress:
    """A bar on stderr with the time left and what is under way."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    return Progress(
        BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn(), TimeRemainingColumn(),
        TextColumn("{task.description}"), console=Console(stderr=True), transient=True,
    )  # fmt: skip
