"""Interrupts and kills of every command at any moment: exit code 130, no traceback, nothing torn or lost."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from evidence.attack.surroundings import COMMANDS, QUICK, Odd, furnish, surrounded
from evidence.attack.watched import HUNG, START, End

KILLED = ("inspect", "estimate", "batch", "report", "simulate", "import", "identify")
UP = 0.05  # s until the interpreter has read the first line of the program: before, the system ends it
LEFT = {".result.h5": "m.result.h5", "page.html": "page.html", "s.h5": "s.h5", "i.h5": "i.h5"}


def is_whole(path: Path) -> bool:
    """Whether a file is what its name says, all of it."""
    if path.suffix == ".html":
        return path.read_text("utf-8").rstrip().endswith("</html>")
    try:
        with h5py.File(path) as f:
            return bool({"estimate", "motion"} & set(f))
    except OSError:
        return False


def killed(folder: Path, seed: int, count: int) -> Iterator[tuple[str, str, End, list[str]]]:
    """Signal and command, end and faults, of that many."""
    furnish(folder)
    surrounded(Odd("none"), ["estimate", "m.h5", "-o", "old.result.h5", *QUICK], folder)
    rng, took = np.random.default_rng([seed, 2]), {}
    for name in KILLED:
        took[name] = surrounded(Odd("none"), COMMANDS[name], folder).seconds
    for _ in range(count):
        name = str(rng.choice(KILLED))
        sent = signal.SIGINT if rng.random() < 0.7 else signal.SIGKILL
        if rng.random() < 0.5:
            shutil.rmtree(folder / "out", ignore_errors=True)
            for path in ("m.result.h5", "page.html", "s.h5", "i.h5"):
                (folder / path).unlink(missing_ok=True)
        had = {path for path in folder.rglob("*") if path.suffix in (".h5", ".html") and path.name[0] != "."}
        began = time.monotonic()
        process = subprocess.Popen(
            [*START, *COMMANDS[name]], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        time.sleep(float(rng.uniform(UP, took[name] + 0.02)))
        late = False
        try:
            (os.killpg if name == "batch" and sent == signal.SIGINT else os.kill)(process.pid, sent)
            out, err = process.communicate(timeout=HUNG)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
            late = True
        texts = [text.decode("utf-8", "replace") for text in (out, err)]
        end = End(COMMANDS[name], process.returncode, *texts, time.monotonic() - began, late)
        faults = end.faults()
        if sent == signal.SIGKILL and end.code == -signal.SIGKILL and "unexpected" in faults:
            faults.remove("unexpected")
        now = {path for path in folder.rglob("*") if path.suffix in (".h5", ".html") and path.name[0] != "."}
        faults += ["lost"] * bool(had - now) + ["torn"] * (not all(map(is_whole, now)))
        yield sent.name, name, end, faults
