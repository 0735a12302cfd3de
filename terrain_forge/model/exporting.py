"""Finding what can be plugged in: exporters, of ours and of other packages."""

from __future__ import annotations

import logging
from dataclasses import dataclass, is_dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol, cast

from terrain_forge.base import RecipeError, Spec

if TYPE_CHECKING:
    from terrain_forge.model.world import World

EXPORTERS = "terrain_forge.exporters"
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class ExportReport:
    """What an exporter did."""

    files: tuple[Path, ...]
    """Files written, relative to the export's directory."""
    losses: tuple[str, ...]
    """What the format cannot say, a sentence each, with the size of the error where there is
    one."""


class Exporter(Protocol):
    """A module (or object) that writes a world in one format."""

    Options: type[Spec]
    """Frozen dataclass of the format's options, each with a default and documented."""

    def export(self, world: World, directory: Path, *, options: Any) -> ExportReport:
        """Write `world` into the existing, empty `directory`.

        Raises:
            ExportError: if the format cannot hold this world with these options.
        """


def exporter_names() -> list[str]:
    """Names of the exporters that are installed, working or not."""
    return sorted(plugins(EXPORTERS))


def exporter(name: str) -> Exporter:
    """The exporter of that name.

    Raises:
        RecipeError: if none has it, or if it cannot be imported; lists those that are installed.
    """
    found = plugins(EXPORTERS)
    if name not in found:
        raise RecipeError(f"unknown exporter {name!r}, installed: {', '.join(sorted(found))}")
    module = _load(found[name])
    if module is None:
        raise RecipeError(f"exporter {name!r} is installed but broken (see the warning above)")
    return cast(Exporter, module)


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
                group.rpartition(".")[2].removesuffix("s"), point.name, point.value, first.value,
            )  # fmt: skip
    return found


def check_capacity(exporter: Exporter, options: Any, *, nodes: float, rocks: float) -> None:
    """Let an exporter refuse a world of that size before it is made, if it knows a limit.

    Args:
        exporter: The exporter.
        options: Its options.
        nodes: Nodes of the ground.
        rocks: Expected number of rocks.

    Raises:
        ExportError: if the format cannot hold such a world.
    """
    check = getattr(exporter, "check_capacity", None)
    if check is not None:
        check(options, nodes=nodes, rocks=rocks)


def _precedence(point: EntryPoint) -> tuple[bool, str]:
    return not point.value.startswith("terrain_forge."), point.value


def _load(point: EntryPoint) -> ModuleType | None:
    try:
        module = point.load()
        missing = [part for part in ("Options", "export") if not hasattr(module, part)]
        if not missing and not is_dataclass(module.Options):
            missing = ["dataclass Options"]
    except Exception as error:  # whatever a foreign package raises must not break ours
        why = " ".join(str(error).split()) or type(error).__name__
        _log.warning("exporter %r (%s) is skipped: %s", point.name, point.value, why)
        return None
    if missing:
        _log.warning("exporter %r (%s) is skipped: has no %s", point.name, point.value, missing[0])
        return None
    return cast(ModuleType, module)
