"""Which exports to write: those of the recipe, or what the command line names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from terrain_forge.base import OutputError, RecipeError
from terrain_forge.model import World, packages_gone
from terrain_forge.recipe import ExportOrder, Recipe, export_orders


def chosen_exports(recipe: Recipe, only: tuple[str, ...] | str | None) -> tuple[ExportOrder, ...]:
    """The recipe's exports, or those that `only` names: its folders, or else exporters.

    One may stand alone.

    Raises:
        OutputError: if `only` is empty, or names what is neither.
        RecipeError: for an export of the recipe that cannot be.
    """
    if only is None:
        return export_orders(recipe)
    if not only:
        raise OutputError("--only names no format")
    only, planned = (only,) if isinstance(only, str) else only, planned_exports(recipe)
    try:
        return export_orders(
            replace(recipe, exports={name: planned.get(name, {}) for name in only})
        )
    except RecipeError as error:
        if error.key[1:2] and error.key[1] not in planned:
            raise OutputError(f"--only {error.key[1]}: {error}") from None
        raise


def planned_exports(recipe: Recipe) -> dict[str, Any]:
    """The recipe's exports by folder, with their options."""
    exports = recipe.exports
    return exports if isinstance(exports, dict) else {name: {} for name in exports}


def re_export_orders(world: World, out: Path, only: tuple[str, ...]) -> tuple[ExportOrder, ...]:
    """The exports that `only` names: folders of the world's recipe, or else exporters.

    Raises:
        OutputError: if `only` names no exporter, or this version refuses the world's recipe.
    """
    try:
        return chosen_exports(world.site.recipe, only)
    except RecipeError as error:
        raise _refused(out, error) from None


def require_readable_recipe(world: World, out: Path, *, exports: bool = True) -> None:
    """Refuse a world whose recipe, or an export of it, this version does not read.

    Args:
        world: The world in a built folder.
        out: The folder.
        exports: Whether its exports are wanted too.

    Raises:
        OutputError: with what is refused; names packages that are not installed.
    """
    try:
        recipe = world.site.recipe
        if exports:
            export_orders(recipe)
    except RecipeError as error:
        raise _refused(out, error) from None


def _refused(out: Path, error: RecipeError) -> OutputError:
    what = ": ".join(filter(None, [".".join(map(str, error.key)), str(error)]))
    gone = packages_gone(out)
    needed = f"{gone}, with which it was built" if gone else "the package that it was built with"
    return OutputError(
        f"{out}: this version refuses the recipe of that world, {what}; install {needed}, or "
        "build it anew"
    )
