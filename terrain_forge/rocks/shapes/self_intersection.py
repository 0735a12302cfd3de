"""Whether a surface cuts itself."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner, kernel
from terrain_forge.model import Mesh

_TOUCHING = 1e-9  # of the extent: faces of one plane are as far apart by rounding


def cuts_itself(mesh: Mesh) -> bool:
    """Whether an edge of a face runs through another face.

    Faces that touch or lie in one plane do not count. Sweep and prune along x: O(n²) at worst, but
    near linear for small faces.
    """
    corners = mesh.vertices[mesh.faces]
    order = np.argsort(corners[:, :, 0].min(axis=1), kind="stable")
    faces = mesh.faces[order].astype(np.int64)
    triangles = np.ascontiguousarray(corners[order])
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    depth = _TOUCHING * float((high.max(axis=0) - low.min(axis=0)).max())
    return bool(_any_crossing(triangles, faces, low, high, depth))


@kernel
def _any_crossing(triangles, faces, low, high, depth):  # type: ignore[no-untyped-def]
    for f in range(len(faces)):
        for g in range(f + 1, len(faces)):
            if low[g, 0] > high[f, 0]:
                break
            if low[g, 1] > high[f, 1] or low[f, 1] > high[g, 1]:
                continue
            if low[g, 2] > high[f, 2] or low[f, 2] > high[g, 2]:
                continue
            if _pierces(triangles, faces, f, g, depth):
                return True
            if _pierces(triangles, faces, g, f, depth):
                return True
    return False


@inner
def _pierces(triangles, faces, f, g, depth):  # type: ignore[no-untyped-def]
    """Whether an edge of f that has no corner in common with g runs through g."""
    face, other = faces[f], faces[g]
    for side in range(3):
        a, b = face[side], face[(side + 1) % 3]
        apart = True
        for k in range(3):
            apart = apart and a != other[k] and b != other[k]
        p, q = triangles[f, side], triangles[f, (side + 1) % 3]
        if apart and _runs_through(p, q, triangles[g], depth):
            return True
    return False


@inner
def _volume(a, b, c, d):  # type: ignore[no-untyped-def]
    """Six times the signed volume of a tetrahedron."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return ux * (vy * wz - vz * wy) - uy * (vx * wz - vz * wx) + uz * (vx * wy - vy * wx)


@inner
def _double_area(a, b, c):  # type: ignore[no-untyped-def]
    """Twice the area of a triangle."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return np.sqrt(x * x + y * y + z * z)


@inner
def _runs_through(p, q, triangle, depth):  # type: ignore[no-untyped-def]
    """Whether the segment from p to q, both farther off than `depth`, meets a triangle's inside."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    before, after = _volume(p, a, b, c), _volume(q, a, b, c)
    least = depth * _double_area(a, b, c)
    if before * after >= 0.0 or abs(before) <= least or abs(after) <= least:
        return False
    one, other, third = _volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)
    all_left = one > 0.0 and other > 0.0 and third > 0.0
    return all_left or (one < 0.0 and other < 0.0 and third < 0.0)
