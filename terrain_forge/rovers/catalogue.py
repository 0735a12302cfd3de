"""The rovers that a recipe can name."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

from terrain_forge.errors import RecipeError
from terrain_forge.rovers.description import Rover
from terrain_forge.rovers.morpheus import morpheus

ROVERS: dict[str, Callable[[], Rover]] = {"morpheus": morpheus}


def rover_names() -> list[str]:
    """Names of all rovers, sorted."""
    return sorted(ROVERS)


def find_rover(name: str) -> Rover:
    """The rover of that name.

    Raises:
        RecipeError: if there is none; suggests the nearest name and lists all.
    """
    if name in ROVERS:
        return ROVERS[name]()
    close = get_close_matches(name, ROVERS, n=1)
    hint = f", did you mean {close[0]!r}?" if close else ","
    raise RecipeError(
        f"unknown rover {name!r}{hint} known: {', '.join(rover_names())}", key=("rover",)
    )
