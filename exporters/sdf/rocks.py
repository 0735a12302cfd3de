"""The rocks as a static model: large ones one by one, small ones merged per tile and population."""

from __future__ import annotations

import numpy as np

from terrain_forge.frames import rpy_from_quaternion
from terrain_forge.mesh import Mesh
from terrain_forge.rock_mesh import merge_rocks
from terrain_forge.world import RockField, World
from terrain_forge.writers.mesh import vertex_normals, write_obj, write_stl

from . import material
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
    """Write the merged meshes of one tile's small rocks; returns the link of all its rocks.

    Args:
        tile: The tile.
        whole: The world that it is part of.
        model: The model of the rocks.
        number: The tile's number, in the names of its files and elements.
        coarse: The mesh that stands for each prototype among the merged rocks.
        options: The export's options.
    """
    large = tile.field.diameter >= options.individual_min_m
    small = tile.field.select(~large)
    parts: list[Lines] = [_single_rocks(whole, tile.field.select(large), model, options)]
    for population in np.unique(small.population).tolist():
        name = f"small_{number:03}_{population}"
        rocks = small.select(small.population == population)
        _write_merged(rocks, coarse, whole, model, f"meshes/{name}.stl")
        parts += _merged_rocks(model, name, _colour(whole, population), options.friction)
    return element("link", *parts, name=f"rocks_{number:03}")


def write_model(world: World, model: Model, *, links: list[Lines], options: Options) -> None:
    """Write the model of the tiles' links, and the meshes of the shapes that single rocks share."""
    single = world.field.prototype[world.field.diameter >= options.individual_min_m]
    _write_shapes(world, model, np.unique(single).tolist())
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
        normals = vertex_normals(finest.vertices, finest.faces)
        path = model.path(_shape_file(number))
        write_obj(path, vertices=finest.vertices, faces=finest.faces, normals=normals)
        for part, hull in enumerate(shape.hulls):
            path = model.path(_hull_file(number, part))
            write_stl(path, vertices=hull.vertices, faces=hull.faces)


def _single_rocks(world: World, rocks: RockField, model: Model, options: Options) -> Lines:
    """A visual and the convex collisions of each rock, a line each, named by the rock's id."""
    poses = np.hstack([rocks.position, rpy_from_quaternion(rocks.quaternion)]).tolist()
    touch = "".join(surface(options.friction))
    populations = range(len(rocks.populations))
    looks = ["".join(material.plain(_colour(world, number))) for number in populations]
    parts = [len(shape.hulls) for shape in world.library.prototypes]
    columns = (rocks.id, rocks.prototype, rocks.population, rocks.scale)
    table = zip(poses, *(column.tolist() for column in columns), strict=True)
    lines: Lines = []
    for pose, identity, prototype, population, scale in table:
        place = f"<pose>{numbers(pose)}</pose>"
        look = f"{place}{_geometry(model.uri(_shape_file(prototype)), scale)}{looks[population]}"
        lines.append(f'<visual name="rock_{identity}_visual">{look}</visual>')
        for part in range(parts[prototype]):
            solid = f"{place}{_geometry(model.uri(_hull_file(prototype, part)), scale)}{touch}"
            name = f"rock_{identity}_collision_{part}"
            lines.append(f'<collision name="{name}">{solid}</collision>')
    return lines


def _geometry(uri: str, scale: float) -> str:
    size = f"{scale:.9g}"
    scaled = f"<uri>{uri}</uri><scale>{size} {size} {size}</scale>"
    return f"<geometry><mesh>{scaled}</mesh></geometry>"


def _merged_rocks(model: Model, name: str, rgb: material.Colour, friction: float) -> list[Lines]:
    geometry = mesh(model.uri(f"meshes/{name}.stl"))
    return [
        element("collision", geometry, surface(friction), name=f"{name}_collision"),
        element("visual", geometry, material.plain(rgb), name=f"{name}_visual"),
    ]


def _colour(world: World, population: int) -> material.Colour:
    red, green, blue = (world.appearance.rock_rgb[population] / 255).tolist()
    return red, green, blue


def _shape_file(prototype: int) -> str:
    return f"meshes/shape_{prototype:03}.obj"


def _hull_file(prototype: int, part: int) -> str:
    return f"meshes/shape_{prototype:03}_hull_{part}.stl"
