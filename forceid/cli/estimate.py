"""forceid estimate: the wrench of one motion file."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forceid.cli.boundary.completion import words_of
from forceid.cli.boundary.output import describe, summary, to_json
from forceid.cli.boundary.terminal import LOUDNESS, note, tell
from forceid.errors import DataError, EstimationError
from forceid.memory import keep_freed

if TYPE_CHECKING:
    from forceid.config import Settings
    from forceid.estimation import Progress

MotionFile = Annotated[Path, typer.Argument(metavar="FILE.h5", help="Motion file, HDF5.")]
Config = Annotated[
    Path | None, typer.Option("-c", "--config", metavar="CONFIG", help="Settings, a TOML file.")
]


def written(metavar: str, text: str) -> Any:
    """The option -o of what is written."""
    return typer.Option("-o", "--output", metavar=metavar, help=text)


def choice(metavar: str, text: str, *words: str, flags: tuple[str, ...] = ()) -> Any:
    """An option that a shell completes with `words_of` these; flags: its names, where it has a short one."""
    return typer.Option(*flags, metavar=metavar, help=text, autocompletion=words_of(*words))


METHOD_WORDS = "difference, savgol, spline, filter or smoother (the default)."
MODEL_WORDS = "rigid, affine, modal or auto: the smallest enough (default)."
ENGINE_WORDS = "compiled, numpy, filterpy (slow) or auto (the fastest here)."
MethodOption = Annotated[str | None, choice("M", METHOD_WORDS, "forceid.config", "Method")]
ModelOption = Annotated[str | None, choice("L", MODEL_WORDS, "forceid.config", "Model")]
EngineOption = Annotated[str | None, choice("E", ENGINE_WORDS, "forceid.kalman.engines", "MODULES", "auto")]
Force = Annotated[bool, typer.Option("--force", help="Replace a file that is not of this program.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]


def run(
    file: MotionFile,
    config: Config = None,
    output: Annotated[
        Path | None, written("OUT.h5", "Result file; FILE.result.h5 beside the input if not given.")
    ] = None,
    method: MethodOption = None,
    model: ModelOption = None,
    engine: EngineOption = None,
    force: Force = False,
    json: Json = False,
    profile: Annotated[
        bool, typer.Option("--profile", help="Show the CPU time of every stage, with --json on stderr.")
    ] = False,
) -> None:
    """Estimate the applied force and moment of FILE, with covariance.

    Exit code 1 when the estimate is refused; the result is still written, with NaN where nothing is known. A
    recording that takes long, over 1 GB or 1500 frames, goes on where it was stopped.

    Example: forceid estimate toss.h5 --method smoother -o toss.result.h5
    """
    from forceid.cli.crew.progress import progress
    from forceid.config import load_settings
    from forceid.files.stored.atomic import sweep
    from forceid.report import show_stages

    settings = load_settings(config, method=method, model=model, engine=engine)
    output = output or file.with_suffix(".result.h5")
    sweep(output.parent, {output.name})
    record = estimate_file(file, output, settings, progress, *([config] if config else []), force=force)
    if json:
        tell(to_json(record))
    else:
        note(summary(record, LOUDNESS[0] > 1))
    if profile or LOUDNESS[0] > 1:
        table = StringIO()
        show_stages(record["timing"], table)
        tell(table.getvalue().rstrip(), sys.stdout if profile and not json else sys.stderr)
    if "refused" in (record["verdict"], record.get("interface", {}).get("verdict")):
        raise typer.Exit(1)


@contextmanager
def naming(source: Path) -> Iterator[None]:
    """Put the file's name before errors from where only the variable is known; say want of memory."""
    try:
        yield
    except (DataError, EstimationError) as e:
        if str(source) in e.where:
            raise
        raise type(e)(
            e.what, f"{source}:{'' if e.where.startswith('/') else ' '}{e.where}", e.next_step
        ) from e
    except MemoryError as e:
        what = f"needs more memory than there is ({' '.join(str(e).split()) or 'none left'})"
        raise EstimationError(what, str(source), "leave out nodes, sensors or frames, or give it more") from e


def kept_of(output: Path) -> Path:
    """The folder beside a result for what is done of one that takes long: what was killed goes on there."""
    return output.with_name(f".{output.name}.kept")


def estimate_file(
    source: Path,
    output: Path,
    settings: Settings,
    progress: Progress | None = None,
    *beside: Path,
    force: bool = False,
) -> dict[str, Any]:
    """Read, estimate, write; return what there is to say of it. progress: of a recording that takes long.

    beside: further inputs that the output must not be; force: it may take the place of any file.
    """
    from shutil import rmtree

    from forceid.timing import in_order, recorded, stage

    keep_freed()
    with recorded() as spent, stage("loading"):
        from forceid.estimation import estimate_source, unwatched
        from forceid.files import check_output, write_result
    check_output(output, "result", (source, *beside), force)
    try:
        with naming(source):
            estimate, recording = estimate_source(source, settings, kept_of(output), progress or unwatched)
    except DataError:
        rmtree(kept_of(output), ignore_errors=True)
        raise
    estimate = replace(estimate, timing=in_order(spent, estimate.timing))
    with recorded() as spent, stage("writing"):
        write_result(output, estimate, recording)
    rmtree(kept_of(output), ignore_errors=True)
    estimate = replace(estimate, timing=in_order(spent, estimate.timing))
    return describe(estimate, source, output, recording.truth)
