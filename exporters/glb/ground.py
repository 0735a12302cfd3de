"""The ground: one mesh and one texture per tile."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    bake_ground,
    detail_placement,
    finest_texture,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
)
from terrain_forge.model import GroundDetail, Heightfield, World
from terrain_forge.writers import Gltf, encode_png

from .material import matt
from .options import Options

TRANSFORM = "KHR_texture_transform"


class SharedParts:
    """What tiles share: texture coordinates and faces if they are of one shape, the soil's normals.

    Args:
        gltf: The asset that they are added to.
        detail: The soil's detail tile, if there is one.
    """

    def __init__(self, gltf: Gltf, detail: GroundDetail | None) -> None:
        self._gltf = gltf
        self._detail = detail
        self.shape = cache(self._add_shape)
        if detail:
            self._normals = gltf.add_texture(encode_png(image_rows(detail.normals)), tiles=True)

    def normals(self, ground: Heightfield) -> dict[str, Any] | None:
        """The normal map of a tile's material, laid where it belongs, if there is one."""
        if not self._detail:
            return None
        (along, across), (west, south) = detail_placement(ground, self._detail)
        # v runs down from the top of both images.
        place = {"scale": [along, across], "offset": [west, (1.0 - across - south) % 1.0]}
        return {"index": self._normals, "extensions": {TRANSFORM: place}}

    def _add_shape(self, rows: int, columns: int) -> tuple[int, int]:
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
    tile: World,
    whole: World,
    gltf: Gltf,
    *,
    name: str,
    shared: SharedParts,
    options: Options,
) -> dict[str, Any]:
    """Add a tile's mesh and texture; returns its node.

    Args:
        tile: The tile.
        whole: The world that it is part of.
        gltf: The asset.
        name: Name of the node, the mesh and the material.
        shared: What tiles share.
        options: The export's options.
    """
    corner = tile_corner(tile)
    coordinates, faces = shared.shape(*tile.ground.shape)
    upright = grid_normals(tile.ground, whole.ground)
    attributes = {
        "POSITION": gltf.add_vertices(_vertices(tile.ground, corner[2]), bounded=True),
        "NORMAL": gltf.add_vertices(upright),
        "TEXCOORD_0": coordinates,
    }
    if tile.appearance.detail:
        attributes["TANGENT"] = gltf.add_vertices(_tangents(upright))
    finer = finest_texture(whole.ground, options.texture_pixels)
    picture = image_rows(bake_ground(tile, finer=finer).rgb)
    texture = gltf.add_texture(encode_png(picture), tiles=False)
    look = matt(name, texture=texture, normals=shared.normals(tile.ground))
    material = gltf.add("materials", look)
    primitive = {"attributes": attributes, "indices": faces, "material": material}
    mesh = gltf.add("meshes", {"name": name, "primitives": [primitive]})
    return {"name": name, "mesh": mesh, "translation": corner.tolist()}


def _tangents(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Unit vectors along the surface to the east, and 1: u, v and normal are right-handed."""
    tangents = np.zeros((len(normals), 4), np.float32)
    length = np.hypot(normals[:, 0], normals[:, 2])
    tangents[:, 0] = normals[:, 2] / length
    tangents[:, 2] = -normals[:, 0] / length
    tangents[:, 3] = 1.0
    return tangents


def _vertices(ground: Heightfield, height: float) -> NDArray[np.float32]:
    """The nodes relative to the tile's corner [m], shape [nodes, 3]."""
    rows, columns = ground.shape
    vertices = np.empty((rows, columns, 3), np.float32)
    vertices[..., 0] = np.arange(columns) * ground.spacing
    vertices[..., 1] = (np.arange(rows) * ground.spacing)[:, None]
    np.subtract(ground.elevation, height, out=vertices[..., 2], casting="same_kind")
    return vertices.reshape(-1, 3)
