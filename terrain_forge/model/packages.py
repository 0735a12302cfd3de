"""The software that a world is made with, as its manifest has it, and what of it is not here."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from terrain_forge.base import DataError, read_text, their_packages

MANIFEST = "manifest.json"
"""File of a built folder that says what it was made from."""
MAX_MANIFEST = 2**28
"""Bytes of a manifest."""
_LIBRARIES = (
    *("numpy", "scipy", "numba", "rasterio", "manifold3d", "embreex", "mujoco", "usd-core"),
    *("matplotlib", "pillow", "pydantic"),
)


@cache
def made_with() -> dict[str, str]:
    """Versions of what makes a world: libraries, and installed packages with parts for us."""
    found = {"python": platform.python_version()}
    for package in _LIBRARIES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return {**found, **their_packages()}


def packages_gone(directory: Path) -> str:
    """Packages with parts for us that a built folder was made with, and that are not here as such.

    In words, such as `dykes 0.1, terraces 1.0`; empty where its manifest tells of none.
    """
    try:
        manifest = json.loads(read_text(directory / MANIFEST, MANIFEST, most=MAX_MANIFEST))
        return lacking(dict(manifest["versions"]))
    except (DataError, OSError, ValueError, LookupError, TypeError, RecursionError):
        return ""


def lacking(versions: Mapping[str, str]) -> str:
    """Packages with parts for us by which something was made, and that are not here as such."""
    theirs = sorted({*versions} - {"python", *_LIBRARIES})
    return ", ".join(f"{name} {versions[name]}" for name in theirs if _here(name) != versions[name])


def _here(package: str) -> str:
    """The version of a package that is installed; empty if none is."""
    try:
        return version(package)
    except (PackageNotFoundError, ValueError, OSError):  # no name at all, or no metadata
        return ""
