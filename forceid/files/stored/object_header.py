"""Attributes, judged by their declaration and by what is stored, then read; texts where they are stored.

HDF5 makes room for a text before it looks for it. An attribute is a message in the header of its object:
name, type, shape, then the values; of a text of any length these are references, length, address and index.
Source: HDF5 File Format Specification, IV.A.1, Data Object Header Prefix, IV.A.2.m, Attribute Message,
IV.A.2.q, Object Header Continuation Message.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from itertools import islice
from typing import Any

import h5py

from forceid.errors import DataError
from forceid.files.stored.heap import check_references
from forceid.files.values import text

_ATTRIBUTE, _CONTINUED = 0x0C, 0x10  # types of messages
_OF_ANY_LENGTH = 9  # class of a type
_SHARED = 0x02  # a message, or a type, that is kept elsewhere
_PARTS, _ROOM = 256, 1 << 20  # blocks of a header that are looked at, and bytes of each
_REFERENCE = 16
_NAMES = 1000  # attributes that are looked at
_LARGEST, _TEXTS = 1 << 20, 100  # bytes of an attribute, and texts in one


def check_texts(item: Any, where: str) -> None:
    """DataError: an attribute of an open object names a text that the file does not hold.

    Attributes that a dense storage holds, as of objects with very many, are not looked at.
    """
    path, address = item.file.filename, h5py.h5o.get_info(item.id).addr
    with open(path, "rb", buffering=0) as f:
        found = [body for kind, body in messages(f.fileno(), address) if kind == _ATTRIBUTE]
    if stored := b"".join(map(attribute_references, found)):
        check_references(path, stored, where)


def messages(file: int, address: int) -> Iterator[tuple[int, bytes]]:
    """Type and bytes of the messages of the header at an address, as far as it makes sense.

    What does not is left to HDF5, which reads it with all its checks.
    """
    head = os.pread(file, 32, address)
    second = head.startswith(b"OHDR")
    if second:
        flags, at = head[5], 6 + 16 * bool(head[5] & 0x20) + 4 * bool(head[5] & 0x10)
        width = 1 << (flags & 3)
        parts = [(address + at + width, int.from_bytes(head[at : at + width], "little"))]
        form = struct.Struct("<BHBH" if flags & 0x04 else "<BHB")
    else:
        parts = [(address + 16, int.from_bytes(head[8:12], "little"))]
        form = struct.Struct("<HHB3x")
    for k in range(_PARTS):
        if k == len(parts):
            return
        start, size = parts[k]
        part = os.pread(file, min(size, _ROOM), start) if 0 <= start < os.fstat(file).st_size else b""
        at = 0
        while at + form.size <= len(part):
            kind, length, flags, *_ = form.unpack_from(part, at)
            body = part[at + form.size : at + form.size + length]
            if kind == _CONTINUED and len(body) >= 16:
                begin, size = struct.unpack_from("<QQ", body)
                parts.append((begin + 4, size - 8) if second else (begin, size))
            elif not flags & _SHARED:
                yield kind, body
            at += form.size + length


def attribute_references(attribute: bytes) -> bytes:
    """The references in the message of an attribute of texts; nothing of one of numbers.

    >>> attribute_references(bytes(8))
    b''
    """
    if len(attribute) < 8 or attribute[0] not in (1, 2, 3) or (attribute[0] > 1 and attribute[1] & 1):
        return b""
    version, sizes = attribute[0], struct.unpack_from("<HHH", attribute, 2)
    name, kind, shape = (-(-n // 8) * 8 for n in sizes) if version == 1 else sizes
    at = (9 if version == 3 else 8) + name
    if at >= len(attribute) or attribute[at] & 0x0F != _OF_ANY_LENGTH:
        return b""
    stored = attribute[at + kind + shape :]
    return stored[: len(stored) // _REFERENCE * _REFERENCE]


def attributes(item: Any, where: str) -> dict[str, Any]:
    """The attributes of a group, judged by their declaration before they are read."""
    check_texts(item, where)
    names = list(islice(item.attrs, _NAMES))
    for name in names:
        judge_attribute(item, name, where)
    return {text(name): item.attrs[name] for name in names}


def judge_attribute(item: Any, name: Any, where: str) -> None:
    """DataError: an attribute that is more than a few numbers or texts."""
    declared = h5py.h5a.open(item.id, name if isinstance(name, bytes) else name.encode("utf-8"))
    count, each = math.prod(declared.shape), declared.get_type().get_size()
    objects = declared.dtype.kind == "O"
    if count * each > _LARGEST or (
        objects and (count > _TEXTS or not h5py.check_string_dtype(declared.dtype))
    ):
        what = f"holds {count} values of {declared.dtype}, expected a number or a text"
        raise DataError(what, f"{where}@{text(name)}", "keep large data in a variable")
