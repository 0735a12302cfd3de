"""Closed meshes: mass properties, whether a surface cuts itself, how far two are apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, inner, kernel
from terrain_forge.model import Mesh

_TOUCHING = 1e-9  # of the extent: faces of one plane are as far apart by rounding
_DEPTH = 24  # halvings of a face's sides; far more than any tolerance needs


class MassProperties(NamedTuple):
    """Mass properties of a homogeneous solid of density 1 kg/m³."""

    volume: float
    """Volume [m³]; positive where the faces point outward."""
    centre: Array
    """Centre of mass [m], shape [3]."""
    inertia: Array
    """Inertia tensor about the centre of mass [kg m²], shape [3, 3]."""


def signed_volume(mesh: Mesh) -> float:
    """Volume of a closed mesh [m³]; negative where the faces point inward."""
    vertices = mesh.vertices - mesh.vertices.mean(axis=0)
    a, b, c = (vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", np.cross(a, b), c) / 6.0)


def mass_properties(mesh: Mesh) -> MassProperties:
    """Integrate over the signed tetrahedra between a closed mesh's middle and each of its faces.

    Taken from a far origin they would be large and cancel out, to no digits.

    With s the sum of a tetrahedron's corners a, b, c (the fourth is the middle) and V its volume,
    the integral of x xᵀ over it is V/20 (s sᵀ + a aᵀ + b bᵀ + c cᵀ); the inertia is tr(C) 1 - C of
    their sum C. Tonon 2004, doi:10.3844/jmssp.2005.8.11.
    """
    middle = mesh.vertices.mean(axis=0)
    corners = (mesh.vertices - middle)[mesh.faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0
    volume = volumes.sum()
    sums = corners.sum(axis=1)
    centre = np.einsum("i,ij->j", volumes, sums) / (4.0 * volume)
    second = np.einsum("ij,ik->jk", volumes[:, None] * sums, sums)
    for corner in (a, b, c):
        second += np.einsum("ij,ik->jk", volumes[:, None] * corner, corner)
    central = second / 20.0 - volume * np.outer(centre, centre)
    return MassProperties(
        volume=float(volume),
        centre=middle + centre,
        inertia=np.trace(central) * np.eye(3) - central,
    )


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
    stack, face = np.empty((3 * _DEPTH + 4, 3, 3)), np.empty((3, 3))
    nearest = np.int64(0)
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
    east, beyond = 0, len(balls)
    while east < beyond:
        middle = (east + beyond) // 2
        if balls[middle, 0] < x:
            east = middle + 1
        else:
            beyond = middle
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
