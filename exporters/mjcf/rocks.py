"""Static rocks as geoms right in the world body, where MuJoCo steps them fastest, and their meshes.

A rock that is large enough to look at, or dynamic, is drawn by its textured shape, and its convex
hulls are hidden; others are drawn by their hulls.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from terrain_forge.model import RockField, RockLibrary

from .options import Options

SCALE_ERROR = 0.01
"""Largest relative change of a rock's size by sharing meshes."""
_STEP = 2 * math.log1p(SCALE_ERROR)


def shared_scale(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes rounded to a geometric ladder, so that rocks of like size can share a mesh asset."""
    return np.asarray(np.exp(np.round(np.log(scale) / _STEP) * _STEP))


def shape_sizes(field: RockField, options: Options) -> list[str]:
    """Sizes of the meshes that rocks are drawn by."""
    return _texts(field.scale if options.exact_scale else shared_scale(field.scale))


def hull_sizes(field: RockField, options: Options) -> list[str]:
    """Sizes of the rocks' hulls; dynamic rocks keep theirs, with which they were settled."""
    exact = field.dynamic | options.exact_scale
    return _texts(np.where(exact, field.scale, shared_scale(field.scale)))


def _texts(scale: NDArray[np.float64]) -> list[str]:
    return [f"{s:.9g}" for s in scale.tolist()]


def has_own_shape(field: RockField, options: Options) -> NDArray[np.bool_]:
    """Which rocks are drawn by their shapes rather than by their hulls."""
    large: NDArray[np.bool_] = field.diameter >= options.visual_min_m
    return large | field.dynamic


def mesh_assets(library: RockLibrary, fields: Iterable[RockField], options: Options) -> list[str]:
    """A mesh asset for each shape and hull in each size that occurs."""
    hulls, shapes = set[tuple[int, str]](), set[tuple[int, str]]()
    for field in fields:
        own_shape = has_own_shape(field, options)
        touched = field.select(field.collides | ~own_shape)
        drawn = field.select(own_shape)
        hulls.update(zip(touched.prototype.tolist(), hull_sizes(touched, options), strict=True))
        shapes.update(zip(drawn.prototype.tolist(), shape_sizes(drawn, options), strict=True))
    parts = [
        f'<mesh name="{hull_mesh(p, h, s)}" file="{hull_file(p, h)}" scale="{s} {s} {s}"/>'
        for p, s in _in_order(hulls)
        for h in range(len(library.prototypes[p].hulls))
    ]
    return parts + [
        f'<mesh name="{shape_mesh(p, s)}" file="{shape_file(p)}" scale="{s} {s} {s}"/>'
        for p, s in _in_order(shapes)
    ]


def fixed_rocks(library: RockLibrary, field: RockField, options: Options) -> Iterator[str]:
    """The geoms of the rocks that are not dynamic, named as `docs/exporters/mjcf.md` says."""
    parts = [len(prototype.hulls) for prototype in library.prototypes]
    field = field.select(~field.dynamic)
    rows = zip(
        field.id.tolist(),
        field.population.tolist(),
        field.prototype.tolist(),
        hull_sizes(field, options),
        has_own_shape(field, options).tolist(),
        field.collides.tolist(),
        np.hstack([field.position, field.quaternion]).tolist(),
        strict=True,
    )
    for rock, population, prototype, size, own_shape, solid, pose in rows:
        place = _PLACE % tuple(pose)
        if own_shape:
            yield geom(
                f"rock_{rock}_shape", f"shape_{population}", shape_mesh(prototype, size), place
            )
        if solid or not own_shape:
            kind = "hull" if own_shape else f"rock_{population}" if solid else f"seen_{population}"
            for h in range(parts[prototype]):
                yield geom(hull_name(rock, h), kind, hull_mesh(prototype, h, size), place)


def geom(name: str, kind: str, mesh: str, more: str = "") -> str:
    """A mesh geom of a default class."""
    return f'<geom name="{name}" class="{kind}" mesh="{mesh}"{more}/>'


_PLACE = ' pos="%.9g %.9g %.9g" quat="%.9g %.9g %.9g %.9g"'


def hull_name(rock: int, part: int) -> str:
    """Name of the geom of a rock's convex part."""
    return f"rock_{rock}_{part}" if part else f"rock_{rock}"


def hull_mesh(prototype: int, part: int, size: str) -> str:
    """Name of the mesh asset of a prototype's convex part in a size."""
    return f"hull_{prototype}_{part}_{size}"


def shape_mesh(prototype: int, size: str) -> str:
    """Name of the mesh asset of a prototype's shape in a size."""
    return f"shape_{prototype}_{size}"


def hull_file(prototype: int, part: int) -> str:
    """File of a prototype's convex part."""
    return f"assets/hull_{prototype}_{part}.stl"


def shape_file(prototype: int) -> str:
    """File of a prototype's textured shape."""
    return f"assets/shape_{prototype}.obj"


def _in_order(pairs: Iterable[tuple[int, str]]) -> list[tuple[int, str]]:
    return sorted(pairs, key=lambda pair: (pair[0], float(pair[1])))
