"""The file of a study: which recipes, what is varied, what is recorded, who is evaluated."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Interval, MinLen

from terrain_forge.base import DataError, FileName, Key, RecipeError, Spec, complaint
from terrain_forge.evaluation import (
    Adapter,
    ScoreOptions,
    find_system,
    require_program,
    with_binaries,
)
from terrain_forge.recipe import read_mapping


@dataclass(frozen=True, kw_only=True)
class RecordSpec(Spec):
    """Which part of each recording is made."""

    from_s: Annotated[float, Ge(0)] = 0.0
    """From when [s]."""
    to_s: Annotated[float, Gt(0)] | None = None
    """Until when [s]; to the end, if left out."""
    only: tuple[str, ...] = ()
    """Names of the sensors; all that the systems can use, if left out."""


@dataclass(frozen=True, kw_only=True)
class StudySpec(Spec):
    """A study: what is varied, and what is measured."""

    about: str = ""
    """What it asks; stands above its tables."""
    recipe: str = ""
    """The recipe's file, relative to the study's."""
    recipes: tuple[str, ...] = ()
    """Or several of them, which are a factor of their own."""
    set: dict[str, Any] = field(default_factory=dict)
    """Keys of the recipe that differ in all of it."""
    study: dict[str, Any] = field(default_factory=dict)
    """The factors: by a recipe's key a list of its levels; or by any name a mapping from levels to
    the keys that they set; and `seeds`: how many worlds of each, or which seeds."""
    design: Literal["all", "each"] = "all"
    """`all`: each level with each of all other factors; `each`: one factor at a time, the others
    at their first level."""
    record: RecordSpec = RecordSpec()
    """Which part is recorded."""
    systems: Annotated[tuple[str, ...], MinLen(1)]
    """Names of systems, or their files relative to the study's."""
    binaries: dict[FileName, str] = field(default_factory=dict)
    """Programs that the user has, by the names of systems."""
    trust: bool = False
    """Whether the programs of `binaries` and of the systems' files may run, which can do anything
    that their user can. Systems that are known by name need no such word."""
    runs: Annotated[int, Interval(ge=1, le=100)] = 1
    """How often each system is run on a recording."""
    score: ScoreOptions = field(default_factory=ScoreOptions)
    """What is free in the scores."""
    keep: bool = False
    """Whether the recordings are kept; else each is removed when its systems were evaluated."""


@dataclass(frozen=True, kw_only=True)
class StudyFile:
    """A study and where its parts stand."""

    path: Path
    """The file."""
    spec: StudySpec
    """What it says."""
    lines: Mapping[Key, int | str]
    """Lines of its keys."""
    systems: tuple[Adapter, ...]
    """The systems."""

    @property
    def name(self) -> str:
        """The study's name: the file's."""
        return self.path.stem

    @property
    def recipes(self) -> tuple[Path, ...]:
        """Files of its recipes."""
        told = self.spec.recipes or (self.spec.recipe,)
        return tuple(self.path.parent / one for one in told)

    def place(self, *key: str | int) -> str:
        """File and line of a key, for messages."""
        while key and key not in self.lines:
            key = key[:-1]
        return f"{self.path}:{self.lines[key]}" if key else str(self.path)


def shipped_studies() -> dict[str, Path]:
    """The studies that ship, by name."""
    folder = files("terrain_forge.recipes.studies")
    return {path.stem: path for path in sorted(Path(str(folder)).glob("*.yaml"))}


def read_study(path: Path | str, *, trust: bool = False) -> StudyFile:
    """Read and check the file of a study.

    Args:
        path: The file, or the name of one that ships.
        trust: Whether the programs that it names may run, as its own `trust: true` says.

    Raises:
        RecipeError: `file:line: key: what was found, what is allowed`.
    """
    from pydantic import TypeAdapter, ValidationError

    path = Path(path)
    if not path.exists() and str(path) in shipped_studies():
        path = shipped_studies()[str(path)]
    data, lines = read_mapping(path, what="a study")
    adapter = TypeAdapter(StudySpec)
    try:
        spec = adapter.validate_json(json.dumps(data), strict=True)
    except (TypeError, ValueError) as error:
        if not isinstance(error, ValidationError):
            raise RecipeError(f"{path}: {error}") from None
        told = complaint(error, adapter, data)
        file = StudyFile(path=path, spec=None, lines=lines, systems=())  # type: ignore[arg-type]
        raise RecipeError(f"{file.place(*told.key)}: {told}") from None
    file = StudyFile(path=path, spec=spec, lines=lines, systems=())
    if bool(spec.recipe) == bool(spec.recipes):
        raise RecipeError(f"{path}: a study has a `recipe`, or a list of `recipes`")
    if not trust and not spec.trust:
        _require_no_programs(file)
    begin, end = spec.record.from_s, spec.record.to_s
    if end is not None and end <= begin:
        raise RecipeError(
            f"{file.place('record', 'to_s')}: record.to_s: {end:g} s, must be after from_s, "
            f"{begin:g} s"
        )
    try:
        found = [_system(name, path.parent) for name in spec.systems]
        binaries = [f"{name}={place}" for name, place in spec.binaries.items()]
        systems = tuple(with_binaries(found, binaries))
        for system in filter(lambda one: one.binary, systems):
            require_program(system)
    except DataError as error:
        raise RecipeError(f"{file.place('systems')}: systems: {error}") from None
    return StudyFile(path=path, spec=spec, lines=lines, systems=systems)


def _require_no_programs(file: StudyFile) -> None:
    """Refuse a study that names programs, which would run by the name of the study alone.

    Raises:
        RecipeError: says at which key.
    """
    own = {"systems": next(filter(_is_file, file.spec.systems), "")}
    own["binaries"] = next(iter(file.spec.binaries.values()), "")
    for key, name in own.items():
        if name:
            raise RecipeError(
                f"{file.place(key)}: {key}: {name} would run a program that the study brings: look "
                "at it, then say `trust: true` in the study, or --trust"
            )


def _is_file(name: str) -> bool:
    return name.endswith((".yaml", ".yml"))


def _system(name: str, folder: Path) -> Adapter:
    return find_system(str(folder / name) if _is_file(name) else name)
