"""The usual difficulty: what it changes in a recipe."""

from __future__ import annotations

import json
from typing import Any

from terrain_forge.base import portable
from terrain_forge.recipe import DifficultySpec, recipe_from_json
from terrain_forge.rocks import PopulationSpec
from terrain_forge.terrain import Ripples


def between(low: float, high: float, part: float, *, logarithmic: bool) -> float:
    """The number at a part of the way from one to another, or from logarithm to logarithm."""
    if not logarithmic:
        return low + part * (high - low)
    return float(low * portable.power(high / low, part))


def with_difficulty(plain: dict[str, Any], spec: DifficultySpec, level: float) -> dict[str, Any]:
    """Change a recipe, as plain data, for a difficulty; returns what is new, by its keys."""
    recipe = recipe_from_json(json.dumps(plain))
    changed: dict[str, Any] = {}
    if spec.rock_cover is not None:
        cover = between(*spec.rock_cover, level, logarithmic=True)
        for n, population in enumerate(recipe.rocks.populations):
            law = plain["rocks"]["populations"][n]["size_frequency"]
            if law["kind"] == "golombek":
                law |= {"k": cover, "cover": None, "site": None}
                changed[f"rocks.populations.{n}.size_frequency.k"] = cover
            elif law.get("number_per_m2"):
                number = law["number_per_m2"] * cover / _cover(population)
                law["number_per_m2"] = number
                changed[f"rocks.populations.{n}.size_frequency.number_per_m2"] = number
    for n, layer in enumerate(recipe.terrain.layers):
        own = plain["terrain"]["layers"][n]
        for key, value in _changes(own, layer, spec, level).items():
            target, (*way, last) = own, key.split(".")
            for word in way:
                target = target[word]
            target[last] = value
            changed[f"terrain.layers.{n}.{key}"] = value
    return changed


def _cover(population: PopulationSpec) -> float:
    """Part of the ground that a population's law covers between its diameters."""
    law, (smallest, largest) = population.size_frequency, population.diameter_m
    smallest = smallest or law.smallest_known or 0.0
    return float(law.cumulative_area(smallest)) - float(law.cumulative_area(largest or 1e3))


def _changes(own: dict[str, Any], layer: Any, spec: DifficultySpec, level: float) -> dict[str, Any]:
    """What becomes of a layer, by its keys."""
    if own["kind"] == "fractal" and spec.roughness is not None:
        return {"gain": own["gain"] * between(*spec.roughness, level, logarithmic=True)}
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
