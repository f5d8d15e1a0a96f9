"""Every table and picture of the site made anew, by the commands that docs/results.md names.

    python -m evidence.remake -o DIR [--only speed calibration ...] [--minutes 60]

What a page is made by writes into DIR, or is printed into DIR/PAGE.txt. What is done stays done, for the same
code: an interrupted run goes on from DIR/remade.jsonl. DIR/manifest.json has versions, machine, and of every
page its commands, seeds, times, exit codes and hashes of files. --minutes begins no page after so many, and
begins with those that took the least by docs/manifest.json: so nights do as much as they have time for.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version as version_of
from pathlib import Path
from time import monotonic
from typing import Any

from evidence.journal import Journal, version
from evidence.written import asked, written

ROOT = Path(__file__).parents[1]
ROW = re.compile(r"\| \[(?P<page>\w+)\]\([^)]*\) \| [^|]* \| (?P<commands>.*) \|")
COUNTED = re.compile(r"\$\(seq (\d+) (\d+)\)")
SEEDS = ("--seed", "--seeds", "--first")
PACKAGES = ("numpy", "scipy", "h5py", "xarray", "matplotlib", "filterpy")
PROGRAMS = {
    "python": [sys.executable],
    "forceid": [sys.executable, "-m", "forceid"],
    "pytest": [sys.executable, "-m", "pytest", "-q"],
}


def pages(text: str) -> dict[str, list[str]]:
    """The commands of every page of the table in docs/results.md.

    >>> pages("| [claims](claims.md) | honest? | `python -m evidence.claims.strict`, `.ladder` |")
    {'claims': ['python -m evidence.claims.strict', 'python -m evidence.claims.ladder']}
    """
    found: dict[str, list[str]] = {}
    for row in ROW.finditer(text):
        commands: list[str] = []
        for said in re.findall(r"`([^`]+)`", row["commands"]):
            commands.append(commands[-1].rpartition(".")[0] + said if said.startswith(".") else said)
        found[row["page"]] = commands
    return found


def words_of(command: str, folder: Path) -> list[list[str]]:
    """What is to be run for a command that writes into docs, into a folder; of NAME.h5 each that ships.

    >>> words_of("make bench -o docs/a --seeds $(seq 3 5)", Path("out"))
    [['make', 'bench', '-o', 'out/a', '--seeds', '3', '4', '5']]
    """

    def numbers(of: re.Match[str]) -> str:
        return " ".join(map(str, range(int(of[1]), int(of[2]) + 1)))

    program, *words = shlex.split(COUNTED.sub(numbers, command))
    words = [
        str(folder / word.removeprefix("docs").lstrip("/")) if before == "-o" else word
        for before, word in zip([program, *words], words, strict=False)
    ]
    begin = PROGRAMS.get(program, [program])
    shipped = sorted(path.stem for path in (ROOT / "data/synthetic").glob("*.h5"))
    if not any("NAME" in word for word in words):
        return [begin + words]
    out = [str(folder / "NAME.result.h5")] if "estimate" in words else []
    each = [*words, *(["-o", *out, "--force"] if out else [])]
    return [begin + [word.replace("NAME", name) for word in each] for name in shipped]


def remade(page: str, commands: Sequence[str], folder: Path) -> dict[str, Any]:
    """What comes of the commands of a page: exit codes, seconds, and hashes of the files they wrote."""
    began, spent = monotonic(), cpu()
    before = hashes(folder)
    folder.joinpath(f"{page}.txt").write_bytes(b"")  # what it printed under other code
    codes = []
    for command in commands:
        for words in words_of(command, folder):
            with (folder / f"{page}.txt").open("ab") as printed:
                done = subprocess.run(words, cwd=ROOT, stdout=printed, stderr=sys.stderr, check=False)
            codes.append(done.returncode)
    return {
        "commands": list(commands),
        "seeds": [seed for command in commands for seed in seeds_of(command)],
        "exit": codes,
        "wall_s": round(monotonic() - began, 1),
        "cpu_s": round(cpu() - spent, 1),
        "files": {name: at for name, at in hashes(folder).items() if before.get(name) != at},
    }


def seeds_of(command: str) -> list[str]:
    """What a command says behind the options of seeds.

    >>> seeds_of("python -m evidence.strangers --seeds $(seq 1 3) -o docs --seed 7")
    ['$(seq 1 3)', '7']
    """
    return re.findall(rf"(?:{'|'.join(SEEDS)}) (\$\([^)]*\)|[\d ]*\d)", command)


def cpu() -> float:
    """CPU seconds of all commands so far."""
    used = os.times()
    return used.children_user + used.children_system


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every page and picture in a folder, by name."""
    files = (path for path in folder.rglob("*") if path.suffix in (".md", ".png", ".svg", ".json", ".txt"))
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(files)
        if path.name != "manifest.json"
    }


def machine() -> dict[str, Any]:
    """What the pages were made on, and with."""
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    return {
        "forceid": version(),
        "commit": commit,
        "python": platform.python_version(),
        "packages": {name: version_of(name) for name in PACKAGES},
        "platform": platform.platform(),
        "cores": os.cpu_count(),
    }


def shortest_first(names: Sequence[str], known: Mapping[str, Any]) -> list[str]:
    """Pages by the time that they took; those that were never timed at the end.

    >>> shortest_first(["a", "b", "c"], {"b": {"wall_s": 2.0}, "c": {"wall_s": 1.0}})
    ['c', 'b', 'a']
    """
    return sorted(names, key=lambda name: known.get(name, {}).get("wall_s", float("inf")))


def main() -> int:
    """Remake what was asked for; the exit code says whether any command failed."""
    every = pages((ROOT / "docs/results.md").read_text("utf-8"))
    args = asked("evidence.remake", __doc__, only=tuple(every), minutes=0.0)
    folder, began = args.output.resolve(), monotonic()
    journal = Journal.opened(folder / "remade.jsonl")
    last = ROOT / "docs/manifest.json"
    known = json.loads(last.read_text("utf-8"))["pages"] if last.exists() else {}
    if unknown := set(args.only) - every.keys():
        print(f"{', '.join(sorted(unknown))}: no page of {', '.join(every)}", file=sys.stderr)
        return 2
    names = shortest_first(args.only, known) if args.minutes else list(args.only)
    done: dict[str, Any] = {}
    for k, name in enumerate(names, 1):
        if args.minutes and monotonic() - began > 60 * args.minutes:
            break
        print(f"{k} of {len(names)}: {name}", file=sys.stderr, flush=True)
        key = json.dumps([name, every[name], version()])
        done[name] = journal.once(key, lambda name=name: remade(name, every[name], folder))  # type: ignore[misc]
        text = json.dumps({**machine(), "pages": done}, indent=1)
        written(folder, "manifest.json", text + "\n")
    return int(any(any(page["exit"]) for page in done.values()))


if __name__ == "__main__":
    sys.exit(main())
