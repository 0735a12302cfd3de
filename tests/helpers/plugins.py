"""Packages of others beside ours, as pip installs them and a new process finds them."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from tests.helpers.pictures import make_small


def install(site: Path, name: str, points: str, modules: Mapping[str, str]) -> Path:
    """Put a package of modules with entry points into a folder."""
    info = site / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(points)
    for file, text in modules.items():
        (site / file).parent.mkdir(exist_ok=True)
        (site / file).write_text(text)
    return site


_imported: dict[Path, dict[str, ModuleType]] = {}
"""What was imported with a folder's packages, which need not be done again."""


@contextmanager
def fresh(site: Path, *, anew: bool = False) -> Iterator[None]:
    """Within it `terrain_forge` is imported anew, with a folder's packages installed.

    A process of its own would import all that we depend on too, which takes seconds. What one
    such block has imported the next has too, unless it begins `anew`, as who wants to see what is
    said at the import must.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        kept = {name: sys.modules.pop(name) for name in list(sys.modules) if _is_ours(name)}
        if not anew:
            sys.modules.update(_imported.get(site, {}))
        importlib.invalidate_caches()
        try:
            with pytest.MonkeyPatch.context() as small:
                make_small(small)
                yield
        finally:
            theirs = f"{site}{os.sep}"
            _imported[site] = {
                name: sys.modules.pop(name)
                for name, module in list(sys.modules.items())
                if _is_ours(name) or (getattr(module, "__file__", "") or "").startswith(theirs)
            }
            sys.modules.update(kept)


def _is_ours(name: str) -> bool:
    return name.partition(".")[0] == "terrain_forge"
