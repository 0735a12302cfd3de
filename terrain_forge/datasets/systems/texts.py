"""Numbers and tables as the systems' YAML readers take them: OpenCV's, PyYAML's, yaml-cpp's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from terrain_forge.base import Array
from terrain_forge.writers import yaml_number

OPENCV = "%YAML:1.0\n"
"""First line of what OpenCV reads."""


def row(values: Iterable[float]) -> str:
    """Numbers in brackets."""
    return f"[{', '.join(map(yaml_number, values))}]"


def opencv_matrix(name: str, values: Array, kind: str = "d") -> str:
    """A matrix as OpenCV stores it: of doubles, or of floats (`f`) where a reader expects these."""
    rows, columns = values.shape
    return (
        f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: {kind}\n"
        f"   data: {row(values.ravel().tolist())}\n"
    )


def nested(name: str, values: Array, indent: str = "") -> str:
    """A matrix as a list of rows."""
    rows = "".join(f"{indent}- {row(one)}\n" for one in values.tolist())
    return f"{indent[:-2]}{name}:\n{rows}"


def lines(values: Mapping[str, Any], indent: str = "") -> str:
    """Keys and values, a line each; floats with their points, texts in quotes as they come."""

    def told(value: Any) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        return yaml_number(value) if isinstance(value, float) else str(value)

    return "".join(f"{indent}{key}: {told(value)}\n" for key, value in values.items())


def remark(*sentences: str) -> str:
    """Comment lines."""
    return "".join(f"# {sentence}\n" for sentence in sentences)
