"""Rocks as static mesh geoms right in the world body, where MuJoCo steps them fastest."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from terrain_forge.mesh import Mesh
from terrain_forge.world import RockField, RockLibrary, World

from .xml import element

SCALE_ERROR = 0.01
"""Largest relative change of a rock's size by sharing meshes."""
_STEP = 2 * math.log1p(SCALE_ERROR)


def shared_scale(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sizes rounded to a geometric ladder, so that rocks of like size can share a mesh asset."""
    return np.asarray(np.exp(np.round(np.log(scale) / _STEP) * _STEP))


def rock_materials(world: World) -> list[str]:
    """A material and a default class per population."""
    colours = world.appearance.rock_rgb / 255.0
    return [
        element("material", name=f"rock_{n}", rgba=(*rgb, 1.0), specular=0.0, shininess=0.0)
        for n, rgb in enumerate(colours)
    ]


def rock_classes(world: World) -> list[str]:
    """A default class per population, so that a rock's line holds only what is its own."""
    return [
        element("default", [element("geom", material=f"rock_{n}")], class_=f"rock_{n}")
        for n in range(len(world.field.populations))
    ]


def mesh_files(library: RockLibrary) -> dict[str, Mesh]:
    """The collision hulls of all prototypes, by the names of their STL files."""
    return {
        _file(p, h): hull
        for p, prototype in enumerate(library.prototypes)
        for h, hull in enumerate(prototype.hulls)
    }


def mesh_assets(
    library: RockLibrary, fields: Iterable[RockField], *, exact_scale: bool
) -> list[str]:
    """A mesh asset for each prototype's hull in each size that occurs."""
    sizes = {
        size
        for field in fields
        for size in zip(*_sizes(field, exact_scale=exact_scale), strict=True)
    }
    return [
        f'<mesh name="{_mesh(p, h, s)}" file="{_file(p, h)}" scale="{s} {s} {s}"/>'
        for p, s in sorted(sizes, key=lambda size: (size[0], float(size[1])))
        for h in range(len(library.prototypes[p].hulls))
    ]


def rock_geoms(library: RockLibrary, field: RockField, *, exact_scale: bool) -> list[str]:
    """A geom for each hull of each rock: `rock_<id>`, further hulls `rock_<id>_<part>`."""
    parts = [len(prototype.hulls) for prototype in library.prototypes]
    prototypes, scales = _sizes(field, exact_scale=exact_scale)
    rows = zip(
        field.id.tolist(),
        field.population.tolist(),
        prototypes,
        scales,
        np.hstack([field.position, field.quaternion]).tolist(),
        strict=True,
    )
    return [
        _GEOM % (_name(rock, h), population, _mesh(prototype, h, scale), *pose)
        for rock, population, prototype, scale, pose in rows
        for h in range(parts[prototype])
    ]


_GEOM = (
    '<geom name="%s" class="rock_%d" mesh="%s" pos="%.9g %.9g %.9g" quat="%.9g %.9g %.9g %.9g"/>'
)


def _sizes(field: RockField, *, exact_scale: bool) -> tuple[list[int], list[str]]:
    scale = field.scale if exact_scale else shared_scale(field.scale)
    return field.prototype.tolist(), [f"{s:.9g}" for s in scale.tolist()]


def _name(rock: int, part: int) -> str:
    return f"rock_{rock}_{part}" if part else f"rock_{rock}"


def _mesh(prototype: int, part: int, scale: str) -> str:
    return f"shape_{prototype}_{part}_{scale}"


def _file(prototype: int, part: int) -> str:
    return f"assets/shape_{prototype}_{part}.stl"
