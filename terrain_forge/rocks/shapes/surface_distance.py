"""How far two surfaces are apart: the Hausdorff distance, by branch and bound."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inner, kernel
from terrain_forge.model import Mesh

_DEPTH = 24  # halvings of a face's sides; far more than any tolerance needs


def hausdorff_distance(one: Mesh, other: Mesh, *, tolerance: float = 1e-3) -> float:
    """Largest distance of a point of either surface from the other surface [m].

    The distance from a single triangle of the other surface is convex, so no point of a face is
    farther from that surface than the farthest of its corners is from any one triangle there. A
    face is cut in four only while that is more than what was found already. The true distance
    exceeds the result by at most `tolerance` [m].
    """
    corners = [mesh.vertices[mesh.faces] for mesh in (one, other)]
    orders = [np.argsort(triangles.mean(axis=1)[:, 0], kind="stable") for triangles in corners]
    corners = [triangles[order] for triangles, order in zip(corners, orders, strict=True)]
    balls = [_balls(triangles) for triangles in corners]
    found = _farthest(corners[0], corners[1], balls[1], 0.0, tolerance)
    return float(_farthest(corners[1], corners[0], balls[0], found, tolerance))


def _balls(triangles: Array) -> Array:
    """Centre and radius of a ball around each triangle, and the largest radius, [triangles, 5]."""
    centres = triangles.mean(axis=1)
    away = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
    return np.column_stack([centres, away, np.full(len(away), away.max())])


@kernel
def _farthest(faces, others, balls, best, tolerance):  # type: ignore[no-untyped-def]
    """The larger of `best` and the distance of the farthest point of faces from other ones."""
    stack, face, nearest = np.empty((3 * _DEPTH + 4, 3, 3)), np.empty((3, 3)), 0
    for f in range(len(faces)):
        _copy(faces, f, stack[0])
        size = 1
        while size > 0:
            size -= 1
            _copy(stack, size, face)
            if _bound(others, nearest, face) <= best + tolerance:
                continue
            x = (face[0, 0] + face[1, 0] + face[2, 0]) / 3.0
            y = (face[0, 1] + face[1, 1] + face[2, 1]) / 3.0
            z = (face[0, 2] + face[1, 2] + face[2, 2]) / 3.0
            away, nearest = _distance(others, balls, x, y, z, nearest)
            best = max(best, away)
            if _bound(others, nearest, face) > best + tolerance and size + 4 <= len(stack):
                size = _quarter(face, stack, size)
    return best


@inner
def _copy(triangles, n, face):  # type: ignore[no-untyped-def]
    for corner in range(3):
        for k in range(3):
            face[corner, k] = triangles[n, corner, k]


@inner
def _quarter(face, stack, size):  # type: ignore[no-untyped-def]
    """Put the four quarters of a face on the stack; returns its size."""
    for k in range(3):
        a, b, c = face[0, k], face[1, k], face[2, k]
        p, q, r = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        stack[size, 0, k], stack[size, 1, k], stack[size, 2, k] = p, q, r
        stack[size + 1, 0, k], stack[size + 1, 1, k], stack[size + 1, 2, k] = a, p, r
        stack[size + 2, 0, k], stack[size + 2, 1, k], stack[size + 2, 2, k] = p, b, q
        stack[size + 3, 0, k], stack[size + 3, 1, k], stack[size + 3, 2, k] = r, q, c
    return size + 4


@inner
def _bound(triangles, t, face):  # type: ignore[no-untyped-def]
    """How far the farthest point of a face is from one of the triangles."""
    square = 0.0
    for corner in range(3):
        x, y, z = face[corner, 0], face[corner, 1], face[corner, 2]
        square = max(square, _square_distance(triangles, t, x, y, z))
    return np.sqrt(square)


@inner
def _distance(triangles, balls, x, y, z, start):  # type: ignore[no-untyped-def]
    """Distance of a point from triangles, and the nearest of them.

    The triangles run from west to east; they are searched from the point's place both ways.
    """
    nearest, largest = start, balls[0, 4]
    away = np.sqrt(_square_distance(triangles, start, x, y, z))
    east = np.searchsorted(balls[:, 0], x)
    for direction in (-1, 1):
        t = east - 1 if direction < 0 else east
        while 0 <= t < len(triangles):
            if abs(balls[t, 0] - x) > away + largest:
                break
            reach = away + balls[t, 3]
            far = (balls[t, 0] - x) ** 2 + (balls[t, 1] - y) ** 2 + (balls[t, 2] - z) ** 2
            if far < reach * reach:
                square = _square_distance(triangles, t, x, y, z)
                if square < away * away:
                    away, nearest = np.sqrt(square), t
            t += direction
    return away, nearest


@inner
def _square_distance(triangles, t, x, y, z):  # type: ignore[no-untyped-def]
    """Square of the distance of a point from a triangle (Ericson 2005, section 5.1.5)."""
    ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
    abx, aby, abz = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
    acx, acy, acz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    d1, d2 = abx * px + aby * py + abz * pz, acx * px + acy * py + acz * pz
    bb, cc = abx * abx + aby * aby + abz * abz, acx * acx + acy * acy + acz * acz
    bc = abx * acx + aby * acy + abz * acz
    d3, d4, d5, d6 = d1 - bb, d2 - bc, d1 - bc, d2 - cc
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / bb, 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / cc
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    dx, dy, dz = px - v * abx - w * acx, py - v * aby - w * acy, pz - v * abz - w * acz
    return dx * dx + dy * dy + dz * dz
