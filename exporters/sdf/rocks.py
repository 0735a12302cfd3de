"""The rocks: a static model of large ones and, merged per tile, small ones; dynamic ones apart."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import rpy_from_quaternion
from terrain_forge.geometry import (
    grouped,
    inertias,
    lie_upright,
    mean_rock_srgb,
    merge_rocks,
    rock_factors,
    rock_maps,
    rock_texture,
    write_rock_shape,
    write_rocks_glb,
)
from terrain_forge.model import CLOSE, Mesh, RockField, Tile, World
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import rock_tints
from terrain_forge.writers import Lines, element, numbers, rock_name, write_stl, write_texture

from .model import TEXTURES, Model, inertial, mesh, plain, surface
from .options import Options

_NORMALS, _ROUGHNESS = "rock_normals.png", "rock_roughness.png"
"""The maps that all single rocks share."""


def write_tile(
    tile: Tile,
    model: Model,
    friction: float,
    coarse: list[Mesh],
    options: Options,
    *,
    close: Container[int] = (),
    shapes: Model | None = None,
) -> Lines:
    """Write the merged meshes of one tile's small rocks; returns the link of all its static rocks.

    The single ones' shapes lie in the model, or in that of `shapes`; those whose ids are in `close`
    are drawn by their close meshes. Among the merged rocks a mesh of `coarse` stands for each
    prototype.
    """
    whole = tile.whole
    single = is_single(tile.field, options.individual_min_m)
    parts: list[Lines] = [
        _single_rocks(
            whole, tile.field.select(single & ~tile.field.dynamic), shapes or model, friction, close
        )
    ]
    small = tile.field.select(~single)
    for population, unseen, rocks in grouped(small, ~small.collides):
        name = f"{tile.name('seen' if unseen else 'small')}_{population}"
        file = f"meshes/{name}.{'glb' if options.binary else 'stl'}"
        if options.binary:
            write_rocks_glb(model.path(file), rocks, coarse, whole.ground)
        else:
            # Without shared corners STL is half the size of an OBJ with normals, and read faster.
            vertices, faces = merge_rocks(rocks, coarse, whole.ground)
            write_stl(model.path(file), vertices=vertices, faces=faces)
        geometry = mesh(model.uri(file))
        if not unseen:
            touch = surface(friction)
            parts.append(element("collision", geometry, touch, name=f"{name}_collision"))
        look = plain(mean_rock_srgb(whole, population), classic=model.classic)
        parts.append(element("visual", geometry, look, name=f"{name}_visual"))
    return element("link", *parts, name=tile.name("rocks"))


def is_single(field: RockField, least: float) -> NDArray[np.bool_]:
    """Which rocks are elements of their own: the dynamic ones and those of a diameter [m]."""
    large: NDArray[np.bool_] = field.diameter >= least
    return large | field.dynamic


def write_model(
    world: World, model: Model, *, links: list[Lines], close: frozenset[int], options: Options
) -> None:
    """Write the model of the tiles' links, and the meshes and textures that single rocks share.

    Those of the rocks of `close` have their close meshes too.
    """
    single = world.field.select(is_single(world.field, options.individual_min_m))
    populations = np.unique(single.population).tolist()
    _write_pictures(world, model, populations)
    _write_meshes(world, model, sorted({*_kinds(single, close)}))
    model.write_scripts(list(map(_texture_file, populations)), address="wrap")
    model.write(title=f"{world.site.name}: rocks", links=links)


def write_shapes(world: World, model: Model, *, close: bool) -> None:
    """Write all prototypes' meshes, those for `close` views too, and all populations' pictures."""
    kinds = [
        (number, upright, fine)
        for number, shape in enumerate(world.library.prototypes)
        for upright in (True, False)
        for fine in ((False, True) if close and shape.close else (False,))
    ]
    _write_meshes(world, model, kinds)
    _write_pictures(world, model, range(len(world.field.populations)))


def _kinds(rocks: RockField, close: Container[int]) -> list[tuple[int, bool, bool]]:
    """Prototype of each rock, whether it lies upright, and whether by its close mesh."""
    fine = [one in close for one in rocks.id.tolist()]
    return [*zip(rocks.prototype.tolist(), lie_upright(rocks).tolist(), fine, strict=True)]


def _write_meshes(world: World, model: Model, kinds: Sequence[tuple[int, bool, bool]]) -> None:
    """Write the shapes of kinds of rocks, and their prototypes' convex parts."""
    for prototype, upright, close in kinds:
        path = model.path(_shape_file(prototype, upright, close))
        shape = world.library.prototypes[prototype]
        write_rock_shape(path, shape, CLOSE if close else 0, upright=upright)
    for prototype in {kind[0] for kind in kinds}:
        for part, hull in enumerate(world.library.prototypes[prototype].hulls):
            path = model.path(_hull_file(prototype, part))
            write_stl(path, vertices=hull.vertices, faces=hull.faces)


def _write_pictures(world: World, model: Model, populations: Sequence[int]) -> None:
    for population in populations:
        image = rock_texture(world, population, tinted=not model.classic)
        write_texture(model.path(f"{TEXTURES}/{_texture_file(population)}"), image)
    if populations and model.relief and (maps := rock_maps(world)):
        for file, image in zip((_NORMALS, _ROUGHNESS), maps, strict=True):
            write_texture(model.path(f"{TEXTURES}/{file}"), image)


def _single_rocks(
    world: World, rocks: RockField, model: Model, friction: float, close: Container[int]
) -> Lines:
    """A visual and the convex collisions of each rock, a line each, named by the rock's id."""
    poses = np.hstack([rocks.position, rpy_from_quaternion(rocks.quaternion)]).tolist()
    touch = "".join(surface(friction))
    looks, kinds = _looks(world, model), _kinds(rocks, close)
    lines: Lines = []
    for row, pose in enumerate(poses):
        name, place = f"{rock_name(rocks.id[row])}_", f"<pose>{numbers(pose)}</pose>"
        felt = touch if rocks.collides[row] else ""
        shape = _shape_file(*kinds[row])
        lines += _parts(world, rocks, row, model, looks, felt, shape, name=name, place=place)
    return lines


def dynamic_rocks(world: World, model: Model, *, close: Container[int]) -> list[Lines]:
    """A model `rock_<id>` for each dynamic rock, which gravity holds and a rover can push.

    They share meshes and textures with the static rocks, whose model this is.
    """
    field = world.field.select(world.field.dynamic)
    poses = np.hstack([field.position, rpy_from_quaternion(field.quaternion)])
    looks, tensors = _looks(world, model), inertias(field, world.library)
    kinds, models = _kinds(field, close), []
    for row, rock in enumerate(field.id.tolist()):
        contact = dynamic_contact(float(field.diameter[row]))  # as it was settled
        # SDF's torsional friction is 3π/16 patch radius · coefficient · normal force.
        radius = 16.0 * contact.torsional / (3.0 * math.pi * contact.sliding)
        touch = "".join(surface(contact.sliding, patch_radius=radius))
        parts = _parts(world, field, row, model, looks, touch, _shape_file(*kinds[row]))
        mass = "".join(inertial(float(field.mass[row]), tensors[row]))
        link = element("link", [mass], parts, name="rock")
        pose = element("pose", poses[row])
        models.append(element("model", pose, link, name=rock_name(rock)))
    return models


def _parts(
    world: World,
    rocks: RockField,
    row: int,
    model: Model,
    looks: list[list[str]],
    touch: str,
    shape: str,
    *,
    name: str = "",
    place: str = "",
) -> Lines:
    """The visual of a rock by its shape's file and, with a touch, collisions of its hulls."""
    prototype, size = int(rocks.prototype[row]), f"{rocks.scale[row]:.9g}"
    tint = int(rock_tints(rocks.id[row : row + 1], world.site.seed)[0])

    def geometry(file: str) -> str:
        mesh = f"<uri>{model.uri(file)}</uri><scale>{size} {size} {size}</scale>"
        return f"{place}<geometry><mesh>{mesh}</mesh></geometry>"

    look = f"{geometry(shape)}{looks[rocks.population[row]][tint]}"
    hulls = world.library.prototypes[prototype].hulls if touch else ()
    return [f'<visual name="{name}visual">{look}</visual>'] + [
        f'<collision name="{name}collision_{part}">{geometry(_hull_file(prototype, part))}{touch}'
        "</collision>"
        for part in range(len(hulls))
    ]


def _looks(world: World, model: Model) -> list[list[str]]:
    """The materials of each population's single rocks by their tints, as text."""
    has_maps = model.relief and rock_maps(world) is not None
    maps = {"normals": _NORMALS, "roughness": _ROUGHNESS} if has_maps else {}
    return [
        [
            "".join(model.textured(_texture_file(number), factor=factor, **maps))
            for factor in rock_factors(world, number).tolist()
        ]
        for number in range(len(world.field.populations))
    ]


def _shape_file(prototype: int, upright: bool, close: bool) -> str:
    """File of a prototype's textured shape or close mesh, with dust on its top or bare."""
    detail, dust = "_close" if close else "", "" if upright else "_turned"
    return f"meshes/shape_{prototype:03}{detail}{dust}.obj"


def _hull_file(prototype: int, part: int) -> str:
    """File of a prototype's convex part."""
    return f"meshes/shape_{prototype:03}_hull_{part}.stl"


def _texture_file(population: int) -> str:
    """File of a population's texture, in its folder."""
    return f"rock_{population}.png"
