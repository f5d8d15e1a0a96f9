"""The elements of MAT files v5 to v7.2, one in another: checked before scipy reads, which crashes on others.

Source: MATLAB, MAT-File Format, chapter 1: data types (table 1-1), array types (table 1-3), small elements.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator

from forceid.errors import DataError

_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # of a number, by data type
_TEXT = (16, 17, 18)
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_CELL, _STRUCT, _CHAR, _SPARSE, _INT64 = 1, 2, 4, 5, 15
_COMPLEX = 0x0800
_DEPTH = 32
Element = tuple[int, memoryview]


def check_elements(data: bytes, where: str) -> None:
    """DataError unless every array of numbers, text, cells and structs is made as the format says.

    Objects and functions are not looked into: they are not to be read.
    """
    order = "<" if data[126:128] == b"IM" else ">"
    for kind, content in elements(memoryview(data)[128:], order, where):
        if kind == _COMPRESSED:
            content = memoryview(zlib.decompress(content))
            inner = list(elements(content, order, where))
            if len(inner) != 1:
                raise damaged("a compressed part that is not one variable", where)
            kind, content = inner[0]
        if kind != _MATRIX:
            raise damaged(f"an element of type {kind} in place of a variable", where)
        check_array(content, order, where, 0)


def elements(data: memoryview, order: str, where: str) -> Iterator[Element]:
    """Type and content of the elements that follow one another."""
    start = 0
    while start < len(data):
        if len(data) - start < 8:
            raise damaged(f"{len(data) - start} bytes too many", where)
        kind, size = struct.unpack_from(f"{order}II", data, start)
        begin, room = start + 8, len(data) - start - 8
        if kind >> 16:  # type, size and at most four bytes in one tag
            kind, size, begin, room = kind & 0xFFFF, kind >> 16, start + 4, 4
        if size > room:
            raise damaged(f"an element of {size} bytes where {room} are left", where)
        yield kind, data[begin : begin + size]
        start = begin + size if kind == _COMPRESSED else start + 8 + (size + 7 if room > 4 else 0) // 8 * 8


def check_array(content: memoryview, order: str, where: str, depth: int) -> None:
    """DataError unless flags, dimensions and name are there, and what the class of the array asks for."""
    if not len(content):
        return  # an empty cell
    parts = list(elements(content, order, where))
    kinds = [kind for kind, _ in parts]
    if kinds[0] != _UINT32 or len(parts[0][1]) != 8:
        raise damaged("an array without flags", where)
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    kind = flags & 0xFF
    if depth and not 0 < kind <= _INT64:
        raise damaged(f"an array of class {kind} in another", where)
    if kind > _INT64 or kind == 3:
        return
    if kinds[1:3] != [_INT32, _INT8] or len(parts[1][1]) % 4:
        raise damaged("an array without dimensions and name", where)
    dims = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
    if len(dims) < 2 or min(dims) < 0:
        raise damaged(f"an array of dimensions {dims}", where)
    count, rest = math.prod(dims), parts[3:]
    if kind in (_CELL, _STRUCT):
        fields = fields_of(rest, order, where) if kind == _STRUCT else 1
        rest = rest[2:] if kind == _STRUCT else rest
        if [k for k, _ in rest] != [_MATRIX] * (fields * count) or depth > _DEPTH:
            raise damaged(f"{len(rest)} arrays in a class of {fields * count}, or too deep", where)
        for _, inner in rest:
            check_array(inner, order, where, depth + 1)
    elif kind == _SPARSE:
        sizes = [_BYTES.get(k, 0) for k, _ in rest]
        if len(rest) != (4 if flags & _COMPLEX else 3) or not all(sizes):
            raise damaged("a sparse array without its indices", where)
    else:
        wanted = 2 if flags & _COMPLEX and kind != _CHAR else 1
        if len(rest) != wanted or not all(has_count(part, count, kind) for part in rest):
            raise damaged(f"an array that is not made of {wanted} times {count} numbers", where)


def fields_of(rest: list[Element], order: str, where: str) -> int:
    """How many fields a struct has."""
    if [k for k, _ in rest[:2]] != [_INT32, _INT8] or len(rest[0][1]) != 4:
        raise damaged("a struct without field names", where)
    width = int(struct.unpack(f"{order}i", rest[0][1])[0])
    if width < 1 or len(rest[1][1]) % width:
        raise damaged(f"field names of {width} letters", where)
    return len(rest[1][1]) // width


def has_count(part: Element, count: int, kind: int) -> bool:
    """Whether a part holds as many numbers, or letters, as the dimensions say."""
    if kind == _CHAR:
        return (part[0] in _TEXT or part[0] in (2, 4) or not count) and count <= len(part[1])
    size = _BYTES.get(part[0], 0)
    return size > 0 and len(part[1]) == size * count


def damaged(what: str, where: str) -> DataError:
    """What is wrong in the file, in one line."""
    return DataError(f"holds {what}, which no whole MAT file does", where, "export or copy it again")
