"""A rock's shape as textured triangles: the level of detail that will do, seams cut open."""

from __future__ import annotations

import numpy as np

from terrain_forge.model import RockPrototype, TexturedMesh
from terrain_forge.writers import vertex_normals


def level_of_detail(prototype: RockPrototype, tolerance: float) -> int:
    """The coarsest level whose outline is off by no more than `tolerance` [mean axes].

    The finest level is the shape itself, so there always is one.
    """
    errors = prototype.outline_errors
    return max(level for level, error in enumerate(errors) if level == 0 or error <= tolerance)


def surface(prototype: RockPrototype, level: int = 0) -> TexturedMesh:
    """A level of detail for formats that know one index per corner: cut open along seams.

    Normals are those of the closed mesh, so that no seam shows in the shading.
    """
    mesh = prototype.meshes[level]
    corners = mesh.faces.reshape(-1, 1).astype(np.float64)
    rows = np.hstack([corners, prototype.uvs[level].reshape(-1, 2)])
    distinct, index = np.unique(rows, axis=0, return_inverse=True)
    vertex = distinct[:, 0].astype(np.int64)
    return TexturedMesh(
        vertices=mesh.vertices[vertex],
        normals=vertex_normals(mesh.vertices, mesh.faces)[vertex],
        texture_coordinates=distinct[:, 1:],
        faces=index.reshape(-1, 3).astype(np.int32),
    )
