"""An output folder that appears whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path

from terrain_forge.base import OutputError
from terrain_forge.building.manifest import NAME, read_manifest


def require_ours(out: Path) -> None:
    """Refuse an output folder that exists and was not made by us."""
    if not out.exists() and not out.is_symlink():
        parent = next(p for p in out.absolute().parents if p.exists())
        if not parent.is_dir() or not os.access(parent, os.W_OK):
            raise OutputError(f"{out} cannot be made: {parent} is no folder that can be written")
        return
    if not out.is_dir() or (any(out.iterdir()) and not (out / NAME).is_file()):
        raise OutputError(
            f"{out} exists and is not a terrain-forge world; remove it or choose another with -o"
        )
    if (out / NAME).is_file():
        read_manifest(out)


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A temporary folder of the same name that takes the target's place when the block ends well.

    It lies in a sibling folder. An older target is set aside until then. Leftovers of builds that
    were killed are cleared away.
    """
    target = target.absolute()
    around = target.with_name(f".{target.name}.new-{os.getpid()}")
    fresh = around / target.name
    aside = target.with_name(f".{target.name}.old-{os.getpid()}")
    _clear_leftovers(target)
    try:
        _make(around)
        fresh.mkdir()
        yield fresh
        if target.exists():
            target.rename(aside)
        fresh.rename(target)
    except BaseException:
        shutil.rmtree(around, ignore_errors=True)
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
    around.rmdir()
    shutil.rmtree(aside, ignore_errors=True)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise OutputError(f"{folder.parent} cannot be written: {error.strerror}") from None


def _clear_leftovers(target: Path) -> None:
    """Remove what killed builds of this target left; bring back a world that one had set aside."""
    for kind in ("new", "old"):
        for left in sorted(target.parent.glob(f".{escape(target.name)}.{kind}-*")):
            process = left.name.rpartition("-")[2]
            if process.isdigit() and Path(f"/proc/{process}").exists():
                continue
            if kind == "old" and not target.exists():
                left.rename(target)
            else:
                shutil.rmtree(left, ignore_errors=True)
