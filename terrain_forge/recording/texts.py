"""The texts of a recording: tables, YAML, trajectories; numbers read back as they were."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.writers import yaml_number

Blocks = Iterator[bytes]
"""A file in parts."""
STAMP = "#timestamp [ns]"
_BLOCK = 8192
"""Rows of a part."""


def table(columns: Mapping[str, NDArray[Any]], stamps: NDArray[np.int64]) -> Blocks:
    """A CSV of columns behind their stamps, as EuRoC's."""
    yield _joined([",".join([STAMP, *columns])])
    for part in blocks(len(stamps)):
        yield table_rows(stamps[part], *(column[part] for column in columns.values()))


def table_rows(*columns: NDArray[Any]) -> bytes:
    """Rows of a CSV; there is one at least."""
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return _joined(",".join(map(str, row)) for row in rows)


def blocks(count: int) -> Iterator[slice]:
    """So many rows in parts, whose texts take little memory."""
    return (slice(n, min(n + _BLOCK, count)) for n in range(0, count, _BLOCK))


def written(parts: Blocks) -> Callable[[Path], None]:
    """What writes a file of some parts, one after another."""

    def write(path: Path) -> None:
        with path.open("wb") as file:
            file.writelines(parts)

    return write


def files_text(stamps: Sequence[int], suffix: str) -> bytes:
    """A CSV of files that are called by their stamps, as EuRoC's."""
    return _joined([f"{STAMP},filename", *(f"{stamp},{stamp}{suffix}" for stamp in stamps)])


def yaml_text(values: Mapping[str, Any], comment: str) -> bytes:
    """Plain values as YAML that readers of 1.1 and 1.2 take alike; inner mappings are blocks."""
    return _joined([f"# {comment}", *_block(values)])


def matrix(values: Array) -> dict[str, Any]:
    """A matrix as EuRoC's YAML has it."""
    return {"cols": values.shape[1], "rows": values.shape[0], "data": values.ravel().tolist()}


def _block(values: Mapping[str, Any], indent: str = "") -> Iterable[str]:
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield f"{indent}{key}:"
            yield from _block(value, f"{indent}  ")
        else:
            yield f"{indent}{key}: {_flow(value)}"


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str):
        plain = value.replace("_", "a").replace("-", "a").isalnum() and value[:1].isalpha()
        return value if plain and value.lower() not in _WORDS else _quoted(value)
    if value is None or isinstance(value, (bool, np.bool_)):
        return "null" if value is None else str(bool(value)).lower()
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return yaml_number(value)


_WORDS = {"null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf"}


def _quoted(text: str) -> str:
    inside = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{inside}"'


def _joined(lines: Iterable[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
