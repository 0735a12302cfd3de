"""What a rover's file may hold: far more than any rover has (docs/rovers.md)."""

from __future__ import annotations

from terrain_forge.base import DataError
from terrain_forge.rovers.rover_xml import KEY

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
_LONGEST = 200
"""Characters of a name."""


def require_below(count: int, most: int, what: str, name: str) -> None:
    """Refuse too many of something.

    Raises:
        DataError: if there are more than `most`.
    """
    if count > most:
        raise DataError(f"{name} has {count:,} {what}, at most {most:,}", key=KEY)


def check_name(name: str, what: str) -> str:
    """A name, if it can be printed.

    Raises:
        DataError: if it holds control characters or is too long.
    """
    if len(name) > _LONGEST or not name.isprintable():
        raise DataError(
            f"{what} {name[:40]!r}: a name has at most {_LONGEST} characters, all printable",
            key=KEY,
        )
    return name
