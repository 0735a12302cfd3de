"""What exporters are and how they are found, of ours and of other packages; what they share."""

from __future__ import annotations

import json
import logging
import re
from dataclasses import dataclass, is_dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    FOREIGN_FAILURES,
    RecipeError,
    Spec,
    checked,
    complaint,
    failure_words,
    hint_at,
    hold_interrupts,
    is_ours,
    load_plugin,
    plugin_at_fault,
    plugins,
    refused_name,
    returning,
    skip_plugin,
    skipped,
    type_adapter,
)
from terrain_forge.model.body import Body

if TYPE_CHECKING:
    from terrain_forge.model.world import World

_log = logging.getLogger(__name__)
EXPORTERS = "terrain_forge.exporters"
RESERVED = {
    *("world", "truth", "paths", "validation", "dataset"),
    *("manifest.json", "timings.json", "report.html", "preview.png"),
}
"""Names in a world's folder that no export may have, in any case."""


@dataclass(frozen=True, kw_only=True)
class ExportReport:
    """What an exporter did."""

    files: tuple[Path, ...]
    """Files written, relative to the export's directory."""
    losses: tuple[str, ...]
    """What the format cannot say, a sentence each, with the size of the error where there is
    one."""


@dataclass(frozen=True, kw_only=True)
class Opening:
    """How an exported folder is opened, for the report page."""

    title: str
    """The program or kind of programs."""
    commands: str
    """Lines for a terminal in the folder that holds the exported one, or for Python."""


@dataclass(frozen=True, kw_only=True)
class Export:
    """An exported folder of a built world, as its manifest has it."""

    folder: str
    """Its path in the built folder."""
    kind: str
    """The exporter that wrote it."""
    options: dict[str, Any]
    """The exporter's options as JSON, defaults written out."""
    losses: tuple[str, ...] = ()
    """What the export cannot say."""

    def opening(self, directory: Path) -> Opening | None:
        """How the export in a built folder is opened, where its exporter says it.

        The validation's own exports have no such words.
        """
        if "/" in self.folder:
            return None
        try:
            module, options = self.opened()
            words = getattr(module, "opening", None)
            with returning(module, f"exporter {self.kind!r}: opening", "an Opening or None"):
                found: Opening | None = words and words(directory / self.folder, options)
                if not isinstance(found, Opening | None):
                    raise TypeError(f"found {found!r:.40}")
            return found
        except FOREIGN_FAILURES as error:  # it must not break the page
            _warn_once(self.folder, plugin_at_fault(error) or failure_words(error))
            return None

    def opened(self) -> tuple[Exporter, Any]:
        """The exporter, and the options as it reads them.

        Raises:
            RecipeError: if the exporter is not installed, or no longer takes the options.
        """
        from pydantic import ValidationError

        found = exporter(self.kind)
        adapter = type_adapter(found.Options)
        try:
            return found, adapter.validate_json(json.dumps(self.options))
        except ValidationError as error:
            why = complaint(error, adapter, self.options)
            raise RecipeError(f"exporter {self.kind!r} refuses its options: {why}") from None


@cache
def _warn_once(folder: str, why: str) -> None:
    _log.warning("how to open %s is not known: %s", folder, why)


def plain_options(options: Spec) -> dict[str, Any]:
    """An exporter's options as JSON, defaults written out."""
    plain: dict[str, Any] = type_adapter(type(options)).dump_python(options, mode="json")
    plain.pop("kind", None)
    return plain


class Exporter(Protocol):
    """A module (or object) that writes a world in one format.

    It may have more, which docs/exporters/writing-one.md describes: `check_capacity`, `prepare`,
    `CONSUMERS` (how its folders are read back) and `opening` (how they are opened).
    """

    Options: type[Spec]
    """Frozen dataclass of the format's options, each with a default and documented."""

    def export(self, world: World, directory: Path, *, options: Any) -> ExportReport:
        """Write `world` into the existing, empty `directory`.

        Raises:
            ExportError: if the format cannot hold this world with these options.
        """


def refused_folder(name: str) -> str:
    """Why an export's folder, or an exporter, must not have a name; empty if it may."""
    return refused_name(name, RESERVED, "world")


def exporter_names() -> list[str]:
    """Names of the exporters that are installed, working or not."""
    return sorted(plugins(EXPORTERS))


@checked
def exporter(name: str) -> Exporter:
    """The exporter of that name.

    Raises:
        RecipeError: if none has it, or if it cannot be imported; lists those that are installed.
    """
    found = plugins(EXPORTERS)
    if name not in found:
        hint = hint_at(name.lower(), found) or _for_program(name)
        raise RecipeError(f"unknown exporter {name!r}{hint}, installed: {', '.join(sorted(found))}")
    if refused := refused_folder(name):
        skip_plugin(found[name], EXPORTERS, refused)
    elif module := load_plugin(found[name], EXPORTERS):
        why = _unfit(module)
        if not why:
            return cast(Exporter, module)
        skip_plugin(found[name], EXPORTERS, why)
    why = "; ".join(skipped(found[name], EXPORTERS))
    raise RecipeError(f"exporter {name!r} ({found[name].value}) is installed but broken: {why}")


def _for_program(name: str) -> str:
    """Which of our exporters is for a program or kind of files, such as `gazebo` or `stl`."""
    for kind, point in sorted(plugins(EXPORTERS).items()):
        module = load_plugin(point, EXPORTERS) if is_ours(point.value) else None
        told = module and re.search(rf"\b{re.escape(name)}\b", module.__doc__ or "", re.IGNORECASE)
        if told and told[0] != told[0].lower():  # no word that is no name
            return f" ({kind} is for it)"
    return ""


def _unfit(module: ModuleType) -> str:
    """Why a module cannot be used as an exporter; empty if it can.

    Our own load what they have beside `Options` when they are asked for it, so that is not done.
    """
    missing = [part for part in ("Options", "export") if part not in dir(module)]
    if missing or not is_dataclass(module.Options):
        return f"has no {(*missing, 'dataclass Options')[0]}"
    if is_ours(module.__name__):
        return ""
    for name in ("export", "check_capacity", "prepare", "opening"):
        if not callable(getattr(module, name, callable)):
            return f"has {name}, which is no function"
    readers = getattr(module, "CONSUMERS", ())
    named = isinstance(readers, tuple | list) and all(
        isinstance(getattr(one, "name", None), str) and callable(getattr(one, "read", None))
        for one in readers
    )
    return "" if named else f"has CONSUMERS, a {type(readers).__name__}: no tuple of Consumers"


def check_capacity(exporter: Exporter, options: Any, *, nodes: float, rocks: float) -> None:
    """Let an exporter refuse a world of so many nodes and rocks before it is made.

    Raises:
        ExportError: if the format is known not to hold such a world.
    """
    check = getattr(exporter, "check_capacity", None)
    if check is not None:
        check(options, nodes=nodes, rocks=rocks)


def prepare(exporter: Exporter, options: Any) -> None:
    """Load an exporter's code, and what it must load before other threads run.

    A library whose constructors give Python's lock away, as OpenUSD's do, waits for ever where
    another thread of Python's asks the loader meanwhile, which NumPy does for large arrays.
    """
    with hold_interrupts():  # OpenUSD prints what interrupts its import, and goes on half made
        exporter.export  # noqa: B018  # a door loads what is behind it when asked
        load = getattr(exporter, "prepare", None)
        if load is not None:
            load(options)


@dataclass(frozen=True, kw_only=True)
class Friction:
    """Coefficients of sliding friction of a world's fixed surfaces."""

    ground: float
    """On the ground."""
    rock: float
    """On static rocks."""


class FrictionOptions(Protocol):
    """What an export's options say of friction."""

    @property
    def surface(self) -> Literal["regolith", "bedrock"]:
        """What the ground is."""

    @property
    def friction(self) -> float | None:
        """Coefficient of both ground and rocks, instead of the body's."""


def material_frictions(world: World, options: FrictionOptions) -> tuple[float, ...]:
    """Friction that an export gives to each of a world's ground materials; one where all is alike.

    The regolith is as `world_friction` says; the options' own coefficient counts for all.
    """
    usual = world_friction(world.site.body, options).ground
    looks = world.appearance
    if looks.material is None or options.friction is not None:
        return (usual,)
    return (usual, *(material.friction for material in looks.materials[1:]))


def cells_by_friction(world: World, frictions: tuple[float, ...]) -> dict[float, NDArray[np.bool_]]:
    """Which cells of a world's ground have each coefficient; none where all have the same.

    A cell is of the material of its south-western node.
    """
    material = world.appearance.material
    if material is None or len(set(frictions)) < 2:
        return {}
    felt = np.array(frictions)[material[:-1, :-1]]
    return {one: felt == one for one in np.unique(felt).tolist()}


def ground_patches(
    world: World, frictions: tuple[float, ...]
) -> list[tuple[float, NDArray[np.bool_] | None]]:
    """Each friction of a world's ground with its cells; None for all of them."""
    felt = cells_by_friction(world, frictions)
    if len(felt) < 2:
        return [(next(iter(felt), frictions[0]), None)]
    return [*felt.items()]


def world_friction(body: Body, options: FrictionOptions) -> Friction:
    """Friction that an export gives to the ground and the static rocks of a body."""
    if options.friction is not None:
        return Friction(ground=options.friction, rock=options.friction)
    ground = body.friction.bedrock if options.surface == "bedrock" else body.friction.regolith
    return Friction(ground=ground.coefficient, rock=body.friction.rock.coefficient)
