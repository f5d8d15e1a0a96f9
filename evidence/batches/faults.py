"""Batches that are killed, interrupted, run out of room or lose workers, at random moments, counted.

    python -m evidence.batches.faults -o docs [--rounds 12] [--files 24] [--seed 0]

Writes faults.md. Every round begins a batch, does something to it at a random moment, and resumes it until
nothing is left to do. What then stands in the folder is compared, number by number, with a batch that was
left alone. Counted are files without result, results that are torn or hold other numbers, results done twice
although they were whole, tracebacks, exit codes that the contract does not have, and runs that do not end.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from evidence.batches.records import bits, results
from evidence.written import asked, paged, table
from forceid.cli.app import main as forceid

PATIENCE = 120  # s until a run counts as one that does not end
QUICK = ["--method", "difference", "--model", "rigid"]
RECIPE = 'scene = "spinner"\ntitle = "toss"\nduration = 0.2\nsample_rate = 200\nnoise_std = 5e-4\n'
START = """
import resource, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
{before}
if __name__ == "__main__":
    from forceid.cli.app import main
    sys.exit(main())
"""
CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""
ABOUT = """\
`{command}`: batches of {count} files; when a random number of them is done something happens to each, \
then it is resumed. *Lost*: without result in the end; *half-written*: a result by its name that is torn, \
or holds other numbers than that of a batch left alone; *done twice*: written again although it was whole; \
*hangs*: no end within two minutes; *left behind*: hidden files in the folder. Damaged files are on a page \
of their own, [mutated_files](mutated_files.md)."""
COUNTED = ("lost", "half-written", "done twice", "tracebacks", "odd exit codes", "hangs")
ALLOWED = {0, 1, 2, 130, -signal.SIGKILL}
Run = subprocess.Popen[str]


def batch(folder: Path, words: list[str], before: str = "") -> Run:
    """A batch as a group of processes of its own."""
    script = folder / "start.py"
    script.write_text(START.format(before=before))
    pipe = subprocess.PIPE
    argv = [sys.executable, str(script), "batch", *words, *QUICK, "--json"]
    return subprocess.Popen(argv, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def ended(run: Run, found: Counter[str], where: str) -> None:
    """Wait for the end of a run, and count what it should not do."""
    try:
        _, said = run.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(run.pid, signal.SIGKILL)
        _, said = run.communicate()
        found["hangs"] += 1
    if "Traceback" in said:
        print(where, said, file=sys.stderr)
        found["tracebacks"] += 1
    if run.returncode not in ALLOWED:
        print(where, "exit code", run.returncode, said, file=sys.stderr)
        found["odd exit codes"] += 1


def workers(process: int) -> list[int]:
    """Processes that a process has started to work for it, from any of its threads."""
    threads = Path(f"/proc/{process}/task").glob("*/children")
    own = [int(k) for thread in threads for k in thread.read_text().split()]
    return [k for k in own if "spawn_main" in Path(f"/proc/{k}/cmdline").read_text()]


def kill_process(run: Run) -> None:
    if own := workers(run.pid):
        os.kill(random.choice(own), signal.SIGKILL)


def interrupt_twice(run: Run) -> None:
    run.send_signal(signal.SIGINT)
    time.sleep(random.uniform(0, 0.3))
    run.send_signal(signal.SIGINT)


def nothing(run: Run) -> None:
    """What is wrong is wrong from the start, or somebody else does it."""


FULL = "resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0}))"
FAULTS: dict[str, tuple[str, Callable[[Run], None]]] = {
    "kill -9 of the batch": ("", Run.kill),
    "kill -9 of one of its processes": ("", kill_process),
    "interrupt": ("", lambda run: run.send_signal(signal.SIGINT)),
    "interrupt, twice": ("", interrupt_twice),
    "disk full": (FULL, nothing),
    "a second batch into the folder": ("", nothing),
    "kill -9 of a cluster's worker": ("", nothing),
}


def torn(out: Path, whole: dict[str, dict[str, bytes]], found: Counter[str]) -> dict[Path, int]:
    """Results there are, with the time of their writing; those that are not what they should be, counted."""
    for path in out.glob("*.result.h5"):
        try:
            found["half-written"] += bits(path) != whole[path.name]
        except OSError:
            found["half-written"] += 1
    return {path: path.stat().st_mtime_ns for path in out.glob("*.result.h5")}


def one_round(
    fault: str, folder: Path, files: list[str], whole: dict[str, dict[str, bytes]], dice: random.Random
) -> Counter[str]:
    """What came of a batch to which that was done."""
    found: Counter[str] = Counter(rounds=1)
    before, act = FAULTS[fault]
    out, own = folder / "out", folder / "own"
    own.mkdir()
    words = [*files, "-o", str(out), "-j", "2"]
    cluster: Run | None = None
    if "cluster" in fault:
        cluster = subprocess.Popen(
            [sys.executable, "-c", CLUSTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, start_new_session=True,
        )  # fmt: skip
        assert cluster.stdout is not None
        words = [*files, "-o", str(out), "--scheduler", cluster.stdout.readline().strip()]
    run = batch(own, words, before.format(dice.randrange(10_000, 60_000)))
    some, late = dice.randrange(len(files)), time.monotonic() + 8
    while run.poll() is None and time.monotonic() < late and len(list(out.glob("*.result.h5"))) < some:
        time.sleep(0.01)
    time.sleep(dice.uniform(0, 0.3))
    if "second" in fault:
        (folder / "other").mkdir()
        ended(batch(folder / "other", words), found, fault)
    if cluster is not None:
        os.kill(dice.choice(workers(cluster.pid)), signal.SIGKILL)
    if run.poll() is None:
        random.seed(dice.random())
        act(run)
    else:
        found["after its end"] += 1
    ended(run, found, fault)
    if cluster is not None:
        os.killpg(cluster.pid, signal.SIGKILL)
        cluster.wait()
        words = [*files, "-o", str(out), "-j", "2"]
    done = torn(out, whole, found)
    found["whole before"] += len(done)
    ended(batch(own, [*words, "--resume"]), found, fault)
    after = torn(out, whole, found)
    found["lost"] += len(files) - len(after)
    found["done twice"] += sum(after.get(path) != written for path, written in done.items())
    found["left behind"] += sum(path.name.startswith(".") for path in out.iterdir())
    return found


def study(rounds: int, count: int, seed: int) -> dict[str, Counter[str]]:
    """Every fault that many times."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "toss.toml").write_text(RECIPE)
        files = [str(folder / f"m{k:02d}.h5") for k in range(count)]
        for k, path in enumerate(files):
            forceid(["simulate", str(folder / "toss.toml"), "-o", path, "--seed", str(k)])
        ended(batch(folder, [*files, "-o", str(folder / "whole"), "-j", "1"]), Counter(), "left alone")
        whole = results(folder / "whole")
        assert len(whole) == count
        found = {}
        for fault in FAULTS:
            found[fault] = Counter[str]()
            for k in range(rounds):
                own = folder / f"{fault.replace(' ', '_')}_{k}"
                own.mkdir()
                found[fault] += one_round(fault, own, files, whole, dice)
            print(fault, json.dumps(found[fault]), file=sys.stderr, flush=True)
    return found


def counted(found: dict[str, Counter[str]], count: int) -> str:
    """The counts as a table."""
    return table([
        {
            "what was done": fault, "rounds": counts["rounds"],
            "results whole when it stopped": f"{counts['whole before'] / counts['rounds']:.1f} of {count}",
            **{name: counts[name] for name in (*COUNTED, "left behind")},
        }
        for fault, counts in found.items()
    ])  # fmt: skip


def main() -> int:
    """Do it; the exit code says whether anything was lost."""
    args = asked("evidence.batches.faults", __doc__, rounds=12, files=24, seed=0)
    found = study(args.rounds, args.files, args.seed)
    about = ABOUT.format(command=args.command, count=args.files)
    paged(args.output, "faults", "Faults, done to batches", about, counted(found, args.files))
    return int(any(counts[name] for counts in found.values() for name in COUNTED))


if __name__ == "__main__":
    sys.exit(main())
