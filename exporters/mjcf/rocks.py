"""Rocks as MuJoCo steps them fastest: static ones as geoms right in the world body.

Dynamic ones are free bodies, which touch the ground as they did when they were settled.
A rock that is large enough to look at, or dynamic, is drawn by its textured shape, and its convex
hulls are hidden; others are drawn by their hulls.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import portable
from terrain_forge.geometry import inertias, write_rock_shape
from terrain_forge.model import RockField, RockLibrary, RockPrototype
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import Lines, element, numbers, rock_name, write_stl

from .options import Options

_LEVEL = 1
"""Level of detail that is drawn; MuJoCo holds a copy for each size."""
SCALE_ERROR = 0.01
"""Largest relative change of a rock's size by sharing meshes."""
_STEP = 2 * math.log1p(SCALE_ERROR)


def shared_scale(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes rounded to a geometric ladder, so that rocks of like size can share a mesh asset."""
    return np.asarray(portable.exp(np.round(portable.log(scale) / _STEP) * _STEP))


def _sizes(field: RockField, options: Options, *, of_hulls: bool = False) -> list[str]:
    """Sizes of the rocks' shapes or hulls; dynamic rocks keep the hulls that they settled with."""
    exact = np.full(len(field), options.exact_scale) | (field.dynamic & of_hulls)
    sizes = np.where(exact, field.scale, shared_scale(field.scale))
    return [f"{size:.9g}" for size in sizes.tolist()]


def has_own_shape(field: RockField, options: Options) -> NDArray[np.bool_]:
    """Which rocks are drawn by their shapes rather than by their hulls."""
    large: NDArray[np.bool_] = field.diameter >= options.visual_min_m
    return large | field.dynamic


def mesh_assets(library: RockLibrary, fields: Iterable[RockField], options: Options) -> Lines:
    """A mesh asset for each shape and hull in each size that occurs."""
    hulls, shapes = set[tuple[int, str]](), set[tuple[int, str]]()
    for field in fields:
        own_shape = has_own_shape(field, options)
        touched = field.select(field.collides | ~own_shape)
        drawn = field.select(own_shape)
        hulls.update(
            zip(touched.prototype.tolist(), _sizes(touched, options, of_hulls=True), strict=True)
        )
        shapes.update(zip(drawn.prototype.tolist(), _sizes(drawn, options), strict=True))

    def ordered(pairs: set[tuple[int, str]]) -> list[tuple[int, str]]:
        return sorted(pairs, key=lambda pair: (pair[0], float(pair[1])))

    parts = [
        f'<mesh name="{_hull_mesh(p, h, s)}" file="{_hull_file(p, h)}" scale="{s} {s} {s}"/>'
        for p, s in ordered(hulls)
        for h in range(len(library.prototypes[p].hulls))
    ]
    return parts + [
        f'<mesh name="{_shape_mesh(p, s)}" file="{_shape_file(p)}" scale="{s} {s} {s}"/>'
        for p, s in ordered(shapes)
    ]


def fixed_rocks(library: RockLibrary, field: RockField, options: Options) -> Iterator[str]:
    """The geoms of the rocks that are not dynamic, named as `docs/exporters/mjcf.md` says."""
    parts = [len(prototype.hulls) for prototype in library.prototypes]
    field = field.select(~field.dynamic)
    rows = zip(
        field.id.tolist(),
        field.population.tolist(),
        field.prototype.tolist(),
        _sizes(field, options, of_hulls=True),
        has_own_shape(field, options).tolist(),
        field.collides.tolist(),
        np.hstack([field.position, field.quaternion]).tolist(),
        strict=True,
    )
    for rock, population, prototype, size, own_shape, solid, pose in rows:
        place = _PLACE % tuple(pose)
        if own_shape:
            look = f"shape_{population}"
            yield _geom(f"{rock_name(rock)}_shape", look, _shape_mesh(prototype, size), place)
        if solid or not own_shape:
            kind = "hull" if own_shape else f"rock_{population}" if solid else f"seen_{population}"
            for h in range(parts[prototype]):
                yield _geom(_hull_name(rock, h), kind, _hull_mesh(prototype, h, size), place)


def dynamic_rocks(library: RockLibrary, field: RockField, options: Options) -> Iterator[Lines]:
    """A body `rock_<id>` for each dynamic rock, with its shape and its hulls."""
    field = field.select(field.dynamic)
    # MuJoCo wants xx yy zz xy xz yz.
    six = inertias(field, library)[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    sizes = zip(_sizes(field, options, of_hulls=True), _sizes(field, options), strict=True)
    for row, (hull_size, shape_size) in enumerate(sizes):
        rock, prototype = int(field.id[row]), int(field.prototype[row])
        name = rock_name(rock)
        look = f"shape_{field.population[row]}"
        touch = f' friction="{numbers(dynamic_contact(float(field.diameter[row])).friction)}"'
        parts = [
            element("freejoint", name=name),
            element("inertial", pos=np.zeros(3), mass=field.mass[row], fullinertia=six[row]),
            [_geom(f"{name}_shape", look, _shape_mesh(prototype, shape_size))],
        ]
        for part in range(len(library.prototypes[prototype].hulls)):
            mesh = _hull_mesh(prototype, part, hull_size)
            parts.append([_geom(_hull_name(rock, part), "dynamic", mesh, touch)])
        place = {"pos": field.position[row], "quat": field.quaternion[row]}
        yield element("body", *parts, name=name, **place)


def _geom(name: str, kind: str, mesh: str, more: str = "") -> str:
    """A mesh geom of a default class."""
    return f'<geom name="{name}" class="{kind}" mesh="{mesh}"{more}/>'


_PLACE = ' pos="%.9g %.9g %.9g" quat="%.9g %.9g %.9g %.9g"'


def _hull_name(rock: int, part: int) -> str:
    """Name of the geom of a rock's convex part."""
    return f"{rock_name(rock)}_{part}" if part else rock_name(rock)


def _hull_mesh(prototype: int, part: int, size: str) -> str:
    """Name of the mesh asset of a prototype's convex part in a size."""
    return f"hull_{prototype}_{part}_{size}"


def _shape_mesh(prototype: int, size: str) -> str:
    """Name of the mesh asset of a prototype's shape in a size."""
    return f"shape_{prototype}_{size}"


def _hull_file(prototype: int, part: int) -> str:
    """File of a prototype's convex part."""
    return f"assets/hull_{prototype}_{part}.stl"


def _shape_file(prototype: int) -> str:
    """File of a prototype's textured shape."""
    return f"assets/shape_{prototype}.obj"


def drawn_level(shape: RockPrototype) -> int:
    """The level of detail by which a shape is drawn."""
    return min(_LEVEL, len(shape.meshes) - 1)


def write_meshes(library: RockLibrary, shapes: Iterable[int], directory: Path) -> list[str]:
    """Write the convex parts of all prototypes and the textured shapes of some; returns files."""
    files = []
    for prototype, shape in enumerate(library.prototypes):
        for part, hull in enumerate(shape.hulls):
            files.append(_hull_file(prototype, part))
            write_stl(directory / files[-1], vertices=hull.vertices, faces=hull.faces)
    for prototype in shapes:
        shape = library.prototypes[prototype]
        files.append(_shape_file(prototype))
        write_rock_shape(directory / files[-1], shape, drawn_level(shape))
    return files
