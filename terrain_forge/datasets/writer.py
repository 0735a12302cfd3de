"""What formats of datasets are, how they are found, and how one is written."""

from __future__ import annotations

import shutil
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from math import inf
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

from terrain_forge.base import (
    ExportError,
    OutputError,
    PluginError,
    Progress,
    RecipeError,
    Spec,
    checked,
    complaint,
    first_odd,
    hint_at,
    is_ours,
    parts,
    refused_name,
    require_disk,
    require_unlinked,
    resolved,
    returning,
    silent,
    storing,
    type_adapter,
    write_through,
)
from terrain_forge.datasets.beside import FORMATS
from terrain_forge.datasets.reader import INDEX, Recording, open_recording
from terrain_forge.datasets.sizes import Footprint, footprints_of
from terrain_forge.datasets.streams import RecordedSensor
from terrain_forge.model import ExportReport

Need = Literal["two cameras", "pictures without distortion", "a lidar", "depth", "class"]
"""What a rig must have: sensors, or pictures or channels of a camera."""
GROUP = "terrain_forge.datasets"
"""Entry points that name modules of other packages with formats."""
RESERVED = {
    *("mav0", "truth", "calibration", "slam", "euroc"),
    *(INDEX, FORMATS, "plan.json", "written.csv"),
}
"""Names in a recording's folder, and its own as a format, that no format of others may have."""
_States = dict[str, tuple[int, int]]
_Sensor = TypeVar("_Sensor", bound=RecordedSensor)


class DatasetWriter:
    """Writes a recording in one format; a format is a subclass with its `kind`.

    It must have a `title`, its `Options`, and `write`; `needs`, `naming` and `check` may stay.

    It writes what it reads one measurement at a time, so that its memory does not grow with the
    recording, and the same bytes each time.
    """

    kind: ClassVar[str]
    """The format's name, and that of its folder in a recording, which has none of that name."""
    title: ClassVar[str]
    """What it is, in a few words."""
    Options: ClassVar[type[Spec]]
    """Frozen dataclass of the format's options, each with a default and documented."""
    needs: ClassVar[tuple[Need, ...]] = ()
    """What every recording in it needs of a rig, so that a recipe without is refused at once."""
    naming: ClassVar[tuple[str, ...]] = ()
    """Options that name sensors, so that a recipe with a wrong name is refused at once; one that is
    called as a kind of sensor, such as `lidar`, names one of these."""

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a recording that lacks what the format needs, before anything is written.

        Raises:
            ExportError: says what is missing.
        """

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """About the bytes that it writes, so that a disk without room is refused.

        By default as many as the recording has.
        """
        del options
        return sum(one.size for one in footprints)

    @abstractmethod
    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the recording into an existing, empty folder.

        Returns:
            What the format cannot say, a sentence each.
        """
        raise NotImplementedError


@cache
def dataset_kinds() -> dict[str, type[DatasetWriter]]:
    """All installed formats by their names."""
    found = parts(DatasetWriter, "terrain_forge.datasets.formats", GROUP, refused=_refused_kind)
    return {one.kind: one for one in found}


def _refused_kind(writer: type[DatasetWriter]) -> str:
    why = refused_name(writer.kind, RESERVED, "recording")
    return why and f"has a wrong kind: {why}"


def dataset_kind(name: str) -> type[DatasetWriter]:
    """The format of a name.

    Raises:
        RecipeError: if none has it; lists those that are installed.
    """
    known = dataset_kinds()
    if name not in known:
        installed = f"installed: {', '.join(sorted(known))}"
        raise RecipeError(f"unknown dataset format {name!r}{hint_at(name, known)}, {installed}")
    return known[name]


@checked
def write_dataset(
    recording: Recording | Path | str,
    kind: str,
    folder: Path | str,
    options: Spec | Mapping[str, Any] | None = None,
    *,
    progress: Progress = silent,
) -> ExportReport:
    """Write a recording in a format; the folder is there whole or not at all.

    Args:
        recording: The recording, or its folder.
        kind: The format.
        folder: Where it is written; it must not exist, or be empty.
        options: The format's options, as its `Options` or by their names.
        progress: Told of the share that is written.

    Raises:
        RecipeError: if there is no such format, or it has no such option.
        ExportError: if the recording lacks what the format needs.
        DataError: if a file of the recording is broken.
        OutputError: if the folder holds something.
        StorageError: if the disk does not take it.
        PluginError: if the format is another package's and returns what it may not, leaves a link
            in its folder, or writes beside it.
    """
    writer = dataset_kind(kind)()
    chosen = _options(writer, options)
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    writer.check(recording, chosen)
    target = resolved(folder)
    around = target.with_name(f".{target.name}.part")
    fresh = around / target.name
    with storing(target, target.parent):
        _require_free(target, recording)
        require_unlinked(around.parent, around.name)
        require_disk(target, round(_size(writer, footprints_of(recording), chosen)))
        try:
            shutil.rmtree(around, ignore_errors=True)  # what a killed process left
            fresh.mkdir(parents=True)
            losses = _write(writer, recording, fresh, chosen, progress)
            files = tuple(sorted(p.relative_to(fresh) for p in fresh.rglob("*") if p.is_file()))
            with suppress(FileNotFoundError):
                target.rmdir()
            write_through(fresh)
            fresh.rename(target)
        finally:
            shutil.rmtree(around, ignore_errors=True)
    return ExportReport(files=files, losses=losses)


def _write(
    writer: DatasetWriter, recording: Recording, fresh: Path, options: Any, progress: Progress
) -> tuple[str, ...]:
    """Let a format write into its folder; returns what it cannot say.

    Raises:
        PluginError: if it returns what it may not, or leaves more than files in that folder.
    """
    place = fresh.parents[1]
    watched = not is_ours(writer.__module__) and place == recording.folder.resolve()
    before = _states(place) if watched else {}
    with returning(writer, f"dataset format {writer.kind!r}: write", "a tuple of sentences"):
        losses = _sentences(writer.write(recording, fresh, options, progress))
    _require_own(writer, fresh)
    if watched:
        _require_same(writer, before, _states(place))
    return losses


def _sentences(losses: tuple[str, ...]) -> tuple[str, ...]:
    if isinstance(losses, str) or not all(isinstance(one, str) for one in losses):
        raise TypeError(f"found {losses!r}")
    return tuple(losses)


def _require_own(writer: DatasetWriter, fresh: Path) -> None:
    """Refuse what a format left beside its folder, and links in it, which lead elsewhere.

    Raises:
        PluginError: names the module and the file.
    """
    if fresh.is_symlink() or not fresh.is_dir():
        raise PluginError(f"{_named(writer)} removed its folder")
    if odd := sorted(path.name for path in fresh.parent.iterdir() if path != fresh):
        raise PluginError(f"{_named(writer)} wrote {odd[0]} beside its folder")
    if found := first_odd(fresh):
        raise PluginError(f"{_named(writer)} left {found} in its folder")


def _require_same(writer: DatasetWriter, before: _States, after: _States) -> None:
    """Refuse a format that changed what lies beside its folder in a recording.

    Raises:
        PluginError: names the module and the file.
    """
    names = sorted(before.keys() | after.keys())
    if odd := [name for name in names if before.get(name) != after.get(name)]:
        raise PluginError(
            f"{_named(writer)} changed {odd[0]} beside its folder, or another process did meanwhile"
        )


def _states(folder: Path) -> _States:
    """What tells the files of a folder, and folders in it, from what they were before."""
    found = {}
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name in dataset_kinds():
            continue  # another process may write another format meanwhile
        with suppress(FileNotFoundError):  # another process's, gone meanwhile
            told = path.lstat()
            found[path.name] = (told.st_ino, 0 if path.is_dir() else told.st_mtime_ns)
    return found


def _named(writer: DatasetWriter) -> str:
    return f"dataset format {writer.kind!r} ({type(writer).__module__})"


def checked_options(kind: str, options: Mapping[str, Any]) -> Any:
    """A format's options, checked.

    Raises:
        RecipeError: if there is no such format, or it has no such option.
    """
    return _options(dataset_kind(kind)(), options)


def _options(writer: DatasetWriter, options: Spec | Mapping[str, Any] | None) -> Any:
    if isinstance(options, Spec):
        return options
    from pydantic import ValidationError

    adapter, plain = type_adapter(writer.Options), dict(options or {})
    try:
        return adapter.validate_python(plain)
    except ValidationError as error:
        why = complaint(error, adapter, plain)
        raise RecipeError(f"dataset format {writer.kind!r}: {why}", key=why.key) from None


def format_size(kind: str, options: Mapping[str, Any], footprints: Sequence[Footprint]) -> float:
    """About the bytes that a recording takes in a format.

    Raises:
        RecipeError: if there is no such format, or it has no such option.
    """
    writer = dataset_kind(kind)()
    return _size(writer, footprints, _options(writer, options))


def _size(writer: DatasetWriter, footprints: Sequence[Footprint], options: Any) -> float:
    with returning(writer, f"dataset format {writer.kind!r}: size", "a number of bytes"):
        found = writer.size(footprints, options)
        if not isinstance(found, Real) or not 0.0 <= found < inf:
            raise ValueError(f"found {found!r}")
        return float(found)


def _require_free(target: Path, recording: Recording) -> None:
    if target.is_relative_to(recording.folder.resolve() / "mav0"):
        raise OutputError(f"{target} lies in the recording itself: choose another folder")
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise OutputError(f"{target} exists: remove it, or choose another folder")


def needed(module: str, what: str) -> Any:
    """A module of an extra, imported.

    Raises:
        ExportError: if it is not installed; says how it is.
    """
    from importlib import import_module

    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise ExportError(
            f"{what} needs {package}: pip install 'terrain-forge[datasets]'"
        ) from None


def one_of(found: tuple[_Sensor, ...], name: str, what: str, kind: str) -> _Sensor:
    """Of some recorded sensors the one of a name or folder, or the first.

    Raises:
        ExportError: if there is none.
    """
    for one in found:
        if name in ("", one.key, one.name) and one.span:
            return one
    if found and name:
        known = ", ".join(f"{one.key} ({one.name})" for one in found)
        raise ExportError(f"{kind}: no {what} {name!r} was recorded, there are: {known}")
    raise ExportError(f"{kind} needs a {what}, and the recording has none")
