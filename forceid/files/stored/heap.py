"""The text of an HDF5 file lies in its global heaps: a damaged one can make the library turn forever.

A heap is a row of objects, each with its size; where one says zero (blank bytes, as a power cut leaves them)
the library never comes past it, and where one says too much it reads what is not its own. Source: HDF5 File
Format Specification, III.E, Level 1E, Global Heap.
"""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Callable
from pathlib import Path

from forceid.errors import DataError

_SIGNATURE = b"GCOL\x01"
_HEAD = 16  # bytes before the first object
_OBJECT = struct.Struct("<HHIQ")  # index, references, reserved, size
_REFERENCE = struct.Struct("<IQI")  # length, address of the heap, index of the object
_BLOCK = 1 << 20
GIGABYTE = 10**9


def fingerprint(path: str | Path, passed: Callable[[], None] | None = None) -> str:
    """SHA-256 of the bytes of an HDF5 file, its heaps checked on the way. DataError: see check_heaps.

    passed() is called after every gigabyte.
    """
    digest, read = hashlib.sha256(), 0

    def use(block: memoryview) -> None:
        nonlocal read
        digest.update(block)
        before, read = read, read + len(block)
        if passed is not None and read // GIGABYTE > before // GIGABYTE:
            passed()

    check_heaps(path, use)
    return digest.hexdigest()


def check_heaps(path: str | Path, use: Callable[[memoryview], None] | None = None) -> None:
    """DataError: a heap that the library would not come to the end of. `use` gets all bytes, in order."""
    heaps: list[int] = []
    kept = len(_SIGNATURE) - 1  # a signature may lie across two blocks
    block, at = bytearray(kept + _BLOCK), 0
    with open(path, "rb", buffering=0) as f:
        while n := f.readinto(memoryview(block)[kept:]):
            if use is not None:
                use(memoryview(block)[kept : kept + n])
            match = block.find(_SIGNATURE, 0, kept + n)
            while match >= 0:
                heaps.append(at - kept + match)
                match = block.find(_SIGNATURE, match + 1, kept + n)
            block[:kept] = block[n : kept + n]
            at += n
        if wide(os.pread(f.fileno(), 16, 0)):
            for heap in heaps:
                check_heap(f.fileno(), heap, str(path))


def wide(superblock: bytes) -> bool:
    """Whether the file counts sizes in eight bytes, as all do unless asked otherwise."""
    if len(superblock) < 16 or not superblock.startswith(b"\x89HDF\r\n\x1a\n"):
        return False
    return superblock[14 if superblock[8] < 2 else 10] == 8


def check_heap(file: int, start: int, where: str) -> None:
    """DataError where the walk over the objects of the heap would stand still, or leave it."""
    head = os.pread(file, _HEAD, start)
    whole = start + int.from_bytes(head[8:], "little") <= os.fstat(file).st_size
    if len(head) == _HEAD and head[5:8] == b"\0\0\0" and whole:  # a cut file is told as such by HDF5
        objects(file, start, where)


def objects(file: int, start: int, where: str) -> dict[int, int]:
    """Index and size in bytes of every object of a heap. DataError: the walk stands still or leaves it."""
    head = os.pread(file, _HEAD, start) if start < os.fstat(file).st_size else b""
    if len(head) < _HEAD or not head.startswith(_SIGNATURE):
        raise DataError(f"is damaged (no text at {start}), expected readable HDF5", where, "copy it again")
    size, room = int.from_bytes(head[8:], "little"), os.fstat(file).st_size - start
    heap, at, found = os.pread(file, min(size, room), start), _HEAD, {}
    while at + _OBJECT.size <= len(heap):
        index, _, _, length = _OBJECT.unpack_from(heap, at)
        step = _OBJECT.size + -(-length // 8) * 8 if index else length
        if step < _OBJECT.size or at + step > size or size > room:
            said = "blank bytes in the text" if step == 0 else "a text that is longer than its place"
            what = f"is damaged ({said} at {start + at}), expected readable HDF5"
            raise DataError(what, where, "copy it again")
        found[index] = length
        at += step
    return found


def check_references(path: str | Path, stored: bytes, where: str) -> int:
    """Bytes of the texts that references name: length, address and index in 16 bytes each.

    DataError: one that names no object of a heap, or more than it holds.
    """
    references = [found for found in _REFERENCE.iter_unpack(stored) if found[0]]  # what is empty lies nowhere
    with open(path, "rb", buffering=0) as f:
        heaps = {at: objects(f.fileno(), at, where) for at in {at for _, at, _ in references}}
    for length, at, index in references:
        if index == 0 or heaps[at].get(index, -1) < length:
            what = f"is damaged (text {index} of the heap at {at}), expected readable HDF5"
            raise DataError(what, where, "copy it again")
    return sum(length for length, _, _ in references)
