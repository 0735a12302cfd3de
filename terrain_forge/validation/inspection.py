"""What a check of a built world is: one module, found in `checks/` or by an entry point."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from terrain_forge.base import (
    DataError,
    PluginError,
    SimulationError,
    is_ours,
    read_json,
    staying,
)
from terrain_forge.model import Check, Export, World
from terrain_forge.recipe import ValidateSpec

_TOLD = 3
"""Altered files that are named."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BuiltFolder:
    """A built world, as checks are given it."""

    world: World
    """The world."""
    directory: Path
    """Its folder."""
    exports: tuple[Export, ...] = ()
    """The exports in it, an MJCF among them where rocks are dynamic or a drive is asked for."""
    spec: ValidateSpec
    """What the recipe asks to be checked."""
    altered: tuple[str, ...] = ()
    """Files of the folder that are not as they were built."""
    foreign: tuple[str, ...] = ()
    """Files of the folder that are not the world's."""
    driven: Mapping[str, Any] | None = None
    """The earlier report where its drives still hold, with their `files`."""
    progress: Callable[[float], None] | None = None
    """Told how far a long check is, 0 to 1."""

    @property
    def mjcf(self) -> Path | None:
        """The folder of its first MJCF export.

        Raises:
            SimulationError: if one of its files is altered.
        """
        found = next((export.folder for export in self.exports if export.kind == "mjcf"), None)
        if found is None:
            return None
        if why := not_opened(found, self.altered):
            raise SimulationError(why)
        return self.directory / found


def not_opened(folder: str, altered: Iterable[str]) -> str:
    """Why an export is not given to programs: they would read whatever stands in altered files."""
    names = [name for name in altered if name.startswith(f"{folder}/")]
    return f"not opened, since altered: {', '.join(names[:_TOLD])}" if names else ""


@contextmanager
def leaving(who: str, module: str, folder: Path, *, added: bool = False) -> Iterator[None]:
    """Refuse code of another package that changes or removes files which are there, or goes away.

    Args:
        who: Who it is, in words.
        module: Its module.
        folder: The folder of the files.
        added: Whether new files are refused too.

    Raises:
        PluginError: names who and the file.
    """
    if is_ours(module):
        yield
        return
    before = _states(folder)
    with staying(who):
        yield
    after = _states(folder)
    names = before.keys() | after.keys() if added else before.keys()
    if odd := sorted(name for name in names if before.get(name) != after.get(name)):
        raise PluginError(f"{who} changed {odd[0]}")


def _states(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of change of the files of a folder, by their names in it."""
    files = {path: path.lstat() for path in folder.rglob("*") if not path.is_dir()}
    return {
        path.relative_to(folder).as_posix(): (stat.st_size, stat.st_mtime_ns)
        for path, stat in files.items()
    }


def content_of(file: Path) -> dict[str, Any]:
    """The content of a JSON file of a world, empty where it was not written.

    Raises:
        DataError: if it is damaged.
    """
    if not file.is_file():
        return {}
    try:
        content = read_json(file, file.name)
    except DataError:
        content = None
    if not isinstance(content, dict):
        raise DataError(f"{file} is damaged: remove it, then validate or build the world anew")
    return content


class Inspection:
    """Checks one thing of a built world; what it keeps of that, its other methods tell.

    A subclass must have a `kind`, which no other has, and `checks`; it should have a `group`.
    """

    kind: ClassVar[str]
    """Its name."""
    group: ClassVar[str] = ""
    """Where its checks stand in the report."""

    @abstractmethod
    def checks(self, built: BuiltFolder) -> Iterable[Check]:
        """The checks; one that fails is a result, not an error.

        One whose figure or limit is not finite has failed.
        """
        raise NotImplementedError

    def report(self) -> dict[str, Any]:
        """More parts of report.json, by names that are not taken, as JSON can hold them."""
        return {}

    def timings(self) -> tuple[tuple[str, float], ...]:
        """What goes into timings.json."""
        return ()

    def write(self, built: BuiltFolder, folder: Path) -> Iterable[Path]:
        """Write further files into the folder of the validation; returns them."""
        del built, folder
        return ()
