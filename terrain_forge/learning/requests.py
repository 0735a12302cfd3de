"""What a learner may ask of an environment, and the worlds that it then gets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    NonNegativeInt,
    Strict,
    TypeAdapter,
    ValidationError,
)

from terrain_forge.base import Fraction, OutputError, Positive, complaint
from terrain_forge.variation import ORDER, read_summary, worlds_in

_SHOWN = 5
"""Worlds that are not there that a message names."""


def _plain(given: Any) -> Any:
    """One of NumPy's numbers as one of Python's."""
    return given.item() if isinstance(given, np.generic) else given


def _named(given: Any) -> Any:
    """What names a world."""
    plain = _plain(given)
    if isinstance(plain, str) or plain is None or (type(plain) is int and plain >= 0):
        return plain
    raise ValueError("must be a whole number from 0 on or a folder's name")


def _ascending(levels: tuple[float, float]) -> tuple[float, float]:
    """Two difficulties, the least first."""
    if levels[0] > levels[1]:
        raise ValueError("must have the least first")
    return levels


_Number = Annotated[NonNegativeInt, Strict(), BeforeValidator(_plain)]
"""A world's number, also one of NumPy's; no truth value, as a mask would have."""


_Length = Annotated[Positive, Strict(), BeforeValidator(_plain)]
_Level = Annotated[Fraction, Strict(), BeforeValidator(_plain)]
Difficulty = Annotated[tuple[_Level, _Level], AfterValidator(_ascending)] | None
"""Between which difficulties; None for all."""


@dataclass(frozen=True, kw_only=True)
class Wished:
    """Which worlds are wished."""

    difficulty: Difficulty


@dataclass(frozen=True, kw_only=True)
class Arguments(Wished):
    """What an environment may be asked for."""

    worlds: Path | None
    numbers: tuple[_Number, ...] | None
    distance_m: _Length
    speed_m_s: _Length
    sight: Literal["heights", "depth", "none"]
    render_mode: Literal["rgb_array"] | None


@dataclass(frozen=True, kw_only=True)
class Reset:
    """What a reset may be asked for."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")
    world: Annotated[int | str | None, BeforeValidator(_named)] = None


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a reset is given."""

    options: Reset


def require_request(kind: type, given: Any) -> None:
    """Refuse arguments by name, in a line.

    Raises:
        ValueError: if they cannot be.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(kind)
    try:
        adapter.validate_python(given)
    except ValidationError as error:
        raise ValueError(str(complaint(error, adapter, given))) from None


def folders_of(worlds: Path, numbers: Sequence[int] | None) -> tuple[Path, ...]:
    """Folders of the worlds of some numbers; of all without any.

    Raises:
        OutputError: if there is none, or one of these numbers is not there.
    """
    if not (worlds / ORDER).is_file():
        raise OutputError(f"{worlds} holds no worlds (no {ORDER}): terrain-forge worlds makes them")
    found = worlds_in(worlds)
    if numbers is not None:
        wanted = {f"{number:05}" for number in numbers}
        if gone := sorted(wanted - {path.name for path in found}, key=int):
            named = ", ".join(gone[:_SHOWN]) + ", …" * (len(gone) > _SHOWN)
            have = f"{len(found)}, {found[0].name} to {found[-1].name}" if found else "none"
            raise OutputError(f"numbers: {worlds} has no world {named}; it has {have}")
        found = tuple(path for path in found if path.name in wanted)
    if not found:
        raise OutputError(f"{worlds} has no worlds" if numbers is None else "numbers: none given")
    return tuple(path.resolve() for path in found)


def require_one_rover(folders: tuple[Path, ...]) -> None:
    """Refuse worlds of several rovers, whose actions and observations are not alike.

    Raises:
        OutputError: names the first of another.
    """
    names = [str(read_summary(folder).get("rover", "")) for folder in folders]
    if other := next((n for n, name in enumerate(names) if name != names[0]), 0):
        raise OutputError(
            f"{folders[other]} has the rover {names[other]!r}, {folders[0].name} has {names[0]!r}: "
            "give `numbers` of worlds with one, which worlds.csv tells"
        )


def of_difficulty(folders: tuple[Path, ...], between: tuple[float, float]) -> tuple[Path, ...]:
    """Those whose wished difficulty lies between two.

    Raises:
        OutputError: if there is none.
    """
    low, high = between
    levels = {path: read_summary(path)["difficulty"] for path in folders}
    told = sorted(level for level in levels.values() if level is not None)
    found = [path for path in folders if (one := levels[path]) is not None and low <= one <= high]
    if not found:
        have = f"{told[0]:.3g} to {told[-1]:.3g}" if told else "none"
        raise OutputError(
            f"{folders[0].parent} has no worlds of difficulty {low:g} to {high:g}: theirs is {have}"
        )
    return tuple(found)
