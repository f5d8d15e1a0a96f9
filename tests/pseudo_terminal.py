"""A pseudo-terminal that a test reads, as a person would see it."""

import os

import pytest

pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")


def watched_on_terminal(start):
    """A process, and all that it writes to a terminal: start(end) starts it on one end of that."""
    parent, child = pty.openpty()
    process = start(child)
    os.close(child)
    written = b""
    try:
        while block := os.read(parent, 65536):
            written += block
    except OSError:  # how Linux says that the other end is closed
        pass
    os.close(parent)
    return process, written.decode()
