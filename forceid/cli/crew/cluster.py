"""The workers of a dask.distributed cluster that runs already, as the crew of a batch.

They see the files under the same paths, and have the same version of forceid.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forceid import __version__
from forceid.cli.crew.pool import Crew, Record, Work, failure
from forceid.errors import ConfigError

if TYPE_CHECKING:
    from forceid.config import Settings

ANSWER = 10  # s in which a scheduler answers, and has a worker
NO_WORKER = 60.0  # s without any worker until the rest fails


@contextmanager
def cluster(address: str) -> Iterator[Crew]:
    """The crew of the scheduler at `address`, tcp://HOST:PORT, or a scheduler file, NAME.json.

    ConfigError: dask.distributed is missing, no scheduler answers, or it has no worker.
    """
    try:
        import distributed
        from distributed.client import ClosedClientError, FutureCancelledError
    except ImportError as e:
        raise ConfigError("needs dask.distributed", "--scheduler", "pip install 'forceid[cluster]'") from e
    for name in [n for n in logging.root.manager.loggerDict if n.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters comes as records
    untyped: Any = distributed
    where = f"--scheduler {address}"
    place = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
    if "scheduler_file" in place and not os.path.isfile(address):  # distributed would wait for it
        raise ConfigError("no scheduler answers (no such file)", where, "start one with `dask scheduler`")
    try:
        client: Any = untyped.Client(**place, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as e:
        said = " ".join(str(e).split()) or type(e).__name__
        raise ConfigError(f"no scheduler answers ({said})", where, "start one with `dask scheduler`") from e
    with client:
        try:
            client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError as e:
            raise ConfigError("has no workers", where, "start some with `dask worker --nthreads 1`") from e
        threads = [worker["nthreads"] for worker in workers_of(client)]
        if max(threads) > 1:
            say = "forceid: some workers run several files in one process; `--nthreads 1` keeps them apart"
            print(say, file=sys.stderr)

        @contextmanager
        def open_executor() -> Iterator[Executor]:
            yield client.get_executor(pure=False)  # nothing is shared between two runs of one file

        gone = distributed.KilledWorker, CancelledError, FutureCancelledError, ClosedClientError
        deserted = watch(lambda: len(workers_of(client)))
        yield Crew(open_executor, 2 * sum(threads), gone, deserted, lambda: not tasks_of(client))


def workers_of(client: Any) -> list[dict[str, Any]]:
    """What the scheduler knows of its workers; none where it does not answer."""
    try:
        return list(client.scheduler_info(n_workers=-1)["workers"].values())
    except (OSError, KeyError, RuntimeError):
        return []


def tasks_of(client: Any) -> list[str]:
    """Our tasks that workers are at, and one that stands for them where nobody can tell."""
    try:
        at_work = client.processing()
    except (OSError, RuntimeError):
        at_work = {}
    ours = [str(key) for keys in at_work.values() for key in keys if str(key).startswith(remotely.__name__)]
    return ours if at_work else ["unknown"]


def watch(count: Callable[[], int], clock: Callable[[], float] = time.monotonic) -> Callable[[], bool]:
    """A question that is answered with yes once `count` has been zero for NO_WORKER seconds."""
    since: list[float] = []

    def deserted() -> bool:
        if count():
            since.clear()
        elif not since:
            since.append(clock())
        return bool(since) and clock() - since[0] >= NO_WORKER

    return deserted


def on_workers(work: Work) -> Work:
    """The work as a worker does it, wherever it was started."""
    return partial(remotely, work, __version__, os.getcwd())


def remotely(work: Work, version: str, folder: str, source: Path, output: Path, settings: Settings) -> Record:
    """Do one job with the paths as seen from the folder of the batch; fails where versions differ."""
    if version != __version__:
        return failure(source, output, f"its worker has forceid {__version__}, expected {version}")
    done = work(Path(folder, source), Path(folder, output), settings)
    return {**done, "file": str(source), "output": str(output)}
