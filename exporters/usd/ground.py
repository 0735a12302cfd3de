"""The ground: per tile a mesh that is seen, and touched where friction is one; its craters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    ClosePatch,
    bake_tile,
    close_patches,
    detail_placement,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
    horizon_detail,
    horizon_surface,
)
from terrain_forge.model import (
    GroundDetail,
    Heightfield,
    Horizon,
    Tile,
    World,
    ground_patches,
    material_frictions,
)
from terrain_forge.terrain import Craters
from terrain_forge.truth import craters_of
from terrain_forge.writers import encode_jpeg, write_png

from .layer import define_mesh, define_st, label, make_collider, new_stage, save
from .material import add_normal_map, bind, bind_friction, define_friction, define_textured
from .options import Options

DETAIL = "ground_detail.png"
"""The normal map that all tiles' materials repeat."""
LOOK = "Looks/regolith"
"""Place of a tile's own material in its layer."""
_SOIL = "st1"
"""Texture coordinates of the land beyond for that map: its own picture is a palette."""
_CENTRES = np.array([(2 / 3, 1 / 3), (1 / 3, 2 / 3)])
"""Centres of a cell's two triangles, in the order of `ground_mesh.grid_faces` [cells]."""


def write_ground(tile: Tile, assets: Path, *, craters: list[Craters], options: Options) -> None:
    """Write `assets`/ground_NNN.usdc and its texture ground_NNN.png for one tile of the world."""
    name, ground = tile.name("ground"), tile.ground
    stage = new_stage(assets / f"{name}.usdc", name)
    vertices, faces = grid_vertices(ground), grid_faces(*ground.shape)
    mesh = define_mesh(stage, f"/{name}/surface", vertices, faces)
    normals = grid_normals(ground, tile.whole.ground)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    define_st(mesh, grid_texture_coordinates(*ground.shape), UsdGeom.Tokens.vertex)
    friction = touch_ground(stage, mesh, vertices, faces, tile=tile, options=options)
    label(mesh.GetPrim(), "ground")
    label_craters(mesh, ground, craters)
    write_png(assets / f"{name}.png", image_rows(bake_tile(tile, options.texture_pixels).rgb))
    path = f"/{name}/{LOOK}"
    look = define_textured(stage, path, f"./{name}.png", friction, wrap="clamp")
    if detail := tile.whole.appearance.detail:
        scale, offset = detail_placement(ground, detail)
        add_normal_map(stage, path, f"./{DETAIL}", scale=scale, offset=offset)
    bind(mesh.GetPrim(), look)
    within, largest = options.close_within_m, options.texture_pixels
    patches = close_patches(tile, within=within, largest=largest)
    looks = write_patches(stage, patches, assets, name, friction)
    bind_faces(stage, mesh, tile, looks)
    save(stage)


def ground_friction(tile: Tile, options: Options) -> float | None:
    """Friction of a tile's ground; None where it has several."""
    patches = _patches(tile, options)
    return patches[0][0] if len(patches) == 1 else None


def _patches(tile: Tile, options: Options) -> list[tuple[float, NDArray[np.bool_] | None]]:
    """Each friction of a tile's ground with its cells; None for all of them."""
    return ground_patches(tile.world, material_frictions(tile.whole, options))


def touch_ground(
    stage: Usd.Stage,
    mesh: UsdGeom.Mesh,
    vertices: NDArray[np.floating],
    faces: NDArray[np.int32],
    *,
    tile: Tile,
    options: Options,
) -> float | None:
    """Let physics collide with a tile's ground; returns the friction that its looks then have.

    Where it has several, the cells of each are a mesh of their own that is touched instead, since
    some engines, Newton among them, know no friction of a part of a mesh; the looks have none.
    """
    patches = _patches(tile, options)
    if len(patches) == 1:
        make_collider(mesh, UsdPhysics.Tokens.none)
        return patches[0][0]
    root = stage.GetDefaultPrim().GetPath()
    for number, (some, cells) in enumerate(patches):
        used, corners = np.unique(faces[np.repeat(cells, 2)], return_inverse=True)
        part = define_mesh(stage, f"{root}/touched_{number}", vertices[used], corners)
        part.CreatePurposeAttr(UsdGeom.Tokens.guide)
        make_collider(part, UsdPhysics.Tokens.none)
        felt = define_friction(stage, f"{root}/Looks/touched_{number}", some)
        bind_friction(part.GetPrim(), felt)
    return None


def write_patches(
    stage: Usd.Stage,
    patches: Iterable[ClosePatch],
    assets: Path,
    name: str,
    friction: float | None,
) -> list[tuple[NDArray[np.int64], UsdShade.Material]]:
    """Write pictures of the ground near paths; their cells, and what shows them."""
    return [(patch.cells, _write_patch(stage, patch, assets, name, friction)) for patch in patches]


def _write_patch(
    stage: Usd.Stage, patch: ClosePatch, assets: Path, name: str, friction: float | None
) -> UsdShade.Material:
    """Write the pictures of the ground near a path, and define a material that shows them."""
    images = {"": patch.texture.rgb, "_normals": patch.texture.normals}
    files = {kind: f"{name}_close_{patch.number}{kind}.jpg" for kind in images}
    for kind, pixels in images.items():
        (assets / files[kind]).write_bytes(encode_jpeg(image_rows(pixels)))
    path = f"{stage.GetDefaultPrim().GetPath()}/Looks/close_{patch.number}"
    place = {"scale": patch.scale, "offset": patch.offset}
    look = define_textured(stage, path, f"./{files['']}", friction, wrap="clamp", **place)
    add_normal_map(stage, path, f"./{files['_normals']}")
    return look


def write_horizon(horizon: Horizon, detail: GroundDetail | None, assets: Path) -> None:
    """Write `assets`/horizon.usdc and its picture: what lies beyond the border, visual-only.

    Its soil is that of the ground's `detail`, if it has one.
    """
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
    if detail:
        soil = horizon_detail(horizon, detail)
        define_st(mesh, soil, UsdGeom.Tokens.vertex, name=_SOIL)
        add_normal_map(stage, path, f"./{DETAIL}", coordinates=_SOIL)
    save(stage)


def bind_faces(
    stage: Usd.Stage,
    mesh: UsdGeom.Mesh,
    tile: Tile,
    patches: Sequence[tuple[NDArray[np.int64], UsdShade.Material]] = (),
) -> None:
    """Give faces the looks of patches near paths, and the names of materials.

    Args:
        stage: The ground's stage.
        mesh: Its mesh, whose faces are the cells' by twos.
        tile: The tile.
        patches: Cells and their looks; no cell is in two.
    """
    cells, looks = tile.ground.shape[0] - 1, tile.world.appearance
    root = stage.GetDefaultPrim().GetPath()
    shown = np.zeros(cells * (tile.ground.shape[1] - 1), np.int64)
    for number, (some, _) in enumerate(patches, start=1):
        shown[some] = number
    made = np.zeros_like(shown)
    if looks.material is not None:
        made = looks.material[:-1, :-1].reshape(-1).astype(np.int64)
    kinds = 1 + int(made.max(initial=0))
    subsets = made + kinds * shown  # a face is in one of them
    order = np.argsort(subsets, kind="stable")
    found, starts = np.unique(subsets[order], return_index=True)
    for key, group in zip(found.tolist(), np.split(order, starts[1:]), strict=True):
        patch, kind = divmod(key, kinds)
        if key == 0 and not patches:
            continue
        parts = [f"material_{kind}"] * (kind > 0) + [f"close_{patch}"] * (patch > 0)
        name = "_".join(parts) or "far"
        faces = (2 * group[:, None] + np.arange(2)).reshape(-1)
        subset = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).CreateMaterialBindSubset(
            name, Vt.IntArray.FromNumpy(faces.astype(np.int32))
        )
        if patch:
            bind(subset.GetPrim(), patches[patch - 1][1])
        elif patches:  # Blender gives faces without a look of their own that of any other
            bind(subset.GetPrim(), UsdShade.Material(stage.OverridePrim(f"{root}/{LOOK}")))
        if kind:
            label(subset.GetPrim(), looks.materials[kind].name)


def empty_materials(mesh: UsdGeom.Mesh, tile: Tile) -> None:
    """Take all faces from the materials that `bind_faces` gave them, so that it may give others."""
    kinds = tile.world.appearance.material
    for kind in () if kinds is None else np.unique(kinds[:-1, :-1]).tolist():
        if kind:
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).CreateMaterialBindSubset(
                f"material_{kind}", Vt.IntArray()
            )


def shown_craters(world: World) -> list[Craters]:
    """The craters of each layer that still show in the world's ground."""
    return [craters.select(craters.shows) for _, craters in craters_of(world)]


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
