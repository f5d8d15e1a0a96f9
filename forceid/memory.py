"""How much memory one piece of work may take here, and what is done with memory that it frees."""

from __future__ import annotations

import os
from contextlib import suppress

UNKNOWN = 4 << 30  # bytes, where the system does not tell: what a laptop has
KEPT = {-3: 1 << 25, -1: 1 << 28}  # bytes, by option of glibc: arrays below, and freed memory, stay


def memory_limit() -> int:
    """Bytes: half of what the machine has, or of the address space that this process is allowed."""
    rooms = []
    with suppress(AttributeError, ValueError, OSError):
        rooms.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on every system

        space = resource.getrlimit(resource.RLIMIT_AS)[0]
        rooms += [space] if space > 0 else []
    return min(rooms) // 2 if rooms else UNKNOWN


def keep_freed() -> None:
    """Keep memory that is freed for what is asked for next, where the C library lets a process say so.

    Given back and asked for anew, every page of it is cleared once more: a seventh of the time of an estimate
    of 1500 frames. For processes that are this program's own.
    """
    with suppress(ImportError, AttributeError, OSError, TypeError):
        import ctypes  # as numpy does

        for option, size in KEPT.items():
            ctypes.CDLL(None).mallopt(option, size)
