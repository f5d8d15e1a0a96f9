"""A failure of size: records of tens of thousands of frames."""

from __future__ import annotations

from forceid.study.failures import Failure
from forceid.study.failures_sensing import record_length

FAILURES = (
    Failure(
        "long_record", "length", "Long record", "frames", (300, 600, 1000, 2000, 4000, 8000, 16000, 30000),
        "rounding adds up, and the prior is tuned on a part of the record", record_length,
    ),
)  # fmt: skip
