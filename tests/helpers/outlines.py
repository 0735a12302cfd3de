"""Outlines of rocks, measured on the mesh."""

from __future__ import annotations

import numpy as np

from terrain_forge.rocks.embedding.outline import convex_hull, edges, exposed_points, extent


def exposed_outline(mesh, *, rotation, normal, buried):
    """Convex hull of the plan outline of the part of a rock above a plane."""
    turn = np.array(rotation, np.float64, order="C")
    up = tuple(turn.T @ np.asarray(normal, np.float64))
    vertices = mesh.vertices.copy()
    low, high = extent(vertices, up)
    level = low + buried * (high - low)
    return convex_hull(exposed_points(vertices, edges(mesh), turn, up, level))
