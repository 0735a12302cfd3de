"""The manifest: what a world was made from, by what, and the hash of every file."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from terrain_forge import __version__
from terrain_forge.base import OutputError
from terrain_forge.model import Export, Site
from terrain_forge.recipe import sha256

NAME = "manifest.json"
FORMAT = 2
_PACKAGES = (
    *("numpy", "scipy", "numba", "rasterio", "manifold3d", "embreex", "mujoco", "usd-core"),
    *("matplotlib", "pillow", "pydantic"),
)
_FREE = ("dataset/", "validation/consumers/")


def write_manifest(
    site: Site,
    directory: Path,
    *,
    exports: Sequence[Export],
    altered: dict[str, str],
) -> Path:
    """Write `directory`/manifest.json over all files that are there; equal worlds, equal bytes.

    Args:
        site: what the world was made from.
        directory: the output folder.
        exports: what was exported into the folder.
        altered: files that are not as they were built, which keep the hash that they should have.
    """
    manifest = {
        "terrain_forge": __version__,
        "format": FORMAT,
        "name": site.name,
        "seed": site.seed,
        "recipe": json.loads(site.recipe_json),
        "versions": {"python": platform.python_version(), **_versions()},
        "inputs": dict(site.inputs),
        "exports": {export.folder: _plain(export) for export in sorted(exports, key=_folder)},
        "outputs": dict(sorted({**_hashes(directory), **altered}.items())),
    }
    path = directory / NAME
    text = json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
    return path


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of a built world.

    Raises:
        OutputError: if the folder holds none of ours.
    """
    try:
        manifest = json.loads((directory / NAME).read_text(encoding="utf-8"))
    except OSError:
        raise OutputError(f"{directory} is not a terrain-forge world (no {NAME})") from None
    except ValueError:
        raise OutputError(f"{directory / NAME} is damaged: not JSON") from None
    if not isinstance(manifest, dict) or "terrain_forge" not in manifest:
        raise OutputError(f"{directory}/{NAME} is not terrain-forge's")
    return manifest


def exports_in(manifest: dict[str, Any]) -> tuple[Export, ...]:
    """The exports that a manifest names, by folder.

    Raises:
        OutputError: if an older version wrote it, which did not name them.
    """
    if "exports" not in manifest:
        raise OutputError("an older version built that world; build it anew")
    return tuple(
        Export(folder=folder, **{**plain, "losses": tuple(plain["losses"])})
        for folder, plain in manifest["exports"].items()
    )


def _plain(export: Export) -> dict[str, Any]:
    return {"kind": export.kind, "options": export.options, "losses": list(export.losses)}


def _folder(export: Export) -> str:
    return export.folder


def altered_files(
    directory: Path, manifest: dict[str, Any], *, besides: tuple[str, ...]
) -> dict[str, str]:
    """Files that are missing or not as they were built, with the hash that they should have.

    Args:
        directory: the output folder.
        manifest: its manifest.
        besides: files and folders (with a slash) that are about to be written anew.
    """
    found = _hashes(directory)
    return {
        name: wanted
        for name, wanted in manifest["outputs"].items()
        if found.get(name) != wanted and not name.startswith(besides)
    }


def _versions() -> dict[str, str]:
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _hashes(directory: Path) -> dict[str, str]:
    names = sorted(
        path.relative_to(directory).as_posix() for path in directory.rglob("*") if path.is_file()
    )
    names = [name for name in names if _is_promised(name)]
    with ThreadPoolExecutor() as pool:
        return dict(zip(names, pool.map(lambda n: sha256(directory / n), names), strict=True))


def _is_promised(name: str) -> bool:
    """Whether equal builds must agree in this file."""
    changing = name in (NAME, "timings.json") or name.endswith(".log")
    return not changing and not name.startswith(_FREE)
