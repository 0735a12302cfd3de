"""The rocks of a tile: instanced for pictures, and colliders apart from them.

Importers of physics ignore what a PointInstancer holds, so the large rocks are instanceable
references to their hulls, and the small ones one static mesh; neither is seen in pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from terrain_forge.frames import xyzw
from terrain_forge.mesh import Mesh
from terrain_forge.rock_mesh import merge_rocks
from terrain_forge.world import RockField, World

from . import library
from .layer import add_reference, define_mesh, gf_quaternion, label, make_collider, new_stage
from .material import bind, define_plain, linear_from_srgb
from .options import Options

_LIBRARY = f"./{library.FILE}"


def write_rocks(
    tile: World, whole: World, assets: Path, *, name: str, coarse: list[Mesh], options: Options
) -> None:
    """Write `assets`/NAME.usdc for one tile of the world.

    Args:
        tile: The tile; its own rocks are written.
        whole: The world that it is part of.
        assets: The folder.
        name: Name of the file and of its root prim.
        coarse: The mesh that stands for each prototype among the merged colliders.
        options: The export's options.
    """
    stage = new_stage(assets / f"{name}.usdc", name, kind=Kind.Tokens.component)
    field = tile.field
    large = field.diameter >= options.collider_min_m
    for population in np.unique(field.population).tolist():
        rocks = field.population == population
        # The finest level of detail where the camera may come close enough to tell.
        detail = np.where(large[rocks], 0, 1)
        path = f"/{name}/visual_{population}"
        _define_instancer(stage, path, field.select(rocks), whole, detail)
        rgb = linear_from_srgb(whole.appearance.rock_rgb[population] / 255)
        look = define_plain(stage, f"/{name}/Looks/rock_{population}", rgb, options.friction)
        bind(stage.GetPrimAtPath(path), look)
    colliders = UsdGeom.Xform.Define(stage, f"/{name}/colliders")
    colliders.CreatePurposeAttr(UsdGeom.Tokens.guide)
    if len(field):
        bind(colliders.GetPrim(), look)
    _define_merged(stage, f"/{name}/colliders/small", field.select(~large), whole, coarse)
    layer = stage.GetRootLayer()
    del stage
    _specify_hulls(layer, f"/{name}/colliders", field.select(large))
    layer.Save()


def _define_instancer(
    stage: Usd.Stage, path: str, rocks: RockField, whole: World, detail: np.ndarray
) -> None:
    shapes = whole.library.prototypes
    level = np.minimum(detail, [len(shapes[n].meshes) - 1 for n in rocks.prototype.tolist()])
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


def _define_prototypes(stage: Usd.Stage, path: str, pairs: np.ndarray) -> list[Sdf.Path]:
    targets = []
    for prototype, level in pairs.tolist():
        source = library.visual_path(prototype, level)
        prim = stage.DefinePrim(f"{path}/Prototypes/{source.rsplit('/', 1)[1]}", "Xform")
        prim.GetReferences().AddReference(_LIBRARY, source)
        targets.append(prim.GetPath())
    return targets


def _define_merged(
    stage: Usd.Stage, path: str, rocks: RockField, whole: World, coarse: list[Mesh]
) -> None:
    if not len(rocks):
        return
    vertices, faces = merge_rocks(rocks, coarse, whole.ground)
    mesh = define_mesh(stage, path, vertices, faces)
    make_collider(mesh, UsdPhysics.Tokens.none)


def _specify_hulls(layer: Sdf.Layer, path: str, rocks: RockField) -> None:
    """An instanceable reference per rock, as specs of a layer that no stage is open on.

    Composing each of them while it is written would take ten times as long.
    """
    parent = layer.GetPrimAtPath(path)
    order = Vt.TokenArray(["xformOp:translate", "xformOp:orient", "xformOp:scale"])
    columns = (rocks.id, rocks.prototype, rocks.position, rocks.quaternion, rocks.scale)
    with Sdf.ChangeBlock():
        for identity, prototype, position, quaternion, scale in zip(*columns, strict=True):
            rock = Sdf.PrimSpec(parent, f"rock_{identity}", Sdf.SpecifierDef, "Xform")
            rock.instanceable = True
            add_reference(rock, _LIBRARY, library.hull_path(prototype))
            values = (
                ("translate", Sdf.ValueTypeNames.Double3, Gf.Vec3d(*position.tolist())),
                ("orient", Sdf.ValueTypeNames.Quatf, gf_quaternion(quaternion)),
                ("scale", Sdf.ValueTypeNames.Float3, Gf.Vec3f(float(scale))),
            )
            for operation, kind, value in values:
                Sdf.AttributeSpec(rock, f"xformOp:{operation}", kind).default = value
            ops = Sdf.AttributeSpec(
                rock, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
            )
            ops.default = order
