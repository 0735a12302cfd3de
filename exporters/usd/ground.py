"""The ground: per tile one mesh that is seen and collided with alike, its texture, its craters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    bake_tile,
    detail_placement,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
    horizon_surface,
)
from terrain_forge.model import (
    Heightfield,
    Horizon,
    Tile,
    World,
    material_frictions,
    world_friction,
)
from terrain_forge.terrain import Craters
from terrain_forge.truth import craters_of
from terrain_forge.writers import write_png

from .layer import define_mesh, define_st, label, make_collider, new_stage, save
from .material import add_normal_map, bind, bind_friction, define_friction, define_textured
from .options import Options

DETAIL = "ground_detail.png"
"""The normal map that all tiles' materials repeat."""
_LEAST_DEPTH = 0.1
"""A crater that has less of its fresh depth left than this part is ground like any other."""
_CENTRES = np.array([(2 / 3, 1 / 3), (1 / 3, 2 / 3)])
"""Centres of a cell's two triangles, in the order of `ground_mesh.grid_faces` [cells]."""


def write_ground(tile: Tile, assets: Path, *, craters: list[Craters], options: Options) -> None:
    """Write `assets`/ground_NNN.usdc and its texture ground_NNN.png for one tile of the world."""
    name, ground = tile.name("ground"), tile.ground
    stage = new_stage(assets / f"{name}.usdc", name)
    mesh = define_mesh(stage, f"/{name}/surface", grid_vertices(ground), grid_faces(*ground.shape))
    normals = grid_normals(ground, tile.whole.ground)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    define_st(mesh, grid_texture_coordinates(*ground.shape), UsdGeom.Tokens.vertex)
    make_collider(mesh, UsdPhysics.Tokens.none)
    label(mesh.GetPrim(), "ground")
    label_craters(mesh, ground, craters)
    write_png(assets / f"{name}.png", image_rows(bake_tile(tile, options.texture_pixels).rgb))
    path = f"/{name}/Looks/regolith"
    friction = world_friction(tile.whole.site.body, options)
    look = define_textured(stage, path, f"./{name}.png", friction.ground, wrap="clamp")
    if detail := tile.whole.appearance.detail:
        scale, offset = detail_placement(ground, detail)
        add_normal_map(stage, path, f"./{DETAIL}", scale=scale, offset=offset)
    bind(mesh.GetPrim(), look)
    bind_materials(stage, mesh, tile, options)
    save(stage)


def write_horizon(horizon: Horizon, assets: Path) -> None:
    """Write `assets`/horizon.usdc and its picture: what lies beyond the border, for the eye."""
    surface, picture = horizon_surface(horizon)
    write_png(assets / "horizon.png", picture)
    stage = new_stage(assets / "horizon.usdc", "horizon")
    mesh = define_mesh(stage, "/horizon/surface", surface.vertices, surface.faces)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(surface.normals.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    define_st(mesh, surface.texture_coordinates, UsdGeom.Tokens.vertex)
    label(mesh.GetPrim(), "horizon")
    path = "/horizon/Looks/horizon"
    bind(mesh.GetPrim(), define_textured(stage, path, "./horizon.png", None, wrap="clamp"))
    save(stage)


def bind_materials(stage: Usd.Stage, mesh: UsdGeom.Mesh, tile: Tile, options: Options) -> None:
    """Name the faces of each material of the ground, and give them its friction."""
    looks, root = tile.world.appearance, stage.GetDefaultPrim().GetPath()
    if looks.material is None:
        return
    frictions = material_frictions(tile.whole, options)
    cells = looks.material[:-1, :-1].reshape(-1)
    for number in np.unique(cells[cells > 0]).tolist():
        name = f"material_{number}"
        faces = 2 * np.flatnonzero(cells == number)[:, None] + np.arange(2)
        subset = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).CreateMaterialBindSubset(
            name, Vt.IntArray.FromNumpy(faces.reshape(-1).astype(np.int32))
        )
        label(subset.GetPrim(), looks.materials[number].name)
        if number < len(frictions):
            felt = define_friction(stage, f"{root}/Looks/{name}", frictions[number])
            bind_friction(subset.GetPrim(), felt)


def fresh_craters(world: World) -> list[Craters]:
    """The craters of each layer that still show in the world's ground."""
    found = (craters for _, craters in craters_of(world))
    return [some.select(some.depth >= _LEAST_DEPTH * some.fresh_depth) for some in found]


def label_craters(mesh: UsdGeom.Mesh, ground: Heightfield, layers: list[Craters]) -> None:
    """Label the faces of a tile's ground that have their centres within rims of craters."""
    rows, columns = ground.shape
    inside = np.zeros((rows - 1, columns - 1, 2), np.bool_)
    for craters in layers:
        centres = (craters.xy - ground.origin) / ground.spacing
        radii = 0.5 * craters.diameter / ground.spacing
        low = np.floor(centres - radii[:, None]).astype(np.int64).clip(0)
        high = np.ceil(centres + radii[:, None]).astype(np.int64).clip(0)
        for (x, y), radius, (west, south), (east, north) in zip(
            centres.tolist(), radii.tolist(), low.tolist(), high.tolist(), strict=True
        ):
            part = inside[south:north, west:east]
            u = west + np.arange(part.shape[1])[:, None] + _CENTRES[:, 0] - x
            v = south + np.arange(part.shape[0])[:, None] + _CENTRES[:, 1] - y
            part |= u**2 + v[:, None, :] ** 2 <= radius**2
    if not inside.any():
        return
    faces = Vt.IntArray.FromNumpy(np.flatnonzero(inside).astype(np.int32))
    subset = UsdGeom.Subset.CreateGeomSubset(
        mesh, "craters", UsdGeom.Tokens.face, faces, "semantics", UsdGeom.Tokens.nonOverlapping
    )
    label(subset.GetPrim(), "crater")
