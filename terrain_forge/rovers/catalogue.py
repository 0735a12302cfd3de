"""The rovers that a recipe can name, describe, or bring in a file."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union

import numpy as np
from pydantic import Discriminator, Tag, TypeAdapter, ValidationError

from terrain_forge.base import RecipeError, TerrainForgeError, complaint, hint_at
from terrain_forge.model import Rover
from terrain_forge.rovers.assembly import Assembly
from terrain_forge.rovers.bounds import FileError, parse_xml, read_xml
from terrain_forge.rovers.built_in import BuiltInRover, build_rover, built_in_rovers
from terrain_forge.rovers.custom import FileRover, FoundRover
from terrain_forge.rovers.macros import expand_trusted, expand_xacro
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.rig import with_sensors
from terrain_forge.rovers.rolling import make_rover
from terrain_forge.rovers.urdf import read_urdf

if TYPE_CHECKING:
    from terrain_forge.model import Site

_LONGEST = 600
"""Characters of a message."""
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

_adapter: Callable[[type], TypeAdapter[Any]] = cache(TypeAdapter)


def find_rover(name: str, **options: Any) -> Rover:
    """The built-in rover of that name.

    Args:
        name: Its name.
        options: What shall differ, by the keys of `rover: {kind: name, …}` (docs/recipe.md).

    Raises:
        RecipeError: if there is none, which suggests the nearest name and lists all, or it has not
            what shall differ.
    """
    return _find(name, options).rover


def _find(name: str, options: dict[str, Any]) -> FoundRover:
    known = built_in_rovers()
    if name in known:
        adapter = _adapter(known[name])
        try:
            choice = adapter.validate_python(options)
        except ValidationError as error:
            told = complaint(error, adapter, options)
            raise RecipeError(f"rover {name!r}: {told}", key=("rover", *told.key)) from None
        return build_rover(choice)
    raise RecipeError(
        f"unknown rover {name!r}{hint_at(name, known)}, known: {', '.join(known)}; a "
        "rover of your own is `{kind: file, file: …}`",
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
    if isinstance(choice, str):
        found = _find(choice, {})
    elif isinstance(choice, BuiltInRover):
        found = build_rover(choice)
    else:
        found = _read_rover(choice, folder)
    step = found.rover.step_limit
    highest = 2.0 * min(wheel.radius for wheel in found.rover.wheels)
    if step is not None and step > highest:
        raise RecipeError(
            f"{step:.3g} m is more than the diameter of the smallest wheel, {highest:.3g} m, over "
            "which no wheel climbs",
            key=("rover", "step_limit_m"),
        )
    return found


def rover_of(site: Site) -> Rover:
    """The rover of a planned site."""
    recipe = site.recipe
    if site.custom_rover:
        return site.custom_rover
    found = resolve_rover(recipe.rover, Path())
    return with_sensors(found.rover, recipe.sensors, frames=found.frames)


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


def _read_rover(spec: FileRover, folder: Path) -> FoundRover:
    """The rover of a URDF, xacro or MJCF file."""
    with _one_line(spec.file):
        file = folder / spec.file
        given = {name: folder / place for name, place in spec.packages.items()}
        assembly, files = _read(spec, file, Packages(given, file))
        rover, frames = make_rover(assembly, spec)
        return FoundRover(rover=rover, files=tuple(dict.fromkeys(files)), frames=frames)


def _read(spec: FileRover, file: Path, packages: Packages) -> tuple[Assembly, list[Path]]:
    root = read_xml(file, spec.file)
    if root.tag == "mujoco":
        from terrain_forge.rovers.mjcf import read_mjcf

        return read_mjcf(file, packages)
    if root.tag != "robot":
        raise FileError(
            f"{spec.file} is a <{root.tag}>, allowed: a URDF or xacro (<robot>), an MJCF (<mujoco>)"
        )
    files = [file]
    if file.suffix != ".xacro":
        for element in root.iter():
            if element.tag.startswith("xacro:"):
                raise FileError(
                    f"{spec.file} holds <{element.tag}>; a .urdf is not evaluated, name it .xacro"
                )
    elif spec.trust:
        text, included = expand_trusted(file, packages)
        root, files = parse_xml(text, spec.file), [file, *included]
    else:
        root, included = expand_xacro(file, packages)
        files += included
    assembly, meshes = read_urdf(root, file, packages)
    return assembly, [*files, *meshes]


@contextmanager
def _one_line(name: str) -> Iterator[None]:
    """Turns whatever a file provokes into one line; libraries have nothing to say on their own."""
    log = logging.getLogger("trimesh")
    level = log.level
    try:
        log.setLevel(logging.CRITICAL + 1)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except TerrainForgeError as error:
        raise type(error)(_printable(str(error)), key=error.key) from None
    except RecursionError:
        raise FileError(_printable(f"{name} nests too deep")) from None
    except Exception as error:  # readers raise whatever a broken file provokes
        why = f"{type(error).__name__}: {error}"
        raise FileError(_printable(f"{name} cannot be read as a rover: {why}")) from None
    finally:
        log.setLevel(level)


def _printable(text: str) -> str:
    """One line that no terminal takes for a command."""
    line = " ".join(text.split())
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…"
