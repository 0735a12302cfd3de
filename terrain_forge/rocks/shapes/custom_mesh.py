"""Rock shapes that the user brings: read, repaired where that is safe, else refused with reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Key,
    require_gltf,
)
from terrain_forge.model import Mesh
from terrain_forge.rocks.shapes.collision import manifold, unite
from terrain_forge.rocks.shapes.mesh_companions import GLTF, Beside, files_of_mesh
from terrain_forge.rocks.shapes.shapes import projections
from terrain_forge.rocks.shapes.solid import cuts_itself, signed_volume

Faces = NDArray[np.int64]

FORMATS = (".obj", ".stl", ".ply", ".glb", ".gltf")
"""Endings of the files that are read."""
MOST_FACES = 200_000
"""Faces of a file, at most; a rock's own mesh has a hundredth of them."""
WIDEST_HOLE = 12
"""Edges around a hole that is filled, at most."""
LARGEST_HOLE = 0.02
"""Part of a mesh's area that a hole may have that is filled, at most."""
ALL_HOLES = 0.05
"""Part of a mesh's area that all its holes together may have, at most."""

_MOST_NUMBERS = 200 * MOST_FACES  # of a glTF, so that none is read that has far more faces
_COARSEST = 1 / 16  # of an edge of middling length: steps of the coordinates
_SAME_PLACE = 1e-7  # of the largest extent
_FLATTEST = 1e-5  # volume over the cube of the largest extent, thickness over width


class Refused(Exception):
    """Why a mesh cannot be a rock."""


def read_rock_mesh(path: Path, *, key: Key) -> tuple[Mesh, tuple[str, ...]]:
    """Read a closed mesh of one body, with what had to be repaired.

    Vertices at one place are merged, faces without area or given twice are dropped, faces are
    turned to look outward, small holes and closed cavities are filled, and bodies that overlap are
    united. The axes and units are the file's, but glTF, in which y is up by its specification, is
    turned to z up; the origin becomes the middle.

    Args:
        path: An OBJ, STL, PLY, GLB or glTF file.
        key: Where in the recipe it is named.

    Raises:
        DataError: for a file that is missing, unreadable or no closed body, with the reason.
    """
    try:
        points, faces, notes = _load(path)
        points, faces, cleaned = _clean(points, faces)
        faces, turned = _orient(faces)
        points, faces, filled = _fill_holes(points, faces)
        _require_fans(faces)
        mesh, united = _unite_bodies(points, faces)
    except Refused as refused:
        raise DataError(f"{path.name}: {refused}", key=key) from None
    return mesh, (*notes, *cleaned, *turned, *filled, *united)


def _load(path: Path) -> tuple[Array, Faces, list[str]]:
    """Vertices and faces of all that a file holds, and what is to be said of it.

    Its middle becomes the origin, since sums over coordinates of a map would lose their digits.
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
        if kind in GLTF:
            require_gltf(path.read_bytes(), most=_MOST_NUMBERS)
        beside: Any = Beside(path.parent, frozenset(files_of_mesh(path)))
        loaded: Any = trimesh.load(path, process=False, resolver=beside)
        points, faces, textured = _joined(loaded)
    except Refused:
        raise
    except Exception:  # trimesh's readers raise whatever they stumble over
        raise Refused(unreadable) from None
    if not len(faces):
        raise Refused(f"holds no faces, or {unreadable}")
    if faces.min() < 0 or faces.max() >= len(points):
        raise Refused(unreadable)
    used = points[np.unique(faces)]
    points = points - 0.5 * (used.min(axis=0) + used.max(axis=0))
    if kind in GLTF:
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
        if sum(map(len, faces)) > MOST_FACES:
            raise Refused(f"more than {MOST_FACES} faces: simplify it first")
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
    """What is to be said of an OBJ file's text; refuses short lines and faces without vertices."""
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


def _clean(points: Array, faces: Faces) -> tuple[Array, Faces, list[str]]:
    """Merge vertices at one place, drop faces without three corners or given twice."""
    used = points[np.unique(faces)]
    extent = float(np.ptp(used, axis=0).max())
    if extent == 0.0:
        raise Refused("all its corners lie at one place")
    principal = np.linalg.svd(used - used.mean(axis=0), compute_uv=False)
    if principal[-1] <= _FLATTEST * principal[0]:
        raise Refused("encloses no volume: all its corners lie in one plane")
    places = np.round(points / (_SAME_PLACE * extent)).astype(np.int64)
    _, first, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    faces = place.ravel()[faces]
    a, b, c = faces.T
    whole = faces[(a != b) & (b != c) & (c != a)]
    _, once = np.unique(np.sort(whole, axis=1), axis=0, return_index=True)
    kept = whole[np.sort(once)]
    repairs = [f"{len(points) - len(first)} vertices merged"] if len(first) < len(points) else []
    if len(kept) < len(faces):
        repairs.append(f"{len(faces) - len(kept)} faces without area or given twice dropped")
    return points[first], kept, repairs


def _edges(faces: Faces) -> Faces:
    """The directed edges of faces, side by side, shape [3 · faces, 2]."""
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def _orient(faces: Faces) -> tuple[Faces, list[str]]:
    """Turn faces so that each runs along its edges against its neighbours."""
    edges = _edges(faces)
    _, edge, uses = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    if uses.max() > 2:
        raise Refused(f"{int((uses > 2).sum())} edges belong to more than two faces")
    order = np.argsort(edge.ravel(), kind="stable")
    first = np.cumsum([0, *uses[:-1]])[uses == 2]
    one, other = order[first], order[first + 1]
    # Each face is there twice, as it is and turned; each is linked to what agrees with it.
    turn = np.where(edges[one, 0] == edges[other, 1], 0, len(faces))
    one, other = one // 3, other // 3
    starts, ends = [one, one + len(faces)], [other + turn, other + len(faces) - turn]
    label = _connected(np.concatenate(starts), np.concatenate(ends), 2 * len(faces))
    as_is, reverse = label.reshape(2, -1)
    if (as_is == reverse).any():
        raise Refused("has no inside: its faces cannot all look outward")
    turned = as_is > reverse  # parts are numbered by their first face, which stays as it is
    few = min(int(turned.sum()), int((~turned).sum()))
    repairs = [f"{few} faces turned to agree with their neighbours"] if few else []
    return np.where(turned[:, None], faces[:, ::-1], faces), repairs


def _connected(starts: NDArray[np.int64], ends: NDArray[np.int64], count: int) -> Faces:
    """Number of the connected part of a graph that each of its nodes belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(starts)), (starts, ends)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _fill_holes(points: Array, faces: Faces) -> tuple[Array, Faces, list[str]]:
    """Fill the holes that are small and of few edges by fans around their middles."""
    whole, total = _area(points, faces), 0.0
    new_points, new_faces = [points], [faces]
    for loop in _hole_edges(faces):
        if len(loop) > WIDEST_HOLE:
            raise Refused(
                f"is open: a hole of {len(loop)} edges, at most {WIDEST_HOLE} can be filled"
            )
        new_points.append(points[loop].mean(axis=0)[None])
        middle = np.full(len(loop), len(points) + len(new_faces) - 1)
        new_faces.append(np.stack([loop, np.roll(loop, -1), middle], axis=1))
        area = _area(np.concatenate(new_points), new_faces[-1]) / whole
        total += area
        if area > LARGEST_HOLE or total > ALL_HOLES:
            raise Refused(
                f"is open: holes of {total:.1%} of its area, at most {LARGEST_HOLE:.0%} each and "
                f"{ALL_HOLES:.0%} together can be filled"
            )
    repairs = [f"{len(new_faces) - 1} small holes filled"] if len(new_faces) > 1 else []
    return np.concatenate(new_points), np.concatenate(new_faces), repairs


def _hole_edges(faces: Faces) -> list[list[int]]:
    """The vertices around each hole, in the order in which faces that fill it run."""
    directed = {(int(a), int(b)) for a, b in _edges(faces)}
    following: dict[int, int] = {}
    for a, b in directed:
        if (b, a) not in directed:
            if b in following:
                raise Refused("is open: two holes meet at one corner")
            following[b] = a
    loops = []
    while following:
        loop = [min(following)]
        while (end := following.pop(loop[-1])) != loop[0]:
            loop.append(end)
        loops.append(loop)
    return loops


def _area(points: Array, faces: Faces) -> float:
    """Area of triangles [m²]."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _require_fans(faces: Faces) -> None:
    """Refuse a closed mesh of which two parts meet in one vertex alone."""
    # Each corner of a face, and the one at the same vertex in the next face around it.
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    leaving = dict(zip(map(tuple, _edges(faces).tolist()), corner.ravel().tolist(), strict=True))
    into = [(b, a) for a, b in _edges(faces[:, [2, 0, 1]]).tolist()]
    following = [leaving[edge] for edge in into]
    fans = _connected(corner.ravel(), np.array(following), corner.size).max() + 1
    pinched = fans - len(np.unique(faces))
    if pinched:
        raise Refused(f"parts of it meet in a single corner, at {pinched} places: let them overlap")


def _unite_bodies(points: Array, faces: Faces) -> tuple[Mesh, list[str]]:
    """One closed body whose faces look outward."""
    starts, ends = _edges(faces).T
    part = _connected(starts, ends, len(points))[faces[:, 0]]
    found = []
    for number in np.unique(part):
        body = _compact(points, faces[part == number])
        volume = signed_volume(body)
        if abs(volume) <= _FLATTEST * np.ptp(body.vertices, axis=0).max() ** 3:
            raise Refused("encloses no volume")
        if cuts_itself(body):
            raise Refused("its surface cuts itself")
        if volume < 0.0:
            body = body.replace(faces=body.faces[:, ::-1])
        found.append((body, abs(volume), volume < 0.0))
    found.sort(key=lambda one: -one[1])
    bodies, repairs, cavities, inside_out = [], [], 0, False
    for body, _, inward in found:
        others = (manifold(other) for other, _, turned in found if turned != inward)
        if any((manifold(body) - other).is_empty() for other in others):  # wholly within it
            cavities += 1
            continue
        inside_out = inside_out or inward
        bodies.append(body)
    if inside_out:
        repairs.append("turned inside out")
    if cavities:
        repairs.append(f"{cavities} cavities filled" if cavities > 1 else "cavity filled")
    if len(bodies) == 1:
        return bodies[0], repairs
    return _union(bodies), [*repairs, f"{len(bodies)} bodies united"]


def _compact(points: Array, faces: Faces) -> Mesh:
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(vertices=points[used], faces=index.reshape(faces.shape).astype(np.int32))


def _union(bodies: list[Mesh]) -> Mesh:
    mesh = unite(tuple(bodies))
    points, faces, _ = _clean(mesh.vertices, mesh.faces.astype(np.int64))
    _, uses = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_counts=True)
    apart = len(manifold(mesh).decompose())
    if apart > 1:
        raise Refused(f"holds {apart} bodies that do not overlap: a rock is one body")
    if (uses != 2).any():
        raise Refused(f"its {len(bodies)} bodies only touch: let them overlap")
    return _compact(points, faces)
