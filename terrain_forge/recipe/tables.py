"""Tables of a user's: read strictly, complaints name the line."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from terrain_forge.base import MAX_TABLE, Array, DataError, InputFile, Key, plain_number, read_text
from terrain_forge.model import Table


def read_table(file: str, folder: Path, mark: InputFile, *, key: Key) -> Table:
    """The numbers of a CSV file whose first line names the columns; lines after # are skipped.

    The mark tells which columns it may have, and how many rows.

    Raises:
        DataError: if it is no such table; says in which line.
    """
    text = read_text(folder / file, file, most=MAX_TABLE, lines=2 * mark.most, key=key)
    try:
        return _read(file, text, mark)
    except ValueError as error:
        raise DataError(f"{file}{error}", key=key) from None


def _read(file: str, text: str, mark: InputFile) -> Table:
    """The table of a text. What is wrong with it is a ValueError, to be read after the file."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise ValueError(" needs a line of column names and at least one more")
    if len(lines) > mark.most + 1:
        raise ValueError(f" has {len(lines) - 1:,} rows, at most {mark.most:,}")
    columns = tuple(_fields(lines[0][1]))
    _require_columns(columns, mark)
    values = _all_numbers([line for _, line in lines[1:]], len(columns))
    if values is None:
        blanks = dict(mark.blanks)
        values = np.array([_numbers(n, _fields(line), columns, blanks) for n, line in lines[1:]])
    table = Table(path=file, columns=columns, values=values)
    for name in mark.positive:
        if name in columns and (least := float(table.column(name).min())) <= 0.0:
            raise ValueError(f": {name} must be above 0, found {least:g}")
    return table


def _fields(line: str) -> list[str]:
    return [field.strip() for field in next(csv.reader([line]))]


def _all_numbers(lines: list[str], columns: int) -> Array | None:
    """The numbers of all lines at once, or None where they must be looked at one by one."""
    if not all(line.isascii() for line in lines):  # digits of other scripts are numbers to NumPy
        return None
    try:
        values = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError:
        return None
    return values if values.shape[1] == columns and np.isfinite(values).all() else None


def _require_columns(columns: tuple[str, ...], mark: InputFile) -> None:
    for name in mark.columns:
        if name not in columns:
            raise ValueError(f" has no column {name!r}, found {', '.join(columns)}")
    known = (*mark.columns, *mark.optional)
    for name in columns:
        if name not in known:
            raise ValueError(f": unknown column {name!r}, allowed: {', '.join(known)}")
        if columns.count(name) > 1:
            raise ValueError(f" has two columns {name!r}")


def _numbers(
    line: int, row: list[str], columns: tuple[str, ...], blanks: dict[str, float]
) -> list[float]:
    if len(row) != len(columns):
        raise ValueError(f", line {line}: {len(row)} fields, expected {len(columns)}")
    numbers = []
    for name, field in zip(columns, row, strict=True):
        if not field and name in blanks:
            numbers.append(blanks[name])
            continue
        try:
            number = plain_number(field)
        except ValueError:
            raise ValueError(f", line {line}: {name} must be a number, found {field!r}") from None
        if not np.isfinite(number):
            raise ValueError(f", line {line}: {name} is {field}, not finite")
        numbers.append(number)
    return numbers
