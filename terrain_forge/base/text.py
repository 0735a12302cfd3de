"""Text that users bring: of a bounded size, in UTF-8, from a file that ends."""

from __future__ import annotations

from math import inf
from pathlib import Path

from terrain_forge.base.errors import DataError, reading

_LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


def require_file(
    path: Path, name: str, key: tuple[str | int, ...] = (), *, most: float = inf
) -> None:
    """Refuse what is no file, such as a pipe or a device, and one of more than `most` bytes.

    Raises:
        DataError: says by `name` what is there instead.
    """
    with reading(name, key=key):
        if path.is_dir():
            raise DataError(f"is a folder, not a file: {name}", key=key)
        if not path.is_file():
            problem = "is no regular file" if path.exists() else "no such file"
            raise DataError(f"{problem}: {name}", key=key)
        if (size := path.stat().st_size) > most:
            raise DataError(
                f"{name} has {size / 2**20:,.1f} MiB, at most {most / 2**20:,.0f} MiB", key=key
            )


def read_text(
    path: Path, name: str, *, most: int, lines: int = 2**32, key: tuple[str | int, ...] = ()
) -> str:
    """The text of a file in UTF-8, a byte order mark left out.

    Args:
        path: The file.
        name: What it is called in errors.
        most: Bytes that it may have.
        lines: Lines that it may have.
        key: Where in the recipe it is named.

    Raises:
        DataError: if there is no such file or it is no such text; names the line.
    """
    require_file(path, name, key, most=most)
    with reading(name, key=key):
        data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataError(f"{name}:{line}: is no text in UTF-8", key=key) from None
    if (found := sum(map(text.count, _LINE_ENDS))) > lines:
        raise DataError(f"{name} has {found:,} lines, at most {lines:,}", key=key)
    return text
