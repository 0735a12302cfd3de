"""The manifest: what a world was made from, by what, and the hash of every file."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote
from typing import Any, NoReturn

from terrain_forge import __version__
from terrain_forge.base import (
    DataError,
    OutputError,
    TerrainForgeError,
    is_inside,
    read_text,
    worker_threads,
    write_whole,
)
from terrain_forge.dtm import origin
from terrain_forge.model import MANIFEST, MAX_MANIFEST, Export, Site, made_with
from terrain_forge.recipe import sha256

Manifest = dict[str, Any]
"""What a manifest holds, as JSON."""
NAME = MANIFEST
STAGING = ".terrain-forge"
"""Folder of a world in which something is being made, and ending of the one beside it."""
LOCK, MARK = "lock", b"a terrain-forge is or was at work here\n"
"""File that tells such a folder from a user's, and what it holds."""
WHOLE = "whole"
"""Folder in the staging folder of a world whose changed copy is taking the world's places."""
FORMAT = 2
WORLD = "world"
"""What a folder holds whose manifest does not say."""
_OF_THE_MACHINE = frozenset(
    {errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EINTR}
)
"""Errors in reading that say nothing of the file that is read."""
_READERS = 8
"""Files that are read at once."""
_OWN = {NAME, "timings.json"}
ASSESSED: tuple[str, ...] = ("validation/", "report.html")
"""What every assessment writes anew."""
_FREE = ("dataset/", "validation/consumers/")


def write_manifest(
    site: Site,
    directory: Path,
    *,
    exports: Sequence[Export],
    known: Mapping[str, str] | None = None,
    foreign: Collection[str] = (),
    holds: str = WORLD,
) -> Path:
    """Write `directory`/manifest.json over all files that are there; equal worlds, equal bytes.

    Args:
        site: what the world was made from.
        directory: the output folder.
        exports: what was exported into the folder.
        known: SHA-256 that files should have, which are not read: of those that are not as they
            were built, above all.
        foreign: files that are not the world's, which it does not list.
        holds: what the folder holds, in a word.
    """
    names = [name for name in all_files(directory) if name not in foreign]
    known = known or {}
    outputs = {**_hashes(directory, [name for name in names if name not in known]), **known}
    manifest = {
        "terrain_forge": __version__,
        "format": FORMAT,
        **({} if holds == WORLD else {"holds": holds}),
        **site.stated,
        "versions": made_with(),
        **_origins(site.stated["recipe"]["dtm"]),
        "exports": {
            one.folder: {"kind": one.kind, "options": one.options, "losses": list(one.losses)}
            for one in sorted(exports, key=_folder)
        },
        "outputs": dict(sorted(outputs.items())),
        "varying": sorted({*names} - {*outputs} - _OWN),
    }
    text = json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False)
    return write_whole(directory / NAME, text + "\n")


def _meant(path: Path) -> str:
    """What to name instead of a path that is no folder of ours; empty where nothing is known."""
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        return f": `terrain-forge build {quote(path.name)}` makes one"
    with suppress(OSError):
        for one in sorted(path.glob("*")):
            if (one / NAME).is_file():
                return f": name one in it, such as {one.name}"
    return ""


def _origins(dtm: dict[str, Any]) -> dict[str, Any]:
    """Where a terrain model comes from that the recipe names by product or address."""
    found = origin(dtm)
    return {"origins": {dtm["product"] or dtm["url"]: found}} if found else {}


def read_manifest(directory: Path, *, holds: str = WORLD) -> Manifest:
    """The manifest of a built world, or of a folder that holds something else of ours.

    Raises:
        OutputError: if the folder holds none of ours, or one of another thing.
    """
    try:
        if not (directory / NAME).is_file():
            told = f"{directory} is not a terrain-forge {holds} (no {NAME})"
            raise OutputError(f"{told}{_meant(directory)}")
        manifest = json.loads(read_text(directory / NAME, NAME, most=MAX_MANIFEST))
    except DataError as error:
        if getattr(error.__cause__, "errno", None) in _OF_THE_MACHINE:
            raise error.__cause__ from None  # type: ignore[misc]
        raise OutputError(f"{directory}: {error}") from None
    except (ValueError, RecursionError):
        raise OutputError(f"{directory / NAME} is damaged: not JSON") from None
    if isinstance(manifest, dict) and isinstance(manifest.get("tiles"), dict):
        part = ": `terrain-forge cut` makes a world of a part of it" * (holds == WORLD)
        raise OutputError(f"{directory} is a site in tiles{part}")
    if not _is_ours(manifest):
        raise OutputError(
            f"{directory}/{NAME} is not one of this version of terrain-forge: move it away"
        )
    if (found := manifest.get("holds", WORLD)) != holds:
        raise OutputError(f"{directory} holds a terrain-forge {found}, no {holds}")
    return dict(manifest)


def _is_ours(manifest: Any) -> bool:
    """Whether it has the parts of a manifest that are asked for."""
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        return False
    varying, exports = manifest.get("varying"), manifest.get("exports")
    return (
        lists_outputs(manifest)
        and isinstance(varying, list)
        and all(isinstance(name, str) for name in varying)
        and isinstance(exports, dict)
        and all(map(is_inside, (*varying, *exports)))
        and all(
            isinstance(e, dict)
            and {*e} == {"kind", "options", "losses"}
            and isinstance(e["kind"], str)
            and isinstance(e["options"], dict)
            and isinstance(e["losses"], list)
            and all(isinstance(loss, str) for loss in e["losses"])
            for e in exports.values()
        )
    )


def lists_outputs(manifest: Manifest) -> bool:
    """Whether a manifest names its files, none outside of its folder, each with a hash."""
    outputs = manifest.get("outputs")
    return (
        isinstance(outputs, dict)
        and all(isinstance(value, str) for value in outputs.values())
        and all(map(is_inside, outputs))
    )


def exports_in(manifest: Manifest) -> tuple[Export, ...]:
    """The exports that a manifest names, by folder."""
    return tuple(
        Export(folder=folder, **{**plain, "losses": tuple(plain["losses"])})
        for folder, plain in manifest["exports"].items()
    )


def _folder(export: Export) -> str:
    return export.folder


def foreign_files(directory: Path, manifest: Manifest) -> list[str]:
    """Files, links and empty folders in a world's folder that its manifest does not list."""
    varying = {n for n in manifest.get("varying", ()) if n.endswith("/") or not _is_promised(n)}
    listed = {*manifest.get("outputs", ()), *varying} | (_OWN if manifest else set())
    return [name for name in all_files(directory) if name not in listed]


def changed_files(directory: Path, manifest: Manifest) -> list[str]:
    """Listed files that are there and not as they were built, whatever their times say."""
    there = {*all_files(directory)}
    return [name for name in altered_files(directory, manifest) if name in there]


def suspect_files(directory: Path, *, holds: str = WORLD) -> dict[str, bool]:
    """Files in a world's folder that may be a user's: not listed (False), or changed (True).

    Where a killed process has left the world half changed, both its manifests list files.
    """
    places = [directory]
    whole = directory / STAGING / WHOLE / directory.name
    if is_staging(directory / STAGING) and (whole / NAME).is_file():
        places.append(whole)
    found: list[dict[str, bool]] = []
    for place in places:
        manifest = read_manifest(place, holds=holds)
        foreign, changed = foreign_files(directory, manifest), changed_files(directory, manifest)
        found.append({**dict.fromkeys(foreign, False), **dict.fromkeys(changed, True)})
    common = {*found[0]}.intersection(*found[1:])
    if len(found) > 1:
        common = {name for name in common if not name.endswith("/")}  # its files are yet to come
    return {name: any(one[name] for one in found) for name in sorted(common)}


def is_rewritten(name: str) -> bool:
    """Whether an assessment may write a file of a world in its place."""
    return name in _OWN or name.startswith(ASSESSED)


def is_staging(folder: Path) -> bool:
    """Whether a folder is one in which we make something, or did when we were killed.

    One that was killed at once left it empty, or with an empty lock.
    """
    try:
        lock, inside = folder / LOCK, [path.name for path in folder.iterdir()]
        marks = (MARK,) if {*inside} - {LOCK} else (MARK, b"")
        if folder.is_symlink() or lock.is_symlink() or (inside and not lock.is_file()):
            return False
        return not inside or (lock.stat().st_size <= len(MARK) and lock.read_bytes() in marks)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return False


def altered_files(directory: Path, manifest: Manifest) -> dict[str, str]:
    """Files that are missing or not as they were built, with the hash that they should have.

    Raises:
        OutputError: for one that is a pipe or a device, which has no end.
    """
    names = all_files(directory)
    for path in (directory / name for name in names):
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise OutputError(f"{path} is no regular file: move it away")
    found = _hashes(directory, names, hash_found)
    return {
        name: wanted for name, wanted in manifest["outputs"].items() if found.get(name) != wanted
    }


@contextmanager
def blaming(directory: Path, altered: Collection[str]) -> Iterator[None]:
    """Turns what a world's damaged files raise, wherever they are read, into one line.

    Raises:
        OutputError: in place of any error that is not ours nor the disk's, if a file is altered.
    """
    try:
        yield
    except TerrainForgeError:
        raise
    except Exception as error:
        if not altered or getattr(error, "errno", None):
            raise
        why = " ".join(str(error).split()) or type(error).__name__
        name = min(altered)
        raise OutputError(f"{directory / name} is not as it was built: {why[:300]}") from error


def all_files(directory: Path) -> list[str]:
    """Files, links and empty folders (with a slash) of a folder; staging folders apart."""
    found = []
    for place, folders, files in os.walk(directory, onerror=_raise):
        if Path(place) == directory and STAGING in folders and is_staging(directory / STAGING):
            folders.remove(STAGING)
        links = [name for name in folders if (Path(place) / name).is_symlink()]
        here = Path(place).relative_to(directory)
        found += [(here / name).as_posix() for name in (*files, *links)]
        found += [] if folders or files else [f"{here.as_posix()}/"]
    return sorted({*found} - {"./"})


def _raise(error: OSError) -> NoReturn:
    """A folder that cannot be listed must not look empty."""
    raise error


def hash_found(path: Path) -> str:
    """SHA-256 of a file that may have been changed since, or why it cannot be read."""
    try:
        return sha256(path)
    except OSError as error:
        if error.errno in _OF_THE_MACHINE:
            raise
        return str(error)


def _hashes(
    directory: Path, names: Sequence[str], hashed: Callable[[Path], str] = sha256
) -> dict[str, str]:
    """SHA-256 of those of the files that equal builds must agree in."""
    names = [name for name in names if _is_promised(name) and (directory / name).is_file()]
    with worker_threads(_READERS) as pool:
        return dict(zip(names, pool.map(lambda n: hashed(directory / n), names), strict=True))


def _is_promised(name: str) -> bool:
    """Whether equal builds must agree in this file."""
    changing = name in (NAME, "timings.json") or name.endswith(".log")
    return not changing and not name.startswith(_FREE)


@dataclass(frozen=True, kw_only=True)
class FolderState:
    """What lies in a built folder before it is assessed again."""

    altered: dict[str, str] = field(default_factory=dict)
    """Files that are not as they were built, with the hash that they should have."""
    foreign: tuple[str, ...] = ()
    """Files that are not the world's."""
    assessment: tuple[str, ...] = ()
    """Files of an earlier assessment."""
    intact: bool = False
    """Whether world, exports and assessment are as versions like ours wrote them, but for what is
    about to be written anew."""


def folder_state(out: Path, manifest: Manifest, *renewed: str) -> FolderState:
    """What lies in a built folder, besides what is about to be written anew.

    Args:
        out: The folder.
        manifest: Its manifest.
        renewed: Folders (with a slash) that are written anew.
    """
    foreign, altered = foreign_files(out, manifest), altered_files(out, manifest)
    anew = (*ASSESSED, *renewed)
    kept = (name for name in altered if not name.startswith(renewed or "\0"))
    made_by = manifest.get("terrain_forge"), manifest.get("versions")
    return FolderState(
        intact=not any(kept) and made_by == (__version__, made_with()),
        altered={name: wanted for name, wanted in altered.items() if not name.startswith(anew)},
        foreign=tuple(name for name in foreign if not name.startswith(renewed or "\0")),
        assessment=tuple(
            name
            for name in all_files(out)
            if name.startswith("validation/") and not name.endswith("/") and name not in foreign
        ),
    )
