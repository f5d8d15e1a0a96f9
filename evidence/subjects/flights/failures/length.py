"""A failure of size: records of up to a hundred thousand frames."""

from __future__ import annotations

from evidence.stress.failure import Failure
from evidence.subjects.flights.failures.sensing import record_length

FAILURES = (
    Failure(
        "long_record", "length", "Long record", "frames", (300, 600, 1000, 3000, 6000, 10000, 30000, 100000),
        "rounding adds up, and the prior is tuned on a part of the record", record_length,
    ),
)  # fmt: skip
