"""An output folder that appears whole or not at all, one writer at a time.

What is being made lies in a staging folder beside the target until the two change places. A lock in
the staging folder, which ends with its process, tells a live build's from what a killed one left.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import logging
import os
import shutil
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path, PurePosixPath

from terrain_forge.base import (
    DataError,
    OutputError,
    hold_interrupts,
    read_json,
    storing,
    sync,
    write_through,
)
from terrain_forge.building.manifest import (
    LOCK,
    MARK,
    NAME,
    STAGING,
    WHOLE,
    WORLD,
    all_files,
    foreign_files,
    is_rewritten,
    is_staging,
    read_manifest,
    suspect_files,
)
from terrain_forge.building.refusals import require_ours

_log = logging.getLogger(__name__)
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@contextmanager
def replacing(target: Path, *, force: bool = False, holds: str = WORLD) -> Iterator[Path]:
    """A new folder of the same name that takes the target's place when the block ends well.

    Args:
        target: The output folder, symbolic links resolved.
        force: Whether files that its manifest does not list may be removed.
        holds: What an older folder of ours must hold to be replaced.

    Raises:
        OutputError: if another process writes the target, or it is not ours to replace.
        StorageError: if the disk does not take what is written.
        KeyboardInterrupt: with what the target is, where that came after the exchange.
    """
    around = target.with_name(f".{target.name}{STAGING}")
    fresh = around / target.name
    number = -1
    try:
        with _leaving_none(*target.parents), storing(target, around), ExitStack() as locks:
            locks.enter_context(_staging(around, target))
            if target.exists():
                locks.enter_context(_staging(target / STAGING, target))
            fresh.mkdir()
            number = fresh.stat().st_ino
            yield fresh
            write_through(fresh)
            known = require_ours(target, force=force, holds=holds)  # again: a build takes its time
            _exchange(fresh, target)
            sync(target.parent)
            with suppress(OSError):  # the new world is there, whatever comes of the old
                _keep_new_files(fresh, target, known, holds)
    except BaseException as error:
        complete = target.exists() and target.stat().st_ino == number
        if complete and isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(f"{target} is complete") from None
        raise


@contextmanager
def _leaving_none(*folders: Path) -> Iterator[None]:
    """Removes those of some folders, the innermost first, that came to be for what then failed."""
    made = [folder for folder in folders if not folder.exists()]
    try:
        yield
    except BaseException:
        with suppress(OSError):  # those that hold something stay
            for folder in made:
                folder.rmdir()
        raise


def finish(out: Path) -> None:
    """Go on where a process was killed while a world's changed files took their places.

    Raises:
        OutputError: if another process writes the world, a file or link of others is in the way, or
            what was left is damaged.
        StorageError: if the disk does not take the files.
    """
    if is_staging(out / STAGING) and (out / STAGING / WHOLE).exists():
        with storing(out, out), _staging(out / STAGING, out):
            pass


@contextmanager
def holding(out: Path) -> Iterator[None]:
    """Within it no other process of ours writes a folder, which is made where there is none.

    Raises:
        OutputError: if another one does.
        StorageError: if the disk does not take what is written.
    """
    with _leaving_none(out, *out.parents), storing(out, out), _staging(out / STAGING, out):
        yield


@contextmanager
def updating(out: Path, *, anew: Iterable[str] = (), foreign: Iterable[str] = ()) -> Iterator[Path]:
    """A copy of a world to be changed, by links, whose files take the world's places in the end.

    Until then the world stays as it is. Where a process is killed while they do, the next one that
    writes the world goes on.

    Args:
        out: The world's folder.
        anew: Folders that are written anew, of which nothing is copied.
        foreign: Files that stay where they are.

    Raises:
        OutputError: if another process writes the world, or a file of others is in the way.
        StorageError: if the disk does not take what is written.
        KeyboardInterrupt: with what the world is, where that came when it was whole.
    """
    for name in all_files(out):
        if (name == "validation" or is_rewritten(name)) and (out / name).is_symlink():
            raise OutputError(f"{out / name} is a link, and would be written: put the file there")
    number = -1
    try:
        with storing(out, out), _staging(out / STAGING, out) as staging:
            fresh = staging / _NEXT / out.name
            _link(out, fresh, leave={*foreign}, anew=tuple(f"{folder}/" for folder in anew))
            yield fresh
            made = all_files(fresh)
            if clash := sorted({*made} & {*foreign}):
                raise OutputError(f"{out / clash[0]} is in the way: move it away")
            gone = sorted({*all_files(out)} - {*made, *foreign})
            (fresh.parent / _GONE).write_text(json.dumps(gone), encoding="utf-8")
            write_through(fresh.parent)
            number = (fresh / NAME).stat().st_ino
            fresh.parent.rename(staging / WHOLE)
            _take_places(staging / WHOLE, out)
    except KeyboardInterrupt:
        if (out / NAME).stat().st_ino == number:
            raise KeyboardInterrupt(f"{out} is complete") from None
        raise


def _link(out: Path, fresh: Path, *, leave: Collection[str], anew: tuple[str, ...]) -> None:
    """Copy a world's files by links; those that are written anew, bit by bit."""
    fresh.mkdir(parents=True)
    for name in all_files(out):
        if name in leave or name.startswith(anew or "\0"):
            continue
        (fresh / name).parent.mkdir(parents=True, exist_ok=True)
        if name.endswith("/"):
            (fresh / name).mkdir()
            continue
        try:
            if is_rewritten(name):
                raise OSError
            os.link(out / name, fresh / name, follow_symlinks=False)
        except OSError:  # nor has every file system such links
            shutil.copy2(out / name, fresh / name, follow_symlinks=False)


def _take_places(whole: Path, out: Path, *, kept: Collection[str] = ()) -> None:
    """Let the files of a world's changed copy take the world's places, but those that are kept.

    It may be begun again.

    Raises:
        OutputError: if a file or link of others stands where a folder goes, or the list of what is
            to go is damaged.
    """
    fresh = whole / out.name
    names, gone = all_files(fresh), {*_gone(whole)} - {*kept}
    staying = {*all_files(out)} - gone
    folders = {str(folder) for name in names for folder in PurePosixPath(name).parents}
    if clash := sorted(folders & staying):
        raise OutputError(f"{out / clash[0]} is in the way: move it away")
    for name in (name for name in all_files(out) if name in gone):
        (out / name).rmdir() if name.endswith("/") else (out / name).unlink()
        for above in (out / name).parents:
            if above == out or any(above.iterdir()):
                break
            above.rmdir()
    for name in sorted(names, key=lambda name: name == NAME):  # the manifest last
        if name.endswith("/"):
            (out / name).mkdir(parents=True, exist_ok=True)
        elif name not in kept:
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            (fresh / name).replace(out / name)
    for folder in {(out / name).parent for name in names}:
        sync(folder)
    whole.rename(whole.with_name(_NEXT))  # what is left of it


def _gone(whole: Path) -> list[str]:
    """Files that are to go where a world's changed copy takes its places."""
    try:
        gone, why = read_json(whole / _GONE, _GONE), f"{_GONE} is no list of names"
    except DataError as error:
        gone, why = None, str(error)
    if not isinstance(gone, list) or not all(isinstance(name, str) for name in gone):
        raise OutputError(f"{whole} is damaged: {why}; move it away, and build the world anew")
    return gone


@contextmanager
def _staging(folder: Path, target: Path) -> Iterator[Path]:
    """An empty folder that is locked; it is removed at the end."""
    handle = -1
    try:
        with hold_interrupts():
            handle = _locked(folder, target)
            _recover(folder, target)
        yield folder
    finally:
        with hold_interrupts(wholly=True):
            if handle >= 0:
                try:
                    _clear(folder, target)
                finally:
                    os.close(handle)


def _clear(folder: Path, target: Path) -> None:
    _recover(folder, target)
    with suppress(OSError):
        if len(list(folder.iterdir())) == 1:  # what could not be cleared keeps its mark
            (folder / LOCK).unlink()
            folder.rmdir()


_NEXT, _GONE = "next", "gone.json"
"""Where a world is changed, and beside it what of the older one is to go."""
_OLD = "old"
"""Where the older world lies for a moment, on file systems that cannot exchange two folders."""


def _locked(folder: Path, target: Path) -> int:
    while True:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if os.path.lexists(folder) and not is_staging(folder) and os.path.lexists(folder):
                raise OutputError(f"{folder} is in the way: move it away") from None
        with suppress(FileNotFoundError):  # another one has just removed the folder
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
            handle = os.open(folder / LOCK, flags, 0o600)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(handle).st_ino == (folder / LOCK).stat().st_ino:
                    os.pwrite(handle, MARK, 0)
                    return handle
            except BlockingIOError:
                os.close(handle)
                raise OutputError(f"{target} is being written by another terrain-forge") from None
            except BaseException:
                with suppress(OSError):  # a full disk takes no mark: what is empty goes
                    if not os.fstat(handle).st_size:
                        (folder / LOCK).unlink()
                        folder.rmdir()
                os.close(handle)
                raise
            os.close(handle)


def _recover(folder: Path, target: Path) -> None:
    """Bring back a world that was set aside and not replaced; clear what else is left."""
    old, whole = folder / _OLD, folder / WHOLE
    if _is_ours(old) and not target.exists():
        old.rename(target)
    if _is_ours(whole) and _is_ours(whole / target.name):
        _empty(folder, LOCK, WHOLE)
        _take_places(whole, target, kept=suspect_files(target))
    _empty(folder, LOCK)


def _empty(folder: Path, *kept: str) -> None:
    """Remove what is in a staging folder but for some names; what links lead to stays."""
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.name in kept:
            continue
        if _is_ours(path):
            gone = path.with_name(f"{path.name}-{os.getpid()}")
            with suppress(OSError):  # at once, lest a worker go on in what is left of its folder
                path = path.rename(gone)
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()


def _is_ours(path: Path) -> bool:
    """Whether a part of a staging folder is a folder, as we make them; links lead elsewhere."""
    return path.is_dir() and not path.is_symlink()


def _exchange(fresh: Path, target: Path) -> None:
    """Let two folders change places, at once where the system can."""
    if not target.exists():
        fresh.rename(target)
    elif not _renamed_at_once(fresh, target):
        aside = fresh.with_name(_OLD)
        target.rename(aside)
        fresh.rename(target)
        aside.rename(fresh)


def _renamed_at_once(one: Path, other: Path) -> bool:
    """Whether the system has renameat2 and this file system exchanges folders."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    paths = os.fsencode(one), os.fsencode(other)
    return bool(rename(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0)


def _keep_new_files(old: Path, target: Path, known: Collection[str], holds: str) -> None:
    """Set an older world aside for good if files of others came into it at the last moment."""
    if not old.is_dir():
        return
    manifest = read_manifest(old, holds=holds) if (old / NAME).is_file() else {}
    if set(foreign_files(old, manifest)) - set(known):
        kept = target.with_name(f"{target.name}-{time.time_ns()}")
        old.rename(kept)
        _log.warning(
            "%s got new files while it was built anew; the older is kept: %s", target, kept
        )
