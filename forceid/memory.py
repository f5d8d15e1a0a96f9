"""How much memory one piece of work may take here."""

from __future__ import annotations

import os
from contextlib import suppress

UNKNOWN = 4 << 30  # bytes, where the system does not tell: what a laptop has


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
