"""Rock shapes that the user brings: read, repaired where that is safe, else refused with reason."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Key
from terrain_forge.model import Mesh
from terrain_forge.rocks.shapes.mesh_file import Refused, load_mesh
from terrain_forge.rocks.shapes.self_intersection import cuts_itself
from terrain_forge.rocks.shapes.solid import signed_volume

Faces = NDArray[np.int64]

WIDEST_HOLE = 12
"""Edges around a hole that is filled, at most."""
LARGEST_HOLE = 0.02
"""Part of a mesh's area that a hole may have that is filled, at most."""
ALL_HOLES = 0.05
"""Part of a mesh's area that all its holes together may have, at most."""

_SAME_PLACE = 1e-7  # of the largest extent
_FLATTEST = 1e-5  # volume over the cube of the largest extent, thickness over width


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
        points, faces, notes = load_mesh(path)
        points, faces, cleaned = _clean(points, faces)
        faces, turned = _orient(faces)
        points, faces, filled = _fill_holes(points, faces)
        _require_fans(faces)
        mesh, united = _unite_bodies(points, faces)
    except Refused as refused:
        raise DataError(f"{path.name}: {refused}", key=key) from None
    return mesh, (*notes, *cleaned, *turned, *filled, *united)


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
                    raise Refused("has no inside: its faces cannot all look outward")
    result = np.where(turned[:, None] == 1, faces[:, ::-1], faces)
    few = min(int(turned.sum()), int((1 - turned).sum()))
    return result, [f"{few} faces turned to agree with their neighbours"] if few else []


def _fill_holes(points: Array, faces: Faces) -> tuple[Array, Faces, list[str]]:
    """Fill the holes that are small and of few edges by fans around their middles."""
    whole, total = _area(points, faces), 0.0
    new_points, new_faces, holes = [points], [faces], 0
    for loop in _hole_edges(faces):
        if len(loop) > WIDEST_HOLE:
            raise Refused(
                f"is open: a hole of {len(loop)} edges, at most {WIDEST_HOLE} can be filled"
            )
        middle = points[loop].mean(axis=0)[None]
        rim, ends = np.array(loop), np.roll(loop, -1)
        area = _area(points - middle, np.stack([rim, ends], axis=1)) / whole
        total += area
        if area > LARGEST_HOLE or total > ALL_HOLES:
            raise Refused(
                f"is open: holes of {total:.1%} of its area, at most {LARGEST_HOLE:.0%} each and "
                f"{ALL_HOLES:.0%} together can be filled"
            )
        new_points.append(middle)
        new_faces.append(np.stack([rim, ends, np.full(len(rim), len(points) + holes)], axis=1))
        holes += 1
    repairs = [f"{holes} small holes filled"] if holes else []
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
    """Area of triangles; of those between sides and the origin where `faces` are pairs [m²]."""
    if faces.shape[1] == 2:
        normals = np.cross(points[faces[:, 0]], points[faces[:, 1]])
    else:
        a, b, c = (points[faces[:, corner]] for corner in range(3))
        normals = np.cross(b - a, c - a)
    return float(0.5 * np.linalg.norm(normals, axis=1).sum())


def _require_fans(faces: Faces) -> None:
    """Refuse a closed mesh of which two parts meet in one vertex alone."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Each corner of a face, and the one at the same vertex in the next face around it.
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    leaving = dict(zip(map(tuple, _edges(faces).tolist()), corner.ravel().tolist(), strict=True))
    into = [(b, a) for a, b in _edges(faces[:, [2, 0, 1]]).tolist()]
    following = [leaving[edge] for edge in into]
    links = coo_array((np.ones(corner.size), (corner.ravel(), following)), shape=(corner.size,) * 2)
    fans, _ = connected_components(links, directed=False)
    pinched = fans - len(np.unique(faces))
    if pinched:
        raise Refused(f"parts of it meet in a single corner, at {pinched} places: let them overlap")


def _unite_bodies(points: Array, faces: Faces) -> tuple[Mesh, list[str]]:
    """One closed body whose faces look outward."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = _edges(faces).T
    graph = coo_array((np.ones(links.shape[1]), tuple(links)), shape=(len(points),) * 2)
    _, label = connected_components(graph, directed=False)
    found = [
        _sound(_compact(points, faces[label[faces[:, 0]] == number]))
        for number in np.unique(label[faces[:, 0]])
    ]
    found.sort(key=lambda body: -body[1])
    bodies, repairs, cavities, inside_out = [], [], 0, False
    for body, _, inward in found:
        around = any(_within(body, other) for other, _, turned in found if turned != inward)
        if around:
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


def _sound(body: Mesh) -> tuple[Mesh, float, bool]:
    """A closed body turned to look outward, its volume [m³], and whether it looked inward."""
    volume = signed_volume(body)
    if abs(volume) <= _FLATTEST * np.ptp(body.vertices, axis=0).max() ** 3:
        raise Refused("encloses no volume")
    if cuts_itself(body):
        raise Refused("its surface cuts itself")
    inward = volume < 0.0
    return body.replace(faces=body.faces[:, ::-1]) if inward else body, abs(volume), inward


def _within(body: Mesh, other: Mesh) -> bool:
    """Whether a body lies wholly within another one."""
    from manifold3d import Manifold, Mesh64

    one, around = (
        Manifold(Mesh64(mesh.vertices.copy(), mesh.faces.astype(np.uint64)))
        for mesh in (body, other)
    )
    return bool((one - around).is_empty())


def _compact(points: Array, faces: Faces) -> Mesh:
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(vertices=points[used], faces=index.reshape(faces.shape).astype(np.int32))


def _union(bodies: list[Mesh]) -> Mesh:
    from terrain_forge.rocks.shapes.collision import unite

    mesh = unite(tuple(bodies))
    points, faces, _ = _clean(mesh.vertices, mesh.faces.astype(np.int64))
    _, uses = np.unique(np.sort(_edges(faces), axis=1), axis=0, return_counts=True)
    from manifold3d import Manifold, Mesh64

    apart = len(Manifold(Mesh64(mesh.vertices.copy(), mesh.faces.astype(np.uint64))).decompose())
    if apart > 1:
        raise Refused(f"holds {apart} bodies that do not overlap: a rock is one body")
    if (uses != 2).any():
        raise Refused(f"its {len(bodies)} bodies only touch: let them overlap")
    return _compact(points, faces)
