"""The ground as a static model: one mesh and one texture per tile."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    bake_ground,
    finest_texture,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
)
from terrain_forge.model import World, world_friction
from terrain_forge.writers import write_obj, write_png

from ..sdf.markup import Lines, element
from .geometry import MATERIALS, rigid, visual
from .options import Options


def ground_link(tile: World, whole: World, folder: Path, *, name: str, options: Options) -> Lines:
    """Write a tile's mesh and texture; returns its link."""
    write_obj(
        folder / f"{name}.obj",
        vertices=grid_vertices(tile.ground),
        faces=grid_faces(*tile.ground.shape),
        normals=grid_normals(tile.ground, whole.ground),
        texture_coordinates=grid_texture_coordinates(*tile.ground.shape),
        material=(MATERIALS, name),
    )
    texture = bake_ground(tile, finer=finest_texture(whole.ground, options.texture_pixels))
    write_png(folder / f"{name}.png", image_rows(texture.rgb))
    uri = f"{folder.name}/{name}.obj"
    grip = world_friction(whole.site.body, options)
    touch = rigid(f"{name}_collision", uri, grip.ground)
    return element("link", visual(f"{name}_visual", uri), touch, name=name)
