"""Errors that say what was found, where, what was expected and what to do next."""

from __future__ import annotations


class ForceIdError(Exception):
    """Base of all errors forceid raises on purpose.

    `what` is one sentence: what was found and what was expected. `where` names the file, variable or
    key. `next_step` tells the user what to do. `exit_code` is that of the command line.

    >>> print(DataError("holds 3 NaN, expected finite values", "toss.h5:/motion/time", "drop those rows"))
    toss.h5:/motion/time holds 3 NaN, expected finite values; drop those rows
    """

    exit_code = 1

    def __init__(self, what: str, where: str = "", next_step: str = "") -> None:
        self.what, self.where, self.next_step = what, where, next_step
        super().__init__(what, where, next_step)

    def __str__(self) -> str:
        head = f"{self.where} {self.what}" if self.where else self.what
        return f"{head}; {self.next_step}" if self.next_step else head


class EstimationError(ForceIdError):
    """The data and settings are valid, yet no estimate can be defended (exit code 1)."""


class ConfigError(ForceIdError):
    """A setting, option or scene recipe is wrong (exit code 2)."""

    exit_code = 2


class DataError(ForceIdError):
    """A file does not hold what the contract asks of it (exit code 3)."""

    exit_code = 3
