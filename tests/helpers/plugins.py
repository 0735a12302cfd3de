"""Packages of others beside ours, as pip installs them and a new process finds them."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

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


@contextmanager
def fresh(site: Path) -> Iterator[None]:
    """Within it `terrain_forge` is imported anew, with a folder's packages installed.

    A process of its own would import all that we depend on too, which takes seconds.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        kept = {name: sys.modules.pop(name) for name in list(sys.modules) if _is_ours(name)}
        importlib.invalidate_caches()
        try:
            with pytest.MonkeyPatch.context() as small:
                make_small(small)
                yield
        finally:
            for name, module in list(sys.modules.items()):
                file = getattr(module, "__file__", None)
                if _is_ours(name) or (file and Path(file).is_relative_to(site)):
                    del sys.modules[name]
            sys.modules.update(kept)


def _is_ours(name: str) -> bool:
    return name.partition(".")[0] == "terrain_forge"
