"""Rock shapes that the user brings: read, repaired where that is safe, else refused with reason."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.errors import DataError
from terrain_forge.mesh import Mesh
from terrain_forge.rocks.self_intersection import cuts_itself
from terrain_forge.rocks.shapes import projections
from terrain_forge.rocks.solid import signed_volume

Array = NDArray[np.float64]
Faces = NDArray[np.int64]
Key = tuple[str | int, ...]

FORMATS = (".obj", ".stl", ".ply", ".glb", ".gltf")
"""Endings of the files that are read."""
MOST_FACES = 200_000
"""Faces of a file, at most; a rock's own mesh has a hundredth of them."""
WIDEST_HOLE = 12
"""Edges around a hole that is filled, at most."""

_Y_UP = (".glb", ".gltf")
_SAME_PLACE = 1e-7  # of the largest extent
_FLATTEST = 1e-5  # volume over the cube of the largest extent


class _Refused(Exception):
    """Why a mesh cannot be a rock."""


def read_rock_mesh(path: Path, *, key: Key) -> tuple[Mesh, tuple[str, ...]]:
    """Read a closed mesh of one body, with what had to be repaired.

    Vertices at one place are merged, faces without area or given twice are dropped, faces are
    turned to look outward, small holes are filled, and bodies that overlap are united. The axes and
    units are the file's, but glTF, in which y is up by its specification, is turned to z up.

    Args:
        path: An OBJ, STL, PLY, GLB or glTF file.
        key: Where in the recipe it is named.

    Raises:
        DataError: for a file that is missing, unreadable or no closed body, with the reason.
    """
    try:
        points, faces, repairs = _load(path)
        points, faces, cleaned = _clean(points, faces)
        faces, turned = _orient(faces)
        points, faces, filled = _fill_holes(points, faces)
        mesh, united = _unite_bodies(points, faces)
    except _Refused as refused:
        raise DataError(f"{path.name}: {refused}", key=key) from None
    return mesh, (*repairs, *cleaned, *turned, *filled, *united)


def _load(path: Path) -> tuple[Array, Faces, list[str]]:
    if path.suffix.lower() not in FORMATS:
        raise _Refused(f"not a mesh that can be read; allowed: {', '.join(FORMATS)}")
    if not path.is_file():
        raise _Refused("no such file")
    import trimesh

    try:
        loaded: Any = trimesh.load(path, process=False)
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        why = " ".join(str(error).split()) or type(error).__name__
        raise _Refused(f"cannot be read as {path.suffix[1:].upper()} ({why})") from None
    points, faces, textured = _joined(loaded)
    if not len(faces):
        raise _Refused("holds no faces")
    if len(faces) > MOST_FACES:
        raise _Refused(f"{len(faces)} faces, at most {MOST_FACES}: simplify it first")
    if not np.isfinite(points).all():
        raise _Refused("holds coordinates that are not finite")
    if path.suffix.lower() in _Y_UP:
        points = points[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    return points, faces, ["its texture is not used"] if textured else []


def _joined(loaded: Any) -> tuple[Array, Faces, bool]:
    """Vertices and faces of everything in a file, and whether it has a texture."""
    parts = [(np.eye(4), loaded)]
    if hasattr(loaded, "geometry"):
        nodes = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
        parts = [(transform, loaded.geometry[name]) for transform, name in nodes]
    parts = [(transform, part) for transform, part in parts if hasattr(part, "faces")]
    points, faces, first, textured = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0, False
    for transform, part in parts:
        turned = projections(np.asarray(part.vertices, np.float64), transform[:3, :3])
        points.append(turned + transform[:3, 3])
        faces.append(np.asarray(part.faces, np.int64) + first)
        first += len(points[-1])
        textured = textured or getattr(part.visual, "kind", None) == "texture"
    return np.concatenate(points), np.concatenate(faces), textured


def _clean(points: Array, faces: Faces) -> tuple[Array, Faces, list[str]]:
    """Merge vertices at one place, drop faces without three corners or given twice."""
    extent = float(np.ptp(points[np.unique(faces)], axis=0).max())
    if extent == 0.0:
        raise _Refused("all its corners lie at one place")
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
        raise _Refused(f"{int((uses > 2).sum())} edges belong to more than two faces")
    order = np.argsort(edge.ravel(), kind="stable")
    pairs = [tuple(order[n : n + 2]) for n in np.cumsum([0, *uses[:-1]])[uses == 2]]
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in faces]
    for one, other in pairs:
        against = bool(edges[one, 0] == edges[other, 1])
        neighbours[one // 3].append((int(other) // 3, against))
        neighbours[other // 3].append((int(one) // 3, against))
    turned = np.full(len(faces), -1)
    for start in range(len(faces)):
        if turned[start] >= 0:
            continue
        turned[start], queue = 0, deque([start])
        while queue:
            face = queue.popleft()
            for other, against in neighbours[face]:
                wanted = turned[face] if against else 1 - turned[face]
                if turned[other] < 0:
                    turned[other] = wanted
                    queue.append(other)
                elif turned[other] != wanted:
                    raise _Refused("has no inside: its faces cannot all look outward")
    result = np.where(turned[:, None] == 1, faces[:, ::-1], faces)
    few = min(int(turned.sum()), int((1 - turned).sum()))
    return result, [f"{few} faces turned to agree with their neighbours"] if few else []


def _fill_holes(points: Array, faces: Faces) -> tuple[Array, Faces, list[str]]:
    """Fill the holes of few edges by fans around their middles."""
    edges = _edges(faces)
    directed = {(int(a), int(b)) for a, b in edges}
    following: dict[int, int] = {}
    for a, b in directed:
        if (b, a) not in directed:
            if b in following:
                raise _Refused("is open: two holes meet at one corner")
            following[b] = a
    holes = 0
    new_points, new_faces = [points], [faces]
    while following:
        loop = [min(following)]
        while (end := following.pop(loop[-1])) != loop[0]:
            loop.append(end)
        if len(loop) > WIDEST_HOLE:
            raise _Refused(
                f"is open: a hole of {len(loop)} edges, at most {WIDEST_HOLE} can be filled"
            )
        middle = len(points) + holes
        new_points.append(points[loop].mean(axis=0)[None])
        ends = [*loop[1:], loop[0]]
        new_faces.append(np.array([(a, b, middle) for a, b in zip(loop, ends, strict=True)]))
        holes += 1
    repairs = [f"{holes} small holes filled"] if holes else []
    return np.concatenate(new_points), np.concatenate(new_faces), repairs


def _unite_bodies(points: Array, faces: Faces) -> tuple[Mesh, list[str]]:
    """One closed body whose faces look outward."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = _edges(faces).T
    graph = coo_array((np.ones(links.shape[1]), tuple(links)), shape=(len(points),) * 2)
    _, label = connected_components(graph, directed=False)
    bodies, inside_out = [], 0
    for number in np.unique(label[faces[:, 0]]):
        body = _compact(points, faces[label[faces[:, 0]] == number])
        if cuts_itself(body):
            raise _Refused("its surface cuts itself")
        volume = signed_volume(body.replace(vertices=body.vertices - body.vertices.mean(axis=0)))
        if abs(volume) <= _FLATTEST * np.ptp(body.vertices, axis=0).max() ** 3:
            raise _Refused("encloses no volume")
        inside_out += volume < 0.0
        bodies.append(body if volume > 0.0 else body.replace(faces=body.faces[:, ::-1]))
    repairs = ["turned inside out"] if inside_out else []
    if len(bodies) == 1:
        return bodies[0], repairs
    return _union(bodies), [*repairs, f"{len(bodies)} bodies united"]


def _compact(points: Array, faces: Faces) -> Mesh:
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(vertices=points[used], faces=index.reshape(faces.shape).astype(np.int32))


def _union(bodies: list[Mesh]) -> Mesh:
    from terrain_forge.rocks.collision import unite

    mesh = unite(tuple(bodies))
    points, faces, _ = _clean(mesh.vertices, mesh.faces.astype(np.int64))
    _, uses = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_counts=True)
    from manifold3d import Manifold, Mesh64

    apart = len(Manifold(Mesh64(mesh.vertices.copy(), mesh.faces.astype(np.uint64))).decompose())
    if apart > 1:
        raise _Refused(f"holds {apart} bodies that do not overlap: a rock is one body")
    if (uses != 2).any():
        raise _Refused(f"its {len(bodies)} bodies only touch: let them overlap")
    return _compact(points, faces)
