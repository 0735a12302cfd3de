"""Top-down truth: the highest surface above every node of the ground, and whose it is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import checked, inner, kernel, over_chunks
from terrain_forge.model import World, merge, rotations

_STRIP = 32
"""Rows of the grid that one task fills; tasks share no node, so threads change no result."""


@checked
def rock_rasters(world: World) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Height of the highest surface and id of the rock it belongs to, at the ground's nodes.

    Exact: a vertical ray through each node meets the triangles of the rocks' finest meshes. Rocks
    whose centre lies outside the window count too. Where two rocks are equally high, the lower id
    wins; where a rock only touches the ground, the ground.

    Returns:
        top: Heights in the world frame [m], shape [rows, columns], rows run north.
        rock_id: Id of the rock on top, -1 where it is the ground, same shape.
    """
    top = world.ground.elevation.copy()
    rock_id = np.full(top.shape, -1, np.int32)
    rocks = merge(world.field, world.neighbours)
    if len(rocks):
        site, window = world.site, world.window
        meshes = [prototype.meshes[0] for prototype in world.library.prototypes]
        # In columns and rows of the site, so that a window's raster has the whole one's bits.
        units = np.array([site.spacing, site.spacing, 1.0])
        centre = (rocks.position - (site.west, site.south, 0.0)) / units
        pose = rotations(rocks) * rocks.scale[:, None, None] / units[:, None]
        radius = np.array([np.linalg.norm(mesh.vertices, axis=1).max() for mesh in meshes])
        reach = (radius[rocks.prototype] * rocks.scale) / site.spacing + 1e-6
        first, members = _strips(centre[:, 1] - window.row, reach, top.shape[0])
        over_chunks(
            _rasterise,
            len(first) - 1,
            max(len(mesh.vertices) for mesh in meshes),
            top,
            rock_id,
            (window.column, window.row),
            (first, members),
            (rocks.id, rocks.prototype, centre, pose, reach),
            _joined([mesh.vertices for mesh in meshes]),
            _joined([mesh.faces for mesh in meshes]),
        )
    return top, rock_id


def _joined(parts: list[NDArray[Any]]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Arrays one after another, and where each begins."""
    return np.concatenate(parts), np.cumsum([0, *map(len, parts)])


def _strips(
    row: NDArray[np.float64], reach: NDArray[np.float64], rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which rocks may touch strip s of rows, in their order: members[first[s] : first[s + 1]]."""
    strips = -(-rows // _STRIP)
    low = np.clip(np.floor((row - reach) / _STRIP), 0, strips).astype(np.int64)
    high = np.clip(np.floor((row + reach) / _STRIP), -1, strips - 1).astype(np.int64)
    spans = np.maximum(high - low + 1, 0)
    rock = np.repeat(np.arange(len(row)), spans)
    strip = np.arange(len(rock)) - np.repeat(np.cumsum(spans) - spans, spans) + low[rock]
    order = np.argsort(strip, kind="stable")
    return np.searchsorted(strip[order], np.arange(strips + 1)), rock[order]


@kernel
def _rasterise(  # type: ignore[no-untyped-def]
    first_strip, last_strip, largest, top, rock_id, corner, strips, rocks, vertices, faces
):
    first, members = strips
    ids, prototypes, centre, pose, reach = rocks
    corners, first_vertex = vertices
    triangles, first_face = faces
    column, row = corner
    points = np.empty((largest, 3))
    nodes = np.empty((largest, 4), np.int32)
    for strip in range(first_strip, last_strip):
        south = row + strip * _STRIP
        box = column, column + top.shape[1] - 1, south, min(south + _STRIP, row + len(top)) - 1
        for member in range(first[strip], first[strip + 1]):
            rock = members[member]
            if not _meets_node(centre[rock], reach[rock], box):
                continue
            shape = prototypes[rock]
            mesh = corners[first_vertex[shape] : first_vertex[shape + 1]]
            _place(mesh, pose[rock], centre[rock], points, nodes)
            faces_of = triangles[first_face[shape] : first_face[shape + 1]]
            _draw(faces_of, points, nodes, box, corner, ids[rock], top, rock_id)


@inner
def _meets_node(centre, reach, box):  # type: ignore[no-untyped-def]
    """Whether a square about a rock holds a node of the box: many pebbles fit between the nodes."""
    west, east, south, north = box
    columns = min(np.floor(centre[0] + reach), east) - max(np.ceil(centre[0] - reach), west)
    rows = min(np.floor(centre[1] + reach), north) - max(np.ceil(centre[1] - reach), south)
    return columns >= 0.0 and rows >= 0.0


@inner
def _place(corners, pose, centre, points, nodes):  # type: ignore[no-untyped-def]
    """Vertices as (column, row, height), and the nodes west, east, south and north of each."""
    for n in range(len(corners)):
        x, y, z = corners[n, 0], corners[n, 1], corners[n, 2]
        for axis in range(3):
            points[n, axis] = (
                pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z + centre[axis]
            )
        nodes[n, 0], nodes[n, 1] = np.floor(points[n, 0]), np.ceil(points[n, 0])
        nodes[n, 2], nodes[n, 3] = np.floor(points[n, 1]), np.ceil(points[n, 1])


@inner
def _draw(triangles, points, nodes, box, corner, identity, top, rock_id):  # type: ignore[no-untyped-def]
    """Raise the nodes of the box that lie under the upward triangles of one rock."""
    for n in range(len(triangles)):
        a, b, c = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        # Most triangles are smaller than a cell and have no node between their corners.
        west = min(nodes[a, 1], nodes[b, 1], nodes[c, 1])
        east = max(nodes[a, 0], nodes[b, 0], nodes[c, 0])
        if west > east:
            continue
        south = min(nodes[a, 3], nodes[b, 3], nodes[c, 3])
        north = max(nodes[a, 2], nodes[b, 2], nodes[c, 2])
        for row in range(max(south, box[2]), min(north, box[3]) + 1):
            for column in range(max(west, box[0]), min(east, box[1]) + 1):
                height = _height(points[a], points[b], points[c], column, row)
                i, j = column - corner[0], row - corner[1]
                if height > top[j, i]:
                    top[j, i] = height
                    rock_id[j, i] = identity


@inner
def _height(a, b, c, column, row):  # type: ignore[no-untyped-def]
    """Height of an upward triangle above a node, minus infinity where it does not cover it.

    The products below change sign exactly when an edge is walked the other way, so no ray slips
    between two triangles that share an edge.
    """
    ax, ay = a[0] - column, a[1] - row
    bx, by = b[0] - column, b[1] - row
    cx, cy = c[0] - column, c[1] - row
    over_a = bx * cy - by * cx
    over_b = cx * ay - cy * ax
    over_c = ax * by - ay * bx
    area = over_a + over_b + over_c
    if over_a < 0.0 or over_b < 0.0 or over_c < 0.0 or area <= 0.0:
        return np.float32(-np.inf)
    return np.float32((over_a * a[2] + over_b * b[2] + over_c * c[2]) / area)
