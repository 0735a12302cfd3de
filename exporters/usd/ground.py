"""The ground: per tile one mesh that is seen and collided with alike, and its texture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, UsdGeom, UsdPhysics, Vt

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    bake_ground,
    detail_placement,
    finest_texture,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
)
from terrain_forge.model import GroundDetail, World, world_friction
from terrain_forge.terrain import Craters
from terrain_forge.writers import write_png

from .craters import label_craters
from .layer import define_mesh, label, make_collider, new_stage, save
from .material import add_normal_map, bind, define_textured
from .options import Options

_DETAIL = "ground_detail.png"


def write_detail(detail: GroundDetail, assets: Path) -> None:
    """Write the normal map that all tiles' materials repeat."""
    write_png(assets / _DETAIL, image_rows(detail.normals))


def write_ground(
    tile: World,
    whole: World,
    assets: Path,
    *,
    name: str,
    craters: list[Craters],
    options: Options,
) -> None:
    """Write `assets`/NAME.usdc and its texture NAME.png for one tile of the world."""
    stage = new_stage(assets / f"{name}.usdc", name)
    ground = tile.ground
    faces = grid_faces(*ground.shape)
    mesh = define_mesh(stage, f"/{name}/surface", grid_vertices(ground), faces)
    normals = grid_normals(ground, whole.ground)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    _texture_coordinates(mesh, ground.shape)
    make_collider(mesh, UsdPhysics.Tokens.none)
    label(mesh.GetPrim(), "ground")
    label_craters(mesh, ground, craters)
    texture = bake_ground(tile, finer=finest_texture(whole.ground, options.texture_pixels))
    write_png(assets / f"{name}.png", image_rows(texture.rgb))
    path = f"/{name}/Looks/regolith"
    grip = world_friction(tile.site.body, options)
    look = define_textured(stage, path, f"./{name}.png", grip.ground, wrap="clamp")
    if detail := tile.appearance.detail:
        scale, offset = detail_placement(ground, detail)
        add_normal_map(stage, path, f"./{_DETAIL}", scale=scale, offset=offset)
    bind(mesh.GetPrim(), look)
    save(stage)


def _texture_coordinates(mesh: UsdGeom.Mesh, shape: tuple[int, int]) -> None:
    coordinates = grid_texture_coordinates(*shape).astype(np.float32)
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(coordinates))
