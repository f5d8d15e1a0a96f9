"""A short battery: hostile files, odd outputs, odd surroundings and interrupts, each a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np

from forceid.cli.boundary.endings import INTERRUPTED
from forceid.cli.doctor.self_test import RING, Check
from forceid.files import write_motion
from forceid.scenes import simulate

PATIENCE = 120.0  # s on the clock for one command, which takes one or two: more is a hang
COMMAND = (sys.executable, "-m", "forceid")
INTERRUPTS_ITSELF = """
import os, signal, sys, threading
from forceid.cli.boundary.start import at_once, start
signal.signal(signal.SIGINT, at_once)
after = threading.Timer(float(sys.argv.pop(1)), os.kill, (os.getpid(), signal.SIGINT))
after.daemon = True
after.start()
start()
"""  # whoever counts from outside may reach an interpreter that has not begun
QUICK = ("--method", "difference", "--model", "rigid")
POSIX = os.name == "posix"
Edit = Callable[[Any], None]


@dataclass(frozen=True)
class Trial:
    """A command, what the motion file is made to hold before, what stands around it, how it should end.

    out: a file that stands where the command would write; it has to be there afterwards as it was.
    interrupt: s from its start after which it is interrupted.
    """

    claim: str
    words: tuple[str, ...]
    codes: tuple[int, ...]
    edit: Edit | None = None
    out: str = ""
    env: Mapping[str, str] = field(default_factory=dict)
    interrupt: float = 0.0


def put(name: str, change: Callable[[Any], Any]) -> Edit:
    """What puts other values of the same shape into a variable."""

    def edit(file: Any) -> None:
        file[name][...] = change(file[name][...])

    return edit


def at(index: Any, value: float) -> Callable[[Any], Any]:
    """What puts one value into an array."""

    def change(values: Any) -> Any:
        values[index] = value
        return values

    return change


def add(name: str, value: Any) -> Edit:
    """What adds a variable."""

    def edit(file: Any) -> None:
        file[name] = value

    return edit


def cut(file: Any) -> None:
    """Cut the file in half."""
    path = file.filename
    file.close()
    os.truncate(path, os.path.getsize(path) // 2)


TIME, PLACES, MASS = "motion/time", "motion/position", "body/mass"
ESTIMATE = ("estimate", "m.h5", *QUICK)
TRIALS = (
    Trial("a file cut in half is refused", ("inspect", "m.h5"), (3,), cut),
    Trial("one reading of 1e300 m is refused", ESTIMATE, (3,), put(PLACES, at((9, 0, 0), 1e300))),
    Trial("a negative mass is refused", ESTIMATE, (3,), put(MASS, at(0, -1.0))),
    Trial("a mass told twice, and differently, is refused", ESTIMATE, (3,), add("body/total_mass", 25.0)),
    Trial("a clock that runs back is refused", ESTIMATE, (3,), put(TIME, at(9, -1.0))),
    Trial("one step of 1e-9 s is refused", ESTIMATE, (3,), put(TIME, lambda t: at(9, t[8] + 1e-9)(t))),
    Trial("steps of 1e-300 s are refused", ESTIMATE, (3,), put(TIME, lambda t: np.arange(len(t)) * 1e-300)),
    Trial("readings that are all missing are refused", ESTIMATE, (1, 3), put(PLACES, lambda x: x * np.nan)),
    Trial("a text in place of the result stays", (*ESTIMATE, "-o", "kept.h5"), (2,), out="kept.h5"),
    Trial("a text in place of the page stays", ("report", "m.h5", "-o", "k.html"), (2, 3), out="k.html"),
    Trial("the input is not written over", (*ESTIMATE, "-o", "m.h5"), (2,)),
    Trial("a folder that is not there is said", (*ESTIMATE, "-o", "none/r.h5"), (2,)),
    Trial("an unknown option is said", ("estimate", "m.h5", "--methd", "x"), (2,)),
    Trial("a terminal of ASCII is enough", ("inspect", "m.h5"), (0,), env={"PYTHONIOENCODING": "ascii"}),
    Trial("a terminal of a billion columns is none", ("--help",), (0,), env={"COLUMNS": "1000000000"}),
    Trial("plots need no screen", ("demo", "-o", "demo"), (0,), env={"MPLBACKEND": "nonsense"}),
    Trial("an interrupt ends with one line", ("estimate", "m.h5"), (0, 130), interrupt=1.0),
)  # fmt: skip


def attacked() -> Iterator[Check]:
    """Every trial, in a folder of its own."""
    recording = simulate(RING)
    for trial in TRIALS:
        if trial.interrupt and not POSIX:
            continue
        with TemporaryDirectory() as name:
            folder = Path(name)
            write_motion(folder / "m.h5", recording)
            if trial.edit is not None:
                with h5py.File(folder / "m.h5", "r+") as file:
                    trial.edit(file)
            if trial.out:
                (folder / trial.out).write_text("hours of work")
            yield judged(trial, folder)


def judged(trial: Trial, folder: Path) -> Check:
    """How a trial ended, and what is wrong with that."""
    kept = [folder / "m.h5", *([folder / trial.out] if trial.out else [])]
    before = [path.read_bytes() for path in kept]
    code, err = ended(trial, folder)
    if code is None:
        return Check(trial.claim, False, f"no end in {PATIENCE:.0f} s")
    told = next((line for line in reversed(err.splitlines()) if "error:" in line), "")
    wrong = [f"exit code {code}, expected {' or '.join(map(str, trial.codes))}"] * (code not in trial.codes)
    wrong += ["a traceback"] * ("Traceback" in err) + ["an error that nobody foresaw"] * (
        "unexpected " in err
    )
    helps = "; " in told or " See " in told
    wrong += ["a refusal that does not say what to do"] * (code in (2, 3) and not helps)
    wrong += ["no line that says so"] * (code == INTERRUPTED and not told)
    wrong += ["a file that was there is changed"] * ([path.read_bytes() for path in kept] != before)
    told = told.removeprefix("forceid: error: ")
    return Check(trial.claim, not wrong, "; ".join([*wrong, told]) if wrong else told or f"exit code {code}")


def ended(trial: Trial, folder: Path) -> tuple[int | None, str]:
    """Exit code and standard error of the command; no code where it had to be ended."""
    itself = (sys.executable, "-c", INTERRUPTS_ITSELF, str(trial.interrupt))
    command = [*(itself if trial.interrupt else COMMAND), *trial.words]
    process = subprocess.Popen(
        command, cwd=folder, env={**os.environ, **here(), **trial.env},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        err = process.communicate(timeout=PATIENCE)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return None, ""
    return process.returncode, err.decode("utf-8", "replace")


def here() -> dict[str, str]:
    """An environment in which a command finds the forceid that asks."""
    paths = [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    return {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
