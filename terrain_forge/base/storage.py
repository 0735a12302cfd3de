"""What a disk refuses."""

from __future__ import annotations

import errno
import os
import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from terrain_forge.base.bounded import size_text
from terrain_forge.base.errors import DISK_FULL, StorageError, TerrainForgeError
from terrain_forge.base.registry import plugin_at_fault

_FULL = 2**16
"""Bytes below which a disk is full."""
_REFUSALS = {
    *(*DISK_FULL, errno.EACCES, errno.EPERM),
    *(errno.EIO, errno.ENAMETOOLONG, errno.EBUSY, errno.EXDEV, errno.ENOLCK, errno.ENOTSUP),
    *(errno.ENOENT, errno.EEXIST, errno.ENOTDIR, errno.ELOOP),
}
_MISTAKES = {errno.ENOENT, errno.EEXIST, errno.ENOTDIR}
"""Of them, those that code causes by a wrong name."""
_SQLITE = {10: errno.EIO, 13: errno.ENOSPC}
"""SQLite's own numbers for what the disk refused (SQLITE_IOERR, SQLITE_FULL)."""


@contextmanager
def storing(target: Path, folder: Path) -> Iterator[None]:
    """Turns what a disk's limits raise, in whatever library, into one error.

    What code of another package meets elsewhere goes on as it is: the target has no part in it.

    Raises:
        StorageError: says why the target cannot be written.
    """
    try:
        yield
    except TerrainForgeError:
        raise
    except Exception as error:
        if why := _fault(error, folder):
            raise StorageError(f"{target} cannot be written: {why}") from error
        raise


def require_disk(
    target: Path, needed: float, *, spare: int = 0, gained: int = 0, remedy: str = ""
) -> None:
    """Refuse what a disk has no room for.

    Args:
        target: What is to be written.
        needed: About how many bytes of it are missing.
        spare: Bytes that stay free.
        gained: Bytes of what goes before.
        remedy: What else can be done.

    Raises:
        StorageError: says how much it needs, and how much there is.
    """
    place = next(above for above in (target, *target.absolute().parents) if above.exists())
    free = shutil.disk_usage(place).free + gained
    if needed + spare > free:
        more = f" and {size_text(spare)} to spare" if spare else ""
        raise StorageError(
            f"{target} cannot be written: what is missing needs about {size_text(round(needed))}"
            f"{more}, the disk has {size_text(free)} free{remedy}"
        )


def _is_elsewhere(error: BaseException, folder: Path) -> bool:
    """Whether what the system refused tells nothing of a folder."""
    named = getattr(error, "filename", None)
    if getattr(error, "errno", None) in _MISTAKES or not isinstance(named, str | os.PathLike):
        return True
    return folder not in Path(named).absolute().parents


def _fault(error: BaseException | None, folder: Path) -> str:
    """Why the disk refused; empty if it is not the disk's fault."""
    theirs = error is not None and plugin_at_fault(error)
    while error is not None:
        number = _SQLITE.get(
            getattr(error, "sqlite_errorcode", 0) & 255, getattr(error, "errno", 0)
        )
        if number in _REFUSALS and not (theirs and _is_elsewhere(error, folder)):
            return os.strerror(number)
        told = str(error)  # OpenUSD and GDAL tell it in words, and may have made room since
        for why in map(os.strerror, DISK_FULL):
            if why in told:
                return why
        error = error.__cause__ or error.__context__
    place = next(above for above in (folder, *folder.parents) if above.exists())
    if shutil.disk_usage(place).free < _FULL:
        return os.strerror(errno.ENOSPC)
    largest = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    sizes = (path.lstat().st_size for path in place.rglob("*"))
    if largest != resource.RLIM_INFINITY and any(size >= largest for size in sizes):
        return os.strerror(errno.EFBIG)
    return ""
