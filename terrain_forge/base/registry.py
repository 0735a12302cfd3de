"""Finding what can be plugged in: modules in a folder of ours, and those of other packages.

A kind of part (a layer, a size law, …) is a class with a literal `kind`; a body is a value with a
name. Adding one is adding a module to our folder of that kind, or naming a module of another
package by an entry point.
"""

from __future__ import annotations

import errno
import inspect
import logging
import os
import pkgutil
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from functools import cache
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from terrain_forge.base.errors import DISK_FULL, PluginError, TerrainForgeError
from terrain_forge.base.specs import Spec

_OURS = "terrain_forge"
_log = logging.getLogger(__name__)
_Part = TypeVar("_Part")
_skipped: dict[tuple[str, str, str], list[str]] = {}
"""Why something of a plugin is skipped, by its group, name and value."""
_brought: dict[tuple[str, str, str], dict[str, None]] = {}
"""What a plugin brings, by its group, name and value."""
_asked: set[str] = set()
"""Groups in which something was looked for."""

_PLAIN = {f"ClassVar[{kind.__name__}]": kind for kind in (str, int)}
"""Types of class attributes that are looked at, as bases write them."""

FOREIGN_FAILURES = (Exception, SystemExit)
"""What code of other packages may raise; an exit of theirs must not end ours as if all was done."""


@cache
def plugins(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by their names, of which each has one.

    Where several packages give one name, ours has it, or else the first by its module's name; the
    others are skipped with a warning.
    """
    _asked.add(group)
    found: dict[str, EntryPoint] = {}
    for point in sorted(set(entry_points(group=group)), key=_precedence):
        first = found.setdefault(point.name, point)
        if first.value != point.value:
            _skip_twin(point, group, point.name, point.value, f"{first.value} has that name")
    return found


def load_plugin(point: EntryPoint, group: str) -> ModuleType | None:
    """The module that an entry point names; None, with a warning, where it cannot be imported.

    What it prints meanwhile goes where warnings do, not among what a command says.
    """
    try:
        with redirect_stdout(sys.stderr), staying("as it is imported it"):
            return import_module(point.module)
    except FOREIGN_FAILURES as error:  # whatever a foreign package raises must not break ours
        skip_plugin(point, group, failure_words(error))
        return None


def skip_plugin(point: EntryPoint, group: str, why: str) -> None:
    """Warn, once, that a plugin or one of its parts is skipped."""
    if _is_new(point, group, why):
        _log.warning("%s %r (%s) is skipped: %s", _what(group), point.name, point.value, why)


def skipped(point: EntryPoint, group: str) -> tuple[str, ...]:
    """Why a plugin, or parts of it, were skipped so far."""
    if group not in _asked:
        return (f"nothing is looked for in {group}",)
    return tuple(_skipped.get((group, point.name, point.value), ()))


def their_plugins() -> tuple[tuple[str, EntryPoint], ...]:
    """All plugins of other packages, each after what it is (`layer`), in that order."""
    found = {point for group in entry_points().groups for point in _theirs(group)}
    return tuple(sorted((_what(point.group), point) for point in found))


@cache
def their_packages() -> dict[str, str]:
    """Versions of the installed packages with parts for us, by the packages' names.

    Of several that are installed of one, that which is imported; none of what tells no version.
    """
    points = (point for group in entry_points().groups for point in _theirs(group))
    packages = {point.dist for point in points if point.dist is not None}
    return dict(sorted(found for one in packages if (found := _release(one))))


def _release(package: Distribution) -> tuple[str, str] | None:
    """Name and version of a package; None if it does not tell them."""
    try:  # what finders of other packages find may raise anything here
        return (package.name, package.version) if package.version else None
    except FOREIGN_FAILURES:
        return None


def _theirs(group: str) -> list[EntryPoint]:
    points = entry_points(group=group) if group.startswith(f"{_OURS}.") else ()
    return [point for point in points if not point.value.startswith(f"{_OURS}.")]


@contextmanager
def returning(part: object, what: str, allowed: str) -> Iterator[None]:
    """Judge what code of another package returns: within it any error is one of that code.

    Args:
        part: A part, or an exporter's module.
        what: What is called, such as "layer 'dykes'" and its method.
        allowed: What it may return.

    Raises:
        PluginError: in place of what is raised by who cannot use what was returned. An error in
            the plugin's own lines goes on, see `plugin_at_fault`, and so do ours.
    """
    module = part.__name__ if isinstance(part, ModuleType) else type(part).__module__
    try:
        with nullcontext() if is_ours(module) else staying(f"{what} ({module})"):
            yield
    except TerrainForgeError:
        raise
    except Exception as error:
        if is_ours(module) or _raised_within(module, error):
            raise
        found = failure_words(error)
        raise PluginError(f"{what} ({module}) must return {allowed}: {found}") from error


@contextmanager
def staying(who: str) -> Iterator[None]:
    """Refuse code of another package that changes the current folder; we are there again then.

    In another thread than the first nobody is refused: who went away there is not known.

    Raises:
        PluginError: says who, but for an error of that code, which goes on.
    """
    first = threading.current_thread() is threading.main_thread()
    here = _current() if first else ""
    try:
        yield
    except BaseException:
        _return_to(here)
        raise
    if _return_to(here):
        raise PluginError(f"{who} changed the current folder")


def _return_to(folder: str) -> bool:
    """Go back to a folder; whether we were elsewhere."""
    if not folder or _current() == folder:
        return False
    with suppress(OSError):  # it may be gone
        os.chdir(folder)
    return True


def _current() -> str:
    try:
        return str(Path.cwd())
    except FileNotFoundError:  # it is gone
        return ""


def _raised_within(module: str, error: BaseException) -> bool:
    """Whether code of a module's package raised an error or called what did, and none of ours."""
    package = module.partition(".")[0]
    for frame, _ in reversed(list(traceback.walk_tb(error.__traceback__))):
        name = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if name in (_OURS, package):
            return name == package
    return False


def is_ours(module: str) -> bool:
    """Whether a module of that name is of this package."""
    return module.partition(".")[0] == _OURS


def failure_words(error: BaseException) -> str:
    """What an error says, in one line; its kind where it says nothing."""
    if isinstance(error, SystemExit):
        return f"it would end the process (SystemExit: {error})"
    return " ".join(str(error).split()) or type(error).__name__


def place_of(part: type, error: BaseException) -> str:
    """The module of a part, with the line of its package at which an error was raised."""
    package = part.__module__.partition(".")[0]
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        module = str(frame.f_globals.get("__name__", ""))
        if module.partition(".")[0] == package:
            return f"{module}, line {line}"
    return part.__module__


def brought(point: EntryPoint) -> tuple[str, ...]:
    """The kinds or names that a plugin has brought so far, by which it is used."""
    return tuple(_brought.get((point.group, point.name, point.value), ()))


def _is_new(point: EntryPoint, group: str, why: str) -> bool:
    """Whether that is not known of the plugin; it is then."""
    known = _skipped.setdefault((group, point.name, point.value), [])
    if why in known:
        return False
    known.append(why)
    return True


def _skip_twin(point: EntryPoint, group: str, name: str, module: str, why: str) -> None:
    if _is_new(point, group, f"{name!r}: {why}"):
        _log.warning("%s %r of %s is skipped: %s", _what(group), name, module, why)


def plugin_at_fault(error: BaseException) -> str:
    """The plugin whose code raised an error or called what did, where and why.

    It is empty for our code, and for what the disk is to blame for.
    """
    if getattr(error, "errno", None) in (*DISK_FULL, errno.EIO):
        return ""
    points = [point for package in distributions() for point in package.entry_points]
    foreign = [point for point in points if point.group.startswith(f"{_OURS}.")]
    ends = {part: p for p in foreign for part in (p.module.partition(".")[0], p.module)}
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        module = str(frame.f_globals.get("__name__", ""))
        package = module.partition(".")[0]
        if package == _OURS:
            return ""
        if point := ends.get(module) or ends.get(package):
            why = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
            return f"{_what(point.group)} {point.name!r} ({module}, line {line}) failed: {why}"
    return ""


def parts(
    base: type[_Part],
    folder: str,
    group: str,
    *,
    taken: Iterable[str] = (),
    refused: Callable[[Any], str] = lambda _: "",
) -> tuple[type[_Part], ...]:
    """All installed subclasses of a base class, in the order of their names.

    They tell themselves apart by their class attribute `kind`. Modules of our package `folder` and
    those that entry points of a group name define some; ours keep their kinds, `taken` are ours
    though no module has them. A class of another package that would not work is skipped with a
    warning, see `unfit`; so is one that is `refused`, which says why or is empty.
    """

    def wanted(member: object) -> bool:
        return isinstance(member, type) and issubclass(member, base) and hasattr(member, "kind")

    def misfit(member: type) -> str:
        if is_ours(member.__module__):
            return ""
        return unfit(member) or refused(member)

    named = [
        (str(vars(member).get("kind", member.__name__)), member, member.__module__, point)
        for member, _, point in _members(folder, group, base, wanted, misfit)
    ]
    found = _first_of_each(group, "kind", named, taken)
    return tuple(sorted(found.values(), key=lambda part: part.__name__))


def values(
    base: type[_Part], folder: str, group: str, *, unfit: Callable[[_Part], str]
) -> tuple[_Part, ...]:
    """All installed values of a class, found as by `parts`, in the order of their `name`.

    `unfit` says why one cannot be used, and is empty if it can.
    """
    members = _members(folder, group, base, lambda member: isinstance(member, base), unfit)
    named = [(one.name, one, module, point) for one, module, point in members]
    found = _first_of_each(group, "name", named)
    return tuple(found[name] for name in sorted(found))


def unfit(part: type) -> str:
    """Why a class cannot be used as a part; empty if it can.

    It needs all methods that its bases mark as abstract and all class attributes that they declare
    without a value, texts and whole numbers of their type; a part of recipes is a frozen dataclass
    that pydantic can read, with a literal `kind`.
    """
    lacking = [
        name
        for name in dir(part)
        if getattr(inspect.getattr_static(part, name), "__isabstractmethod__", False)
    ]
    declared = {
        name: kind for base in part.__mro__ for name, kind in inspect.get_annotations(base).items()
    }
    lacking += [
        name
        for name, kind in declared.items()
        if str(kind).startswith("ClassVar") and not hasattr(part, name)
    ]
    if lacking:
        return f"has no {', '.join(lacking)}"
    for name, kind in declared.items():
        plain = _PLAIN.get(str(kind))
        if plain and not isinstance(found := getattr(part, name), plain):
            return f"has {name} = {found!r:.40}, which is no {plain.__name__}"
    try:
        return _unreadable(part) if issubclass(part, Spec) else ""
    except Exception as error:  # whatever pydantic or a foreign annotation raises
        return f"cannot be read from a recipe: {str(error).partition(chr(10))[0]}"


def _unreadable(spec: type[Spec]) -> str:
    """Why pydantic cannot read a part of recipes, or tell it from others; empty if it can.

    Raises:
        Exception: of pydantic, where an annotation says nothing to it.
    """
    from pydantic import TypeAdapter

    parameters = vars(spec).get("__dataclass_params__")
    if parameters is None or not parameters.frozen:
        return "is no @dataclass(frozen=True, kw_only=True)"
    kind = get_type_hints(spec).get("kind")
    default = getattr(spec, "kind", None)
    if get_origin(kind) is not Literal or default not in get_args(kind):
        return f"has not `kind: Literal[{default!r}] = {default!r}`"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        TypeAdapter(spec).json_schema()
    return ""


def _members(
    folder: str,
    group: str,
    base: type,
    wanted: Callable[[object], bool],
    unfit: Callable[[Any], str],
) -> Iterator[tuple[Any, str, EntryPoint | None]]:
    """What modules of our folder bring, then those of other packages that can be imported."""
    names = [m.name for m in pkgutil.iter_modules(import_module(folder).__path__, f"{folder}.")]
    modules: list[tuple[ModuleType, EntryPoint | None]] = [(import_module(n), None) for n in names]
    _asked.add(group)
    points = sorted(set(entry_points(group=group)), key=_precedence)
    modules += [(module, point) for point in points if (module := load_plugin(point, group))]
    for module, point in modules:
        members = [member for member in vars(module).values() if wanted(member)]
        if point is not None and not members:
            skip_plugin(point, group, f"has no {base.__name__}")
        for member in members:
            if point is not None and (why := unfit(member)):
                name = getattr(member, "__name__", getattr(member, "name", ""))
                skip_plugin(point, group, f"{name} {why}")
            else:
                yield member, module.__name__, point


_Named = tuple[str, Any, str, EntryPoint | None]


def _first_of_each(
    group: str, what: str, named: list[_Named], taken: Iterable[str] = ()
) -> dict[str, Any]:
    """The first of each name, but for names that are taken; warns of the others."""
    found: dict[str, tuple[Any, str]] = {name: (None, "terrain_forge") for name in taken}
    for name, member, module, point in named:
        if name not in found and point is not None:
            _brought.setdefault((group, point.name, point.value), {})[name] = None
        first, where = found.setdefault(name, (member, module))
        if first is not member and point is not None:
            _skip_twin(point, group, name, module, f"{where} has that {what}")
    return {name: first for name, (first, _) in found.items() if first is not None}


def _what(group: str) -> str:
    word = group.rpartition(".")[2].replace("_", " ")
    return f"{word[:-3]}y" if word.endswith("ies") else word.removesuffix("s")


def _precedence(point: EntryPoint) -> tuple[bool, str]:
    return not point.value.startswith("terrain_forge."), point.value
