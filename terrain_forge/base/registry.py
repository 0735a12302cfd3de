"""Finding what can be plugged in: modules in a folder of ours, and those of other packages.

A kind of part (a layer, a size law, …) is a class with a literal `kind`; a body is a value with a
name. Adding one is adding a module to our folder of that kind, or naming a module of another
package by an entry point.
"""

from __future__ import annotations

import logging
import pkgutil
from collections.abc import Iterable, Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Protocol, TypeVar

_log = logging.getLogger(__name__)
_Part = TypeVar("_Part")


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_Value = TypeVar("_Value", bound=_Named)


@cache
def plugins(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by their names, of which each has one.

    Where several packages give one name, ours has it, or else the first by its module's name; the
    others are skipped with a warning.
    """
    found: dict[str, EntryPoint] = {}
    for point in sorted(set(entry_points(group=group)), key=_precedence):
        first = found.setdefault(point.name, point)
        if first.value != point.value:
            _log.warning(
                "%s %r of %s is skipped: %s has that name",
                _what(group), point.name, point.value, first.value,
            )  # fmt: skip
    return found


def load_plugin(point: EntryPoint, group: str) -> ModuleType | None:
    """The module that an entry point names; None, with a warning, where it cannot be imported."""
    try:
        return import_module(point.module)
    except Exception as error:  # whatever a foreign package raises must not break ours
        skip_plugin(point, group, " ".join(str(error).split()) or type(error).__name__)
        return None


def skip_plugin(point: EntryPoint, group: str, why: str) -> None:
    """Warn that a plugin is skipped."""
    _log.warning("%s %r (%s) is skipped: %s", _what(group), point.name, point.value, why)


def parts(
    base: type[_Part], folder: str, group: str, *, taken: Iterable[str] = ()
) -> tuple[type[_Part], ...]:
    """All installed subclasses of a base class, in the order of their names.

    Args:
        base: the base class; subclasses tell themselves apart by their class attribute `kind`.
        folder: our package, each of whose modules defines some.
        group: entry points that name modules of other packages. Ours keep their kinds.
        taken: kinds that are ours, though no module of the folder has them.
    """
    found: dict[str, type[_Part]] = {}
    for module, point in _modules(folder, group):
        members = [
            member
            for member in vars(module).values()
            if isinstance(member, type) and issubclass(member, base) and hasattr(member, "kind")
        ]
        _require_some(members, base, point, group)
        for member in members:
            kind = str(vars(member).get("kind", member.__name__))
            if kind in taken:
                _warn_of_twin(group, "kind", kind, member.__module__, "terrain_forge")
                continue
            first = found.setdefault(kind, member)
            if first is not member:
                _warn_of_twin(group, "kind", kind, member.__module__, first.__module__)
    return tuple(sorted(found.values(), key=lambda part: part.__name__))


def values(base: type[_Value], folder: str, group: str) -> tuple[_Value, ...]:
    """All installed values of a class, each with a `name`, in the order of these.

    Args:
        base: the class.
        folder: our package, each of whose modules defines some.
        group: entry points that name modules of other packages. Ours keep their names.
    """
    found: dict[str, tuple[_Value, str]] = {}
    for module, point in _modules(folder, group):
        members = [member for member in vars(module).values() if isinstance(member, base)]
        _require_some(members, base, point, group)
        for member in members:
            first, where = found.setdefault(member.name, (member, module.__name__))
            if first is not member:
                _warn_of_twin(group, "name", member.name, module.__name__, where)
    return tuple(found[name][0] for name in sorted(found))


def _modules(folder: str, group: str) -> list[tuple[ModuleType, EntryPoint | None]]:
    """The modules of our folder, then those of other packages that can be imported."""
    names = [m.name for m in pkgutil.iter_modules(import_module(folder).__path__, f"{folder}.")]
    points = sorted(set(entry_points(group=group)), key=_precedence)
    others = [(module, point) for point in points if (module := load_plugin(point, group))]
    return [*((import_module(name), None) for name in names), *others]


def _require_some(
    members: Sequence[object], base: type, point: EntryPoint | None, group: str
) -> None:
    """Warn of another package's module that brings nothing."""
    if point is not None and not members:
        skip_plugin(point, group, f"has no {base.__name__}")


def _warn_of_twin(group: str, what: str, name: str, module: str, first: str) -> None:
    _log.warning("%s %r of %s is skipped: %s has that %s", _what(group), name, module, first, what)


def _what(group: str) -> str:
    word = group.rpartition(".")[2].replace("_", " ")
    return f"{word[:-3]}y" if word.endswith("ies") else word.removesuffix("s")


def _precedence(point: EntryPoint) -> tuple[bool, str]:
    return not point.value.startswith("terrain_forge."), point.value
