"""Attributes of a group or a variable, judged by their declaration and by what is stored, then read."""

from __future__ import annotations

import math
from itertools import islice
from typing import Any

import h5py

from forceid.errors import DataError
from forceid.files.parse import text
from forceid.files.stored.object_header import check_texts

_NAMES = 1000  # attributes that are looked at
_ATTRIBUTE, _TEXTS = 1 << 20, 100  # bytes of an attribute, and texts in one


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
    if count * each > _ATTRIBUTE or (
        objects and (count > _TEXTS or not h5py.check_string_dtype(declared.dtype))
    ):
        what = f"holds {count} values of {declared.dtype}, expected a number or a text"
        raise DataError(what, f"{where}@{text(name)}", "keep large data in a variable")
