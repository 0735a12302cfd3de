"""What to write again from a world that is built already."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from terrain_forge.base import OutputError, RecipeError
from terrain_forge.model import World
from terrain_forge.recipe import ExportOrder, export_orders


def re_export_orders(world: World, out: Path, only: tuple[str, ...]) -> tuple[ExportOrder, ...]:
    """The exports that `only` names: folders of the world's recipe, or else exporters.

    Raises:
        OutputError: if `only` is empty, or this version refuses the world's recipe.
        RecipeError: for an unknown exporter.
    """
    if not only:
        raise OutputError("--only names no format")
    try:
        recipe = world.site.recipe
    except RecipeError as error:
        raise _refused(out, error) from None
    exports = recipe.exports
    planned = exports if isinstance(exports, dict) else {name: {} for name in exports}
    chosen = {name: planned.get(name, {}) for name in only}
    try:
        return export_orders(replace(recipe, exports=chosen))
    except RecipeError as error:
        if error.key[1:2] and error.key[1] in planned:
            raise _refused(out, error) from None
        raise


def require_readable_recipe(world: World, out: Path) -> None:
    """Refuse a world whose recipe, or an export of it, this version does not read.

    Raises:
        OutputError: with what is refused.
    """
    try:
        export_orders(world.site.recipe)
    except RecipeError as error:
        raise _refused(out, error) from None


def _refused(out: Path, error: RecipeError) -> OutputError:
    what = ": ".join(filter(None, [".".join(map(str, error.key)), str(error)]))
    return OutputError(
        f"{out}: this version refuses the recipe of that world, {what}; install the package that "
        "it was built with, or build it anew"
    )
