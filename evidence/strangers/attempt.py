"""A recording as a user has it: written as a file, read, estimated, whatever comes of it."""

from __future__ import annotations

import tempfile
import traceback
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

from forceid.config import load_settings
from forceid.errors import ForceIdError
from forceid.estimation.long.windows import estimate_of_any_length
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Estimate, Recording


@dataclass(frozen=True)
class Attempt:
    """What came of a recording, as it was read from its file: an estimate, or none.

    verdict: that of the estimate, else refused or crashed; codes: of its findings, or the error; seconds:
    of CPU.
    """

    recording: Recording
    found: Estimate | None
    verdict: str
    codes: tuple[str, ...]
    seconds: float


def attempt(recording: Recording, **settings: Any) -> Attempt:
    """Write, read, estimate."""
    began = process_time()
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.h5"
            write_motion(path, recording)
            recording = read_motion(path)
        found = estimate_of_any_length(recording, load_settings(**settings))
    except Exception as error:
        known = isinstance(error, ForceIdError)
        where = "" if known else traceback.format_exc().splitlines()[-2].strip()
        said, codes = "refused" if known else "crashed", (f"{type(error).__name__}: {error} {where}",)
        return Attempt(recording, None, said, codes, process_time() - began)
    return Attempt(recording, found, found.verdict.level, found.verdict.codes, process_time() - began)
