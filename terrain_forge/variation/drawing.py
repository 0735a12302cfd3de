"""What one of many worlds is: its recipe, drawn by its number alone."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeGuard

import numpy as np

from terrain_forge.base import (
    DataError,
    Key,
    RecipeError,
    dotted,
    stage_key,
    uniforms,
)
from terrain_forge.dtm import Centre, RasterDtm, Terrain, places_of, whole_at_hand
from terrain_forge.making import draft, plan
from terrain_forge.model import BODIES, Site
from terrain_forge.recipe import (
    DifficultySpec,
    Recipe,
    Variation,
    WorldsSpec,
    numbered,
    without_paths,
)
from terrain_forge.variation.difficulty import between, meet, with_difficulty
from terrain_forge.variation.values import checked_recipe, drawn_value, plain_recipe, put_value

PLACES = 64
"""Random places of which the one of a world's difficulty is taken."""
_CENTRE = "dtm.centre"
_OF_PLACE = ("body", "dtm", "sun")
"""Parts of a recipe of which only a plan, with the heights, tells whether they can be."""
_AT_PLACE = (
    *(("dtm",), ("dtm", "centre"), ("dtm", "size_m")),
    *(("dtm", "source"), ("dtm", "nodata"), ("dtm", "fill_holes_m")),
)
"""What is wrong with a terrain model at one place, by its key, and may be right at another."""
_SHOWN = 60
"""Characters of a drawn value that a message shows."""
_OWN = {
    "schema": "it is of the file",
    "name": "each is called by its number",
    "seed": "each has one of its own, drawn from the recipe's",
    "exports": "a series has the same formats throughout",
    "tiles": "they are made whole",
    "worlds": "it says how they differ",
}
"""Parts of a recipe in which worlds do not differ, and why."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """One of many worlds before it is made."""

    number: int
    """Its number, from 0."""
    recipe: Recipe
    """Its own recipe, which a build makes the same world of."""
    site: Site
    """Its site."""
    difficulty: float | None
    """The difficulty that was wished; None where there is none."""
    values: dict[str, Any] = field(default_factory=dict)
    """What was drawn, by the key in the recipe."""


def draw(
    recipe: Recipe,
    number: int,
    *,
    folder: Path,
    difficulty: float | None = None,
    paths: bool = True,
) -> Drawn:
    """Draw one of a recipe's worlds.

    It hangs on the recipe's seed and the number alone, not on how many there are.

    Args:
        recipe: With `worlds`, which says what differs.
        number: Of the world, from 0.
        folder: What the recipe's paths are relative to.
        difficulty: Its difficulty, instead of a drawn one.
        paths: Whether it has paths; without, what was drawn is as `without_paths` says.

    Raises:
        RecipeError, DataError: if such a world cannot be; names the key.
    """
    spec = recipe.worlds or WorldsSpec()
    level = difficulty if difficulty is not None else _level(spec.difficulty, recipe.seed, number)
    plain = plain_recipe(recipe)
    plain["name"] = f"{recipe.name}-{number:05}"
    if plain["horizon"]["reach_m"] is None:  # it would be most of a small world's bytes
        plain["horizon"]["reach_m"] = 0.0
    plain["seed"] = int(stage_key(recipe.seed, f"worlds/{number}/seed")) >> 1
    values: dict[str, Any] = {}
    for key, wish in spec.vary.items():
        where = ("worlds", "vary", key)
        if _is_drawn(wish, where):
            value = drawn_value(wish, level, _chance(recipe.seed, number, f"vary/{key}"), where)
            put_value(plain, key, value, where)
            values[key] = value
    try:
        own = checked_recipe(plain, ("worlds",))
        if spec.difficulty is not None and level is not None:  # of what was drawn
            varied = _keys(recipe).values()
            values = with_difficulty(plain, own, spec.difficulty, level, varied=varied) | values
            own = checked_recipe(plain, ("worlds",))
        if not paths:
            own = without_paths(own)
        _require_goals(own, spec.arrival.distance_m)
        if spec.vary.get(_CENTRE) == "anywhere" or _ranked(spec, own, level):
            rank = level if _ranked(spec, own, level) else None
            own, site, place = _placed(own, recipe.seed, number, folder, spec, rank)
            values[_CENTRE] = place
        else:
            site = plan(own, folder=folder)
    except (RecipeError, DataError) as error:
        drawn = {key: value for key, value in values.items() if key in spec.vary}
        raise _due(error, recipe, drawn, folder, level) from None
    values["seed"] = own.seed
    return Drawn(number=number, recipe=own, site=site, difficulty=level, values=values)


def require_untiled(recipe: Recipe) -> None:
    """Refuse tiles, in which no world of a series is made.

    Raises:
        RecipeError: if the recipe asks for them.
    """
    if recipe.tiles is not None:
        raise RecipeError("worlds of a series are made whole: leave it out", key=("tiles",))


def require_drawable(recipe: Recipe, folder: Path) -> None:
    """Refuse what is drawn from, before a world is made, by the recipes at its ends and the first.

    Args:
        recipe: With `worlds`, which says what differs.
        folder: What the recipe's paths are relative to.

    Raises:
        RecipeError, DataError: for the first key, difficulty or choice of which no world can be.
    """
    spec = recipe.worlds or WorldsSpec()
    keys = _keys(recipe)
    _require_kept(spec, keys)
    placed = spec.difficulty is not None and spec.difficulty.place is not None
    for key, wish in spec.vary.items():
        where = ("worlds", "vary", key)
        if not _is_drawn(wish, where):
            continue
        place = dotted(keys[key])
        steps = len(wish.choice or (0, 1)) - 1
        for step in range(steps + 1):
            chance, plain = step / max(steps, 1), plain_recipe(recipe)
            level = None if spec.difficulty is None else chance
            value = drawn_value(wish, level, chance, where)
            put_value(plain, key, value, where)
            others = [other for name, other in keys.items() if name != key]
            others += [("dtm", "centre")] * (placed and key != _CENTRE)
            # What is wrong beside the key, or together with another, that may set right.
            try:
                own = checked_recipe(plain, where)
            except RecipeError as error:
                if f"cannot be: {place}:" in str(error):
                    raise
                continue
            whole = keys[key][0] in _OF_PLACE
            wrong = _wrong(own, spec, folder, whole=whole)
            if wrong is None or any(meet(wrong.key, other) for other in others):
                continue
            if meet(wrong.key, keys[key]) or _stands(recipe, folder, whole=whole):
                raise _drawn_wrong(wrong, where, value)
    if spec.difficulty is not None:
        low, high = np.broadcast_to(spec.difficulty.level, 2).tolist()
        if low > high:
            where = ("worlds", "difficulty", "level")
            raise RecipeError(f"{low:g} to {high:g}: the smaller number first", key=where)
        for level in (0.0, 1.0):
            plain = plain_recipe(recipe)
            own = checked_recipe(plain, ("worlds",))
            with_difficulty(plain, own, spec.difficulty, level, varied=keys.values())
            checked_recipe(plain, ("worlds", "difficulty"))
    draw(recipe, 0, folder=folder)  # what is wrong in all of them


def _keys(recipe: Recipe) -> dict[str, Key]:
    """Where in the recipe each key of `worlds.vary` stands."""
    spec, plain = recipe.worlds or WorldsSpec(), plain_recipe(recipe)
    return {key: tuple(numbered(plain, key.split("."))) for key in spec.vary}


def _require_kept(spec: WorldsSpec, keys: dict[str, Key]) -> None:
    """Refuse a key that takes the place of what another has drawn, which no world would have.

    Raises:
        RecipeError: names both.
    """
    order = sorted(keys, key=lambda name: spec.vary[name] == "anywhere")  # placed last of all
    for n, name in enumerate(order):
        for lost in order[:n]:
            if keys[lost][: len(keys[name])] == keys[name]:
                raise RecipeError(
                    f"takes the place of what worlds.vary.{lost} draws: leave one out",
                    key=("worlds", "vary", name),
                )


def _wrong(
    own: Recipe, spec: WorldsSpec, folder: Path, *, whole: bool
) -> RecipeError | DataError | None:
    """Why a world's recipe cannot be; what its terrain model says counts if `whole`."""
    try:
        _require_goals(own, spec.arrival.distance_m)
        plan(own, folder=folder) if whole else draft(own, folder=folder)
    except (RecipeError, DataError) as error:
        return error
    return None


def _stands(recipe: Recipe, folder: Path, *, whole: bool) -> bool:
    """Whether the recipe can be where nothing is drawn."""
    own = checked_recipe(plain_recipe(recipe), ("worlds",))
    return _wrong(own, recipe.worlds or WorldsSpec(), folder, whole=whole) is None


def _drawn_wrong(error: RecipeError | DataError, where: Key, value: Any) -> RecipeError:
    """What is wrong with a world, told at the key that drew the value which makes it so."""
    shown = f"{value:g}" if isinstance(value, float) else json.dumps(value)
    told = f"what is drawn cannot be: {dotted(error.key)}: {error} (drawn: {shown[:_SHOWN]})"
    return RecipeError(told, key=where)


def _due(
    error: RecipeError | DataError,
    recipe: Recipe,
    drawn: dict[str, Any],
    folder: Path,
    level: float | None,
) -> RecipeError | DataError:
    """What is wrong with a drawn world, told at the key of `worlds.vary` to which that is due.

    It is the one that alone makes the recipe wrong, or else the one whose value the error is about.
    Of others the difficulty is told, where without it nothing is wrong.
    """
    for key, value in drawn.items():
        where, plain = ("worlds", "vary", key), plain_recipe(recipe)
        put_value(plain, key, value, where)
        try:
            own = checked_recipe(plain, where)
        except RecipeError as alone:
            return alone
        wrong = _wrong(own, recipe.worlds or WorldsSpec(), folder, whole=True)
        if wrong is not None and _stands(recipe, folder, whole=True):
            return _drawn_wrong(wrong, where, value)
    for key, place in _keys(recipe).items():
        if key in drawn and error.key[: len(place)] == place:
            return _drawn_wrong(error, ("worlds", "vary", key), drawn[key])
    if level is not None and error.key[:1] != ("worlds",) and _stands(recipe, folder, whole=True):
        return type(error)(f"in a world of difficulty {level:.3g}: {error}", key=error.key)
    return error


def variation_line(recipe: Recipe) -> str:
    """What differs among a recipe's worlds, as a line."""
    spec = recipe.worlds or WorldsSpec()
    told = [f"{spec.count:,}, each with a seed of its own"]
    if spec.difficulty is not None:
        low, high = np.broadcast_to(spec.difficulty.level, 2).tolist()
        told.append(f"difficulty {low:g}" + (f" to {high:g}" if high > low else ""))
    for key, wish in spec.vary.items():
        if wish == "anywhere":
            told.append(f"{key} anywhere")
        else:
            kind, values = wish.given
            shown = (f"{v:g}" if isinstance(v, float) else str(v) for v in values)
            told.append(f"{key} {kind} {', '.join(shown)}")
    return "; ".join(told)


def _is_drawn(wish: Variation | Literal["anywhere"], where: Key) -> TypeGuard[Variation]:
    """Whether a key's values are drawn, and not places of the DTM, which only the centre has.

    Raises:
        RecipeError: for a key in which worlds of one series cannot differ.
    """
    part = str(where[-1]).partition(".")[0]
    if part in _OWN:
        raise RecipeError(f"worlds cannot differ in {part}: {_OWN[part]}", key=where)
    if wish == "anywhere" and where[-1] != _CENTRE:
        raise RecipeError(f"only {_CENTRE} can be `anywhere`", key=where)
    return wish != "anywhere"


def _level(spec: DifficultySpec | None, seed: int, number: int) -> float | None:
    if spec is None:
        return None
    if isinstance(spec.level, float | int):
        return float(spec.level)
    low, high = spec.level
    return low + _chance(seed, number, "difficulty") * (high - low)


def _chance(seed: int, number: int, what: str) -> float:
    """An even number in (0, 1) for one thing of one world."""
    return float(uniforms(stage_key(seed, f"worlds/{number}/{what}"), 1)[0])


def _require_goals(own: Recipe, distance: float | None) -> None:
    """Refuse goals so far away that starts in a world's middle would have none within it."""
    east, north = own.dtm.size_m
    most = 0.5 * math.hypot(east, north)
    if distance is not None and distance > most:
        raise RecipeError(
            f"{distance:g} m: at most {most:.4g} m, half the diagonal of a world of {east:g} × "
            f"{north:g} m, lest there is no goal within it",
            key=("worlds", "arrival", "distance_m"),
        )


def _ranked(spec: WorldsSpec, own: Recipe, level: float | None) -> bool:
    """Whether the place is taken by the difficulty."""
    wish = spec.difficulty
    told = any(key.startswith(_CENTRE) for key in spec.vary if spec.vary[key] != "anywhere")
    wanted = wish is not None and wish.place is not None and level is not None
    return wanted and not told and isinstance(own.dtm, RasterDtm)


def _placed(
    own: Recipe, seed: int, number: int, folder: Path, spec: WorldsSpec, level: float | None
) -> tuple[Recipe, Site, dict[str, Any]]:
    """The recipe at a place of its terrain model, the site there, and the place.

    The first of the places that can be planned counts.
    """
    if not isinstance(own.dtm, RasterDtm):
        raise RecipeError(
            f"a dtm of kind {own.dtm.kind} has no other places", key=("worlds", "vary", _CENTRE)
        )
    terrain = _places(own.dtm, own.body, folder)
    drawn = uniforms(stage_key(seed, f"worlds/{number}/place"), PLACES)
    chosen = np.minimum((drawn * len(terrain.place)).astype(np.int64), len(terrain.place) - 1)
    if level is not None and spec.difficulty is not None and spec.difficulty.place is not None:
        rank = between(*spec.difficulty.place, level, logarithmic=False) * (PLACES - 1)
        by_slope = chosen[np.argsort(terrain.slope[chosen], kind="stable")]
        chosen = by_slope[np.argsort(np.abs(np.arange(PLACES) - rank), kind="stable")]
    last: DataError | RecipeError | None = None
    for n in chosen.tolist():
        x, y = terrain.place[n].tolist()
        centre = Centre(crs=(x, y)) if terrain.georeferenced else Centre(offset_m=(x, y))
        there = replace(own, dtm=replace(own.dtm, centre=centre))
        try:
            name = "crs" if terrain.georeferenced else "offset_m"
            return there, plan(there, folder=folder), {name: [x, y]}
        except (DataError, RecipeError) as error:
            if error.key not in _AT_PLACE:
                raise
            last = error
    raise DataError(f"none of {PLACES} places of the DTM can be built: {last}", key=("dtm",))


@lru_cache(maxsize=4)
def _places(spec: RasterDtm, body: str, folder: Path) -> Terrain:
    whole = replace(whole_at_hand(spec, body=BODIES[body]), centre=Centre(offset_m=(0.0, 0.0)))
    return places_of(
        whole,
        body=BODIES[body],
        folder=folder,
        size=spec.size_m,
        levelled=spec.level == "plane",
    )
