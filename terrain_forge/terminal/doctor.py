"""What `terrain-forge doctor` says: what is installed here, and what is not. It never fails."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from importlib.metadata import EntryPoint, PackageNotFoundError, version
from pathlib import Path

from terrain_forge import __version__
from terrain_forge.base import brought, size_text, skipped, their_plugins

_PACKAGES = (
    *("numpy", "scipy", "numba", "rasterio", "pydantic", "embreex", "mujoco", "usd-core"),
    *("manifold3d", "coacd", "trimesh", "matplotlib", "pillow", "xacro"),
)
_PROGRAMS = {
    "Gazebo": ("gz", "ign"),
    "Gazebo Classic": ("gazebo",),
    "ROS 2": ("ros2",),
    "Blender": ("blender",),
    "usdview": ("usdview",),
    "MeshLab": ("meshlab",),
    "QGIS": ("qgis",),
    "a browser": ("xdg-open", "open", "firefox", "chromium", "google-chrome"),
}
_PYTHONS = {
    "Drake": ("pydrake", "TERRAIN_FORGE_DRAKE_PYTHON"),
    "Newton": ("newton", "TERRAIN_FORGE_NEWTON_PYTHON"),
}
_GAZEBO_LIBRARIES = "sdformat12"


def doctor_lines(also: Sequence[Callable[[], object]] = ()) -> Iterator[str]:
    """The lines; what cannot be found out is said in its place.

    Args:
        also: Finders of parts in rooms above this one.
    """
    yield f"terrain-forge  {__version__}, {Path(__file__).parents[1]}"
    yield f"Python         {platform.python_version()}, {sys.executable}"
    yield f"system         {platform.platform()}, {platform.machine()}"
    yield f"cores          {_told(_cores)}"
    yield f"cache          {_told(_cache)}"
    yield f"kernels        {_told(_kernels)}"
    yield "packages"
    for name in _PACKAGES:
        yield f"  {name:<12} {_version(name)}"
    yield "engines"
    yield f"  {'rays':<12} {_told(_rays)}"
    yield f"  {'physics':<12} {_told(_physics)}"
    yield "exporters"
    for name in _exporters():
        yield f"  {name:<12} {_told(partial(_exporter, name))}"
    if others := their_plugins():
        yield "parts of other packages"
        _find_all(also)
        for what, point in others:
            yield f"  {what + ' ' + point.name:<24} {_part(point)}"
    yield "programs that open or check exports"
    for name, programs in _PROGRAMS.items():
        found = next(filter(None, map(shutil.which, programs)), "")
        yield f"  {name:<14} {found or 'not found: ' + ', '.join(programs)}"
    for name, (module, variable) in _PYTHONS.items():
        yield f"  {name:<14} {_told(partial(_python, module, variable))}"
    yield f"  {'Gazebo libs':<14} {_told(_gazebo)}"


def _told(find: Callable[[], str]) -> str:
    """What is found, or why not."""
    try:
        return find()
    except Exception as error:  # whatever is broken here is what is to be told
        return " ".join(f"not working: {type(error).__name__}: {error}".split())


def _cores() -> str:
    from terrain_forge.base import kernel_threads, processors

    count = os.cpu_count() or 1
    return f"{count}, {processors()} for this process, {kernel_threads()} used by kernels"


def _cache() -> str:
    from terrain_forge.base import cache_folder

    folder = cache_folder()
    if folder is None:
        return "off (TERRAIN_FORGE_CACHE)"
    return _holding(folder, "*", "file")


def _kernels() -> str:
    from numba.core import config

    chosen = getattr(config, "CACHE_DIR", "")  # read from NUMBA_CACHE_DIR
    return _holding(Path(chosen or Path(__file__).parents[1]), "*.nbi", "compiled kernel", ".nbc")


def _holding(folder: Path, pattern: str, thing: str, also: str = "") -> str:
    """A folder, and what it holds."""
    files = [path for path in folder.rglob(pattern) if path.is_file()] if folder.is_dir() else []
    bodies = [path for path in folder.rglob(f"*{also}") if path.is_file()] if also else []
    size = sum(path.stat().st_size for path in (*files, *bodies))
    return f"{folder}: {len(files):,} {thing}{'s' * (len(files) != 1)}, {size_text(size)}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _rays() -> str:
    from terrain_forge.scene import engine_name

    if engine_name() == "own":
        return "our own (TERRAIN_FORGE_RAYS, or no embreex for this machine)"
    from embreex import rtcore  # noqa: F401

    return f"Embree (embreex {_version('embreex')})"


def _physics() -> str:
    import mujoco

    return f"MuJoCo {mujoco.mj_versionString()}"


def _exporters() -> list[str]:
    from terrain_forge.model import exporter_names

    return exporter_names()


def _exporter(name: str) -> str:
    from terrain_forge.model import exporter

    readers = [reader.name for reader in getattr(exporter(name), "CONSUMERS", ())]
    return f"works; read back by {', '.join(readers)}" if readers else "works"


def _find_all(also: Sequence[Callable[[], object]]) -> None:
    """Look for parts of every kind, which judges those of other packages."""
    from terrain_forge.datasets import dataset_kinds
    from terrain_forge.evaluation import known_systems
    from terrain_forge.recipe import json_schema  # brings layers, laws, shapes, bodies, rovers
    from terrain_forge.sensors import instrument_kinds
    from terrain_forge.validation import inspections

    finders: list[Callable[[], object]] = [json_schema, inspections, instrument_kinds]
    finders += [dataset_kinds, known_systems, *also]
    for find in finders:
        with suppress(Exception):  # the lines say of each part whether it works
            find()
    for name in _exporters():
        with suppress(Exception):
            _exporter(name)


def _part(point: EntryPoint) -> str:
    """Whether a plugin works, where it is, and why not."""
    why = "; ".join(skipped(point, point.group))
    if why:
        return f"not working ({point.value}): {why}"
    used = sorted(brought(point))
    named = f" as {', '.join(used)}" if used and used != [point.name] else ""
    return f"works{named} ({point.value})"


def _python(module: str, variable: str) -> str:
    from terrain_forge.validation import NotRun, python_with

    try:
        return f"{module} in {python_with(module, variable)}"
    except NotRun as reason:
        return f"not found: {reason}"


def _gazebo() -> str:
    if shutil.which("pkg-config") is None:
        return "not found: pkg-config is not installed"
    asked = ["pkg-config", "--modversion", _GAZEBO_LIBRARIES]
    done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=20)
    found = done.stdout.strip()
    return f"{_GAZEBO_LIBRARIES} {found}" if found else f"{_GAZEBO_LIBRARIES} is not installed"
