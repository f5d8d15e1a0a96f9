"""forceid batch: many motion files, a process each, and one bad file never stops the rest."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forceid.cli.estimate import Config, Engine, Json, Method, Model
from forceid.cli.output import to_json, worst, wrap
from forceid.errors import ConfigError, DataError

if TYPE_CHECKING:
    from rich.progress import Progress

    from forceid.cli.pool import Job
    from forceid.config import Settings


def run(
    files: Annotated[list[Path], typer.Argument(metavar="FILE.h5...", help="Motion files, HDF5.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results.")],
    config: Config = None,
    method: Method = None,
    model: Model = None,
    engine: Engine = None,
    jobs: Annotated[
        int, typer.Option("-j", "--jobs", metavar="N", min=1, help="Processes at a time.")
    ] = os.cpu_count() or 1,
    resume: Annotated[bool, typer.Option("--resume", help="Keep results that are still current.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace results that exist.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done, and do nothing.")
    ] = False,
    json: Json = False,
) -> None:
    """Estimate every one of FILES into DIR/NAME.result.h5.

    Exit code 1 when any estimate failed or was refused, forces between parts too; the others are finished all
    the same.

    Example: forceid batch trials/*.h5 -o results -j 4 --resume
    """
    from forceid.cli.pool import run_jobs
    from forceid.config import load_settings

    settings = load_settings(config, method=method, model=model, engine=engine)
    plan = plan_jobs(files, output)
    kept = {job: current(job, settings) for job in plan} if resume and not force else {}
    existing = [job for job in plan if job[1].exists()]
    if existing and not (resume or force):
        what = f"exists already, as do {len(existing) - 1} more" if len(existing) > 1 else "exists already"
        raise ConfigError(
            what, str(existing[0][1]), "give --resume to keep current results or --force to replace"
        )
    todo = [job for job in plan if not kept.get(job)]
    skipped = [record for record in kept.values() if record]
    if dry_run:
        show([*skipped, *({"status": "planned", "file": str(a), "output": str(b)} for a, b in todo)], json)
        return
    output.mkdir(parents=True, exist_ok=True)
    records = list(skipped)
    if json:
        show(skipped, json)
    with progress() as bar:
        task = bar.add_task("estimate", total=len(todo))
        for done in run_jobs(todo, settings, jobs):
            record = done if done["status"] == "failed" else {**done, "status": worst(done)}
            records.append(record)
            bar.advance(task)
            if json:
                print(to_json(record), flush=True)
    print(table(records), file=sys.stderr if json else sys.stdout)
    if any(record["status"] == "failed" or worst(record) == "refused" for record in records):
        raise typer.Exit(1)


def plan_jobs(files: Sequence[Path], folder: Path) -> list[Job]:
    """Input and output of every file; a ConfigError when two would write the same result."""
    plan = [(source, folder / f"{source.stem}.result.h5") for source in files]
    twice = [output for output, count in Counter(output for _, output in plan).items() if count > 1]
    if twice:
        sources = " and ".join(str(source) for source, output in plan if output == twice[0])
        raise ConfigError(f"would be written from {sources}", str(twice[0]), "rename one or run them apart")
    return plan


def current(job: Job, settings: Settings) -> dict[str, Any] | None:
    """What is to say of a result that has the same input, settings and version; None when it has not."""
    import hashlib

    from forceid import __version__
    from forceid.config import to_toml
    from forceid.files.hdf5 import open_hdf5

    source, output = job
    try:
        with open_hdf5(output) as result, open(source, "rb") as data:
            made = [str(result.attrs[key]) for key in ("input_sha256", "config", "forceid_version")]
            known = verdict_of(result["estimate"])
            if "interface" in result:
                known["interface"] = verdict_of(result["interface"])
            wanted = [hashlib.file_digest(data, "sha256").hexdigest(), to_toml(settings), __version__]
    except (DataError, KeyError, OSError):
        return None
    if made != wanted:
        return None
    return {"status": "skipped", "file": str(source), "output": str(output), **known}


def verdict_of(group: Any) -> dict[str, Any]:
    """Verdict and reasons of a group of a result file."""
    return {"verdict": str(group.attrs["verdict"]), "reasons": str(group.attrs["reasons"]).splitlines()}


def show(records: Sequence[dict[str, Any]], json: bool) -> None:
    """One line a record."""
    for record in records:
        print(to_json(record) if json else f"{record['status']:8} {record['file']} -> {record['output']}")


def progress() -> Progress:
    """A bar on stderr with count, rate and time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed or 0:.2g} files/s")

    return Progress(
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def table(records: Sequence[dict[str, Any]]) -> str:
    """The outcome: a line for every file that is not accurate, and why, then the counts."""
    lines = []
    for record in sorted(records, key=lambda r: str(r["file"])):
        reasons = [record["error"]] if "error" in record else list(record.get("reasons", ()))
        joints = record.get("interface", {"verdict": "ok", "reasons": ()})
        said = "refused: " if joints["verdict"] == "refused" else ""
        reasons += [f"joints {said}{reason}" for reason in joints["reasons"]]
        if reasons:
            lines.append(f"{record['status']:8} {record['file']}")
            lines += [wrap(f"       - {reason}") for reason in reasons]
    counts = Counter(record["status"] for record in records)
    lines.append(
        f"{len(records)} files: " + ", ".join(f"{n} {status}" for status, n in sorted(counts.items()))
    )
    return "\n".join(lines)
