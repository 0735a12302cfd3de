"""The rovers that a recipe can name, describe, or bring in a file."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Discriminator, Tag, TypeAdapter

from terrain_forge.base import RecipeError
from terrain_forge.model import Rover
from terrain_forge.rovers.built_in import BuiltInRover, build_rover, built_in_rovers
from terrain_forge.rovers.custom import FileRover, FoundRover

if TYPE_CHECKING:
    from terrain_forge.model import Site

_FILE = "FileRover"
"""Tag of a rover from a file: its kind, `file`, is the name of one of its keys too."""


def _choice_kind(value: Any) -> str:
    found = value.get("kind", "") if isinstance(value, dict) else getattr(value, "kind", "name")
    return _FILE if found == "file" else str(found)


if TYPE_CHECKING:
    RoverChoice = str | BuiltInRover | FileRover
else:
    _kinds = built_in_rovers()
    _members = [Annotated[kind, Tag(name)] for name, kind in _kinds.items()]
    RoverChoice = Annotated[
        Union[(Annotated[str, Tag("name")], *_members, Annotated[FileRover, Tag(_FILE)])],
        Discriminator(
            _choice_kind,
            custom_error_type="rover_kind",
            custom_error_message=f"a name, or a mapping whose kind is {', '.join(_kinds)} or file",
        ),
    ]
"""What a recipe's `rover` may be."""


@cache
def _adapter(name: str) -> TypeAdapter[Any]:
    return TypeAdapter(built_in_rovers()[name])


def find_rover(name: str, **options: Any) -> Rover:
    """The built-in rover of that name.

    Args:
        name: Its name.
        options: What shall differ, by the keys of `rover: {kind: name, …}` (docs/recipe.md).

    Raises:
        RecipeError: if there is none; suggests the nearest name and lists all.
    """
    known = built_in_rovers()
    if name in known:
        return build_rover(_adapter(name).validate_python(options))
    close = get_close_matches(name, known, n=1)
    hint = f", did you mean {close[0]!r}?" if close else ","
    raise RecipeError(
        f"unknown rover {name!r}{hint} known: {', '.join(known)}; a rover of your own is "
        "`{kind: file, file: …}`",
        key=("rover",),
    )


def resolve_rover(choice: RoverChoice, folder: Path) -> FoundRover:
    """The rover that a recipe asks for.

    Args:
        choice: The recipe's `rover`.
        folder: What its paths are relative to.

    Raises:
        RecipeError: for an unknown name, parts that do not fit together, or a step limit above a
            wheel's diameter.
        DataError: for a file that is missing, cannot be read, or is not of a wheeled rover.
    """
    found = _find_choice(choice, folder)
    _require_step(found.rover)
    return found


def _find_choice(choice: RoverChoice, folder: Path) -> FoundRover:
    if isinstance(choice, str):
        return FoundRover(rover=find_rover(choice))
    if isinstance(choice, BuiltInRover):
        return FoundRover(rover=build_rover(choice))
    from terrain_forge.rovers.reading import read_rover

    return read_rover(choice, folder)


def _require_step(rover: Rover) -> None:
    highest = 2.0 * min(wheel.radius for wheel in rover.wheels)
    if rover.step_limit is not None and rover.step_limit > highest:
        raise RecipeError(
            f"{rover.step_limit:.3g} m is more than the diameter of the smallest wheel, "
            f"{highest:.3g} m, over which no wheel climbs",
            key=("rover", "step_limit_m"),
        )


def rover_of(site: Site) -> Rover:
    """The rover of a planned site."""
    return site.custom_rover or resolve_rover(site.recipe.rover, Path()).rover


def require_ground(rover: Rover, *, spacing: float) -> None:
    """Refuse wheels that are too small for the ground's grid: they would roll on single triangles.

    Args:
        rover: The rover.
        spacing: Distance of the ground's nodes [m].

    Raises:
        RecipeError: if a wheel's radius is below the spacing.
    """
    least = min(wheel.radius for wheel in rover.wheels)
    if least < spacing:
        raise RecipeError(
            f"wheel radius {least:.3g} m is below the ground's spacing, {spacing:g} m: choose a "
            f"larger wheel, or a terrain.spacing_m of at most {least:.3g} m",
            key=("rover",),
        )
