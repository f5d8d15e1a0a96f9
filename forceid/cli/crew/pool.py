"""Motion files handed out to a crew of processes: results and failures as they come, whatever a file does."""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from forceid.cli.estimate import estimate_file
from forceid.errors import ForceIdError

if TYPE_CHECKING:
    from forceid.config import Settings

Job: TypeAlias = tuple[Path, Path]
Record: TypeAlias = dict[str, Any]
Work: TypeAlias = "Callable[[Path, Path, Settings], Record]"
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
QUIET = "PYTHONWARNINGS", "ignore:resource_tracker"  # what an end at once leaves, the system clears away
ENVIRONMENT = dict.fromkeys(THREADS, "1")
LEFT_OUT = "left out"  # the status of an input that is a result
LOOK = 2.0  # s between looks at whether the crew is still there
STILL = 8  # looks in a row at a crew that does nothing, until what it says it does is lost


@dataclass(frozen=True)
class Crew:
    """Who does the jobs. open() starts an executor and ends it; `hands` jobs are under way at a time.

    gone: what a job raises whose process died; deserted(): whether nobody is left who could do a job;
    idle(): whether those who are there do none of ours, which happens where a record was lost on its way.
    """

    open: Callable[[], AbstractContextManager[Executor]]
    hands: int
    gone: tuple[type[BaseException], ...] = (BrokenExecutor,)
    deserted: Callable[[], bool] = lambda: False
    idle: Callable[[], bool] = lambda: False


def processes(workers: int) -> Crew:
    """So many processes on this machine, spawned, with one BLAS thread each."""
    return Crew(lambda: open_pool(workers), workers)


@contextmanager
def open_pool(workers: int) -> Iterator[Executor]:
    """A pool whose processes leave the interrupt to the parent, and end when the parent is killed."""
    before = {name: os.environ.get(name) for name in (*ENVIRONMENT, QUIET[0])}
    os.environ[QUIET[0]] = ",".join(filter(None, (before[QUIET[0]], QUIET[1])))
    os.environ.update(ENVIRONMENT)  # read by the spawned process, as it starts and as it imports numpy
    try:
        with ProcessPoolExecutor(workers, get_context("spawn"), initializer=attend) as pool:
            with interrupts_held():
                for _ in range(workers):  # each starts one: as they import, no interrupt reaches them
                    pool.submit(os.getpid)
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def run_jobs(
    jobs: Sequence[Job], settings: Settings, crew: Crew, work: Work | None = None
) -> Iterator[Record]:
    """The record of each job as it finishes.

    A file that kills its process takes the pool with it: the jobs under way then run again one at a time, so
    that only the guilty one fails. After an interrupt no more jobs are handed out, those under way are
    finished and told, and KeyboardInterrupt is raised. work: `run_job` if not given.
    """
    waiting, suspects = deque(jobs), deque[Job]()
    with asked_to_stop() as asked:
        while waiting and not asked:
            with crew.open() as executor:
                yield from hand_out(executor, crew, waiting, suspects, asked, settings, work or run_job)
        while suspects and not asked:
            alone, lost = deque([suspects.popleft()]), deque[Job]()
            with crew.open() as executor:
                yield from hand_out(executor, crew, alone, lost, asked, settings, work or run_job)
            for job in [*lost, *alone]:
                yield failure(*job, "its process died, perhaps for want of memory")
    if asked:
        raise KeyboardInterrupt


def hand_out(
    executor: Executor,
    crew: Crew,
    waiting: deque[Job],
    lost: deque[Job],
    asked: list[int],
    settings: Settings,
    work: Work,
) -> Iterator[Record]:
    """Records of the jobs that wait, as many under way as there are hands; `lost`: their process died."""
    under_way: dict[Future[Record], Job] = {}
    broken, idle, still = False, True, 0
    while under_way or (waiting and not broken and not asked):
        while waiting and len(under_way) < crew.hands and not broken and not asked:
            try:
                under_way[executor.submit(work, *waiting[0], settings)] = waiting[0]
                waiting.popleft()
            except crew.gone:
                broken = True
        if broken and idle and not under_way:
            yield from left(waiting)
        done, _ = wait(under_way, LOOK, FIRST_COMPLETED)
        for future in done:
            idle = False
            job = under_way.pop(future)
            try:
                yield future.result()
            except crew.gone:
                lost.append(job)
            except Exception as error:  # a worker that cannot even begin
                yield failure(*job, f"unexpected {type(error).__name__}: {error}", type(error).__name__)
        if not done and crew.deserted():
            waiting.extend(under_way.values())
            yield from left(waiting)
            return
        still = still + 1 if not done and crew.idle() else 0
        if still == STILL:
            lost.extend(under_way.values())
            return


def left(waiting: deque[Job]) -> Iterator[Record]:
    """Records of the jobs that nobody is there to do."""
    while waiting:
        yield failure(*waiting.popleft(), "no worker is left; start some, and go on with --resume")


def run_job(source: Path, output: Path, settings: Settings) -> Record:
    """Estimate one file; every failure becomes a record that says why, a result that is given says so."""
    from forceid.files import is_result, stamp

    try:
        stamp(source)
        record = estimate_file(source, output, settings, force=True)
        return {"status": record["verdict"], **record, "nis_mean": nis_mean(output)}
    except ForceIdError as error:
        failed = failure(source, output, str(error), cause_key(error, source))
        return failed | {"status": LEFT_OUT} if is_result(source) else failed
    except MemoryError:
        return failure(source, output, "not enough memory; give fewer processes, -j, or split the recording")
    except Exception as error:
        hint = f"forceid estimate {source} --debug shows where"
        what = f"unexpected {type(error).__name__}: {error} ({hint})"
        return failure(source, output, what, type(error).__name__)


def nis_mean(output: Path) -> float:
    """Mean normalized innovation squared of a result, about one where the model is right; NaN without any."""
    import h5py
    import numpy as np

    with h5py.File(output) as f:
        nis = f["estimate/nis"][...]
    seen = np.isfinite(nis)
    return float(nis[seen].mean()) if seen.any() else float("nan")


def failure(source: Path, output: Path, error: str, cause: str = "") -> Record:
    """The record of a file that has no result; cause: the same for all files of one, by default the error."""
    record = {"status": "failed", "file": str(source), "output": str(output)}
    return record | {"error": " ".join(error.split()), "error_cause": cause or error}


def cause_key(error: ForceIdError, source: Path) -> str:
    """What errors of one cause have in common, whichever file: kind, place in the file, and next step."""
    parts = (type(error).__name__, error.where, error.next_step)
    return " ".join(text.replace(str(source), "") for text in parts).strip()


@contextmanager
def asked_to_stop() -> Iterator[list[int]]:
    """A list that an interrupt fills: it may fall into any code, and is obeyed between two jobs.

    The second one ends everything at once: what is half done is hidden, and swept by the next batch.
    """
    asked: list[int] = []

    def ask(number: int, _frame: object) -> None:
        if asked:
            os.write(2, b"\nforceid: error: interrupted\n")
            os._exit(130)
        asked.append(number)
        os.write(2, b"\nforceid: finishing the files under way; once more to stop at once\n")

    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    before = signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Interrupts wait for a moment, and never reach a process that is started in it."""
    if not hasattr(signal, "pthread_sigmask"):  # as on Windows
        yield
        return
    ensure_running()  # lets them through as it begins
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def attend() -> None:
    """Leave the interrupt to the parent, which hands out no more files, and do not outlive it."""
    ignore_interrupt()
    threading.Thread(target=follow, daemon=True).start()


def ignore_interrupt() -> None:
    """Leave the interrupt to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def follow() -> None:
    """End this process when its parent is gone, however it went."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)
