"""The ground: one mesh and one texture per tile; materials, all of them matt."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    ClosePatch,
    bake_tile,
    close_patches,
    detail_placement,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    horizon_detail,
    horizon_surface,
)
from terrain_forge.model import GroundDetail, Heightfield, Horizon, Tile
from terrain_forge.writers import Gltf, encode_jpeg, encode_png

from .options import Options

_TRANSFORM = "KHR_texture_transform"
_NO_GLOSS = {"KHR_materials_specular": {"specularFactor": 0.0}}
"""Soil and rocks have none: with it even rough ones are nearly white towards a low Sun."""
Z_UP_TO_Y_UP = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Turns the world's axes (east, north, up) into glTF's (x, z, -y), as (x, y, z, w)."""


class SharedParts:
    """What tiles share: texture coordinates and faces if they are of one shape, the soil's normals.

    They are added to the asset; the normals are those of the detail tile, if there is one.
    """

    def __init__(self, gltf: Gltf, detail: GroundDetail | None) -> None:
        self._gltf = gltf
        self._detail = detail
        self.shape = cache(self._add_shape)
        self._soil = -1
        if detail:
            self._soil = gltf.add_texture(encode_png(image_rows(detail.normals)), tiles=True)

    def normals(self, ground: Heightfield) -> dict[str, Any] | None:
        """The normal map of a tile's material, laid where it belongs, if there is one."""
        if not self._detail:
            return None
        (along, across), (west, south) = detail_placement(ground, self._detail)
        # v runs down from the top of both images.
        place = {"scale": [along, across], "offset": [west, (1.0 - across - south) % 1.0]}
        return {"index": self._soil, "extensions": {_TRANSFORM: place}}

    def beyond(self, horizon: Horizon) -> dict[str, Any]:
        """What lies beyond the border as a piece of a mesh, with its material."""
        surface, picture = horizon_surface(horizon)
        laid = horizon_detail(horizon, self._detail) if self._detail else None
        piece = self._gltf.add_surface(surface, bumps=laid)
        soil = {"index": self._soil, "texCoord": 1} if self._detail else None
        texture = self._gltf.add_texture(encode_png(picture), tiles=False)
        look = matt("horizon", texture=texture, normals=soil)
        return {**piece, "material": self._gltf.add("materials", look)}

    def _add_shape(self, rows: int, columns: int) -> tuple[int, int]:
        """Accessors of texture coordinates (v downwards, as in glTF) and of faces."""
        coordinates = grid_texture_coordinates(rows, columns).astype(np.float32)
        coordinates[:, 1] = 1 - coordinates[:, 1]
        faces = grid_faces(rows, columns)
        return self._gltf.add_vertices(coordinates), self._gltf.add_indices(faces)


def tile_corner(tile: Tile) -> NDArray[np.float64]:
    """The point that a tile's vertices count from: float32 is finest near 0. Shape [3]."""
    return np.array([*tile.ground.origin, float(tile.ground.elevation[0, 0])])


def ground_tile(tile: Tile, gltf: Gltf, *, shared: SharedParts, options: Options) -> dict[str, Any]:
    """Add a tile's mesh and texture; returns its node."""
    name, corner, ground = tile.name("ground"), tile_corner(tile), tile.ground
    vertices = np.empty((*ground.shape, 3), np.float32)  # relative to the corner
    vertices[..., 0], vertices[..., 1] = np.meshgrid(
        *(np.arange(nodes) * ground.spacing for nodes in reversed(ground.shape))
    )
    np.subtract(ground.elevation, corner[2], out=vertices[..., 2], casting="same_kind")
    coordinates, faces = shared.shape(*tile.ground.shape)
    upright = grid_normals(tile.ground, tile.whole.ground)
    attributes = {
        "POSITION": gltf.add_vertices(vertices.reshape(-1, 3), bounded=True),
        "NORMAL": gltf.add_vertices(upright),
        "TEXCOORD_0": coordinates,
    }
    normals = shared.normals(tile.ground)
    within = options.close_within_m
    patches = list(close_patches(tile, within=within, largest=options.texture_pixels))
    if normals or patches:
        attributes["TANGENT"] = add_tangents(gltf, upright)
    picture = image_rows(bake_tile(tile, options.texture_pixels).rgb)
    texture = gltf.add_texture(encode_png(picture), tiles=False)
    material = gltf.add("materials", matt(name, texture=texture, normals=normals))
    piece = {"attributes": attributes, "indices": faces, "material": material}
    primitives = patched(piece, patches, gltf, shape=ground.shape, name=name)
    mesh = gltf.add("meshes", {"name": name, "primitives": primitives})
    return {"name": name, "mesh": mesh, "translation": corner.tolist()}


def add_tangents(gltf: Gltf, upright: NDArray[np.float32]) -> int:
    """Add tangents of a ground with these normals, which normal maps are laid along."""
    # Unit vectors along the surface to the east, and 1: u, v and normal are right-handed.
    length = np.hypot(upright[:, 0], upright[:, 2])
    east, up = upright[:, 2] / length, -upright[:, 0] / length
    tangents = np.stack([east, np.zeros_like(east), up, np.ones_like(east)], axis=-1)
    return gltf.add_vertices(tangents)


def patched(
    piece: dict[str, Any],
    patches: Sequence[ClosePatch],
    gltf: Gltf,
    *,
    shape: tuple[int, int],
    name: str,
) -> list[dict[str, Any]]:
    """A piece of a mesh, the ground of a tile, cut into what is near paths and the rest.

    Args:
        piece: The whole, with tangents where there are patches.
        patches: What is near paths.
        gltf: What pictures and faces are added to.
        shape: Rows and columns of the tile's nodes.
        name: The ground's, for the materials.
    """
    if not patches:
        return [piece]
    cells, pieces = grid_faces(*shape).reshape(-1, 6), []
    rest = np.ones(len(cells), np.bool_)
    for patch in patches:
        rest[patch.cells] = False
        indices = gltf.add_indices(cells[patch.cells].reshape(-1, 3))
        look = gltf.add("materials", close_look(patch, gltf, name))
        pieces.append({**piece, "indices": indices, "material": look})
    if rest.any():
        pieces.append({**piece, "indices": gltf.add_indices(cells[rest].reshape(-1, 3))})
    return pieces


def close_look(patch: ClosePatch, gltf: Gltf, name: str) -> dict[str, Any]:
    """The material of the ground near a path, its pictures added."""
    (along, across), (west, south) = patch.scale, patch.offset
    # v runs down from the top of both images.
    place = {"scale": [along, across], "offset": [west, 1.0 - across - south]}
    laid = {"extensions": {_TRANSFORM: place}}
    colours, normals = (
        {"index": gltf.add_texture(picture, tiles=False, media_type="image/jpeg"), **laid}
        for picture in map(encode_jpeg, map(image_rows, (patch.texture.rgb, patch.texture.normals)))
    )
    return matt(f"{name}_close_{patch.number}", texture=colours, normals=normals)


def matt(
    name: str,
    *,
    texture: int | dict[str, Any] | None = None,
    rgb: Sequence[float] = (1.0, 1.0, 1.0),
    normals: dict[str, Any] | None = None,
    roughness: int | None = None,
) -> dict[str, Any]:
    """A rough, non-metallic material without gloss.

    Args:
        name: Its name.
        texture: Index of its texture, or as glTF describes one; `rgb` multiplies its colours.
        rgb: Linear colour, 0 to 1.
        normals: Its normal map, as glTF describes one.
        roughness: Index of the texture whose green is its roughness, for readers that pass over the
            extension.
    """
    look: dict[str, Any] = {
        "baseColorFactor": [*rgb, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    }
    if texture is not None:
        look["baseColorTexture"] = {"index": texture} if isinstance(texture, int) else texture
    if roughness is not None:
        look["metallicRoughnessTexture"] = {"index": roughness}
    relief = {"normalTexture": normals} if normals else {}
    return {"name": name, "pbrMetallicRoughness": look, **relief, "extensions": _NO_GLOSS}
