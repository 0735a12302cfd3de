"""The ground as a static model: one mesh and one texture per tile."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO

from terrain_forge.exporters.sdf import material

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
from terrain_forge.writers import write_obj_faces, write_obj_rows, write_png

from .markup import Lines, element
from .model import Model, mesh, surface
from .options import Options


def write_tile(
    tile: World,
    whole: World,
    model: Model,
    *,
    name: str,
    options: Options,
    block_of_shape: Callable[[int, int], bytes],
) -> list[Lines]:
    """Write one tile's mesh and textures; returns its visual and, of a mesh, its collision.

    Args:
        tile: The tile.
        whole: The world that it is part of.
        model: The model of the ground.
        name: Name of the tile's files and elements.
        options: The export's options.
        block_of_shape: `shape_block`, which remembers what it made for earlier tiles.
    """
    with model.path(f"meshes/{name}.obj").open("wb") as file:
        write_obj_rows(file, b"v", grid_vertices(tile.ground))
        write_obj_rows(file, b"vn", grid_normals(tile.ground, whole.ground))
        file.write(block_of_shape(*tile.ground.shape))
    normals = _write_textures(tile, whole, model, name, options)
    # One OBJ for both: it has the normals that Gazebo's physics asks of a collision mesh.
    geometry = mesh(model.uri(f"meshes/{name}.obj"))
    look = material.textured(model, f"{name}.png", normals=normals)
    visual = element("visual", geometry, look, name=f"{name}_visual")
    if options.ground == "heightmap":
        return [visual]
    touch = surface(world_friction(whole.site.body, options).ground)
    return [element("collision", geometry, touch, name=f"{name}_collision"), visual]


def _write_textures(
    tile: World, whole: World, model: Model, name: str, options: Options
) -> str | None:
    """Write a tile's colours and, where they are wanted, its normals; returns the latter's name."""
    texture = bake_ground(tile, finer=finest_texture(whole.ground, options.texture_pixels))
    folder = "materials/textures"
    write_png(model.path(f"{folder}/{name}.png"), image_rows(texture.rgb))
    if model.flavour == "classic" or not options.normal_maps:
        return None
    normals = f"{name}_normals.png"
    write_png(model.path(f"{folder}/{normals}"), image_rows(texture.normals))
    return normals


def shape_block(rows: int, columns: int) -> bytes:
    """The lines of an OBJ that depend on the tile's shape alone: texture coordinates and faces.

    They are most of the file, and nearly all tiles have the same shape.
    """
    block = BytesIO()
    write_obj_rows(block, b"vt", grid_texture_coordinates(rows, columns))
    faces = grid_faces(rows, columns)
    write_obj_faces(block, faces, texture_faces=faces)
    return block.getvalue()


def write_model(model: Model, *, title: str, tiles: list[str], parts: list[Lines]) -> None:
    """Write the model of the named tiles' collisions and visuals: one link of them all."""
    if model.flavour == "classic":
        material.write_scripts(model, [f"{name}.png" for name in tiles], address="clamp")
    model.write(title=title, links=[element("link", *parts, name="ground")])
