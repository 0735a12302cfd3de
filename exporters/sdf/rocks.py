"""The static rocks as a static model: large ones one by one, small ones merged per tile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from terrain_forge.exporters.sdf import material

from terrain_forge.base import rpy_from_quaternion, srgb_from_linear
from terrain_forge.geometry import mean_rock_colour, merge_rocks, rock_texture
from terrain_forge.model import Mesh, RockField, World, world_friction
from terrain_forge.writers import index_corners, vertex_normals, write_obj, write_png, write_stl

from .markup import Lines, element, numbers
from .model import Model, mesh, surface
from .options import Options


def write_tile(
    tile: World,
    whole: World,
    model: Model,
    *,
    number: int,
    coarse: list[Mesh],
    options: Options,
) -> Lines:
    """Write the merged meshes of one tile's small rocks; returns the link of all its static rocks.

    Args:
        tile: The tile.
        whole: The world that it is part of.
        model: The model of the rocks.
        number: The tile's number, in the names of its files and elements.
        coarse: The mesh that stands for each prototype among the merged rocks.
        options: The export's options.
    """
    single = is_single(tile.field, options)
    friction = world_friction(whole.site.body, options).rock
    parts: list[Lines] = [
        _single_rocks(whole, tile.field.select(single & ~tile.field.dynamic), model, friction)
    ]
    small = tile.field.select(~single)
    groups = np.unique(np.stack([small.population, ~small.collides], axis=-1), axis=0)
    for population, unseen in groups.tolist():
        name = f"{'seen' if unseen else 'small'}_{number:03}_{population}"
        rocks = small.select((small.population == population) & (small.collides == (not unseen)))
        _write_merged(rocks, coarse, whole, model, f"meshes/{name}.stl")
        look = _plain(whole, population)
        parts += _merged_rocks(model, name, look, None if unseen else friction)
    return element("link", *parts, name=f"rocks_{number:03}")


def is_single(field: RockField, options: Options) -> NDArray[np.bool_]:
    """Which rocks are elements of their own: the large and the dynamic ones."""
    large: NDArray[np.bool_] = field.diameter >= options.individual_min_m
    return large | field.dynamic


def write_model(world: World, model: Model, *, links: list[Lines], options: Options) -> None:
    """Write the model of the tiles' links, and the meshes and textures that single rocks share."""
    single = world.field.select(is_single(world.field, options))
    _write_shapes(world, model, np.unique(single.prototype).tolist())
    populations = np.unique(single.population).tolist()
    for population in populations:
        image = rock_texture(world, population)
        write_png(model.path(f"materials/textures/{texture_file(population)}"), image)
    if model.flavour == "classic" and populations:
        material.write_scripts(model, list(map(texture_file, populations)), address="wrap")
    model.write(title=f"{world.site.name}: rocks", links=links)


def _write_merged(
    rocks: RockField, shapes: list[Mesh], world: World, model: Model, name: str
) -> None:
    # STL: without shared corners it is half the size of an OBJ with normals, and is read faster.
    vertices, faces = merge_rocks(rocks, shapes, world.ground)
    write_stl(model.path(name), vertices=vertices, faces=faces)


def _write_shapes(world: World, model: Model, prototypes: list[int]) -> None:
    """Write the meshes that single rocks share: finest level of detail, and convex parts."""
    for number in prototypes:
        shape = world.library.prototypes[number]
        finest = shape.meshes[0]
        coordinates, texture_faces = index_corners(shape.uvs[0])
        write_obj(
            model.path(shape_file(number)),
            vertices=finest.vertices,
            faces=finest.faces,
            normals=vertex_normals(finest.vertices, finest.faces),
            texture_coordinates=coordinates,
            texture_faces=texture_faces,
        )
        for part, hull in enumerate(shape.hulls):
            path = model.path(hull_file(number, part))
            write_stl(path, vertices=hull.vertices, faces=hull.faces)


def _single_rocks(world: World, rocks: RockField, model: Model, friction: float) -> Lines:
    """A visual and the convex collisions of each rock, a line each, named by the rock's id."""
    poses = np.hstack([rocks.position, rpy_from_quaternion(rocks.quaternion)]).tolist()
    touch = "".join(surface(friction))
    populations = range(len(rocks.populations))
    looks = ["".join(material.textured(model, texture_file(number))) for number in populations]
    hulls = [len(shape.hulls) for shape in world.library.prototypes]
    columns = (rocks.id, rocks.prototype, rocks.population, rocks.scale, rocks.collides)
    table = zip(poses, *(column.tolist() for column in columns), strict=True)
    lines: Lines = []
    for pose, identity, prototype, population, scale, solid in table:
        place = f"<pose>{numbers(pose)}</pose>"
        look = f"{place}{scaled_mesh(model.uri(shape_file(prototype)), scale)}{looks[population]}"
        lines.append(f'<visual name="rock_{identity}_visual">{look}</visual>')
        for part in range(hulls[prototype] if solid else 0):
            body = f"{place}{scaled_mesh(model.uri(hull_file(prototype, part)), scale)}{touch}"
            name = f"rock_{identity}_collision_{part}"
            lines.append(f'<collision name="{name}">{body}</collision>')
    return lines


def scaled_mesh(uri: str, scale: float) -> str:
    """The geometry of a mesh file in a size, as text."""
    size = f"{scale:.9g}"
    scaled = f"<uri>{uri}</uri><scale>{size} {size} {size}</scale>"
    return f"<geometry><mesh>{scaled}</mesh></geometry>"


def _merged_rocks(model: Model, name: str, look: Lines, friction: float | None) -> list[Lines]:
    """The visual of a merged mesh, and its collision if it has friction."""
    geometry = mesh(model.uri(f"meshes/{name}.stl"))
    visual = element("visual", geometry, look, name=f"{name}_visual")
    if friction is None:
        return [visual]
    touch = surface(friction)
    return [element("collision", geometry, touch, name=f"{name}_collision"), visual]


def _plain(world: World, population: int) -> Lines:
    red, green, blue = srgb_from_linear(mean_rock_colour(world, population)).tolist()
    return material.plain((red, green, blue))


def shape_file(prototype: int) -> str:
    """File of a prototype's textured shape."""
    return f"meshes/shape_{prototype:03}.obj"


def hull_file(prototype: int, part: int) -> str:
    """File of a prototype's convex part."""
    return f"meshes/shape_{prototype:03}_hull_{part}.stl"


def texture_file(population: int) -> str:
    """File of a population's texture, in its folder."""
    return f"rock_{population}.png"
