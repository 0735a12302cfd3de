"""The plan outline of a rock's exposed part, and its diameter.

The exposed diameter D is what size-frequency laws speak of: the mean of the largest width of the
plan outline and of the width across it, of the part above the ground's tangent plane. It is
computed exactly: the exposed part's corners are the mesh's vertices above the plane and the points
where its edges cross it, and the widths of their convex hull in plan are those of the outline.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner, kernel
from terrain_forge.model import Mesh

MAX_TILT = np.radians(40.0)
"""Steepest ground that a rock follows [rad]; on steeper ground it lies as on this."""
MAX_BURIED = 0.6
"""Largest part of a rock's extent that embedding buries, but for a few where more fits."""


def edges(mesh: Mesh) -> NDArray[np.int32]:
    """Edges of a closed mesh, each once, as pairs of vertex indices, shape [edges, 2]."""
    directed = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    return directed[directed[:, 0] < directed[:, 1]]


@kernel
def embedding_rotation(east, north, up, yaw):  # type: ignore[no-untyped-def]
    """The quaternion that turns by `yaw` [rad] about z, then leans z to a unit normal."""
    return leaning(east, north, up, (np.cos(0.5 * yaw), np.sin(0.5 * yaw)))


@inner
def leaning(east, north, up, half_turn):  # type: ignore[no-untyped-def]
    """The same quaternion, given cosine and sine of half the turn."""
    w = np.sqrt(0.5 * (1.0 + up))
    x, y = -0.5 * north / w, 0.5 * east / w
    cos, sin = half_turn
    return w * cos, x * cos + y * sin, y * cos - x * sin, w * sin


@inner
def rotation_matrix(quaternion):  # type: ignore[no-untyped-def]
    """The matrix of a unit quaternion (w, x, y, z), shape [3, 3]."""
    w, x, y, z = quaternion
    m = np.empty((3, 3))
    m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return m


@inner
def plan_axes(quaternion):  # type: ignore[no-untyped-def]
    """The two upper rows of the matrix of a unit quaternion (w, x, y, z), six numbers."""
    w, x, y, z = quaternion
    east = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    north = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    return east + north


@kernel
def extent(vertices, direction):  # type: ignore[no-untyped-def]
    """Lowest and highest coordinate [m] of the vertices along a direction."""
    low, high = np.inf, -np.inf
    for v in range(len(vertices)):
        along = (
            vertices[v, 0] * direction[0]
            + vertices[v, 1] * direction[1]
            + vertices[v, 2] * direction[2]
        )
        low, high = min(low, along), max(high, along)
    return low, high


@kernel
def exposed_diameter(vertices, edges, rotation, up, level):  # type: ignore[no-untyped-def]
    """Exposed plan diameter [m]; arguments as of `exposed_points`."""
    return mean_width(exposed_points(vertices, edges, rotation, up, level))


@kernel
def exposed_points(vertices, edges, rotation, up, level):  # type: ignore[no-untyped-def]
    """Corners, in plan, of the part of a mesh above a plane.

    Args:
        vertices: Vertices of the mesh [m], shape [vertices, 3].
        edges: Pairs of vertex indices, shape [edges, 2].
        rotation: Matrix from the mesh's axes to the world's, shape [3, 3].
        up: Unit normal of the plane in the mesh's axes, a triple.
        level: Coordinate of the plane along `up` [m].

    Returns:
        East and north [m] of the vertices above the plane and of the crossings, shape [points, 2].
    """
    count = len(vertices)
    above = np.empty(count)
    east, north = np.empty(count), np.empty(count)
    points = np.empty((count + len(edges) + 1, 2))
    found = 0
    for v in range(count):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        above[v] = x * up[0] + y * up[1] + z * up[2] - level
        east[v] = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
        north[v] = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
        # Written always and kept or not, since a branch here would be mispredicted half the time.
        points[found, 0], points[found, 1] = east[v], north[v]
        found += above[v] >= 0.0
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        if (above[a] >= 0.0) != (above[b] >= 0.0):
            part = above[a] / (above[a] - above[b])
            points[found, 0] = east[a] + part * (east[b] - east[a])
            points[found, 1] = north[a] + part * (north[b] - north[a])
            found += 1
    return points[:found]


@kernel
def convex_hull(points):  # type: ignore[no-untyped-def]
    """Convex hull of points in the plane, counter-clockwise, shape [corners, 2] (Andrew 1979)."""
    kept, count = _sorted(points.copy()), len(points)
    chain = np.empty(2 * count + 1, dtype=np.int64)
    size = 0
    for sweep in range(2):
        start = size + 1
        for n in range(count):
            p = n if sweep == 0 else count - 1 - n
            while size > start and _turn(kept, chain[size - 2], chain[size - 1], p) <= 0.0:
                size -= 1
            chain[size] = p
            size += 1
        size -= 1
    hull = np.empty((max(size, 1), 2))
    for n in range(len(hull)):
        hull[n, 0], hull[n, 1] = kept[chain[n], 0], kept[chain[n], 1]
    return hull


@kernel
def mean_width(points):  # type: ignore[no-untyped-def]
    """Mean of the diameter of points in the plane (or of their hull) and of the width across it."""
    if len(points) == 0:
        return 0.0
    east, north = _longest(points)
    low, high = np.inf, -np.inf
    for n in range(len(points)):
        across = east * points[n, 1] - north * points[n, 0]
        low, high = min(low, across), max(high, across)
    length = np.sqrt(east * east + north * north)
    return 0.5 * (length + (high - low) / length) if length > 0.0 else 0.0


@inner
def _longest(points):  # type: ignore[no-untyped-def]
    """East and north of the difference of the most distant pair of points.

    A distant pair is found by walking from point to farthest point. A more distant one can only
    lie in the rim that is farther from its middle than its length less the largest distance.
    """
    x = y = 0.0
    for n in range(len(points)):
        x, y = x + points[n, 0], y + points[n, 1]
    corner, _ = farthest(points, x / len(points), y / len(points))
    a, _ = farthest(points, points[corner, 0], points[corner, 1])
    b, longest = farthest(points, points[a, 0], points[a, 1])
    east, north = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    x, y = points[a, 0] + 0.5 * east, points[a, 1] + 0.5 * north
    _, largest = farthest(points, x, y)
    inner = max(np.sqrt(longest) - np.sqrt(largest), 0.0) * (1.0 - 1e-12)
    rim = np.empty((len(points) + 1, 2))
    size = 0
    for n in range(len(points)):
        rim[size, 0], rim[size, 1] = points[n, 0], points[n, 1]
        dx, dy = points[n, 0] - x, points[n, 1] - y
        size += dx * dx + dy * dy >= inner * inner
    for n in range(size):
        for m in range(n):
            dx, dy = rim[n, 0] - rim[m, 0], rim[n, 1] - rim[m, 1]
            if dx * dx + dy * dy > longest:
                longest, east, north = dx * dx + dy * dy, dx, dy
    return east, north


@inner
def farthest(points, x, y):  # type: ignore[no-untyped-def]
    """Index of the point that is farthest from a place, and the square of its distance."""
    largest, farthest = -1.0, 0
    for n in range(len(points)):
        dx, dy = points[n, 0] - x, points[n, 1] - y
        if dx * dx + dy * dy > largest:
            largest, farthest = dx * dx + dy * dy, n
    return farthest, largest


@inner
def _turn(points, a, b, c):  # type: ignore[no-untyped-def]
    """Twice the area of the triangle a, b, c: positive for a turn to the left."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    return ux * (points[c, 1] - points[a, 1]) - uy * (points[c, 0] - points[a, 0])


@inner
def _sorted(points):  # type: ignore[no-untyped-def]
    """Sort points in place by east, then north (Shell's method: short lists, no recursion)."""
    for gap in (701, 301, 132, 57, 23, 10, 4, 1):
        for n in range(gap, len(points)):
            x, y = points[n, 0], points[n, 1]
            m = n
            while m >= gap and (
                points[m - gap, 0] > x or (points[m - gap, 0] == x and points[m - gap, 1] > y)
            ):
                points[m, 0], points[m, 1] = points[m - gap, 0], points[m - gap, 1]
                m -= gap
            points[m, 0], points[m, 1] = x, y
    return points
