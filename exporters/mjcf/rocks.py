"""Rocks as MuJoCo steps them fastest: static ones as geoms right in the world body.

Dynamic ones are free bodies, which touch the ground as they did when they were settled.
A rock that is large enough to look at, or dynamic, is drawn by its textured shape, and its convex
hulls are hidden; others are drawn by their hulls.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import portable
from terrain_forge.geometry import inertias, lie_upright, write_rock_shape
from terrain_forge.model import RockField, RockLibrary, RockPrototype, World
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import rock_tints
from terrain_forge.writers import Lines, element, numbers, rock_name, write_stl

from .options import Options

_LEVEL = 1
"""Level of detail that is drawn; MuJoCo holds a copy for each size."""
SCALE_ERROR = 0.01
"""Largest relative change of a rock's size by sharing meshes."""
_STEP = 2 * math.log1p(SCALE_ERROR)
_PLACE = ' pos="%.9g %.9g %.9g" quat="%.9g %.9g %.9g %.9g"'


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
    hulls, shapes = set[tuple[int, str]](), set[tuple[str, str]]()
    for field in fields:
        own_shape = has_own_shape(field, options)
        touched = field.select(field.collides | ~own_shape)
        drawn = field.select(own_shape)
        hulls.update(
            zip(touched.prototype.tolist(), _sizes(touched, options, of_hulls=True), strict=True)
        )
        shapes.update(zip(_shapes(drawn), _sizes(drawn, options), strict=True))

    def ordered(pairs: set[tuple[Any, str]]) -> list[tuple[Any, str]]:
        return sorted(pairs, key=lambda pair: (pair[0], float(pair[1])))

    parts = [len(prototype.hulls) for prototype in library.prototypes]
    meshes = [(f"hull_{p}_{h}", "stl", s) for p, s in ordered(hulls) for h in range(parts[p])]
    meshes += [(shape, "obj", s) for shape, s in ordered(shapes)]
    return [
        f'<mesh name="{name}_{s}" file="assets/{name}.{kind}" scale="{s} {s} {s}"/>'
        for name, kind, s in meshes
    ]


def fixed_rocks(world: World, field: RockField, options: Options) -> Iterator[str]:
    """The geoms of the rocks that are not dynamic, named as `docs/exporters/mjcf.md` says."""
    library, field = world.library, field.select(~field.dynamic)
    rows = zip(
        map(rock_name, field.id.tolist()),
        _looks(world, field),
        field.prototype.tolist(),
        _shapes(field),
        _sizes(field, options, of_hulls=True),
        has_own_shape(field, options).tolist(),
        field.collides.tolist(),
        np.hstack([field.position, field.quaternion]).tolist(),
        strict=True,
    )
    for name, look, prototype, shape, size, own_shape, solid, pose in rows:
        place = _PLACE % tuple(pose)
        if own_shape:
            yield _geom(f"{name}_shape", f"shape_{look}", f"{shape}_{size}", place)
        if solid or not own_shape:
            kind = "hull" if own_shape else f"rock_{look}" if solid else f"seen_{look}"
            yield from _hull_geoms(library, prototype, name, kind, size, place)


def dynamic_rocks(world: World, field: RockField, options: Options) -> Iterator[Lines]:
    """A body `rock_<id>` for each dynamic rock, with its shape and its hulls."""
    library, field = world.library, field.select(field.dynamic)
    # MuJoCo wants xx yy zz xy xz yz.
    six = inertias(field, library)[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    hull_sizes, shape_sizes = _sizes(field, options, of_hulls=True), _sizes(field, options)
    kinds = zip(hull_sizes, _shapes(field), shape_sizes, _looks(world, field), strict=True)
    for row, (hull_size, shape, shape_size, look) in enumerate(kinds):
        name, prototype = rock_name(field.id[row]), int(field.prototype[row])
        touch = f' friction="{numbers(dynamic_contact(float(field.diameter[row])).friction)}"'
        yield element(
            "body",
            element("freejoint", name=name),
            element("inertial", pos=np.zeros(3), mass=field.mass[row], fullinertia=six[row]),
            [_geom(f"{name}_shape", f"shape_{look}", f"{shape}_{shape_size}")],
            [*_hull_geoms(library, prototype, name, "dynamic", hull_size, touch)],
            name=name,
            pos=field.position[row],
            quat=field.quaternion[row],
        )


def _looks(world: World, field: RockField) -> list[str]:
    """Population and tint of each rock, as classes have them in their names."""
    tints = rock_tints(field.id, world.site.seed).tolist()
    kinds = zip(field.population.tolist(), tints, strict=True)
    return [f"{population}_{tint}" for population, tint in kinds]


def _hull_geoms(
    library: RockLibrary, prototype: int, name: str, kind: str, size: str, more: str
) -> Iterator[str]:
    """The geoms of a rock's convex parts."""
    for part in range(len(library.prototypes[prototype].hulls)):
        own = f"{name}_{part}" if part else name
        yield _geom(own, kind, f"hull_{prototype}_{part}_{size}", more)


def _geom(name: str, kind: str, mesh: str, more: str = "") -> str:
    """A mesh geom of a default class."""
    return f'<geom name="{name}" class="{kind}" mesh="{mesh}"{more}/>'


def drawn_level(shape: RockPrototype) -> int:
    """The level of detail by which a shape is drawn."""
    return min(_LEVEL, len(shape.meshes) - 1)


def _shapes(field: RockField) -> list[str]:
    """The textured shape of each rock: with dust on its top, or bare where it lies otherwise."""
    kinds = zip(field.prototype.tolist(), lie_upright(field).tolist(), strict=True)
    return [f"shape_{prototype}{'' if upright else '_turned'}" for prototype, upright in kinds]


def write_meshes(library: RockLibrary, drawn: RockField, directory: Path) -> list[str]:
    """Write the convex parts of all prototypes and the shapes of some rocks; returns files."""
    files = []
    for prototype, shape in enumerate(library.prototypes):
        for part, hull in enumerate(shape.hulls):
            files.append(f"assets/hull_{prototype}_{part}.stl")
            write_stl(directory / files[-1], vertices=hull.vertices, faces=hull.faces)
    kinds = zip(_shapes(drawn), drawn.prototype.tolist(), lie_upright(drawn).tolist(), strict=True)
    for name, prototype, upright in sorted({*kinds}):
        shape = library.prototypes[prototype]
        files.append(f"assets/{name}.obj")
        write_rock_shape(directory / files[-1], shape, drawn_level(shape), upright=upright)
    return files
