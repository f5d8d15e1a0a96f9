"""Results in the formats of other programs: one function a format, each imported when it is asked for."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from forceid.records import Estimate

FORMATS = {
    "csv": "text", "mot": "text", "sto": "text", "parquet": "binary", "mat": "binary", "c3d": "binary",
}  # fmt: skip


def export(path: Path, estimate: Estimate, kind: str) -> None:
    """An estimate as a file of one of FORMATS, whole or not at all. ConfigError, DataError: it cannot be."""
    getattr(import_module(f"forceid.files.exports.{FORMATS[kind]}"), f"write_{kind}")(path, estimate)
