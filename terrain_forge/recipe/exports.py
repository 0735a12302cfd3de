"""The exports of a recipe: each with its exporter found and its options checked."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from pydantic import ValidationError

from terrain_forge.base import RecipeError, complaint, dotted, refuse_twice, type_adapter
from terrain_forge.model import Exporter, exporter, refused_folder
from terrain_forge.recipe.schema import Recipe


@dataclass(frozen=True, kw_only=True)
class ExportOrder:
    """One folder of an export: which exporter fills it, and how."""

    folder: str
    kind: str
    exporter: Exporter
    options: Any


def export_orders(recipe: Recipe) -> tuple[ExportOrder, ...]:
    """The recipe's exports with their exporters found and their options checked.

    Raises:
        RecipeError: for an unknown exporter or option, a folder that the world needs itself, or one
            that is another again.
    """
    exports = recipe.exports
    if not isinstance(exports, dict):
        refuse_twice(exports, ("exports",))
        exports = {name: {} for name in exports}
    orders = tuple(_order(folder, dict(options)) for folder, options in exports.items())
    for other, order in combinations(orders, 2):
        same = ""
        if other.folder.lower() == order.folder.lower():
            same = f"a folder before is called {other.folder!r}, which is the same, case aside"
        elif (other.kind, other.options) == (order.kind, order.options):
            same = f"{order.kind} with the same options as {other.folder!r}: one of them is enough"
        if same:
            raise RecipeError(same, key=("exports", order.folder))
    return orders


def _order(folder: str, options: dict[str, Any]) -> ExportOrder:
    key = ("exports", folder)
    if refused := refused_folder(folder):
        raise RecipeError(refused, key=key)
    kind = options.pop("kind", folder)
    if not isinstance(kind, str):
        raise RecipeError(f"must be the name of an exporter, found {kind!r}", key=(*key, "kind"))
    try:
        found = exporter(kind)
        adapter = type_adapter(found.Options)
        checked = adapter.validate_json(json.dumps(options), strict=True)
    except RecipeError as error:
        raise RecipeError(str(error), key=(*key, *error.key)) from None
    except ValidationError as error:
        told = complaint(error, adapter, options)
        why = f"option {dotted(told.key)!r} of {kind}: {told.words}{told.rest}"
        raise RecipeError(why, key=(*key, *told.key)) from None
    return ExportOrder(folder=folder, kind=kind, exporter=found, options=checked)
