"""Work that outlives an interruption: a line of JSON for everything finished, found again by its key."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import forceid
from forceid.errors import ConfigError

ESTIMATORS = ("kalman", "motion", "principal", "estimation", "scenes")


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

    folders: of forceid, that answer; modules: of the study, that count as well.
    """
    digest, root = hashlib.sha256(), Path(forceid.__file__).parent
    sources = [path for folder in folders for path in sorted((root / folder).glob("*.*"))]
    for path in [*sources, *(root / "study" / f"{name}.py" for name in modules)]:
        digest.update(path.read_bytes())
    return f"{forceid.__version__}-{digest.hexdigest()[:10]}"


def key(*parts: Any) -> str:
    """A key of parts: version, case, contestant, whatever the result depends on.

    >>> key("0.1", "top", 3) == key("0.1", "top", 3) != key("0.1", "top", 4)
    True
    """
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()[:20]
