"""What an output folder may not be, and what of it is not ours to replace."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Collection, Iterable
from contextlib import suppress
from pathlib import Path

from terrain_forge.base import DataError, OutputError, StorageError, is_text, read_lines, resolved
from terrain_forge.building.manifest import (
    ASSESSED,
    NAME,
    STAGING,
    WORLD,
    Manifest,
    changed_files,
    foreign_files,
    suspect_files,
)

_log = logging.getLogger(__name__)
_FOREIGN = "that its manifest does not list"
_CHANGED = "changed since it was built"
_NAMED = 5
"""Files that a message names."""
_RECORDING, _INDEX = "dataset/", "dataset/dataset.json"
"""Where the recording of a world lies, and what tells that it is one."""
_WRITTEN = "written.csv"
"""Where it lists its files, each with its size."""
_EVALUATED = re.compile(r"dataset/slam/(evaluation\.[a-z]+|[^/]+_[0-9]+/.+)")
"""What its evaluation writes besides."""
_ADDRESS = re.compile("[a-z][a-z0-9+]+:")
"""What is left in a path of the scheme of an address, such as s3://bucket/worlds."""
_LONGEST, _DEEPEST = 255, 3500
"""Bytes of a name, and of the path of a world, whose files' paths are longer."""


def require_folder(out: Path) -> None:
    """Refuse an address of an object store, which is no folder: all is staged, renamed and locked.

    Raises:
        OutputError: names it, and what does serve.
    """
    for number, place in enumerate(out.parts, 1):
        if _ADDRESS.fullmatch(place) and not Path(*out.parts[:number]).exists():
            rest = "/".join(out.parts[number:])
            raise OutputError(
                f"{place}//{rest} is an address: worlds are written into a folder, which is renamed"
                " and locked as object stores cannot; copy the built folder there, or mount the"
                " store"
            )


def require_apart(out: Path, inputs: Iterable[Path]) -> None:
    """Refuse an output folder, symbolic links resolved, in which a file lies that is read.

    Raises:
        OutputError: names the file, or says that the folder's own name is too long.
    """
    require_folder(out)
    if not_text := [name for name in out.parts if not is_text(name)]:
        raise OutputError(f"output folder {not_text[0][:20]}: its name is no text in UTF-8")
    longest = [*((name, _LONGEST) for name in out.parts), (out.name, _LONGEST - len(f".{STAGING}"))]
    for name, most in (*longest, (str(out), _DEEPEST)):
        if (size := len(os.fsencode(name))) > most:
            raise OutputError(f"output folder {name[:20]}…: {size} bytes long, at most {most}")
    for path in inputs:
        if resolved(path).is_relative_to(out):
            raise OutputError(f"{out} would be replaced, and the input {path} lies in it")


def require_ours(out: Path, *, force: bool = False, holds: str = WORLD) -> tuple[str, ...]:
    """Refuse an output folder whose replacement would remove what is not ours.

    Args:
        out: The output folder, symbolic links resolved.
        force: Whether files that its manifest does not list may be removed.
        holds: What an older folder of ours must hold to be replaced.

    Returns:
        Those files, relative to it.

    Raises:
        OutputError: says what is in the way.
        StorageError: if the folder cannot be made.
    """
    if not out.exists():
        parent = next(above for above in out.parents if above.exists())
        if not parent.is_dir():
            raise OutputError(f"{out} cannot be made: {parent} is no folder")
        _require_writable(parent, out)
        return ()
    if os.path.ismount(out):
        raise OutputError(f"{out} is a mount point, which cannot be replaced: name a folder in it")
    with suppress(FileNotFoundError):  # the folder that we are in is gone
        if Path.cwd().is_relative_to(out):
            raise OutputError(
                f"{out} would be replaced, and you are in it: go to another folder, or name a new "
                "one in it with -o"
            )
    _require_writable(out.parent, out)
    if out.is_dir() and not foreign_files(out, {}):
        return ()
    if not (out / NAME).is_file():
        raise OutputError(
            f"{out} exists and is not a terrain-forge {holds}; remove it or choose another with -o"
        )
    suspect = suspect_files(out, holds=holds)
    if not force:
        _refuse(
            out,
            foreign=[name for name, changed in suspect.items() if not changed],
            changed=[name for name, changed in suspect.items() if changed],
        )
    return tuple(sorted(suspect))


def require_listed(
    out: Path,
    manifest: Manifest,
    folders: Iterable[str] = (),
    *,
    also: tuple[str, ...] = ASSESSED,
    force: bool,
) -> None:
    """Refuse to renew parts of a world where that would remove what is not its own, or was edited.

    Args:
        out: The world's folder.
        manifest: Its manifest.
        folders: Folders that are written anew.
        also: Beginnings of names of other files that are.
        force: Whether that may be removed.

    Raises:
        OutputError: names it.
    """
    folders = tuple(folders)
    inside = tuple(f"{folder}/" for folder in folders)
    foreign = [
        name for name in foreign_files(out, manifest) if name in folders or name.startswith(inside)
    ]
    changed = [name for name in changed_files(out, manifest) if name.startswith((*inside, *also))]
    if not force:
        _refuse(out, foreign=foreign, changed=changed)
    if foreign or changed:
        _log.warning("removed from %s: %s", out, ", ".join(told_files(out, {*foreign, *changed})))


def told_files(out: Path, names: Collection[str]) -> tuple[str, ...]:
    """Names of files of a folder for people, in order: those of its recording are one thing."""
    recorded = [name for name in names if name.startswith(_RECORDING)]
    if recorded:
        listed = _recorded(out / _RECORDING)
        recorded = [name for name in recorded if name in listed or _EVALUATED.fullmatch(name)]
    if _INDEX not in recorded:
        return tuple(sorted(names))
    whole = f"{_RECORDING} ({len(recorded):,} files of a recording)"
    return tuple(sorted([*({*names} - {*recorded}), whole]))


def _recorded(folder: Path) -> set[str]:
    """Files that a recording lists as its own, relative to the world."""
    found = {_INDEX, f"{_RECORDING}{_WRITTEN}"}
    with suppress(DataError, OSError):
        for line in read_lines(folder / _WRITTEN, _WRITTEN):
            found.add(_RECORDING + line.partition(",")[2].rstrip("\n"))
    return found


def _refuse(out: Path, *, foreign: list[str], changed: list[str]) -> None:
    """Name all that is in the way."""
    told = []
    for names, what in ((foreign, _FOREIGN), (changed, _CHANGED)):
        if things := told_files(out, names):
            named = ", ".join(things[:_NAMED]) + (" …" if len(things) > _NAMED else "")
            files = "1 file" if len(names) == 1 else f"{len(names):,} files"
            told.append(f"{files} {what}: {named}")
    if told:
        raise OutputError(
            f"{out} holds {', and '.join(told)}; move them away, or let --force remove them"
        )


def _require_writable(parent: Path, out: Path) -> None:
    if not os.access(parent, os.W_OK | os.X_OK):
        raise StorageError(f"{out} cannot be written: {parent} is not writable")
