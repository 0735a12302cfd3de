"""The usual difficulty: what it changes in a recipe."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Any

from terrain_forge.base import Key, RecipeError, portable
from terrain_forge.recipe import DifficultySpec, Recipe
from terrain_forge.rocks import PopulationSpec, PowerLaw, Tabulated
from terrain_forge.terrain import Ripples


def between(low: float, high: float, part: float, *, logarithmic: bool) -> float:
    """The number at a part of the way from one to another, or from logarithm to logarithm."""
    if not logarithmic:
        return low + part * (high - low)
    return float(low * portable.power(high / low, part))


def with_difficulty(
    plain: dict[str, Any],
    recipe: Recipe,
    spec: DifficultySpec,
    level: float,
    *,
    varied: Collection[Key] = (),
) -> dict[str, Any]:
    """Change a recipe, as plain data, for a difficulty; returns what is new, by its keys.

    Args:
        plain: The recipe as plain data, which is changed.
        recipe: The same recipe.
        spec: What a difficulty changes.
        level: The difficulty, 0 to 1.
        varied: Keys that are drawn otherwise: what one of them names stays as it is.

    Raises:
        RecipeError: for a population whose cover cannot be chosen.
    """
    changed: dict[str, Any] = {}
    for where, changes in _all_changes(plain, recipe, spec, level, varied):
        keys = {(*where, *key.split(".")): value for key, value in changes.items()}
        if any(meet(key, other) for key in keys for other in varied):
            continue
        for key, value in keys.items():
            target: Any = plain
            for step in key[:-1]:
                target = target[step]
            target[key[-1]] = value
            if value is not None:
                changed[".".join(map(str, key))] = value
    return changed


def meet(one: Key, other: Key) -> bool:
    """Whether one key is the other or lies in it."""
    shared = min(len(one), len(other))
    return shared > 0 and one[:shared] == other[:shared]


def _all_changes(
    plain: dict[str, Any],
    recipe: Recipe,
    spec: DifficultySpec,
    level: float,
    varied: Collection[Key],
) -> Iterator[tuple[Key, dict[str, Any]]]:
    """Where a difficulty changes something, and what, by keys there: all of them or none."""
    for n, population in enumerate(recipe.rocks.populations):
        if spec.rock_cover is not None:
            where = ("rocks", "populations", n, "size_frequency")
            cover = between(*spec.rock_cover, level, logarithmic=True)
            try:
                changes = _with_cover(population, cover, where)
            except RecipeError:
                if any(meet(where, other) for other in varied):
                    continue
                raise
            yield where, changes
    for n, layer in enumerate(recipe.terrain.layers):
        yield ("terrain", "layers", n), _changes(plain["terrain"]["layers"][n], layer, spec, level)


def _with_cover(population: PopulationSpec, cover: float, where: Key) -> dict[str, Any]:
    """What a population's law becomes so that its rocks cover a part of the ground, by its keys."""
    law: Any = population.size_frequency
    if law.kind == "golombek":
        return {"k": cover, "cover": None, "site": None}
    number: Any = getattr(law, "number_per_m2", None)
    others: dict[str, Any] = {}
    if isinstance(law, PowerLaw):
        number = law.coefficients[0]
        others = {"exponent": law.coefficients[1], "site": None} if law.site else {}
    numbers = law.numbers_per_m2 if isinstance(law, Tabulated) else None
    now = _cover(population) if number or numbers else 0.0
    if not 0.0 < now < math.inf:
        raise RecipeError(
            f"worlds.difficulty.rock_cover cannot scale this law ({law.kind}): write its numbers "
            "here, so that its rocks cover some of the ground, or give rock_cover: null",
            key=where,
        )
    if numbers:
        return {"numbers_per_m2": [one * cover / now for one in numbers]}
    return {"number_per_m2": number * cover / now, **others}


def _cover(population: PopulationSpec) -> float:
    """Part of the ground that a population's law covers between its diameters."""
    law, (smallest, largest) = population.size_frequency, population.diameter_m
    smallest = smallest or law.smallest_known or 0.0
    return float(law.cumulative_area(smallest)) - float(law.cumulative_area(largest or 1e3))


def _changes(own: dict[str, Any], layer: Any, spec: DifficultySpec, level: float) -> dict[str, Any]:
    """What becomes of a layer, by its keys."""
    if own["kind"] == "fractal" and spec.roughness is not None:
        return {"gain": own.get("gain", 1.0) * between(*spec.roughness, level, logarithmic=True)}
    if own["kind"] == "ripples" and spec.ripple_ratio is not None:
        assert isinstance(layer, Ripples)
        ratio = between(*spec.ripple_ratio, level, logarithmic=False)
        return {"height_m": ratio * layer.wavelength_m}
    production = own.get("production") if own["kind"] == "craters" else None
    if production and "resurfaced" in production and spec.crater_age_ga is not None:
        age = between(*spec.crater_age_ga, level, logarithmic=False)
        part = age / production["age_ga"]
        events = [
            {**event, "age_ga": part * event["age_ga"]} for event in production["resurfaced"] or ()
        ]
        return {"production.age_ga": age} | ({"production.resurfaced": events} if events else {})
    return {}
