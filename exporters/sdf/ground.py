"""The ground as a static model: one mesh and one texture per tile."""

from __future__ import annotations

from terrain_forge.exporters.sdf import material

from terrain_forge.base import image_rows
from terrain_forge.geometry import bake_tile, write_ground_obj
from terrain_forge.model import Tile, world_friction
from terrain_forge.writers import write_png

from .markup import Lines, element
from .model import Model, mesh, surface
from .options import Options


def write_tile(tile: Tile, model: Model, *, options: Options) -> list[Lines]:
    """Write one tile's mesh and textures; returns its visual and, of a mesh, its collision."""
    name = tile.name("ground")
    # One OBJ for both: it has the normals that Gazebo's physics asks of a collision mesh.
    with model.path(f"meshes/{name}.obj").open("wb") as file:
        write_ground_obj(file, tile)
    normals = _write_textures(tile, model, name, options)
    geometry = mesh(model.uri(f"meshes/{name}.obj"))
    look = material.textured(model, f"{name}.png", normals=normals)
    visual = element("visual", geometry, look, name=f"{name}_visual")
    if options.ground == "heightmap":
        return [visual]
    touch = surface(world_friction(tile.whole.site.body, options).ground)
    return [element("collision", geometry, touch, name=f"{name}_collision"), visual]


def _write_textures(tile: Tile, model: Model, name: str, options: Options) -> str | None:
    """Write a tile's colours and, where they are wanted, its normals; returns the latter's name."""
    texture = bake_tile(tile, options.texture_pixels)
    write_png(model.path(f"{material.TEXTURES}/{name}.png"), image_rows(texture.rgb))
    if model.flavour == "classic" or not options.normal_maps:
        return None
    normals = f"{name}_normals.png"
    write_png(model.path(f"{material.TEXTURES}/{normals}"), image_rows(texture.normals))
    return normals


def write_model(model: Model, *, title: str, tiles: list[str], parts: list[Lines]) -> None:
    """Write the model of the named tiles' collisions and visuals: one link of them all."""
    if model.flavour == "classic":
        material.write_scripts(model, [f"{name}.png" for name in tiles], address="clamp")
    model.write(title=title, links=[element("link", *parts, name="ground")])
