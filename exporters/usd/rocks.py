"""The rocks of a tile: static ones instanced for pictures, their colliders apart; dynamic bodies.

Importers of physics ignore what a PointInstancer holds, so the large static rocks are instanceable
references to their hulls, and the small ones one static mesh; neither is seen in pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt
from terrain_forge.exporters.usd import library

from terrain_forge.base import Array, xyzw
from terrain_forge.geometry import grouped, inertias, merge_in_parts, principal_axes, rock_texture
from terrain_forge.model import Mesh, RockField, RockLibrary, Tile, World, world_friction
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import rock_name, write_png

from .layer import (
    apply_schemas,
    define_mesh,
    gf_quaternion,
    label,
    make_collider,
    new_stage,
    specify,
    specify_place,
)
from .library import specify_instance
from .material import bind, bind_friction, define_friction, define_textured
from .options import Options


def write_rocks(
    tile: Tile, assets: Path, *, coarse: list[Mesh], levels: NDArray[np.int64], options: Options
) -> None:
    """Write `assets`/rocks_NNN.usdc for one tile of the world.

    Small rocks are drawn by the level of detail of `levels` for their prototype; among the merged
    colliders a mesh of `coarse` stands for each.
    """
    name, whole, field = tile.name("rocks"), tile.whole, tile.field
    stage = new_stage(assets / f"{name}.usdc", name)
    friction = world_friction(whole.site.body, options)
    looks = {
        n: define_textured(
            stage, f"/{name}/Looks/rock_{n}", f"./{_texture_file(n)}", friction.rock, wrap="repeat"
        )
        for n in np.unique(field.population).tolist()
    }
    fixed, dynamic = field.select(~field.dynamic), field.select(field.dynamic)
    for population, rocks in grouped(fixed):
        # The finest level of detail where the camera may come close enough to tell.
        level = np.where(rocks.diameter >= options.collider_min_m, 0, levels[rocks.prototype])
        path = f"/{name}/visual_{population}"
        _define_instancer(stage, path, rocks, whole, level)
        bind(stage.GetPrimAtPath(path), looks[population])
    colliders = UsdGeom.Xform.Define(stage, f"/{name}/colliders")
    colliders.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if looks:
        bind(colliders.GetPrim(), next(iter(looks.values())))  # all have the same friction
    solid = fixed.select(fixed.collides)
    large = solid.diameter >= options.collider_min_m
    parts = merge_in_parts(solid.select(~large), coarse, whole.ground)
    for number, (vertices, faces) in enumerate(parts):
        path = f"/{name}/colliders/small{f'_{number}' if number else ''}"
        make_collider(define_mesh(stage, path, vertices, faces), UsdPhysics.Tokens.none)
    _define_dynamic_groups(stage, f"/{name}", dynamic, looks)
    layer = stage.GetRootLayer()
    del stage
    # Composing each rock while it is written would take ten times as long.
    _specify_hulls(layer, f"/{name}/colliders", solid.select(large))
    _specify_dynamic(layer, f"/{name}", dynamic, whole.library)
    layer.Save()


def write_textures(world: World, assets: Path) -> None:
    """Write the textures of all populations into `assets`."""
    for population in np.unique(world.field.population).tolist():
        write_png(assets / _texture_file(population), rock_texture(world, population))


def _texture_file(population: int) -> str:
    return f"rock_{population}.png"


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


def _specify_hulls(layer: Sdf.Layer, path: str, rocks: RockField) -> None:
    """An instanceable reference to the hulls of each rock."""
    parent = layer.GetPrimAtPath(path)
    columns = (rocks.id, rocks.prototype, rocks.position, rocks.quaternion, rocks.scale)
    with Sdf.ChangeBlock():
        for identity, prototype, position, quaternion, scale in zip(*columns, strict=True):
            rock = specify_instance(parent, rock_name(identity), library.hull_path(prototype))
            specify_place(rock, position=position, quaternion=quaternion, scale=float(scale))


def _define_dynamic_groups(
    stage: Usd.Stage, root: str, rocks: RockField, looks: dict[int, UsdShade.Material]
) -> None:
    """A group `dynamic_<population>` for each population's dynamic rocks, with its materials."""
    if not len(rocks):
        return
    sliding = dynamic_contact(float(rocks.diameter[0])).sliding  # the same for all sizes
    friction = define_friction(stage, f"{root}/Looks/dynamic", sliding)
    for population in np.unique(rocks.population).tolist():
        group = UsdGeom.Xform.Define(stage, _group(root, population)).GetPrim()
        label(group, "rock")
        bind(group, looks[population])
        bind_friction(group, friction)


def _specify_dynamic(layer: Sdf.Layer, root: str, rocks: RockField, shapes: RockLibrary) -> None:
    """A body `rock_<id>` for each dynamic rock, in the groups of `_define_dynamic_groups`.

    The body itself is not scaled, so that its mass properties are in metres and kilograms.
    """
    if not len(rocks):
        return
    moments, axes = principal_axes(inertias(rocks, shapes))
    with Sdf.ChangeBlock():
        for row in range(len(rocks)):
            parent = layer.GetPrimAtPath(_group(root, int(rocks.population[row])))
            body = Sdf.PrimSpec(parent, rock_name(rocks.id[row]), Sdf.SpecifierDef, "Xform")
            specify_place(body, position=rocks.position[row], quaternion=rocks.quaternion[row])
            apply_schemas(body, "PhysicsRigidBodyAPI", "PhysicsMassAPI")
            _specify_mass(body, float(rocks.mass[row]), moments[row], axes[row])
            scale, prototype = float(rocks.scale[row]), int(rocks.prototype[row])
            visual = specify_instance(body, "visual", library.visual_path(prototype, 0))
            specify_place(visual, scale=scale)
            hulls = specify_instance(body, "hulls", library.hull_path(prototype))
            specify_place(hulls, scale=scale)
            token = Sdf.ValueTypeNames.Token
            specify(hulls, "purpose", token, UsdGeom.Tokens.guide, Sdf.VariabilityUniform)


def _specify_mass(body: Sdf.PrimSpec, mass: float, moments: Array, axes: Array) -> None:
    specify(body, "physics:mass", Sdf.ValueTypeNames.Float, mass)
    specify(body, "physics:centerOfMass", Sdf.ValueTypeNames.Point3f, Gf.Vec3f(0.0))
    diagonal = Gf.Vec3f(*moments.tolist())
    specify(body, "physics:diagonalInertia", Sdf.ValueTypeNames.Float3, diagonal)
    specify(body, "physics:principalAxes", Sdf.ValueTypeNames.Quatf, gf_quaternion(axes))


def _group(root: str, population: int) -> str:
    return f"{root}/dynamic_{population}"
