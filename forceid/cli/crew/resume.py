"""Results that are still current: made from the same input, with the same settings, by the same version."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from forceid import __version__
from forceid.cli.boundary.output import describe
from forceid.cli.crew.pool import Record, nis_mean, run_job
from forceid.errors import DataError

if TYPE_CHECKING:
    from forceid.config import Settings


def resume_job(source: Path, output: Path, settings: Settings) -> Record:
    """What there is to say of one file, estimated only where its result is not current."""
    return current(source, output, settings) or run_job(source, output, settings)


def current(source: Path, output: Path, settings: Settings) -> Record | None:
    """What there is to say of a whole result of the same input, settings and version; None without one."""
    from forceid.files import read_result, read_truth
    from forceid.files.stored.hdf5 import open_hdf5
    from forceid.files.values import text
    from forceid.sections import to_toml

    if not output.is_file():
        return None
    try:
        with open_hdf5(output) as result:
            made, by = text(result.attrs["config"]), text(result.attrs["forceid_version"])
            of = text(result.attrs["input_sha256"])
        if (made, by) != (to_toml(settings), __version__):
            return None
        with open(source, "rb") as data:
            if of != hashlib.file_digest(data, "sha256").hexdigest():
                return None
        record = describe(read_result(output), source, output, read_truth(output))
    except (DataError, KeyError, OSError, ValueError, TypeError):
        return None
    return {"status": "skipped", **record, "nis_mean": nis_mean(output)}
