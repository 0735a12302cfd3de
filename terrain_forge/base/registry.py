"""Finding what can be plugged in: modules in a folder of ours, and those of other packages.

A kind of part (a layer, a size law, …) is a class with a literal `kind`; a body is a value with a
name. Adding one is adding a module to our folder of that kind, or naming a module of another
package by an entry point.
"""

from __future__ import annotations

import logging
import pkgutil
import traceback
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, distributions, entry_points
from types import ModuleType
from typing import Any, TypeVar

_OURS = "terrain_forge"
_log = logging.getLogger(__name__)
_Part = TypeVar("_Part")


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
            twin = _what(group), point.name, point.value, first.value
            _log.warning("%s %r of %s is skipped: %s has that name", *twin)
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


def plugin_at_fault(error: BaseException) -> str:
    """The plugin whose code raised an error or called what did, and where; empty if it was ours."""
    points = [point for package in distributions() for point in package.entry_points]
    foreign = [point for point in points if point.group.startswith(f"{_OURS}.")]
    ends = {part: p for p in foreign for part in (p.module.partition(".")[0], p.module)}
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        module = str(frame.f_globals.get("__name__", ""))
        package = module.partition(".")[0]
        if package == _OURS:
            return ""
        if point := ends.get(module) or ends.get(package):
            return f"{_what(point.group)} {point.name!r} ({module}, line {line})"
    return ""


def parts(
    base: type[_Part], folder: str, group: str, *, taken: Iterable[str] = ()
) -> tuple[type[_Part], ...]:
    """All installed subclasses of a base class, in the order of their names.

    They tell themselves apart by their class attribute `kind`. Modules of our package `folder` and
    those that entry points of a group name define some; ours keep their kinds, `taken` are ours
    though no module has them.
    """

    def wanted(member: object) -> bool:
        return isinstance(member, type) and issubclass(member, base) and hasattr(member, "kind")

    named = [
        (str(vars(member).get("kind", member.__name__)), member, member.__module__)
        for member, _ in _members(folder, group, base, wanted)
    ]
    found = _first_of_each(group, "kind", named, taken)
    return tuple(sorted(found.values(), key=lambda part: part.__name__))


def values(base: type[_Part], folder: str, group: str) -> tuple[_Part, ...]:
    """All installed values of a class, found as by `parts`, in the order of their `name`."""
    members = _members(folder, group, base, lambda member: isinstance(member, base))
    found = _first_of_each(group, "name", [(one.name, one, module) for one, module in members])
    return tuple(found[name] for name in sorted(found))


def _members(
    folder: str, group: str, base: type, wanted: Callable[[object], bool]
) -> Iterator[tuple[Any, str]]:
    """What modules of our folder bring, then those of other packages that can be imported."""
    names = [m.name for m in pkgutil.iter_modules(import_module(folder).__path__, f"{folder}.")]
    modules: list[tuple[ModuleType, EntryPoint | None]] = [(import_module(n), None) for n in names]
    points = sorted(set(entry_points(group=group)), key=_precedence)
    modules += [(module, point) for point in points if (module := load_plugin(point, group))]
    for module, point in modules:
        members = [member for member in vars(module).values() if wanted(member)]
        if point is not None and not members:
            skip_plugin(point, group, f"has no {base.__name__}")
        yield from ((member, module.__name__) for member in members)


def _first_of_each(
    group: str, what: str, named: list[tuple[str, Any, str]], taken: Iterable[str] = ()
) -> dict[str, Any]:
    """The first of each name, but for names that are taken; warns of the others."""
    found: dict[str, tuple[Any, str]] = {name: (None, "terrain_forge") for name in taken}
    for name, member, module in named:
        first, where = found.setdefault(name, (member, module))
        if first is not member:
            twin = _what(group), name, module, where, what
            _log.warning("%s %r of %s is skipped: %s has that %s", *twin)
    return {name: first for name, (first, _) in found.items() if first is not None}


def _what(group: str) -> str:
    word = group.rpartition(".")[2].replace("_", " ")
    return f"{word[:-3]}y" if word.endswith("ies") else word.removesuffix("s")


def _precedence(point: EntryPoint) -> tuple[bool, str]:
    return not point.value.startswith("terrain_forge."), point.value
