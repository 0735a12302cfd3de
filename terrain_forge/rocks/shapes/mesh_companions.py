"""Files that a user's mesh names, of which only those in its folder or below are read."""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from terrain_forge.base import MAX_MESH, lies_within, require_file

GLTF = (".glb", ".gltf")
"""Endings of glTF's files, in which y is up."""


def files_of_mesh(path: Path) -> tuple[Path, ...]:
    """Files that a mesh file names and that are there: materials, textures, buffers.

    They lie in its folder or below, links followed; others it may not name.
    """
    if not path.is_file() or path.stat().st_size > MAX_MESH:
        return ()
    kind, content, named = path.suffix.lower(), path.read_bytes(), list[str]()
    if kind == ".obj":
        named = _words(content, "mtllib")
        for file in _below(path, named):
            if file.stat().st_size <= MAX_MESH:
                named += [words.split()[-1] for words in _words(file.read_bytes(), "map_")]
    elif kind in GLTF:
        if kind == ".glb":
            content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
        with suppress(ValueError, TypeError, AttributeError, RecursionError):
            tree = json.loads(content)
            parts = [*tree.get("buffers", ()), *tree.get("images", ())]
            uris = [str(part["uri"]) for part in parts if "uri" in part]
            named = [unquote(uri) for uri in uris if not uri.startswith("data:")]
    return _below(path, named)


def _below(path: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """Those of some files beside a mesh that are there, in its folder or below."""
    found, folder = [], [path.parent.resolve()]
    for file in (path.parent / name for name in dict.fromkeys(names)):
        with suppress(OSError, RuntimeError, ValueError):  # names that no file can have
            found += [file] if lies_within(file, folder) and file.is_file() else []
    return tuple(found)


def _words(content: bytes, start: str) -> list[str]:
    """What follows in the lines of a text that start so, any case."""
    lines = (line.split(None, 1) for line in content.decode("utf-8", "replace").splitlines())
    return [
        words[1].strip() for words in lines if len(words) > 1 and words[0].lower().startswith(start)
    ]


@dataclass(frozen=True)
class Beside:
    """Lets trimesh read what a mesh names, but for textures, which are not used."""

    folder: Path
    files: frozenset[Path]

    def get(self, name: str) -> bytes:
        """The content of a file."""
        path = self.folder / unquote(name)
        if path not in self.files or path.suffix.lower() not in (".mtl", ".bin"):
            raise FileNotFoundError(path.name)
        require_file(path, path.name, (), most=MAX_MESH)
        return path.read_bytes()

    __getitem__ = get
