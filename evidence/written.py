"""Studies as commands, and what they leave: pages, tables and pictures, each whole or not there at all."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from forceid.files.stored.atomic import atomic, write_whole
from forceid.report.plots.picture import png


def asked(module: str, about: str | None, page: bool = True, **options: Any) -> argparse.Namespace:
    """What a study is asked on the command line.

    module: as `python -m` names it; about: its docstring; page: whether it writes into a folder, `output`;
    options: by name, with their defaults: numbers and words, tuples of them, and False for a switch; a study
    that can do without a folder has `output` among them.
    `command` is the line that asks for the same again.
    """
    head = (about or "").split("\n\n")[0]
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=head)
    if page:
        parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the results")
    for name, default in options.items():
        taken: dict[str, Any] = {
            "default": default,
            "help": None if default is False else f"default: {default}",
        }
        if default is False:
            taken["action"] = "store_true"
        elif isinstance(default, tuple):
            taken |= {"nargs": "+", "type": type(default[0])}
        else:
            taken["type"] = type(default)
        short = [f"-{name[0]}"] if name in ("jobs", "output") else []
        parser.add_argument(*short, f"--{name.replace('_', '-')}", **taken)
    found = parser.parse_args()
    words = [f"python -m {module}", *(["-o docs"] if page else [])]
    for name, default in options.items():
        value = getattr(found, name)
        if value != default and name != "jobs":
            said = [] if value is True else map(str, value if isinstance(value, list) else [value])
            words += [f"--{name.replace('_', '-')}", *said]
    found.command = " ".join(words)
    return found


def each(work: Callable[[Any], Any], jobs: Sequence[Any], workers: int, chunk: int = 1) -> Iterator[Any]:
    """What the work finds for every job, in order, from processes; each is told on stderr."""
    with ProcessPoolExecutor(workers) as pool:
        for k, found in enumerate(pool.map(work, jobs, chunksize=chunk), 1):
            print(k, "of", len(jobs), str(found)[:200], file=sys.stderr, flush=True)
            yield found


def table(rows: Sequence[Mapping[str, Any]], heads: Sequence[str] | None = None) -> str:
    """Rows by name as a table in markdown, numbers in three figures; heads: those of the first row."""
    heads = heads or list(rows[0])
    return tabled(heads, [[figure(row.get(head, "")) for head in heads] for row in rows])


def figure(value: Any) -> str:
    """A number in three figures, or a word."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def tabled(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in markdown; a row that ends early is filled up.

    >>> print(tabled(("", "b"), [["1"]]))
    | | b |
    |---|---|
    | 1 | |
    """
    lines = [[*cells, *[""] * (len(heads) - len(cells))] for cells in (heads, *rows)]
    text = ["|" + "".join(f" {cell} |" if cell else " |" for cell in cells) for cells in lines]
    return "\n".join([text[0], "|" + "---|" * len(heads), *text[1:]])


def written(folder: Path, name: str, text: str) -> Path:
    """A text by its name in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / name, text)
    return folder / name


def paged(folder: Path, name: str, title: str, *parts: str) -> None:
    """A page NAME.md of a title and paragraphs, printed too."""
    text = "\n\n".join([f"# {title}", *parts]) + "\n"
    written(folder, f"{name}.md", text)
    print(text)


def pictured(folder: Path, name: str, figure: Any, dpi: int = 160) -> Path:
    """A figure as NAME.png in a folder, in as many colors as a byte tells."""
    folder.mkdir(parents=True, exist_ok=True)
    with atomic(folder / f"{name}.png") as partial:
        Path(partial).write_bytes(png(figure, dpi))
    return folder / f"{name}.png"
