"""The ground: one mesh and one texture per tile."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.frames import image_rows
from terrain_forge.ground_mesh import grid_faces, grid_normals, grid_texture_coordinates
from terrain_forge.world import Heightfield, World
from terrain_forge.writers.glb import Gltf
from terrain_forge.writers.image import encode_png

from .material import matt


class TileShapes:
    """Texture coordinates and faces, which tiles of one shape share.

    Args:
        gltf: The asset that they are added to.
    """

    def __init__(self, gltf: Gltf) -> None:
        self._gltf = gltf
        self.of = cache(self._add)

    def _add(self, rows: int, columns: int) -> tuple[int, int]:
        """Accessors of texture coordinates (v downwards, as in glTF) and of faces."""
        coordinates = grid_texture_coordinates(rows, columns).astype(np.float32)
        coordinates[:, 1] = 1 - coordinates[:, 1]
        return (
            self._gltf.add_vertices(coordinates),
            self._gltf.add_indices(grid_faces(rows, columns)),
        )


def tile_corner(tile: World) -> NDArray[np.float64]:
    """The point that a tile's vertices count from: float32 is finest near 0. Shape [3]."""
    return np.array([*tile.ground.origin, float(tile.ground.elevation[0, 0])])


def ground_tile(
    tile: World, whole: World, gltf: Gltf, *, name: str, shapes: TileShapes
) -> dict[str, Any]:
    """Add a tile's mesh and texture; returns its node."""
    corner = tile_corner(tile)
    pixels = image_rows(tile.appearance.ground_rgb)
    texture = gltf.add_texture(encode_png(pixels), tiles=False)
    coordinates, faces = shapes.of(*tile.ground.shape)
    attributes = {
        "POSITION": gltf.add_vertices(_vertices(tile.ground, corner[2]), bounded=True),
        "NORMAL": gltf.add_vertices(grid_normals(tile.ground, whole.ground)),
        "TEXCOORD_0": coordinates,
    }
    material = gltf.add("materials", matt(name, texture=texture))
    primitive = {"attributes": attributes, "indices": faces, "material": material}
    mesh = gltf.add("meshes", {"name": name, "primitives": [primitive]})
    return {"name": name, "mesh": mesh, "translation": corner.tolist()}


def _vertices(ground: Heightfield, height: float) -> NDArray[np.float32]:
    """The nodes relative to the tile's corner [m], shape [nodes, 3]."""
    rows, columns = ground.shape
    vertices = np.empty((rows, columns, 3), np.float32)
    vertices[..., 0] = np.arange(columns) * ground.spacing
    vertices[..., 1] = (np.arange(rows) * ground.spacing)[:, None]
    np.subtract(ground.elevation, height, out=vertices[..., 2], casting="same_kind")
    return vertices.reshape(-1, 3)
