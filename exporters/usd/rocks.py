"""The rocks of a tile: static ones instanced for pictures, their colliders apart; dynamic bodies.

Importers of physics ignore what a PointInstancer holds, so the large static rocks are instanceable
references to their hulls, and the small ones one static mesh; neither is seen in pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt
from terrain_forge.exporters.usd import library

from terrain_forge.base import xyzw
from terrain_forge.geometry import merge_in_parts, rock_texture
from terrain_forge.model import Mesh, RockField, World, world_friction
from terrain_forge.writers import write_png

from .dynamic import define_dynamic_groups, specify_dynamic
from .layer import define_mesh, label, make_collider, new_stage
from .library import specify_instance
from .material import bind, define_textured
from .options import Options
from .specs import specify_place


def write_rocks(
    tile: World,
    whole: World,
    assets: Path,
    *,
    name: str,
    coarse: list[Mesh],
    levels: NDArray[np.int64],
    options: Options,
) -> None:
    """Write `assets`/NAME.usdc for one tile of the world.

    Args:
        tile: The tile; its own rocks are written.
        whole: The world that it is part of.
        assets: The folder.
        name: Name of the file and of its root prim.
        coarse: The mesh that stands for each prototype among the merged colliders.
        levels: Level of detail by which each prototype is drawn where rocks are small.
        options: The export's options.
    """
    stage = new_stage(assets / f"{name}.usdc", name, kind=Kind.Tokens.component)
    grip = world_friction(whole.site.body, options)
    looks = _define_materials(stage, name, tile.field, grip.rock)
    fixed, dynamic = (
        tile.field.select(tile.field.dynamic == is_dynamic) for is_dynamic in (False, True)
    )
    _define_visuals(stage, name, fixed, whole, looks, levels=levels, options=options)
    colliders = UsdGeom.Xform.Define(stage, f"/{name}/colliders")
    colliders.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if looks:
        bind(colliders.GetPrim(), next(iter(looks.values())))  # all have the same friction
    solid = fixed.select(fixed.collides)
    large = solid.diameter >= options.collider_min_m
    _define_merged(stage, f"/{name}/colliders/small", solid.select(~large), whole, coarse)
    define_dynamic_groups(stage, f"/{name}", dynamic, looks)
    layer = stage.GetRootLayer()
    del stage
    # Composing each rock while it is written would take ten times as long.
    _specify_hulls(layer, f"/{name}/colliders", solid.select(large))
    specify_dynamic(layer, f"/{name}", dynamic, whole.library)
    layer.Save()


def write_textures(world: World, assets: Path) -> None:
    """Write the textures of all populations into `assets`."""
    for population in np.unique(world.field.population).tolist():
        write_png(assets / _texture_file(population), rock_texture(world, population))


def _texture_file(population: int) -> str:
    return f"rock_{population}.png"


def _define_materials(
    stage: Usd.Stage, name: str, field: RockField, friction: float
) -> dict[int, UsdShade.Material]:
    """The material of each population that occurs."""
    return {
        n: define_textured(
            stage,
            f"/{name}/Looks/rock_{n}",
            f"./{_texture_file(n)}",
            friction,
            wrap="repeat",
        )
        for n in np.unique(field.population).tolist()
    }


def _define_visuals(
    stage: Usd.Stage,
    name: str,
    fixed: RockField,
    whole: World,
    looks: dict[int, UsdShade.Material],
    *,
    levels: NDArray[np.int64],
    options: Options,
) -> None:
    for population in np.unique(fixed.population).tolist():
        rocks = fixed.select(fixed.population == population)
        # The finest level of detail where the camera may come close enough to tell.
        level = np.where(rocks.diameter >= options.collider_min_m, 0, levels[rocks.prototype])
        path = f"/{name}/visual_{population}"
        _define_instancer(stage, path, rocks, whole, level)
        bind(stage.GetPrimAtPath(path), looks[population])


def _define_instancer(
    stage: Usd.Stage, path: str, rocks: RockField, whole: World, level: NDArray[np.int64]
) -> None:
    shapes = whole.library.prototypes
    pairs, index = np.unique(
        np.stack([rocks.prototype, level], axis=-1), axis=0, return_inverse=True
    )
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    label(instancer.GetPrim(), "rock")
    instancer.CreatePrototypesRel().SetTargets(_define_prototypes(stage, path, pairs))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(index.reshape(-1).astype(np.int32)))
    instancer.CreateIdsAttr(Vt.Int64Array.FromNumpy(rocks.id.astype(np.int64)))
    positions = rocks.position.astype(np.float32)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    halves = np.ascontiguousarray(xyzw(rocks.quaternion), dtype=np.float16)
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(halves))
    scales = np.repeat(rocks.scale.astype(np.float32)[:, None], 3, axis=1)
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales))
    radii = np.array([np.linalg.norm(s.meshes[0].vertices, axis=1).max() for s in shapes])
    reach = (rocks.scale * radii[rocks.prototype])[:, None]
    box = np.stack([(positions - reach).min(axis=0), (positions + reach).max(axis=0)])
    instancer.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(box.astype(np.float32)))


def _define_prototypes(stage: Usd.Stage, path: str, pairs: NDArray[np.int64]) -> list[Sdf.Path]:
    targets = []
    for prototype, level in pairs.tolist():
        source = library.visual_path(prototype, level)
        prim = stage.DefinePrim(f"{path}/Prototypes/{source.rsplit('/', 1)[1]}", "Xform")
        prim.GetReferences().AddReference(library.LAYER, source)
        targets.append(prim.GetPath())
    return targets


def _define_merged(
    stage: Usd.Stage, path: str, rocks: RockField, whole: World, coarse: list[Mesh]
) -> None:
    for number, (vertices, faces) in enumerate(merge_in_parts(rocks, coarse, whole.ground)):
        mesh = define_mesh(stage, f"{path}_{number}" if number else path, vertices, faces)
        make_collider(mesh, UsdPhysics.Tokens.none)


def _specify_hulls(layer: Sdf.Layer, path: str, rocks: RockField) -> None:
    """An instanceable reference to the hulls of each rock."""
    parent = layer.GetPrimAtPath(path)
    columns = (rocks.id, rocks.prototype, rocks.position, rocks.quaternion, rocks.scale)
    with Sdf.ChangeBlock():
        for identity, prototype, position, quaternion, scale in zip(*columns, strict=True):
            rock = specify_instance(parent, f"rock_{identity}", library.hull_path(prototype))
            specify_place(rock, position=position, quaternion=quaternion, scale=float(scale))
