"""Files of triangle meshes: read as they are, or refused with the reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.rocks.shapes.shapes import projections

Faces = NDArray[np.int64]

FORMATS = (".obj", ".stl", ".ply", ".glb", ".gltf")
"""Endings of the files that are read."""
MOST_FACES = 200_000
"""Faces of a file, at most; a rock's own mesh has a hundredth of them."""

_Y_UP = (".glb", ".gltf")
_COARSEST = 1 / 16  # of an edge of middling length: steps of the coordinates


class Refused(Exception):
    """Why a mesh cannot be a rock."""


def load_mesh(path: Path) -> tuple[Array, Faces, list[str]]:
    """Vertices and faces of all that a file holds, and what is to be said of it.

    Its middle becomes the origin, since sums over coordinates of a map would lose their digits.

    Raises:
        Refused: for a file that is missing or no whole mesh.
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise Refused(f"not a mesh that can be read; allowed: {', '.join(FORMATS)}")
    if not path.is_file():
        raise Refused("no such file")
    unreadable = f"is no readable {kind[1:].upper()}: truncated or of another format"
    notes = _obj_notes(path, unreadable) if kind == ".obj" else []
    import trimesh

    try:
        loaded: Any = trimesh.load(path, process=False)
        points, faces, textured = _joined(loaded)
    except Refused:
        raise
    except Exception:  # trimesh's readers raise whatever they stumble over
        raise Refused(unreadable) from None
    if not len(faces):
        raise Refused(f"holds no faces, or {unreadable}")
    if len(faces) > MOST_FACES:
        raise Refused(f"{len(faces)} faces, at most {MOST_FACES}: simplify it first")
    if faces.min() < 0 or faces.max() >= len(points):
        raise Refused(unreadable)
    used = points[np.unique(faces)]
    points = points - 0.5 * (used.min(axis=0) + used.max(axis=0))
    if kind in _Y_UP:
        points = points[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    return points, faces, [*notes, *(["its texture is not used"] if textured else [])]


def _joined(loaded: Any) -> tuple[Array, Faces, bool]:
    """Vertices and faces of everything in a file, and whether it has a texture."""
    parts = [(np.eye(4), loaded)]
    if hasattr(loaded, "geometry"):
        nodes = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
        parts = [(transform, loaded.geometry[name]) for transform, name in nodes]
    parts = [(transform, part) for transform, part in parts if hasattr(part, "faces")]
    points, faces, first, textured = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0, False
    for transform, part in parts:
        own, corners = np.asarray(part.vertices, np.float64), np.asarray(part.faces, np.int64)
        _require_digits(own, corners)
        points.append(projections(own, transform[:3, :3]) + transform[:3, 3])
        faces.append(corners + first)
        first += len(own)
        textured = textured or getattr(part.visual, "kind", None) == "texture"
    return np.concatenate(points), np.concatenate(faces), textured


def _require_digits(points: Array, faces: Faces) -> None:
    """Refuse coordinates that are not finite, or whose digits single precision has cut off."""
    if not np.isfinite(points).all():
        raise Refused("holds coordinates that are not finite")
    if not len(faces) or not np.array_equal(points, points.astype(np.float32)):
        return
    largest = float(np.abs(points).max())
    step = float(np.spacing(np.float32(largest)))
    sides = np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=1)], axis=2)
    edge = float(np.median(sides))
    if step > _COARSEST * edge > 0.0:
        raise Refused(
            f"coordinates of about {largest:.1g} m in single precision leave only steps of "
            f"{step:.2g} m, its edges are of {edge:.2g} m: move it to its origin, then save it"
        )


def _obj_notes(path: Path, unreadable: str) -> list[str]:
    """What is to be said of an OBJ file's text.

    Raises:
        Refused: if a line is cut short, or a face names a vertex that the file does not have.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    vertices, largest = 0, 0
    for line in text.replace("\\\n", " ").splitlines():
        kind, *words = line.split("#")[0].split() or [""]
        if kind not in ("v", "f"):
            continue
        if len(words) < 3:
            raise Refused(unreadable)
        vertices += kind == "v"
        try:
            numbers = [float(word.split("/")[0]) for word in words]
        except ValueError:
            raise Refused(unreadable) from None
        if kind == "f":
            largest = max(largest, int(max(numbers)))
            if -min(numbers) > vertices or 0 in numbers:
                raise Refused(unreadable)
    if largest > vertices:
        raise Refused(f"is truncated: faces name {largest} vertices, it holds {vertices}")
    cut = text.rstrip(" ") and not text.endswith("\n")
    return ["its last line has no end: it may be truncated"] if cut else []
