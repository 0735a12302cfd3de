"""The rocks of the 3-D view: the largest ones, as instances of their shapes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import linear_from_srgb, xyzw
from terrain_forge.geometry import lie_upright, rock_texture, surface
from terrain_forge.model import RockField, World
from terrain_forge.report.blocks import jpeg
from terrain_forge.report.model.ground import Relief
from terrain_forge.writers import Gltf

INSTANCING = "EXT_mesh_gpu_instancing"
MOST = 5000
"""Rocks that the view shows as bodies; the picture of the ground shows all."""

_FINEST, _FINE = 16, 400


def shown_rocks(field: RockField) -> RockField:
    """The largest rocks, the largest first."""
    return field.select(np.argsort(-field.diameter, kind="stable")[:MOST])


def rock_nodes(world: World, relief: Relief, gltf: Gltf) -> Iterator[dict[str, Any]]:
    """Add the shown rocks; yields a node for each shape, level of detail and population.

    Rocks rise and sink with the coarser ground beneath them.
    """
    rocks = shown_rocks(world.field)
    plan = rocks.position[:, :2]
    lift = relief.height_at(plan) - world.ground.height_at(plan[:, 0], plan[:, 1])
    position = rocks.position + lift[:, None] * (0.0, 0.0, 1.0)
    prototypes = world.library.prototypes

    @cache
    def shape(kind: int, level: int, upright: int) -> dict[str, Any]:
        return gltf.add_surface(surface(prototypes[kind], level, upright=bool(upright)))

    names = world.field.populations
    look = cache(lambda n: add_painted(gltf, names[n], jpeg(rock_texture(world, n)), tiles=True))
    shapes = rocks.prototype, _levels(world, rocks), lie_upright(rocks)
    kinds = np.stack([*shapes, rocks.population], axis=-1)
    for *kind, population in np.unique(kinds, axis=0).tolist():
        rows = np.all(kinds == (*kind, population), axis=1)
        primitive = {**shape(*kind), "material": look(population)}
        size = np.repeat(rocks.scale[rows, None], 3, axis=1)
        places = {
            "TRANSLATION": gltf.add_samples(position[rows].astype(np.float32)),
            "ROTATION": gltf.add_samples(xyzw(rocks.quaternion[rows]).astype(np.float32)),
            "SCALE": gltf.add_samples(size.astype(np.float32)),
        }
        mesh = gltf.add("meshes", {"primitives": [primitive]})
        yield {"mesh": mesh, "extensions": {INSTANCING: {"attributes": places}}}


def _levels(world: World, rocks: RockField) -> NDArray[np.int64]:
    """Level of detail of each rock, the largest first."""
    wanted = np.full(len(rocks), 2)
    wanted[:_FINE], wanted[:_FINEST] = 1, 0
    coarsest = np.array([len(shape.meshes) - 1 for shape in world.library.prototypes])
    return np.asarray(np.minimum(wanted, coarsest[rocks.prototype]))


def add_painted(gltf: Gltf, name: str, image: bytes, *, tiles: bool, **more: Any) -> int:
    """Add a material that a JPEG covers."""
    texture = gltf.add_texture(image, tiles=tiles, media_type="image/jpeg")
    look = {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    return gltf.add("materials", {"name": name, "pbrMetallicRoughness": look, **more})


def picture_gain(picture: NDArray[np.uint8], world: World) -> float:
    """How much brighter the picture of the ground is than its colours, in linear light."""
    shown = linear_from_srgb(picture[::8, ::8] / 255.0).mean()
    own = linear_from_srgb(world.appearance.ground_rgb[::8, ::8] / 255.0).mean()
    return float(shown / max(own, 1e-6))
