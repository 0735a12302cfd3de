"""Tables that users bring as CSV: read strictly, complaints naming the line."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import DataError, Key
from terrain_forge.dtm import require_file
from terrain_forge.model import Table


def read_table(
    file: str,
    folder: Path,
    *,
    needed: tuple[str, ...],
    optional: tuple[str, ...] = (),
    blanks: tuple[tuple[str, float], ...] = (),
    most: int,
    key: Key,
) -> Table:
    """The numbers of a CSV file whose first line names the columns; lines after # are skipped.

    Args:
        file: path as the recipe writes it.
        folder: what it is relative to.
        needed: columns that must be there.
        optional: columns that may be there; others are refused, lest a misspelt one is lost.
        blanks: columns whose fields may be empty, and what the table holds there.
        most: rows that it may have.
        key: where in the recipe the file is named.

    Raises:
        DataError: if the file is missing or no such table; says in which line.
    """
    require_file(folder / file, file, key)
    try:
        text = (folder / file).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DataError(f"{file} is no text in UTF-8", key=key) from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise DataError(f"{file} needs a line of column names and at least one more", key=key)
    if len(lines) > most + 1:
        raise DataError(f"{file} has {len(lines) - 1:,} rows, at most {most:,}", key=key)
    columns = tuple(_fields(lines[0][1]))
    _require_columns(file, columns, needed, optional, key)
    values = _all_numbers([line for _, line in lines[1:]], len(columns))
    if values is None:
        rows = [
            _numbers(f"{file}, line {n}", _fields(line), columns, dict(blanks), key)
            for n, line in lines[1:]
        ]
        values = np.array(rows)
    return Table(path=file, columns=columns, values=values)


def _fields(line: str) -> list[str]:
    return [field.strip() for field in next(csv.reader([line]))]


def _all_numbers(lines: list[str], columns: int) -> NDArray[np.float64] | None:
    """The numbers of all lines at once, or None where they must be looked at one by one."""
    try:
        values = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError:
        return None
    return values if values.shape[1] == columns and np.isfinite(values).all() else None


def _require_columns(
    file: str,
    columns: tuple[str, ...],
    needed: tuple[str, ...],
    optional: tuple[str, ...],
    key: Key,
) -> None:
    found = f"found {', '.join(columns)}"
    for name in needed:
        if name not in columns:
            raise DataError(f"{file} has no column {name!r}, {found}", key=key)
    for name in columns:
        if name not in (*needed, *optional):
            allowed = ", ".join((*needed, *optional))
            raise DataError(f"{file}: unknown column {name!r}, allowed: {allowed}", key=key)
        if columns.count(name) > 1:
            raise DataError(f"{file} has two columns {name!r}", key=key)


def _numbers(
    where: str, row: list[str], columns: tuple[str, ...], blanks: dict[str, float], key: Key
) -> list[float]:
    if len(row) != len(columns):
        raise DataError(f"{where}: {len(row)} fields, expected {len(columns)}", key=key)
    numbers = []
    for name, field in zip(columns, row, strict=True):
        if not field and name in blanks:
            numbers.append(blanks[name])
            continue
        try:
            number = float(field)
        except ValueError:
            raise DataError(f"{where}: {name} must be a number, found {field!r}", key=key) from None
        if not np.isfinite(number):
            raise DataError(f"{where}: {name} is {field}, not finite", key=key)
        numbers.append(number)
    return numbers
