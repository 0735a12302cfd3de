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
from terrain_forge.rocks.embedding.hull import mean_width

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
    w = np.sqrt(0.5 * (1.0 + up))
    x, y = -0.5 * north / w, 0.5 * east / w
    cos, sin = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
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
