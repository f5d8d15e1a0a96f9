"""CSV: named columns of numbers, parted by the values of one column where wanted."""

from __future__ import annotations

import csv
from collections import UserDict
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.values import likeliest_name
from forceid.import_settings import CsvSetting
from forceid.records import Array

Table = dict[str, list[str]]


def read_csv(path: str | Path, delimiter: str = ",") -> Table:
    """The columns of a CSV file as text, by the names in its first row. DataError: empty, ragged, binary."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as f:
            rows = [row for row in csv.reader(f, delimiter=delimiter) if any(cell.strip() for cell in row)]
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", str(path), "give the path of a CSV file") from e
    except (UnicodeDecodeError, csv.Error) as e:
        raise DataError(f"is not CSV text ({e})", str(path), "export it as UTF-8 text") from e
    if len(rows) < 2:
        raise DataError(f"holds {len(rows)} rows, expected a header and data", str(path), "export it again")
    header = [name.strip() for name in rows[0]]
    for k, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            what = f"has {len(row)} cells in row {k}, expected {len(header)} as in the header"
            raise DataError(what, str(path), f"correct that row, or the delimiter {delimiter!r}")
    return dict(zip(header, map(list, zip(*rows[1:], strict=True)), strict=True))


def part(table: Table, setting: CsvSetting, where: str) -> list[tuple[str, Table]]:
    """The table by groups in order of appearance, those selected; one unnamed group when no column is set."""
    if setting.group is None:
        return [("", table)]
    labels = column_cells(table, setting.group, where)
    selected = setting.select if isinstance(setting.select, tuple) else (setting.select,)
    wanted = [f"{value:g}" if isinstance(value, float) else value for value in selected] or list(
        dict.fromkeys(labels)
    )
    for name in wanted:
        if name not in labels:
            step = likeliest_name(name, sorted(set(labels)), "name one that it has")
            raise DataError(f"has no {setting.group} {name!r}", where, step)
    return [
        (
            name,
            {
                key: [c for c, label in zip(cells, labels, strict=True) if label == name]
                for key, cells in table.items()
            },
        )
        for name in wanted
    ]


class CsvTable(UserDict[str, Any]):
    """The columns of a table as numbers, each read when it is asked for: others may hold text.

    A blank cell is NaN. A CSV file has no place for units and no clock of its own.
    """

    def __init__(self, table: Table, where: str) -> None:
        super().__init__(table)
        self.where = where

    def __getitem__(self, name: str) -> Array:
        cells = column_cells(self.data, name, self.where)
        try:
            return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError as e:
            what = f"holds text ({e}), expected numbers"
            raise DataError(what, f"{self.where}:{name}", "leave gaps blank") from e


def column_cells(table: Table, name: str, where: str) -> list[str]:
    """The cells of one column."""
    if name not in table:
        raise DataError(
            f"has no column {name!r}", where, likeliest_name(name, list(table), "name one that it has")
        )
    return table[name]
