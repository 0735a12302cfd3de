"""What a study varies: factors, their levels, and the recipe's keys that they set."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terrain_forge.base import Key, RecipeError
from terrain_forge.recipe import RecipeFile, load_recipe, members, read_mapping
from terrain_forge.rovers import rig_of
from terrain_forge.studies.spec import StudyFile

SEEDS = "seeds"
RECIPE = "recipe"
MOST_LEVELS = 1000
"""Levels of a factor."""
RECORD = "record."
"""Begins the keys of levels that change which part is recorded, not the recipe."""
_UNSET = object()
"""What is nowhere set."""
Changes = tuple[tuple[str, Any], ...]
"""Keys of a recipe, as a study writes them, and their values."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """One of a factor's levels."""

    name: str
    """What tables call it."""
    number: float | None = None
    """Its value, where it is a number."""
    changes: Changes = ()
    """What it sets."""
    recipe: Path | None = None
    """The recipe that it stands for."""


@dataclass(frozen=True, kw_only=True)
class Factor:
    """Something that is varied."""

    name: str
    """What tables call it."""
    levels: tuple[Level, ...]
    """Its levels; the first is what the others are compared with."""


def factors_of(file: StudyFile) -> tuple[Factor, ...]:
    """The factors of a study, that of its recipes first; `seeds` is none of them.

    Raises:
        RecipeError: for levels that are no list or mapping, or that occur twice.
    """
    found = []
    if file.spec.recipes:
        levels = tuple(Level(name=path.stem, recipe=path) for path in file.recipes)
        found.append(Factor(name=RECIPE, levels=levels))
    for name, told in file.spec.study.items():
        if name != SEEDS:
            found.append(Factor(name=name, levels=tuple(_levels(file, name, told))))
    for factor in found:
        names = [level.name for level in factor.levels]
        if twice := {one for one in names if names.count(one) > 1}:
            key = ("study", factor.name) if factor.name != RECIPE else ("recipes",)
            raise RecipeError(f"{file.place(*key)}: {factor.name}: {twice.pop()} is there twice")
    return tuple(found)


def _levels(file: StudyFile, name: str, told: Any) -> Iterator[Level]:
    place = file.place("study", name)
    if isinstance(told, dict) and told:
        for level, changes in told.items():
            if not isinstance(changes, dict):
                raise RecipeError(
                    f"{place}: {name}: level {level!r} must be a mapping of the recipe's keys, "
                    "such as {sun.elevation_deg: 5}; {} changes nothing"
                )
            yield Level(name=str(level), changes=tuple(changes.items()))
    elif isinstance(told, list) and 1 <= len(told) <= MOST_LEVELS:
        for value in told:
            number = float(value) if _is_number(value) else None
            yield Level(name=_shown(value), number=number, changes=((name, value),))
    else:
        raise RecipeError(
            f"{place}: {name}: must be a list of values, or a mapping from names of levels to "
            f"what they set, found {_shown(told)}"
        )


def seeds_of(file: StudyFile, recipe: RecipeFile) -> tuple[int, ...]:
    """The seeds of a recipe's worlds: its own and those after it, or those that are named.

    Raises:
        RecipeError: for what is no number or list of seeds.
    """
    told = file.spec.study.get(SEEDS, 1)
    first = recipe.recipe.seed
    if _is_number(told) and isinstance(told, int) and 1 <= told <= 10_000:
        return tuple(range(first, first + told))
    if isinstance(told, list) and told and len(set(map(str, told))) == len(told):
        if all(isinstance(one, int) and not isinstance(one, bool) and one >= 0 for one in told):
            return tuple(told)
    raise RecipeError(
        f"{file.place('study', SEEDS)}: {SEEDS}: must be how many worlds of each, from 1 to "
        f"10,000, or a list of different seeds, found {_shown(told)}"
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:g}"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."


class Base:
    """A recipe of a study, to which levels are applied.

    Args:
        file: The study.
        path: The recipe's file.
    """

    def __init__(self, file: StudyFile, path: Path) -> None:
        self._file, self.path = file, path
        self._mapping = self._read()
        self._plain = dict(self._mapping[0])
        self._given: list[str] = []
        keys = [*file.spec.set, *_keys_of(file.spec.study)]
        if self._plain.get("sensors") is None and any(k.startswith("sensors.") for k in keys):
            whole = load_recipe(path)
            rig = rig_of(whole.recipe.rover, whole.folder)
            self._plain["sensors"] = rig
            self._given.append(f"sensors={json.dumps(rig)}")
        for key, value in file.spec.set.items():
            self._given += self._written(key, value)
        self.whole = self._loaded(self._given, "set")

    def _read(self) -> tuple[dict[str, Any], Any]:
        """The recipe's data and lines; one that is not there is the study's fault."""
        try:
            return read_mapping(self.path)
        except RecipeError as error:
            if self.path.exists():
                raise
            key = ("recipes", self._file.recipes.index(self.path))
            place = self._file.place(*(key if self._file.spec.recipes else ("recipe",)))
            raise RecipeError(f"{place}: {error}") from None

    def recipe(self, factors: Mapping[str, Level], seed: int) -> tuple[RecipeFile, tuple[str, ...]]:
        """The recipe at some levels, and the changes that made it of its file.

        Raises:
            RecipeError: names the factor's line, also where it undoes what another one sets.
        """
        told = [("set", *change) for change in self._file.spec.set.items()]
        told += [(SEEDS, "seed", seed)] * (SEEDS in self._file.spec.study)
        told += [(name, *one) for name, level in factors.items() for one in level.changes]
        self._require_kept(told)
        changes, ends = [*self._given, f"seed={seed}"], {}
        for name, level in factors.items():
            for key, value in level.changes:
                if key.partition(".")[0] == "exports":
                    raise RecipeError(
                        f"{self._file.place('study', name)}: {key}: must not differ: nothing that "
                        "a study measures hangs on exports"
                    )
                if not key.startswith(RECORD):
                    changes += self._written(key, value)
            ends[name] = len(changes)
        try:
            return load_recipe(self.path, changes=tuple(changes), mapping=self._mapping), tuple(
                changes
            )
        except RecipeError:
            for name, end in ends.items():  # which is it whose level cannot be?
                self._loaded(changes[:end], "study", name)
            return self._loaded(changes, "study"), tuple(changes)

    def _loaded(self, changes: list[str], *key: str) -> RecipeFile:
        try:
            return load_recipe(self.path, changes=tuple(changes), mapping=self._mapping)
        except RecipeError as error:
            if not changes:  # the recipe itself is wrong
                raise
            why = str(error).removeprefix(f"{self.path}:").removeprefix("--set ")
            told = f"{self._file.place(*key)}: {key[-1]}: {self.path.name}: {why}"
            raise RecipeError(told) from None

    def _require_kept(self, changes: Iterable[tuple[str, str, Any]]) -> None:
        """Refuse changes, each of a factor or `set`, of which a later one undoes an earlier one."""
        held: list[tuple[str, str, Key, Any]] = []
        for name, key, value in changes:
            places = self._places(key)
            for place in places:
                for other, its, end, was in held:
                    inside = end[: len(place)] == place and other != name
                    if inside and dict(_ends(value)).get(end[len(place) :], _UNSET) != was:
                        what = f"both set {key}" if key == its else f"set {key} and {its}"
                        raise RecipeError(
                            f"{self._file.place('study', name)}: {name!r} and {other!r} {what}, of "
                            "which one would win: leave it to one of them"
                        )
            held += [(name, key, (*p, *end), v) for p in places for end, v in _ends(value)]

    def _written(self, key: str, value: Any) -> list[str]:
        """A change as the command line writes it, once for each place that a key names."""
        text = json.dumps(value)
        return [f"{'.'.join(map(str, place))}={text}" for place in self._places(key)]

    def _places(self, key: str) -> list[Key]:
        """The places that a key names."""
        words = tuple(key.replace("[", ".").replace("]", "").split("."))
        if not all(words):
            place = self._file.place("study", key)
            raise RecipeError(f"{place}: {key!r} must be a recipe's key, such as sun.elevation_deg")
        return places_of(self._plain, words)


def _ends(value: Any) -> Iterator[tuple[Key, Any]]:
    """The places of single values within a value, and these."""
    inner = _children(value)
    for step, child in inner:
        for rest, end in _ends(child):
            yield (step, *rest), end
    if not inner:
        yield (), value


def _keys_of(study: Mapping[str, Any]) -> Iterator[str]:
    for name, told in study.items():
        yield name
        for changes in told.values() if isinstance(told, dict) else ():
            yield from changes if isinstance(changes, dict) else ()


def places_of(plain: Any, words: tuple[str, ...]) -> list[Key]:
    """The places in a recipe that a key names; where it is not there yet, where it would be.

    An element of a list is named by its number or its `name`; a step that is not there is looked
    for below, so that `rocks.k` is each k of the rocks.
    """
    found = _found(plain, words)
    known = len(words)
    while not found:
        known -= 1
        rest = words[known:]
        found = [(*place, *rest) for place in _found(plain, words[:known])]
    return list(dict.fromkeys(found))


def _found(node: Any, words: tuple[str, ...]) -> list[Key]:
    """Places of a key that is there, as written or else below."""
    if not words:
        return [()]
    exact = [
        (step, *rest) for step, child in _steps(node, words[0]) for rest in _found(child, words[1:])
    ]
    return exact or [
        (step, *rest) for step, child in _children(node) for rest in _found(child, words)
    ]


def _steps(node: Any, word: str) -> list[tuple[str | int, Any]]:
    """The children of a node that a word names."""
    if isinstance(node, dict):
        return [(word, node[word])] if word in node else []
    return [(n, node[n]) for n in members(node, word)] if isinstance(node, list) else []


def _children(node: Any) -> list[tuple[str | int, Any]]:
    if isinstance(node, dict):
        return list(node.items())
    return list(enumerate(node)) if isinstance(node, list) else []
