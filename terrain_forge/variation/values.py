"""Drawn values, and how they get into a recipe."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

from terrain_forge.base import Key, RecipeError, hint_at
from terrain_forge.recipe import Recipe, Variation, members, recipe_from_json, recipe_json
from terrain_forge.variation.difficulty import between


def plain_recipe(recipe: Recipe) -> dict[str, Any]:
    """The recipe of one world, as JSON has it."""
    plain: dict[str, Any] = json.loads(recipe_json(recipe))
    plain["worlds"] = None
    return plain


def drawn_value(wish: Variation, level: float | None, chance: float, where: Key) -> Any:
    """What is drawn for a key.

    Raises:
        RecipeError: for a wish that is none, or goes by a difficulty that there is not.
    """
    try:
        kind, (*given,) = wish.given
    except RecipeError as error:
        raise RecipeError(str(error), key=where) from None
    if kind == "choice":
        # A world's own: what is drawn of its parts goes into it.
        return deepcopy(given[min(int(chance * len(given)), len(given) - 1)])
    low, high = given
    if low > high and not kind.endswith("difficulty"):  # which may go down as it rises
        raise RecipeError(f"{low:g} to {high:g}: the smaller number first", key=where)
    if kind == "integers":
        return low + min(int(chance * (high - low + 1)), high - low)
    if kind.endswith("difficulty"):
        if level is None:
            raise RecipeError("the worlds have no difficulty: add worlds.difficulty", key=where)
        chance = level
    return between(low, high, chance, logarithmic=kind.startswith("log"))


def put_value(plain: dict[str, Any], name: str, value: Any, where: Key) -> None:
    """Put a value at a dotted key of a recipe, which must be there.

    Raises:
        RecipeError: names the part that is not there, and what is.
    """
    target: Any = plain
    words = name.split(".")
    for depth, word in enumerate(words):
        if isinstance(target, list):
            named = members(target, word)
            if len(named) != 1:
                raise RecipeError(
                    f"{'.'.join(words[:depth])} has {len(target)} members, counted from 0 or by "
                    f"their names; found {word!r}",
                    key=where,
                )
            step: int | str = named[0]
        elif isinstance(target, dict) and word in target:
            step = word
        else:
            allowed = sorted(target) if isinstance(target, dict) else []
            above = ".".join(words[:depth]) or "the recipe"
            has = ", ".join(allowed) or "no keys: give it one in the recipe first"
            raise RecipeError(
                f"{above} has no key {word!r}{hint_at(word, allowed)}, it has {has}", key=where
            )
        if depth == len(words) - 1:
            target[step] = value
        else:
            target = target[step]


def checked_recipe(plain: dict[str, Any], where: Key) -> Recipe:
    """The recipe of a JSON with drawn values.

    Raises:
        RecipeError: if it is none.
    """
    try:
        return recipe_from_json(json.dumps(plain))
    except RecipeError as error:
        raise RecipeError(f"what is drawn cannot be: {error}", key=where) from None
