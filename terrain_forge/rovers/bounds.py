"""What a rover's file may hold: far more than any rover has (docs/rovers.md), and no bombs."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from terrain_forge.base import DataError

MOST_TEXT, MOST_MESH = 20_000_000, 300_000_000
"""Largest files [bytes]."""
MOST_LINKS = 2_000
MOST_SHAPES = 10_000
MOST_TRIANGLES = 5_000_000
"""In all meshes together."""
FARTHEST = 1e4
"""Largest length or coordinate [m]."""
SMALLEST = 1e-6
"""Smallest length of a solid [m]."""
HEAVIEST = 1e7
"""Largest mass [kg] and moment of inertia [kg m²]."""
MOST_EFFORT = 1e9
"""Largest torque [N m] and damping [N m s/rad]; a motor of more is one without a limit."""
FASTEST = 1e6
"""Largest rate of a joint [rad/s]; one of more has no limit."""
_LONGEST = 200
"""Characters of a name."""
_DEEPEST = 200
"""Elements within elements."""
_MOST = 200_000
"""Elements of a file."""


class FileError(DataError):
    """The file of a rover, or one that it names, is not right."""

    def __init__(self, message: str, *, key: tuple[str | int, ...] = ("rover", "file")) -> None:
        super().__init__(message, key=key)


def require_below(count: int, most: int, what: str, name: str) -> None:
    """Refuse too many of something.

    Raises:
        DataError: if there are more than `most`.
    """
    if count > most:
        raise FileError(f"{name} has {count:,} {what}, at most {most:,}")


def check_name(name: str, what: str) -> str:
    """A name, if it can be printed.

    Raises:
        DataError: if it holds control characters or is too long.
    """
    if len(name) > _LONGEST or not name.isprintable():
        raise FileError(
            f"{what} {name[:40]!r}: a name has at most {_LONGEST} characters, all printable"
        )
    return name


def read_file(path: Path, name: str, *, most: int) -> bytes:
    """The content of a regular file: no pipe or device, which may have no end.

    Args:
        path: The file.
        name: What messages call it.
        most: Its largest size [bytes].

    Raises:
        DataError: if it is missing, not regular or too large.
    """

    def open_at_once(path: str, flags: int) -> int:  # nobody need write to a pipe
        return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))

    try:
        with open(path, "rb", opener=open_at_once) as file:
            told = os.fstat(file.fileno())
            if not stat.S_ISREG(told.st_mode):
                raise FileError(f"{name} is no regular file")
            data = file.read(most + 1) if told.st_size <= most else b""
    except FileNotFoundError:
        raise FileError(f"no such file: {name}") from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise FileError(f"{name} cannot be read: {why}") from None
    if max(told.st_size, len(data)) > most:
        raise FileError(f"{name} has more than {most / 1e6:g} MB")
    return data


def read_xml(path: Path, name: str) -> Element:
    """The root element of a file, as `parse_xml` reads it."""
    return parse_xml(read_file(path, name, most=MOST_TEXT), name)


def parse_xml(data: bytes, name: str) -> Element:
    """The root element; names keep their prefix, comments are dropped.

    Raises:
        DataError: if it is not XML, declares entities, or holds too much.
    """
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    count = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        if depth > _DEEPEST or count > _MOST:
            what = f"elements {_DEEPEST} deep" if depth > _DEEPEST else f"{_MOST} elements"
            raise FileError(f"{name} has more than {what}")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> int:
        raise FileError(f"{name} declares XML entities, which are not read")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise FileError(f"{name} is not XML: {error}") from None
    except (ValueError, LookupError) as error:  # an encoding that nobody knows
        raise FileError(f"{name} cannot be read as text: {error}") from None
    return builder.close()
