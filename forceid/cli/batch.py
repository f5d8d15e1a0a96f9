"""forceid batch: many motion files, a process each, and one bad file never stops the rest."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forceid.cli.boundary.output import to_json, worse_verdict, wrap
from forceid.cli.boundary.terminal import note, tell
from forceid.cli.estimate import Config, EngineOption, Json, MethodOption, ModelOption
from forceid.errors import ConfigError, DataError, ForceIdError

if TYPE_CHECKING:
    from forceid.cli.crew.pool import Crew, Job, Record, Work
    from forceid.config import Settings

PAGE = "index.html"


def run(
    files: Annotated[list[Path], typer.Argument(metavar="FILE.h5...", help="Motion files, HDF5.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results.")],
    config: Config = None,
    method: MethodOption = None,
    model: ModelOption = None,
    engine: EngineOption = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j", "--jobs", metavar="N", min=1, help="Processes at a time; one a core if not given."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A dask.distributed cluster that runs: tcp://HOST:PORT."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep results that are still current.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace results that exist.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done, and do nothing.")
    ] = False,
    json: Json = False,
) -> None:
    """Estimate every one of FILES into DIR/NAME.result.h5, and sum them up in DIR/index.html.

    Results among FILES are left out. Exit code 1 when any estimate failed or was refused, forces between
    parts too; the others are finished all the same. What was interrupted or killed goes on with --resume.

    Example: forceid batch trials/*.h5 -o results -j 4 --resume
    """
    from forceid.config import load_settings

    if jobs is not None and scheduler is not None:
        raise ConfigError(
            "are given both", "-j and --scheduler", "leave one out: the cluster has its workers"
        )
    settings = load_settings(config, method=method, model=model, engine=engine)
    plan = plan_jobs(files, output)
    keep = resume and not force
    if dry_run:
        foreseen, left = parted([planned_outcome(job, settings, keep, force) for job in plan])
        show(foreseen, json)
        say_left_out(left, json)
        refuse_existing(plan, output, resume, force, config)
        return
    from forceid.cli.crew.claim import claimed

    with claimed(output), crew_of(jobs, scheduler, len(plan)) as crew:
        refuse_existing(plan, output, resume, force, config)
        done, stopped = work_through(plan, settings, crew, keep, scheduler is not None, json)
        records, left = parted(done)
        if left and not records and not stopped:
            what = f"is a result of forceid ({len(left)} of {len(left)} inputs are), expected motion files"
            raise DataError(what, left[0]["file"], "give the files that they were made from")
        said = sys.stderr if json else sys.stdout
        note(outcome_table(records), said)
        say_left_out(left, json)
        note(f"summary  {write_batch_page(records, output, len(plan) - len(done))}", said)
    if stopped:
        raise KeyboardInterrupt
    if any(record["status"] == "failed" or worse_verdict(record) == "refused" for record in records):
        raise typer.Exit(1)


def plan_jobs(files: Sequence[Path], folder: Path) -> list[Job]:
    """Input and output of every file; a ConfigError when two would write the same result."""
    plan = [(source, folder / f"{source.stem}.result.h5") for source in files]
    twice = [output for output, count in Counter(output for _, output in plan).items() if count > 1]
    if twice:
        sources = " and ".join(str(source) for source, output in plan if output == twice[0])
        raise ConfigError(f"would be written from {sources}", str(twice[0]), "rename one or run them apart")
    return plan


def refuse_existing(
    plan: Sequence[Job], folder: Path, resume: bool, force: bool, config: Path | None
) -> None:
    """A ConfigError where results exist and nothing says what to do with them, or a file would be lost.

    A motion file among the inputs is never written over, a result among them is no input.
    """
    from forceid.files import check_output, is_result

    existing = [] if resume or force else [output for _, output in plan if output.exists()]
    if existing:
        what = f"exists already, as do {len(existing) - 1} more" if len(existing) > 1 else "exists already"
        raise ConfigError(
            what, str(existing[0]), "give --resume to keep current results or --force to replace"
        )
    given = {(s.st_dev, s.st_ino): source for source, _ in plan if (s := status_of(source)) is not None}
    for own, output in plan:
        status = status_of(output)
        taken = None if status is None else given.get((status.st_dev, status.st_ino))
        lost = [taken] if taken is not None and taken != own and not is_result(taken) else []
        check_output(output, "result", lost, force)
    check_output(folder / PAGE, "page", [] if config is None else [config], force)


def status_of(path: Path) -> os.stat_result | None:
    """The status of a file, None where there is none."""
    try:
        return os.stat(path)
    except OSError:
        return None


def crew_of(jobs: int | None, scheduler: str | None, files: int) -> AbstractContextManager[Crew]:
    """Processes here, or the workers of a cluster."""
    from forceid.cli.crew.pool import processes

    if scheduler is None:
        return nullcontext(processes(min(jobs or os.cpu_count() or 1, files)))
    from forceid.cli.crew.cluster import cluster

    return cluster(scheduler)


def planned_outcome(job: Job, settings: Settings, keep: bool, force: bool) -> Record:
    """What would become of a file: skipped, planned, left out, failed, or exists, which ends the batch."""
    from forceid.cli.crew.pool import LEFT_OUT, cause_key, failure
    from forceid.cli.crew.resume import current
    from forceid.files import is_result, stamp

    try:
        stamp(job[0])
    except DataError as e:
        return failure(*job, str(e), cause_key(e, job[0]))
    if is_result(job[0]):
        return {"status": LEFT_OUT, "file": str(job[0])}
    known = current(*job, settings) if keep else None
    status = "exists" if job[1].exists() and not (keep or force) else "planned"
    return known or {"status": status, "file": str(job[0]), "output": str(job[1])}


def work_through(
    plan: Sequence[Job], settings: Settings, crew: Crew, keep: bool, remote: bool, json: bool
) -> tuple[list[Record], bool]:
    """The record of every file that was done, and whether an interrupt left others undone."""
    from forceid.cli.crew.pool import LEFT_OUT, run_job, run_jobs
    from forceid.cli.crew.progress import progress
    from forceid.cli.crew.resume import resume_job
    from forceid.files.stored.atomic import sweep

    work: Work = resume_job if keep else run_job
    if remote:
        from forceid.cli.crew.cluster import on_workers

        work = on_workers(work)
    records: list[Record] = []
    folder, names = plan[0][1].parent, {output.name for _, output in plan}
    sweep(folder, names)
    with progress(len(plan)) as advance:
        try:
            for done in run_jobs(plan, settings, crew, work):
                judged = done["status"] in ("failed", "skipped", LEFT_OUT)
                record = done if judged else {**done, "status": worse_verdict(done)}
                records.append(record)
                advance()
                if json and record["status"] != LEFT_OUT:
                    tell(to_json(record))
        except KeyboardInterrupt:
            return records, True
        finally:
            sweep(folder, names)
    return records, False


def parted(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """The records of motion files, and those of results among the inputs, which `*.h5` picks up."""
    from forceid.cli.crew.pool import LEFT_OUT

    left = [record for record in records if record["status"] == LEFT_OUT]
    return [record for record in records if record["status"] != LEFT_OUT], left


def say_left_out(left: Sequence[Record], json: bool) -> None:
    """One line on the results among the inputs, where there are any."""
    if left:
        first, more = left[0]["file"], f" and {len(left) - 1} more" if len(left) > 1 else ""
        said = sys.stderr if json else sys.stdout
        note(f"left out {first}{more}: results of forceid, no motion files", said)


def write_batch_page(records: Sequence[Record], folder: Path, undone: int) -> str:
    """The page over all files, beside the results; its path, or why it is not there."""
    from forceid.files.stored.atomic import write_whole
    from forceid.report import render_batch

    try:
        write_whole(folder / PAGE, render_batch(records, folder, undone))
    except ForceIdError as error:
        return str(error)
    return str(folder / PAGE)


def show(records: Sequence[Record], json: bool) -> None:
    """One line a record."""
    for record in records:
        line = f"{record['status']:8} {record['file']} -> {record['output']}"
        tell(to_json(record) if json else line + (f": {record['error']}" if "error" in record else ""))


def outcome_table(records: Sequence[Record]) -> str:
    """The outcome: a line for every file that is not accurate, and why, those far off, then the counts."""
    from forceid.report import find_outliers

    lines = []
    for record in sorted(records, key=lambda r: str(r["file"])):
        reasons = [record["error"]] if "error" in record else list(record.get("reasons", ()))
        joints = record.get("interface", {"verdict": "ok", "reasons": ()})
        said = "refused: " if joints["verdict"] == "refused" else ""
        reasons += [f"joints {said}{reason}" for reason in joints["reasons"]]
        if reasons:
            lines.append(f"{record['status']:8} {record['file']}")
            lines += [wrap(f"       - {reason}") for reason in reasons]
    lines += [wrap(f"far off  {outlier.file}: {outlier}") for outlier in find_outliers(records)]
    counts = Counter(record["status"] for record in records)
    lines.append(
        f"{len(records)} files: " + ", ".join(f"{n} {status}" for status, n in sorted(counts.items()))
    )
    return "\n".join(lines)
