"""Rock libraries kept on disk, so that a second build, or another world, need not make them again.

The folder is `terrain-forge` in the user's cache folder (XDG_CACHE_HOME, ~/.cache); the environment
variable TERRAIN_FORGE_CACHE names another one, or `off`. It can be deleted at any time.
"""

from __future__ import annotations

import json
import os
import platform
import tempfile
import zlib
from dataclasses import asdict
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from logging import getLogger
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import from_plain, to_plain
from terrain_forge.model import CustomMesh, RockLibrary
from terrain_forge.rocks.library import LibrarySpec, make_library

logger = getLogger(__name__)

MOST_FILES = 64
"""Libraries that are kept; the oldest go first."""

_VARIABLE = "TERRAIN_FORGE_CACHE"
_MAKERS = ("numpy", "scipy", "numba", "manifold3d", "coacd")
_BROKEN = (OSError, ValueError, LookupError, TypeError, EOFError, BadZipFile, zlib.error)


def find_library(spec: LibrarySpec, *, custom: tuple[CustomMesh, ...] = ()) -> RockLibrary:
    """The library that `make_library` makes, to the bit, from the cache where it holds it.

    A cache that cannot be read or written is only logged: the library is then made.

    Args:
        spec: What is wanted.
        custom: The user's own shapes, by the paths that the spec names.

    Raises:
        RecipeError: if a shape cannot be cut into parts as close as `spec` wants.
    """
    folder = cache_folder()
    if folder is None:
        return make_library(spec, custom=custom)
    file = folder / f"rocks-{library_key(spec, custom)}.npz"
    library = _read(file)
    if library is None:
        library = make_library(spec, custom=custom)
        store(file, library)
    return library


def cache_folder() -> Path | None:
    """Where libraries are kept; None where they are not."""
    chosen = os.environ.get(_VARIABLE)
    if chosen in ("", "off"):
        return None
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        if chosen is not None:
            return Path(chosen).expanduser()
        return Path(base or Path.home() / ".cache") / "terrain-forge"
    except RuntimeError:  # no home folder
        return None


def library_key(spec: LibrarySpec, custom: tuple[CustomMesh, ...]) -> str:
    """SHA-256 of all that a library follows from, hexadecimal: wishes, meshes, code, packages."""
    wishes = json.dumps(asdict(spec), sort_keys=True)
    digest = sha256(f"{wishes}\n{_origin()}".encode())
    for own in custom:
        digest.update(f"{own.path}\n{len(own.mesh.vertices)}\n".encode())
        digest.update(own.mesh.vertices.tobytes())
        digest.update(own.mesh.faces.tobytes())
    return digest.hexdigest()


@cache
def _origin() -> str:
    """The code that makes libraries, and what it runs on."""
    shapes = Path(__file__).parent
    rocks, package = shapes.parents[:2]
    sources = [*sorted(shapes.glob("*.py")), rocks / "library.py"]
    sources += [rocks / "embedding" / f"{name}.py" for name in ("footprint", "outline")]
    sources += [package / "base" / f"{name}.py" for name in ("geometry", "heap", "seeds")]
    sources += [package / "model" / "mesh.py"]
    code = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    return "\n".join([code, platform.machine(), *(f"{n} {version(n)}" for n in _MAKERS)])


def _read(file: Path) -> RockLibrary | None:
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        plain = json.loads(arrays.pop("plain").tobytes())
        library = from_plain(plain["library"], arrays)
        if isinstance(library, RockLibrary) and library.content_hash == plain["content_hash"]:
            return library
        logger.info("rock cache: %s does not hold what it should", file)
    except FileNotFoundError:
        pass
    except _BROKEN as error:
        logger.info("rock cache: %s cannot be read (%s)", file, error)
    return None


def store(file: Path, library: RockLibrary) -> None:
    """Keep a library; readers see all of the file or none of it."""
    arrays: dict[str, NDArray[Any]] = {}
    plain = {"library": to_plain(library, arrays, "library"), "content_hash": library.content_hash}
    text = np.frombuffer(json.dumps(plain).encode(), dtype=np.uint8)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix="new-") as folder:
            new = Path(folder) / file.name
            np.savez(new, allow_pickle=False, plain=text, **arrays)  # type: ignore[arg-type]
            new.replace(file)
        kept = sorted(file.parent.glob("rocks-*.npz"), key=lambda one: one.stat().st_mtime)
        for old in kept[:-MOST_FILES]:
            old.unlink(missing_ok=True)
    except OSError as error:
        logger.info("rock cache: %s cannot be written (%s)", file, error)
