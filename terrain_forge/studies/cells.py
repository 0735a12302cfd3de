"""The cells of a study: a recipe at some levels with a seed, and what is done with it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache, cached_property
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

from terrain_forge.base import OutputError, RecipeError, complaint, type_adapter
from terrain_forge.evaluation import Adapter
from terrain_forge.recipe import RecipeFile, input_paths, recipe_json
from terrain_forge.recipe import sha256 as digest_of
from terrain_forge.studies.factors import RECIPE, RECORD, Base, Factor, Level, factors_of, seeds_of
from terrain_forge.studies.spec import RecordSpec, StudyFile

VERSION = 2
"""Raised when results of older cells are no longer comparable."""
MOST_CELLS = 100_000


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A world to be recorded and evaluated."""

    levels: tuple[tuple[str, str], ...]
    """Its level of each factor."""
    seed: int
    """Seed of its world."""
    recipe: RecipeFile
    """Its recipe."""
    told: str = ""
    """File and line that say what is recorded, for messages."""
    job: dict[str, Any]
    """All that it takes to make it, as JSON values."""

    @cached_property
    def digest(self) -> str:
        """Names what comes out of it: cells of one are alike."""
        told = {key: value for key, value in self.job.items() if key not in _PLACES}
        return sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:12]

    @property
    def title(self) -> str:
        """What tables call it."""
        return ", ".join([*(f"{name} {level}" for name, level in self.levels), f"seed {self.seed}"])


_PLACES = "path", "changes", "keep", "workers"
"""What of a job does not change what comes out of it."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study with its cells."""

    file: StudyFile
    """Its file."""
    factors: tuple[Factor, ...]
    """What is varied."""
    cells: tuple[Cell, ...]
    """Its cells."""


def study_of(file: StudyFile) -> Study:
    """The cells of a study, each of whose recipes was read and checked.

    Raises:
        RecipeError: names file, line and factor.
    """
    factors = factors_of(file)
    bases: dict[Path, Base] = {}
    found: list[Cell] = []
    for levels in _combined(factors, file.spec.design):
        path = levels[RECIPE].recipe if RECIPE in levels else file.recipes[0]
        assert path is not None
        if path not in bases:
            bases[path] = Base(file, path)
        base = bases[path]
        for seed in seeds_of(file, base.whole):
            found.append(_cell(file, base, levels, seed))
            if len(found) > MOST_CELLS:
                raise OutputError(f"{file.path}: more than {MOST_CELLS:,} cells")
    return Study(file=file, factors=factors, cells=tuple(found))


def _combined(factors: tuple[Factor, ...], design: str) -> Iterator[dict[str, Level]]:
    """The levels of each cell's factors."""
    if design == "all":
        for levels in product(*(factor.levels for factor in factors)):
            yield {factor.name: level for factor, level in zip(factors, levels, strict=True)}
        return
    first = {factor.name: factor.levels[0] for factor in factors}
    yield first
    for factor in factors:
        for level in factor.levels[1:]:
            yield {**first, factor.name: level}


def _cell(file: StudyFile, base: Base, levels: Mapping[str, Level], seed: int) -> Cell:
    recipe, changes = base.recipe(levels, seed)
    spec = file.spec
    job = {
        "version": VERSION,
        "path": str(base.path.resolve()),
        "changes": changes,
        "recipe": json.loads(recipe_json(recipe.recipe)),
        "inputs": [_digest(path) for path in input_paths(recipe.recipe, recipe.folder)],
        "record": plain_of(_record(file, levels)),
        "systems": [plain_of(adapter) for adapter in file.systems],
        "runs": spec.runs,
        "score": plain_of(spec.score),
        "keep": spec.keep,
    }
    named = tuple((name, level.name) for name, level in levels.items())
    setters = [n for n, level in levels.items() if f"{RECORD}only" in dict(level.changes)]
    told = file.place("study", setters[-1]) if setters else file.place("record", "only")
    return Cell(levels=named, seed=seed, recipe=recipe, told=told, job=job)


def _record(file: StudyFile, levels: Mapping[str, Level]) -> RecordSpec:
    """Which part is recorded at some levels."""
    from pydantic import ValidationError

    spec, adapter = file.spec.record, type_adapter(RecordSpec)
    for name, level in levels.items():
        told = {k.removeprefix(RECORD): v for k, v in level.changes if k.startswith(RECORD)}
        plain = plain_of(spec) | told
        try:
            spec = adapter.validate_json(json.dumps(plain), strict=True)
        except ValidationError as error:
            why = complaint(error, adapter, plain)
            raise RecipeError(f"{file.place('study', name)}: {name}: {RECORD}{why}") from None
    return spec


@cache
def _digest(path: Path) -> str:
    return digest_of(path) if path.is_file() else ""


def plain_of(spec: Any) -> dict[str, Any]:
    """A spec's fields that differ from their defaults, as JSON values.

    So a field that a later version adds leaves the names of cells as they are.
    """
    found = {}
    for one in fields(spec):
        value = getattr(spec, one.name)
        default = one.default_factory() if one.default_factory is not MISSING else one.default
        if value != default:
            found[one.name] = list(value) if isinstance(value, tuple) else value
    return found


def adapter_of(plain: Mapping[str, Any]) -> Adapter:
    """The system of `plain_of`."""
    told: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in plain.items()}
    return Adapter(**told)
