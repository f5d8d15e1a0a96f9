"""One thread for many small products: more threads would wait for each other, and burn a core each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy  # noqa: F401  its BLAS, and that of scipy, have to be there when the controller looks
import scipy.linalg.blas  # noqa: F401
from threadpoolctl import ThreadpoolController

LARGE = 600  # rows: an eigenvalue problem that takes as long as an estimate, a tenth of a second of one core


@cache
def _controller() -> ThreadpoolController:
    """The libraries of this process that have threads; looking for them takes milliseconds."""
    return ThreadpoolController()


@contextmanager
def threads_for(rows: int) -> Iterator[None]:
    """As many threads of BLAS as matrices of so many rows can use: one below LARGE, else as they were."""
    if rows >= LARGE:
        yield
        return
    with _controller().limit(limits=1, user_api="blas"):
        yield


def blas_libraries() -> list[str]:
    """The libraries of BLAS in this process: name, version, kernel, and how many threads it is wide."""
    return [
        f"{lib['internal_api']} {lib['version']}, kernel {lib.get('architecture')}, {lib['num_threads']} wide"
        for lib in _controller().select(user_api="blas").info()
    ]
