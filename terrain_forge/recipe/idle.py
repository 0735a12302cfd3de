"""Keys of a recipe that change nothing, because of what other keys say or leave out.

Specs tell which of their own fields are so (`Spec.idle`); here is what only a whole recipe tells. A
recipe made in Python does not tell which of its fields somebody wrote, so it is the file that is
looked at.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, NamedTuple

from terrain_forge.base import Key, RecipeError, Spec
from terrain_forge.recipe.exports import ExportOrder, export_orders
from terrain_forge.recipe.renames import value_at
from terrain_forge.recipe.schema import Recipe
from terrain_forge.terrain import MaterialSpec, ReliefBand, SlopeBand

_PEBBLES = "pebbles_min_m"
NEAR_PATHS = ("close_within_m", _PEBBLES)
"""Options of exports, 0 for none, of what lies near paths."""


class IdleKey(NamedTuple):
    """A key that changes nothing."""

    key: Key
    """Where it stands."""
    why: str
    """What of the others makes it so."""
    refused: bool
    """Whether it contradicts them."""


def idle_keys(recipe: Recipe, data: Any) -> Iterator[IdleKey]:
    """The keys that the plain data of a recipe gives though they change nothing.

    Args:
        recipe: What the data say.
        data: Mappings and lists as they stand in the file, keys by their names of now.
    """
    told: set[Key] = set()
    for one in (*_in_whole(recipe), *_all_idle(recipe)):
        if _is_given(data, one.key) and not any(one.key[: len(key)] == key for key in told):
            told.add(one.key)
            yield one


def remove_idle(recipe: Recipe, data: Any) -> Any:
    """The plain data of a whole recipe without keys that change nothing and have their defaults."""
    for (*place, name), _, _ in (*_in_whole(recipe), *_all_idle(recipe)):
        spec: Any = recipe
        for step in place:
            spec = getattr(spec, str(step)) if isinstance(spec, Spec) else spec[step]
        if isinstance(spec, Spec) and spec.is_default(str(name)):  # options stand as written
            value_at(data, tuple(place)).pop(name, None)
    return data


def _all_idle(value: Any, key: Key = ()) -> Iterator[IdleKey]:
    """What all specs within a value say of their own fields."""
    for spec, place in _specs(value, key):
        yield from _told(spec, place)


def _specs(value: Any, key: Key = ()) -> Iterator[tuple[Spec, Key]]:
    """All specs within a value, and where each stands."""
    if isinstance(value, Spec):
        yield value, key
        steps = [(field.name, getattr(value, field.name)) for field in fields(value)]  # type: ignore[arg-type]
    elif isinstance(value, tuple | dict):
        steps = list(enumerate(value) if isinstance(value, tuple) else value.items())  # type: ignore[arg-type]
    else:
        return
    for step, inner in steps:
        yield from _specs(inner, (*key, step))


def _told(spec: Spec, key: Key) -> Iterator[IdleKey]:
    for one in spec.idle():
        yield IdleKey((*key, one.name), one.why, one.refused)


def _in_whole(recipe: Recipe) -> Iterator[IdleKey]:
    """What only the whole recipe tells."""
    rocks = recipe.rocks
    if not rocks.groups:
        yield IdleKey(("rocks", "contact"), "there are no rocks", False)
    if not rocks.populations:
        why = "no population scatters rocks"
        yield IdleKey(("rocks", "exclusion_zones"), why, False)
        yield IdleKey(("horizon", "rocks_m"), why, False)
    for order in _orders(recipe):
        key: Key = ("exports", order.folder)
        yield from _told(order.options, key)
        for name in NEAR_PATHS:
            if getattr(order.options, name, 0.0):
                yield from _near_paths(recipe, (*key, name))
        yield from _no_pebbles(recipe, getattr(order.options, _PEBBLES, 0.0), (*key, _PEBBLES))
    if recipe.dataset is not None:
        yield from _no_pebbles(recipe, recipe.dataset.pebbles_min_m, ("dataset", _PEBBLES))
    for spec, key in _specs(recipe):
        yield from _below_cells(spec, recipe.terrain.spacing_m, key)


def _no_pebbles(recipe: Recipe, smallest: float, key: Key) -> Iterator[IdleKey]:
    """Why there are no pebbles from a diameter [m] on, if rocks are as small."""
    told = [population.diameter_m[0] for population in recipe.rocks.populations]
    least = min((diameter for diameter in told if diameter is not None), default=math.inf)
    if smallest >= least:
        why = f"pebbles are below the smallest rocks, {least:g} m, and {smallest:g} m is not"
        yield IdleKey(key, why, True)


def _below_cells(spec: Spec, spacing: float, key: Key) -> Iterator[IdleKey]:
    """Lengths that are shorter than what the ground's nodes tell."""
    name, cells = ("patch_m", 1) if isinstance(spec, MaterialSpec) else ("baseline_m", 2)
    if isinstance(spec, MaterialSpec | SlopeBand | ReliefBand):
        length, least = getattr(spec, name), cells * spacing
        if length < least * (1.0 - 1e-9):
            what = "a cell" if cells == 1 else "two cells"
            why = f"{length:g} m is below {what} of the ground, {least:g} m, the least that counts"
            yield IdleKey((*key, name), why, False)


def _near_paths(recipe: Recipe, key: Key) -> Iterator[IdleKey]:
    """Why an option of what lies near paths has no effect, if it has none."""
    pebbles = key[-1] == _PEBBLES
    if not recipe.paths:
        yield IdleKey(key, "there is no path", pebbles)
    elif pebbles and not recipe.rocks.populations:
        yield IdleKey(key, "no population has a law that tells their number", pebbles)


def _orders(recipe: Recipe) -> tuple[ExportOrder, ...]:
    """The exports whose options a recipe gives; of wrong ones none, which a build tells of."""
    try:
        return export_orders(recipe) if isinstance(recipe.exports, dict) else ()
    except RecipeError:
        return ()


def _is_given(data: Any, key: Key) -> bool:
    place = value_at(data, key[:-1])
    return isinstance(place, dict) and key[-1] in place
