"""The rocks: a static model of large ones and, merged per tile, small ones; dynamic ones apart."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import rpy_from_quaternion
from terrain_forge.geometry import (
    grouped,
    inertias,
    mean_rock_srgb,
    merge_rocks,
    rock_texture,
    write_rock_shape,
)
from terrain_forge.model import Mesh, RockField, Tile, World
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import Lines, element, numbers, rock_name, write_png, write_stl

from .model import TEXTURES, Model, inertial, mesh, plain, surface
from .options import Options


def write_tile(
    tile: Tile, model: Model, friction: float, coarse: list[Mesh], options: Options
) -> Lines:
    """Write the merged meshes of one tile's small rocks; returns the link of all its static rocks.

    Among the merged rocks a mesh of `coarse` stands for each prototype.
    """
    whole = tile.whole
    single = is_single(tile.field, options.individual_min_m)
    parts: list[Lines] = [
        _single_rocks(whole, tile.field.select(single & ~tile.field.dynamic), model, friction)
    ]
    small = tile.field.select(~single)
    for population, unseen, rocks in grouped(small, ~small.collides):
        name = f"{tile.name('seen' if unseen else 'small')}_{population}"
        # STL: without shared corners it is half the size of an OBJ with normals, and read faster.
        vertices, faces = merge_rocks(rocks, coarse, whole.ground)
        write_stl(model.path(f"meshes/{name}.stl"), vertices=vertices, faces=faces)
        geometry = mesh(model.uri(f"meshes/{name}.stl"))
        if not unseen:
            touch = surface(friction)
            parts.append(element("collision", geometry, touch, name=f"{name}_collision"))
        look = plain(mean_rock_srgb(whole, population))
        parts.append(element("visual", geometry, look, name=f"{name}_visual"))
    return element("link", *parts, name=tile.name("rocks"))


def is_single(field: RockField, least: float) -> NDArray[np.bool_]:
    """Which rocks are elements of their own: the dynamic ones and those of a diameter [m]."""
    large: NDArray[np.bool_] = field.diameter >= least
    return large | field.dynamic


def write_model(world: World, model: Model, *, links: list[Lines], options: Options) -> None:
    """Write the model of the tiles' links, and the meshes and textures that single rocks share."""
    single = world.field.select(is_single(world.field, options.individual_min_m))
    for prototype in np.unique(single.prototype).tolist():
        shape = world.library.prototypes[prototype]
        write_rock_shape(model.path(_shape_file(prototype)), shape)
        for part, hull in enumerate(shape.hulls):
            path = model.path(_hull_file(prototype, part))
            write_stl(path, vertices=hull.vertices, faces=hull.faces)
    populations = np.unique(single.population).tolist()
    for population in populations:
        image = rock_texture(world, population)
        write_png(model.path(f"{TEXTURES}/{_texture_file(population)}"), image)
    model.write_scripts(list(map(_texture_file, populations)), address="wrap")
    model.write(title=f"{world.site.name}: rocks", links=links)


def _single_rocks(world: World, rocks: RockField, model: Model, friction: float) -> Lines:
    """A visual and the convex collisions of each rock, a line each, named by the rock's id."""
    poses = np.hstack([rocks.position, rpy_from_quaternion(rocks.quaternion)]).tolist()
    touch = "".join(surface(friction))
    looks = _looks(model, rocks)
    lines: Lines = []
    for row, pose in enumerate(poses):
        name, place = rock_name(rocks.id[row]), f"<pose>{numbers(pose)}</pose>"
        shape, hulls = _meshes(world, rocks, row, model)
        look = f"{place}{shape}{looks[rocks.population[row]]}"
        lines.append(f'<visual name="{name}_visual">{look}</visual>')
        for part, hull in enumerate(hulls if rocks.collides[row] else ()):
            body = f"{place}{hull}{touch}"
            lines.append(f'<collision name="{name}_collision_{part}">{body}</collision>')
    return lines


def dynamic_rocks(world: World, model: Model) -> list[Lines]:
    """A model `rock_<id>` for each dynamic rock, which gravity holds and a rover can push.

    They share meshes and textures with the static rocks, whose model this is.
    """
    field = world.field.select(world.field.dynamic)
    poses = np.hstack([field.position, rpy_from_quaternion(field.quaternion)])
    looks, tensors = _looks(model, field), inertias(field, world.library)
    models = []
    for row, rock in enumerate(field.id.tolist()):
        contact = dynamic_contact(float(field.diameter[row]))  # as it was settled
        # SDF's torsional friction is 3π/16 patch radius · coefficient · normal force.
        radius = 16.0 * contact.torsional / (3.0 * math.pi * contact.sliding)
        touch = "".join(surface(contact.sliding, patch_radius=radius))
        shape, hulls = _meshes(world, field, row, model)
        parts = [f'<visual name="visual">{shape}{looks[field.population[row]]}</visual>']
        for part, hull in enumerate(hulls):
            parts.append(f'<collision name="collision_{part}">{hull}{touch}</collision>')
        mass = "".join(inertial(float(field.mass[row]), tensors[row]))
        link = element("link", [mass], parts, name="rock")
        pose = element("pose", poses[row])
        models.append(element("model", pose, link, name=rock_name(rock)))
    return models


def _looks(model: Model, rocks: RockField) -> list[str]:
    """The material of each population's single rocks, as text."""
    populations = range(len(rocks.populations))
    return ["".join(model.textured(_texture_file(number))) for number in populations]


def _meshes(world: World, rocks: RockField, row: int, model: Model) -> tuple[str, list[str]]:
    """The geometries of a rock's shape and of its convex parts, as text."""
    prototype, scale = int(rocks.prototype[row]), float(rocks.scale[row])
    parts = range(len(world.library.prototypes[prototype].hulls))
    hulls = [model.uri(_hull_file(prototype, part)) for part in parts]
    shape = _scaled_mesh(model.uri(_shape_file(prototype)), scale)
    return shape, [_scaled_mesh(hull, scale) for hull in hulls]


def _scaled_mesh(uri: str, scale: float) -> str:
    """The geometry of a mesh file in a size, as text."""
    size = f"{scale:.9g}"
    scaled = f"<uri>{uri}</uri><scale>{size} {size} {size}</scale>"
    return f"<geometry><mesh>{scaled}</mesh></geometry>"


def _shape_file(prototype: int) -> str:
    """File of a prototype's textured shape."""
    return f"meshes/shape_{prototype:03}.obj"


def _hull_file(prototype: int, part: int) -> str:
    """File of a prototype's convex part."""
    return f"meshes/shape_{prototype:03}_hull_{part}.stl"


def _texture_file(population: int) -> str:
    """File of a population's texture, in its folder."""
    return f"rock_{population}.png"
