"""The rocks of a tile: static ones instanced for pictures, their colliders apart; dynamic bodies.

Their shapes lie once for the whole world in a library. Importers of physics ignore what a
PointInstancer holds, so the large static rocks are instanceable references to their hulls, and the
small ones one static mesh; neither is seen in pictures.
"""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from terrain_forge.base import xyzw
from terrain_forge.geometry import (
    grouped,
    inertias,
    lie_upright,
    merge_in_parts,
    principal_axes,
    rock_factors,
    rock_maps,
    rocks_box,
    skin,
)
from terrain_forge.model import CLOSE, Mesh, RockField, RockLibrary, Tile, World, world_friction
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import rock_tints
from terrain_forge.writers import rock_name, vertex_normals, write_texture

from .layer import (
    define_mesh,
    define_st,
    gf_quaternion,
    label,
    make_collider,
    new_stage,
    save,
    specify,
    specify_place,
)
from .material import (
    add_normal_map,
    add_roughness_map,
    bind,
    bind_friction,
    define_friction,
    define_textured,
)
from .options import Options

_LIBRARY = "rock_library"
NORMALS, ROUGHNESS = "rock_normals.png", "rock_roughness.png"
"""The maps that all rocks' materials share."""


def write_rock_maps(world: World, assets: Path) -> None:
    """Write the maps of normals and roughness that all rocks share, if there are any."""
    for file, image in zip((NORMALS, ROUGHNESS), rock_maps(world) or (), strict=False):
        write_texture(assets / file, image)


def write_library(
    library: RockLibrary, assets: Path, *, close: Container[int], turned: bool
) -> None:
    """Write all levels of detail and convex parts of every shape, in the prototypes' frames.

    The shapes of `close` have their close meshes too. Where rocks are `turned`, each has a second
    prim for those without dust on their tops.
    """
    stage = new_stage(assets / f"{_LIBRARY}.usdc", _LIBRARY)
    for number, shape in enumerate(library.prototypes):
        for level in [*range(len(shape.meshes)), *([CLOSE] if number in close else ())]:
            mesh, uvs = skin(shape, level)
            path = _visual_path(number, level, True)
            UsdGeom.Xform.Define(stage, path)
            visual = define_mesh(stage, f"{path}/shape", mesh.vertices, mesh.faces)
            normals = vertex_normals(mesh.vertices, mesh.faces).astype(np.float32)
            visual.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
            visual.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
            # Per corner of a face, since the texture has seams.
            define_st(visual, uvs.reshape(-1, 2), UsdGeom.Tokens.faceVarying)
            if turned:
                bare = stage.DefinePrim(_visual_path(number, level, False), "Xform")
                bare.GetReferences().AddInternalReference(path)
                visual = UsdGeom.Mesh(stage.OverridePrim(f"{bare.GetPath()}/shape"))
                _, uvs = skin(shape, level, upright=False)
                define_st(visual, uvs.reshape(-1, 2), UsdGeom.Tokens.faceVarying)
        UsdGeom.Xform.Define(stage, _hull_path(number))
        for part, hull in enumerate(shape.hulls):
            path = f"{_hull_path(number)}/part_{part}"
            collider = define_mesh(stage, path, hull.vertices, hull.faces)
            make_collider(collider, UsdPhysics.Tokens.convexHull)
    save(stage)


def _visual_path(prototype: int, level: int, upright: bool) -> str:
    """The library's prim of a shape's level of detail (0: the shape itself) or close mesh."""
    detail, dust = "close" if level == CLOSE else level, "" if upright else "_turned"
    return f"/{_LIBRARY}/shape_{prototype:03}_{detail}{dust}"


def _hull_path(prototype: int) -> str:
    """The library's prim of a shape's convex parts."""
    return f"/{_LIBRARY}/hull_{prototype:03}"


def _specify_instance(parent: Sdf.PrimSpec, name: str, source: str, shared: str) -> Sdf.PrimSpec:
    """The spec of a child prim that is an instance of a prim of the library."""
    child = Sdf.PrimSpec(parent, name, Sdf.SpecifierDef, "Xform")
    child.instanceable = True
    child.referenceList.prependedItems = [Sdf.Reference(f"{shared}/{_LIBRARY}.usdc", source)]
    return child


def write_rocks(
    tile: Tile,
    assets: Path,
    *,
    coarse: list[Mesh],
    levels: NDArray[np.int64],
    close: NDArray[np.int32],
    options: Options,
    name: str = "",
    shared: str = ".",
) -> None:
    """Write `assets`/rocks_NNN.usdc for one tile of the world, or one of another `name`.

    The library and pictures lie in the folder `shared`, as seen from that of the tile.

    Small rocks are drawn by the level of detail of `levels` for their prototype, rocks whose ids
    are in `close` by their close meshes; among the merged colliders a mesh of `coarse` stands for
    each.
    """
    name, whole, field = name or tile.name("rocks"), tile.whole, tile.field
    stage = new_stage(assets / f"{name}.usdc", name)
    friction = world_friction(whole.site.body, options).rock
    tints = rock_tints(field.id, whole.site.seed)
    looks = {
        (n, tint): define_rock_look(
            stage, f"/{name}/Looks/rock_{n}_{tint}", whole, n, tint, friction, shared=shared
        )
        for n, tint in np.unique(np.stack([field.population, tints], -1), axis=0).tolist()
    }
    fixed, dynamic = field.select(~field.dynamic), field.select(field.dynamic)
    for population, tint, rocks in grouped(fixed, rock_tints(fixed.id, whole.site.seed)):
        level = np.where(rocks.diameter >= options.collider_min_m, 0, levels[rocks.prototype])
        level[np.isin(rocks.id, close)] = CLOSE
        path = f"/{name}/visual_{population}_{tint}"
        define_instancer(stage, path, rocks, whole, level, shared=shared)
        bind(stage.GetPrimAtPath(path), looks[population, tint])
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
    drawn = _drawn_shapes(dynamic, close)
    _define_dynamic_groups(stage, f"/{name}", dynamic, whole.site.seed)
    _define_dressed(stage, f"/{name}", dynamic, drawn, whole.site.seed, looks, shared)
    layer = stage.GetRootLayer()
    del stage
    # Composing each rock while it is written would take ten times as long.
    _specify_hulls(layer, f"/{name}/colliders", solid.select(large), shared)
    _specify_dynamic(layer, f"/{name}", dynamic, drawn, whole, shared)
    layer.Save()


def define_rock_look(
    stage: Usd.Stage,
    path: str,
    world: World,
    population: int,
    tint: int,
    friction: float,
    *,
    shared: str,
) -> UsdShade.Material:
    """The material of a population's rocks of one colour."""
    factor = rock_factors(world, population)[tint].tolist()
    image = f"{shared}/rock_{population}.png"
    look = define_textured(stage, path, image, friction, wrap="repeat", factor=factor)
    if world.library.normals is not None:
        add_normal_map(stage, path, f"{shared}/{NORMALS}")
        add_roughness_map(stage, path, f"{shared}/{ROUGHNESS}")
    return look


def write_pebbles(world: World, rocks: RockField, assets: Path, *, name: str = "pebbles") -> None:
    """Write a layer of `assets`: what is drawn near paths and no part of the world."""
    stage = new_stage(assets / f"{name}.usdc", name)
    friction = world_friction(world.site.body, Options()).rock
    coarsest = np.array([len(shape.meshes) - 1 for shape in world.library.prototypes])
    for population, tint, some in grouped(rocks, rock_tints(rocks.id, world.site.seed)):
        path = f"/{name}/Looks/pebble_{population}_{tint}"
        look = define_rock_look(stage, path, world, population, tint, friction, shared=".")
        path = f"/{name}/visual_{population}_{tint}"
        define_instancer(
            stage, path, some, world, coarsest[some.prototype], shared=".", kind="pebble"
        )
        bind(stage.GetPrimAtPath(path), look)
    save(stage)


def define_instancer(
    stage: Usd.Stage,
    path: str,
    rocks: RockField,
    whole: World,
    level: NDArray[np.int64],
    *,
    shared: str,
    kind: str = "rock",
) -> None:
    """Draw rocks by levels of detail of their shapes, all in one prim."""
    pairs, index = np.unique(
        np.stack([rocks.prototype, level, lie_upright(rocks)], axis=-1),
        axis=0,
        return_inverse=True,
    )
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    label(instancer.GetPrim(), kind)
    targets = []
    for source in (_visual_path(*pair) for pair in pairs.tolist()):
        prim = stage.DefinePrim(f"{path}/Prototypes/{source.rsplit('/', 1)[1]}", "Xform")
        prim.GetReferences().AddReference(f"{shared}/{_LIBRARY}.usdc", source)
        targets.append(prim.GetPath())
    instancer.CreatePrototypesRel().SetTargets(targets)
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(index.reshape(-1).astype(np.int32)))
    instancer.CreateIdsAttr(Vt.Int64Array.FromNumpy(rocks.id.astype(np.int64)))
    positions = rocks.position.astype(np.float32)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    halves = np.ascontiguousarray(xyzw(rocks.quaternion), dtype=np.float16)
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(halves))
    scales = np.repeat(rocks.scale.astype(np.float32)[:, None], 3, axis=1)
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(scales))
    box = np.stack(rocks_box(rocks, whole.library))
    instancer.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(box.astype(np.float32)))


def _specify_hulls(layer: Sdf.Layer, path: str, rocks: RockField, shared: str) -> None:
    """An instanceable reference to the hulls of each rock."""
    parent = layer.GetPrimAtPath(path)
    columns = (rocks.id, rocks.prototype, rocks.position, rocks.quaternion, rocks.scale)
    with Sdf.ChangeBlock():
        for identity, prototype, position, quaternion, scale in zip(*columns, strict=True):
            rock = _specify_instance(parent, rock_name(identity), _hull_path(prototype), shared)
            specify_place(rock, position=position, quaternion=quaternion, scale=float(scale))


def _define_dynamic_groups(
    stage: Usd.Stage,
    root: str,
    rocks: RockField,
    seed: int,
) -> None:
    """A group `dynamic_<population>_<tint>` for the dynamic rocks of a look."""
    if not len(rocks):
        return
    sliding = dynamic_contact(float(rocks.diameter[0])).sliding  # the same for all sizes
    friction = define_friction(stage, f"{root}/Looks/dynamic", sliding)
    for population, tint, _ in grouped(rocks, rock_tints(rocks.id, seed)):
        group = UsdGeom.Xform.Define(stage, f"{root}/dynamic_{population}_{tint}").GetPrim()
        label(group, "rock")
        bind_friction(group, friction)


def _drawn_shapes(rocks: RockField, close: NDArray[np.int32]) -> list[str]:
    """The library's prim of what each dynamic rock is drawn as."""
    level = np.where(np.isin(rocks.id, close), CLOSE, 0).tolist()
    columns = zip(rocks.prototype.tolist(), level, lie_upright(rocks).tolist(), strict=True)
    return [_visual_path(*column) for column in columns]


def _define_dressed(
    stage: Usd.Stage,
    root: str,
    rocks: RockField,
    drawn: list[str],
    seed: int,
    looks: dict[tuple[int, int], UsdShade.Material],
    shared: str,
) -> None:
    """A class for each shape in each look: what is instanced must hold its material itself.

    By USD's rules an instance would have that of the group that it lies in; Blender does not look
    there. A class, unlike a reference, may point to what lies outside of it.
    """
    tints = rock_tints(rocks.id, seed).tolist()
    for population, tint, source in sorted(
        set(zip(rocks.population.tolist(), tints, drawn, strict=True))
    ):
        path = _dressed_path(root, population, tint, source)
        stage.CreateClassPrim(path.rpartition("/")[0])
        prim = stage.CreateClassPrim(path)
        prim.GetReferences().AddReference(f"{shared}/{_LIBRARY}.usdc", source)
        bind(stage.OverridePrim(f"{path}/shape"), looks[population, tint])


def _dressed_path(root: str, population: int, tint: int, source: str) -> str:
    """The class of a shape of the library in a look."""
    return f"{root}/Shapes/{source.rpartition('/')[2]}_{population}_{tint}"


def _specify_dynamic(
    layer: Sdf.Layer,
    root: str,
    rocks: RockField,
    drawn: list[str],
    world: World,
    shared: str,
) -> None:
    """A body `rock_<id>` for each dynamic rock, in the groups of `_define_dynamic_groups`.

    The body itself is not scaled, so that its mass properties are in metres and kilograms.
    """
    if not len(rocks):
        return
    kinds = Sdf.ValueTypeNames
    moments, axes = principal_axes(inertias(rocks, world.library))
    tints = rock_tints(rocks.id, world.site.seed).tolist()
    with Sdf.ChangeBlock():
        for row, (population, tint, prototype) in enumerate(
            zip(rocks.population.tolist(), tints, rocks.prototype.tolist(), strict=True)
        ):
            parent = layer.GetPrimAtPath(f"{root}/dynamic_{population}_{tint}")
            body = Sdf.PrimSpec(parent, rock_name(rocks.id[row]), Sdf.SpecifierDef, "Xform")
            specify_place(body, position=rocks.position[row], quaternion=rocks.quaternion[row])
            schemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
            body.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=schemas))
            specify(body, "physics:mass", kinds.Float, float(rocks.mass[row]))
            specify(body, "physics:centerOfMass", kinds.Point3f, Gf.Vec3f(0.0))
            diagonal = Gf.Vec3f(*moments[row].tolist())
            specify(body, "physics:diagonalInertia", kinds.Float3, diagonal)
            specify(body, "physics:principalAxes", kinds.Quatf, gf_quaternion(axes[row]))
            visual = Sdf.PrimSpec(body, "visual", Sdf.SpecifierDef, "Xform")
            visual.instanceable = True
            dressed = _dressed_path(root, population, tint, drawn[row])
            visual.inheritPathList.prependedItems = [dressed]
            hulls = _specify_instance(body, "hulls", _hull_path(prototype), shared)
            for part in (visual, hulls):
                specify_place(part, scale=float(rocks.scale[row]))
            guide, uniform = UsdGeom.Tokens.guide, Sdf.VariabilityUniform
            specify(hulls, "purpose", kinds.Token, guide, uniform)
