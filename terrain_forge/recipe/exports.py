"""The exports of a recipe: each with its exporter found and its options checked."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter

from terrain_forge.base import RecipeError
from terrain_forge.model import exporter
from terrain_forge.recipe.schema import Recipe

if TYPE_CHECKING:
    from terrain_forge.model import Exporter


@dataclass(frozen=True, kw_only=True)
class ExportOrder:
    """One folder of an export: which exporter fills it, and how."""

    folder: str
    kind: str
    exporter: Exporter
    options: Any


RESERVED = {
    *("world", "truth", "paths", "validation", "dataset"),
    *("manifest.json", "timings.json", "report.html", "preview.png"),
}
"""Names in a world's folder that no export may have, in any case."""


def export_orders(recipe: Recipe) -> tuple[ExportOrder, ...]:
    """The recipe's exports with their exporters found and their options checked.

    Raises:
        RecipeError: for an unknown exporter or option, a folder that the world needs itself, or one
            that is another again.
    """
    exports = recipe.exports
    if not isinstance(exports, dict):
        if len(set(exports)) < len(exports):
            raise RecipeError("a format is named twice", key=("exports",))
        exports = {name: {} for name in exports}
    orders = tuple(_order(folder, dict(options)) for folder, options in exports.items())
    for number, order in enumerate(orders):
        _require_another(order, orders[:number])
    return orders


def _require_another(order: ExportOrder, earlier: tuple[ExportOrder, ...]) -> None:
    """Refuse a folder that is one before it again, by its name or by all that is in it."""
    key = ("exports", order.folder)
    for other in earlier:
        if other.folder.lower() == order.folder.lower():
            raise RecipeError(
                f"a folder before is called {other.folder!r}, which is the same, case aside",
                key=key,
            )
        if (other.kind, other.options) == (order.kind, order.options):
            raise RecipeError(
                f"{order.kind} with the same options as {other.folder!r}: one of them is enough",
                key=key,
            )


def _order(folder: str, options: dict[str, Any]) -> ExportOrder:
    key = ("exports", folder)
    if folder.lower() in RESERVED:
        raise RecipeError(f"{folder!r} is part of every world, choose another name", key=key)
    kind = options.pop("kind", folder)
    if not isinstance(kind, str):
        raise RecipeError(f"must be the name of an exporter, found {kind!r}", key=(*key, "kind"))
    try:
        found = exporter(kind)
        checked = TypeAdapter(found.Options).validate_json(json.dumps(options), strict=True)
    except RecipeError as error:
        raise RecipeError(str(error), key=(*key, *error.key)) from None
    except ValueError as error:
        option = error.errors()[0]["loc"][:1]  # type: ignore[attr-defined]
        message = _option_message(kind, found, error)
        raise RecipeError(message, key=(*key, *option)) from None
    return ExportOrder(folder=folder, kind=kind, exporter=found, options=checked)


def _option_message(kind: str, found: Exporter, error: ValueError) -> str:
    first = error.errors()[0]  # type: ignore[attr-defined]
    option = ".".join(map(str, first["loc"]))
    if first["type"] == "unexpected_keyword_argument":
        allowed = sorted(field.name for field in fields(found.Options) if field.name != "kind")
        close = get_close_matches(option, allowed, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        return f"{kind} has no option {option!r}{hint}, it has: {', '.join(allowed) or 'none'}"
    return f"option {option!r} of {kind}: {first['msg']}, found {first['input']!r}"
