"""Odd surroundings of every command: encodings, names, devices, limits, environments; each a process."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evidence.attack.bodies import write
from evidence.attack.watched import HUNG, START, End
from forceid.cli.doctor.battery import QUICK

RECIPE = 'scene = "spinner"\ntitle = "toss"\nduration = 0.2\nsample_rate = 200\nnoise_std = 5e-4\n'
TABLE = "t,ax,ay,az,bx,by,bz,cx,cy,cz\n" + "".join(
    f"{k / 100},{0.01 * k},0,1,{0.01 * k + 0.1},0,1,{0.01 * k},0.1,1\n" for k in range(30)
)
IMPORTED = """import.gravity = [0.0, 0.0, -9.81]
import.csv.time = "t"
import.csv.position.a = ["ax", "ay", "az"]
import.csv.position.b = ["bx", "by", "bz"]
import.csv.position.c = ["cx", "cy", "cz"]
import.body.mass = { a = 0.02, b = 0.05, c = 0.03 }
"""
CommandTable = Mapping[str, tuple[str, ...]]
COMMANDS: CommandTable = {
    "inspect": ("inspect", "m.h5"),
    "estimate": ("estimate", "m.h5", *QUICK),
    "json": ("estimate", "m.h5", "--json", *QUICK),
    "batch": ("batch", "m.h5", "n.h5", "-o", "out", "-j", "2", "--force", *QUICK),
    "report": ("report", "old.result.h5", "-o", "page.html"),
    "simulate": ("simulate", "toss.toml", "-o", "s.h5"),
    "import": ("import", "t.csv", "-o", "i.h5", "-c", "t.toml"),
    "identify": ("identify", "m.h5"),
    "help": ("estimate", "--help"),
    "settings": ("settings",),
    "usage": ("estimate", "m.h5", "--methd", "x"),
}


@dataclass(frozen=True)
class Odd:
    """A surrounding: what differs in the environment, what is done before in the child, and to the folder.

    out: a path that standard output goes to in place of a pipe; space: bytes of address space.
    """

    name: str
    env: Mapping[str, str] = field(default_factory=dict)
    before: Callable[[], Any] | None = None
    out: str = ""
    words: Callable[[Sequence[str]], Sequence[str | bytes]] = list


def limit(kind: int, value: int) -> Callable[[], None]:
    """What sets a limit of the child."""
    return lambda: resource.setrlimit(kind, (value, value))


def renamed_input(name: str | bytes) -> Callable[[Sequence[str]], Sequence[str | bytes]]:
    """Words with m.h5 by another name, of which a copy is made."""

    def words(given: Sequence[str]) -> Sequence[str | bytes]:
        return [name if word == "m.h5" else word for word in given]

    return words


MB = 1 << 20
ENCODINGS = ("ascii", "latin-1", "cp1252", "utf-16", "cp437")
NAMES: dict[str, str | bytes] = {
    "not UTF-8": b"m\xff\xfe.h5",
    "escapes": "m\x1b[31m\x07.h5",
    "a newline": "m\nforceid: ok.h5",
    "blank": " .h5",
    "unicode": "mλ\u202e.h5",
    "long": "m" * 250 + ".h5",
    "longest": "m" * 243 + ".h5",
    "a dash": "./-m.h5",
    "markup": "<img src=x onerror=alert(1)>.h5",
    "percent": "%s%n{0}.h5",
    "tooLong": "m" * 300 + ".h5",
}
ODD_SURROUNDINGS = [
    *(Odd(f"output in {e}", {"PYTHONIOENCODING": e}) for e in ENCODINGS),
    Odd("locale C", {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
    *(Odd(f"name {what}", words=renamed_input(name)) for what, name in NAMES.items()),
    Odd("output device full", out="/dev/full"),
    Odd("no standard output", before=lambda: os.close(1)),
    Odd("no standard error", before=lambda: os.close(2)),
    Odd("reader gone", out="gone"),
    *(Odd(f"COLUMNS {c[:12]}", {"COLUMNS": c}) for c in ("1000000000", "0", "-5", "1", "x", "9" * 400)),
    *(Odd(f"MPLBACKEND {b}", {"MPLBACKEND": b}) for b in ("nonsense", "TkAgg", "module://no")),
    Odd(
        "no home",
        {"HOME": "/nonexistent", "MPLCONFIGDIR": "/nonexistent/x", "XDG_CACHE_HOME": "/nonexistent"},
    ),
    Odd("no temporary folder", {"TMPDIR": "/nonexistent"}),
    Odd("TERM dumb", {"TERM": "dumb", "NO_COLOR": "1"}),
    Odd("engine unknown", {"FORCEID_ENGINE_ARCH": "nonsense"}),
    Odd("threads 0", {"OMP_NUM_THREADS": "0", "OPENBLAS_NUM_THREADS": "-3"}),
    *(Odd(f"{n} open files", before=limit(resource.RLIMIT_NOFILE, n)) for n in (6, 8, 10, 12, 16, 24)),
    *(
        Odd(f"{n} MB of address space", before=limit(resource.RLIMIT_AS, n * MB))
        for n in (150, 200, 300, 500)
    ),
    Odd(
        "files of 4 kB at most",
        before=lambda: (signal.signal(signal.SIGXFSZ, signal.SIG_IGN), limit(resource.RLIMIT_FSIZE, 4096)()),
    ),
    Odd("no processes", before=limit(resource.RLIMIT_NPROC, 1)),
    Odd("stack of 1 MB", before=limit(resource.RLIMIT_STACK, MB)),
    Odd("folder gone", before=lambda: (os.mkdir("away"), os.chdir("away"), os.rmdir("../away"))),
]


def furnish(folder: Path) -> None:
    """A folder with what the commands take."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(("m.h5", "n.h5")):
        write(folder / name, seed=k)
    (folder / "toss.toml").write_text(RECIPE)
    (folder / "t.csv").write_text(TABLE)
    (folder / "t.toml").write_text(IMPORTED)


def surrounded(odd: Odd, words: Sequence[str], folder: Path, patience: float = HUNG) -> End:
    """The end of a command in a surrounding, in a fresh process."""
    given = odd.words(words)
    for word in given:
        path = os.path.join(os.fsencode(folder), os.fsencode(word))
        if odd.words is not list and not os.path.exists(path) and os.fsencode(word).endswith(b".h5"):
            try:
                if word not in words:
                    os.link(folder / "m.h5", path)
            except OSError:  # longer than the system takes
                pass
    out: Any = subprocess.PIPE
    if odd.out == "gone":
        ours, theirs = socket.socketpair()
        ours.close()
        out = theirs
    elif odd.out:
        out = open(odd.out, "w")  # noqa: SIM115
    began = time.monotonic()
    process = subprocess.Popen(
        [*START, *given],
        cwd=folder,
        env=os.environ | dict(odd.env),
        stdout=out,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        preexec_fn=odd.before,
        start_new_session=True,
    )
    if out is not subprocess.PIPE:
        out.close()
    try:
        said, err = process.communicate(timeout=patience)
        late = False
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said, err = process.communicate()
        late = True
    coding = dict(odd.env).get("PYTHONIOENCODING", "utf-8")
    texts = [(text or b"").decode(coding, "replace") for text in (said, err)]
    return End(tuple(map(str, given)), process.returncode, *texts, time.monotonic() - began, late)


def odd_surroundings(folder: Path, every: int = 1) -> Iterator[tuple[str, str, End, list[str]]]:
    """Name of the surrounding and of the command, end and faults, of all pairs or of every so many."""
    furnish(folder)
    surrounded(Odd("none"), ["estimate", "m.h5", "-o", "old.result.h5", *QUICK], folder)
    pairs = [(odd, name) for odd in ODD_SURROUNDINGS for name in COMMANDS]
    for odd, name in pairs[::every]:
        words = COMMANDS[name]
        if odd.words is not list and "m.h5" not in words:
            continue
        end = surrounded(odd, words, folder)
        faults = end.faults()
        if odd.name == "no standard error":
            faults = [fault for fault in faults if fault != "no next step"]
        if "\x1b" in end.out + end.err and "help" not in name and "usage" not in name:
            faults.append("escapes on the terminal")
        yield odd.name, name, end, faults
