"""Work that outlives an interruption: a line of JSON for everything finished, found again by its key."""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import forceid
from forceid.errors import ConfigError

ESTIMATORS = ("compiled", "kalman", "flight", "motion", "principal", "estimation", "scenes")
PACKAGE, EVIDENCE = Path(forceid.__file__).parent, Path(__file__).parent
SOURCES = (".py", ".cpp", ".hpp", ".toml")
IMPORTS = (ast.Import, ast.ImportFrom)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass
class Journal:
    """Lines of a file by key: what was finished, and what it gave. Those of other versions stay."""

    path: Path
    lines: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def opened(cls, path: Path) -> Journal:
        """The journal at a path; a last line that an interruption cut short is forgotten."""
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = {}
        for line in path.read_text("utf-8").splitlines() if path.exists() else ():
            try:
                entry = json.loads(line)
                lines[entry["key"]] = entry["found"]
            except (json.JSONDecodeError, KeyError, TypeError):
                continue
        return cls(path, lines)

    def once(self, key: str, work: Callable[[], Any]) -> Any:
        """What was found under the key, or what the work finds now, written down."""
        if key not in self.lines:
            self.lines[key] = work()
            try:
                cut = self.path.exists() and self.path.read_bytes()[-1:] not in (b"", b"\n")
                with self.path.open("a", encoding="utf-8") as file:
                    file.write("\n" * cut + json.dumps({"key": key, "found": self.lines[key]}) + "\n")
            except OSError as e:
                raise ConfigError(f"cannot be written ({e.strerror})", str(self.path)) from e
        return self.lines[key]


def version(*modules: str, folders: Sequence[str] = ESTIMATORS) -> str:
    """The version of forceid, and a hash of the code that answers: after a change nothing old is found.

    folders: of forceid, that answer; modules: of evidence, that count as well, by their names in it.
    """
    sources = [*sources_in(folders), *(EVIDENCE / f"{name.replace('.', '/')}.py" for name in modules)]
    return f"{forceid.__version__}-{code_hash(sources)[:10]}"


def sources_in(folders: Iterable[str], root: Path = PACKAGE) -> list[Path]:
    """Every source in folders of the package, however deep."""
    return [path for folder in folders for path in (root / folder).rglob("*") if path.suffix in SOURCES]


def code_hash(sources: Iterable[Path]) -> str:
    """Hash of what sources do: not of their docstrings and comments, of where they lie and what they import.

    A module that is moved, with the imports of all that use it, leaves the hash as it was.
    """
    parts = sorted(filter(None, (hash_of(path.suffix, path.read_bytes()) for path in sources)))
    return hashlib.sha256("".join(parts).encode()).hexdigest()


@cache
def hash_of(suffix: str, source: bytes) -> str:
    """Hash of one source, of Python without docstrings, comments and imports; of one without more, none."""
    if suffix != ".py":
        return hashlib.sha256(source).hexdigest()
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED):
            described = ast.get_docstring(node, clean=False) is not None
            node.body = [part for part in node.body[described:] if not isinstance(part, IMPORTS)]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest() if tree.body else ""


def key(*parts: Any) -> str:
    """A key of parts: version, case, contestant, whatever the result depends on.

    >>> key("0.1", "top", 3) == key("0.1", "top", 3) != key("0.1", "top", 4)
    True
    """
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:20]
