"""Fewer triangles for the same shape: edges collapse where the surface changes least.

Garland & Heckbert 1997, doi:10.1145/258734.258849, with vertices spread evenly where the surface is
flat. A collapse never changes the topology, nor turns a face over.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import heap_pop, heap_push, inner, kernel
from terrain_forge.model import Mesh

_MAX_DEGREE = 24
_PULL = 1e-3  # holds a new vertex to its edge's middle where the surface leaves it free
_EVENNESS = 2e-3  # cost of an edge's length against that of the same distance from the surface
_SLIVER = 0.06  # least area of a face against the square of its longest side, twice
_TURN = 0.2  # least cosine between a face before and after


def simplify(mesh: Mesh, vertices: int, *, star_shaped: bool = False) -> Mesh:
    """A mesh of about `vertices` vertices that keeps the shape, the edges and the topology.

    More stay where no further edge can collapse. Every face of a closed mesh that is `star_shaped`
    is seen from inside from the origin and stays so, which rules out that the surface cuts itself.
    """
    if len(mesh.vertices) <= vertices:
        return mesh
    points, faces = _collapse(
        mesh.vertices.copy(), mesh.faces.astype(np.int64), vertices, star_shaped
    )
    used = np.unique(faces)
    index = np.full(len(points), -1, np.int32)
    index[used] = np.arange(len(used), dtype=np.int32)
    return Mesh(vertices=points[used], faces=index[faces])


@kernel
def _collapse(points, faces, wanted, star_shaped):  # type: ignore[no-untyped-def]
    left = len(points)
    around, degree = _incidence(faces, left)
    mesh = points, faces, around, degree
    quadrics = _quadrics(points, faces)
    version, alive = np.zeros(left, np.int64), np.ones(len(faces), np.bool_)
    place, old, new = np.empty(3), np.empty(3), np.empty(3)
    most = 2 * len(faces) + (left - wanted) * _MAX_DEGREE
    # Edges in the order in which they were found; those that wait lie in a heap of their costs.
    edges, found = np.empty((most, 3), np.int64), np.int64(0)
    costs, waiting, size = np.empty(most), np.empty(most, np.int64), np.int64(0)
    for f in range(len(faces)):
        for side in range(3):
            a, b = faces[f, side], faces[f, (side + 1) % 3]
            if a < b:
                cost = _cost(points, quadrics, a, b, place)
                edges[found, 0], edges[found, 1], edges[found, 2] = a, b, 0
                size = heap_push(costs, waiting, size, cost, found)
                found += 1
    while left > wanted and size > 0:
        a, b, stamp = edges[waiting[0], 0], edges[waiting[0], 1], edges[waiting[0], 2]
        size = heap_pop(costs, waiting, size)
        if degree[a] == 0 or degree[b] == 0 or version[a] + version[b] != stamp:
            continue
        _cost(points, quadrics, a, b, place)
        if not _may_collapse(mesh, a, b, place, old, new, star_shaped):
            continue
        _merge(points, faces, around, degree, alive, quadrics, a, b, place)
        left -= 1
        version[a] += version[b] + 1
        for n in range(degree[a]):
            for corner in range(3):
                c = faces[around[a, n], corner]
                # Each neighbour follows a in just one face.
                if c != a and faces[around[a, n], (corner + 2) % 3] == a:
                    cost = _cost(points, quadrics, a, c, place)
                    edges[found, 0], edges[found, 1] = a, c
                    edges[found, 2] = version[a] + version[c]
                    size = heap_push(costs, waiting, size, cost, found)
                    found += 1
    kept = 0
    for f in range(len(faces)):
        if alive[f]:
            for corner in range(3):
                faces[kept, corner] = faces[f, corner]
            kept += 1
    return points, faces[:kept]


@inner
def _incidence(faces, count):  # type: ignore[no-untyped-def]
    """The faces around each vertex, shape [vertices, degree], and their number."""
    degree = np.zeros(count, np.int64)
    for f in range(len(faces)):
        for corner in range(3):
            degree[faces[f, corner]] += 1
    most = _MAX_DEGREE
    for v in range(count):
        most = max(most, degree[v])
        degree[v] = 0
    around = np.empty((count, most), np.int64)
    for f in range(len(faces)):
        for corner in range(3):
            v = faces[f, corner]
            around[v, degree[v]] = f
            degree[v] += 1
    return around, degree


@inner
def _normal(a, b, c, result):  # type: ignore[no-untyped-def]
    """Write the cross product of two sides; returns its length, twice the area."""
    x1, y1, z1 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    x2, y2, z2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    result[0], result[1], result[2] = y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2
    return np.sqrt(result[0] ** 2 + result[1] ** 2 + result[2] ** 2)


@inner
def _quadrics(points, faces):  # type: ignore[no-untyped-def]
    """Per vertex the squared distances from its faces' planes, weighted by their areas."""
    quadrics, normal = np.zeros((len(points), 11)), np.empty(3)
    for f in range(len(faces)):
        a = points[faces[f, 0]]
        double = _normal(a, points[faces[f, 1]], points[faces[f, 2]], normal)
        if double == 0.0:
            continue
        x, y, z = normal[0] / double, normal[1] / double, normal[2] / double
        d = -(x * a[0] + y * a[1] + z * a[2])
        terms = (x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d, 1.0)
        for corner in range(3):
            for n in range(11):
                quadrics[faces[f, corner], n] += double * terms[n]
    return quadrics


@inner
def _cost(points, quadrics, a, b, place):  # type: ignore[no-untyped-def]
    """What it costs to merge two vertices; writes the best place for them."""
    p, q, area = quadrics[a], quadrics[b], quadrics[a, 10] + quadrics[b, 10]
    pull = _PULL * area + 1e-300
    xx, yy, zz = p[0] + q[0] + pull, p[3] + q[3] + pull, p[5] + q[5] + pull
    xy, xz, yz = p[1] + q[1], p[2] + q[2], p[4] + q[4]
    length = 0.0
    u = 0.5 * (points[a, 0] + points[b, 0]) * pull - p[6] - q[6]
    v = 0.5 * (points[a, 1] + points[b, 1]) * pull - p[7] - q[7]
    w = 0.5 * (points[a, 2] + points[b, 2]) * pull - p[8] - q[8]
    for axis in range(3):
        length += (points[a, axis] - points[b, axis]) ** 2
    i, j, k = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * i + xy * j + xz * k
    m, n, o = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    x = (i * u + j * v + k * w) / determinant
    y = (j * u + m * v + n * w) / determinant
    z = (k * u + n * v + o * w) / determinant
    place[0], place[1], place[2] = x, y, z
    error = (xx - pull) * x * x + (yy - pull) * y * y + (zz - pull) * z * z
    error += 2.0 * (xy * x * y + xz * x * z + yz * y * z)
    error += 2.0 * ((p[6] + q[6]) * x + (p[7] + q[7]) * y + (p[8] + q[8]) * z) + p[9] + q[9]
    return error + _EVENNESS * area * length


@inner
def _may_collapse(mesh, a, b, place, old, new, star_shaped):  # type: ignore[no-untyped-def]
    _, faces, around, degree = mesh
    if degree[a] + degree[b] - 4 > _MAX_DEGREE or degree[a] + degree[b] - 4 < 3:
        return False
    shared = 0
    for n in range(degree[a]):
        for corner in range(3):
            c = faces[around[a, n], corner]
            if c != a and faces[around[a, n], (corner + 2) % 3] == a:
                for m in range(degree[b]):
                    face = faces[around[b, m]]
                    for k in range(3):
                        if face[k] == c and face[(k + 2) % 3] == b:
                            shared += 1
                            if degree[c] <= 3:
                                return False
    if shared != 2:
        return False
    stays = _stays_upright(mesh, a, b, place, old, new, star_shaped)
    return stays and _stays_upright(mesh, b, a, place, old, new, star_shaped)


@inner
def _stays_upright(mesh, a, b, place, old, new, star_shaped):  # type: ignore[no-untyped-def]
    """Whether the faces of a, but those that it shares with b, are sound when it moves."""
    points, faces, around, degree = mesh
    for n in range(degree[a]):
        face = faces[around[a, n]]
        if face[0] == b or face[1] == b or face[2] == b:
            continue
        at = 0 if face[0] == a else (1 if face[1] == a else 2)
        p, q = points[face[(at + 1) % 3]], points[face[(at + 2) % 3]]
        before, after = _normal(points[a], p, q, old), _normal(place, p, q, new)
        longest = 0.0
        for side in range(3):
            one = place if side == 0 else (p if side == 1 else q)
            other = p if side == 0 else (q if side == 1 else place)
            square = (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2
            longest = max(longest, square + (one[2] - other[2]) ** 2)
        if after < _SLIVER * longest:
            return False
        if old[0] * new[0] + old[1] * new[1] + old[2] * new[2] < _TURN * before * after:
            return False
        outward = new[0] * p[0] + new[1] * p[1] + new[2] * p[2]
        if star_shaped and outward < 1e-3 * after:
            return False
    return True


@inner
def _merge(points, faces, around, degree, alive, quadrics, a, b, place):  # type: ignore[no-untyped-def]
    """Put b into a, which moves; the two faces that they share go."""
    for k in range(3):
        points[a, k] = place[k]
    for k in range(11):
        quadrics[a, k] += quadrics[b, k]
    size = 0
    for n in range(degree[a]):
        f = around[a, n]
        if faces[f, 0] == b or faces[f, 1] == b or faces[f, 2] == b:
            alive[f] = False
            for corner in range(3):
                c = faces[f, corner]
                if c != a and c != b:
                    _drop(around, degree, c, f)
        else:
            around[a, size] = f
            size += 1
    for n in range(degree[b]):
        f = around[b, n]
        if alive[f]:
            for corner in range(3):
                if faces[f, corner] == b:
                    faces[f, corner] = a
            around[a, size] = f
            size += 1
    degree[a], degree[b] = size, 0


@inner
def _drop(around, degree, v, face):  # type: ignore[no-untyped-def]
    size = 0
    for n in range(degree[v]):
        if around[v, n] != face:
            around[v, size] = around[v, n]
            size += 1
    degree[v] = size
