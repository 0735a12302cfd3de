"""A site in tiles: per tile a payload whose levels of detail are variants, one stage over all.

OUT/usd/world.usda                 a prim with a payload per tile, and what they share
OUT/tiles/ROW/COLUMN/usd/tile.usda the variants `lod` of a tile: `full`, `quarter`, `sixteenth`;
                                   of a level that a small tile has not, its coarsest
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from terrain_forge.base import Array, image_rows
from terrain_forge.geometry import (
    GroundLevel,
    bake_ground,
    coarse_shape,
    collision_losses,
    detail_placement,
    finest_texture,
    grid_texture_coordinates,
    ground_levels,
    grouped,
    horizon_losses,
    level_normals,
    level_of_detail,
    pebbles_loss,
    rock_texture,
    rocks_error,
    shifted,
    tile_anchor,
    untiled_losses,
)
from terrain_forge.model import RockField, Tile, TiledSite, TileGrid, World, world_friction
from terrain_forge.rocks import require_pebbles, seen_close, tile_pebbles
from terrain_forge.scene import rock_tints
from terrain_forge.writers import write_png

from .ground import DETAIL, bind_faces, label_craters, shown_craters, write_horizon
from .layer import ROOT, define_mesh, define_st, label, make_collider, new_stage, save
from .material import add_normal_map, bind, define_textured
from .options import Options
from .rocks import (
    define_instancer,
    define_rock_look,
    write_library,
    write_pebbles,
    write_rock_maps,
    write_rocks,
)
from .writing import define_parts, define_world, write_sky

LEVELS = {"full": 1, "quarter": 4, "sixteenth": 16}
"""Names of the levels of detail, and cells of the ground to one of theirs, each way."""
_SHARED = "../../../../usd/assets"
"""The shared assets' folder, from that of a tile."""
_TILE = "tile"


def export_tile(tile: Tile, directory: Path, *, grid: TileGrid, options: Options) -> dict[str, Any]:
    """Write a tile's levels of detail and tile.usda; returns its place and the levels' errors."""
    anchor = tile_anchor(tile, grid)
    local = Tile(
        number=tile.number, world=shifted(tile.world, anchor), whole=shifted(tile.whole, anchor)
    )
    finer = finest_texture(tile.ground.replace(elevation=_square(grid)), options.texture_pixels)
    picture = bake_ground(tile.world, finer=finer).rgb
    write_png(directory / "ground.png", image_rows(picture))
    shapes = tile.whole.library.prototypes
    coarse = [coarse_shape(shape, options.outline_error) for shape in shapes]
    levels = np.array([level_of_detail(shape, options.outline_error) for shape in shapes], np.int64)
    close = seen_close(tile.world, within=options.close_within_m)
    errors: dict[str, float] = {}
    farthest = np.array([len(shape.meshes) - 1 for shape in shapes], np.int64)
    strides = {stride: name for name, stride in LEVELS.items()}
    for level in ground_levels(tile, grid, tuple(strides)):
        name = strides[level.stride]
        _write_ground(tile, level, directory / f"ground_{name}.usdc", options=options)
        rocks, near = local.field, level.stride == 1
        shown = (rocks.diameter >= smallest_shown(level, tile)) | near
        drawn = farthest[rocks.prototype]
        if near:  # the finest of those that have colliders of their own
            fine = rocks.diameter >= options.collider_min_m
            drawn = np.where(fine, 0, levels[rocks.prototype])
        errors[name] = level.error + rocks_error(rocks, shapes, details=drawn, shown=shown)
        if near:
            write_rocks(
                local, directory, coarse=coarse, levels=levels, close=close, options=options,
                name="rocks_full", shared=_SHARED,
            )  # fmt: skip
            continue
        _write_far_rocks(local, rocks.select(shown), farthest, directory, name)
    _write_tile(directory / "tile.usda", anchor, list(errors))
    return {"anchor": anchor.tolist(), "errors": errors}


def _square(grid: TileGrid) -> Any:
    """A grid of as many nodes as most tiles have, so that all pictures are equally fine."""
    side = min(grid.cells, max(grid.columns, grid.rows)) + 1
    return np.zeros((side, side), np.float32)


def smallest_shown(level: GroundLevel, tile: Tile) -> float:
    """Diameter of the smallest rocks that a level of detail shows [m]: half its cells' side."""
    return 0.5 * level.stride * tile.ground.spacing


def _write_ground(tile: Tile, level: GroundLevel, path: Path, *, options: Options) -> None:
    name, ground = path.stem, tile.ground
    stage = new_stage(path, name)
    mesh = define_mesh(stage, f"/{name}/surface", level.vertices, level.faces)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(level_normals(tile, level)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    define_st(mesh, grid_texture_coordinates(*ground.shape)[level.nodes], UsdGeom.Tokens.vertex)
    make_collider(mesh, UsdPhysics.Tokens.none)
    label(mesh.GetPrim(), "ground")
    if level.stride == 1:
        label_craters(mesh, ground, shown_craters(tile.world))
    look = f"/{name}/Looks/regolith"
    friction = world_friction(tile.whole.site.body, options)
    material = define_textured(stage, look, "./ground.png", friction.ground, wrap="clamp")
    if level.stride == 1 and (detail := tile.whole.appearance.detail):
        scale, offset = detail_placement(ground, detail)
        add_normal_map(stage, look, f"{_SHARED}/{DETAIL}", scale=scale, offset=offset)
    bind(mesh.GetPrim(), material)
    if level.stride == 1:
        bind_faces(stage, mesh, tile, options)
    save(stage)


def _write_far_rocks(
    tile: Tile, rocks: RockField, far: NDArray[np.int64], directory: Path, level: str
) -> None:
    """Write the rocks of a level of detail that are seen from afar, which nothing touches."""
    name = f"rocks_{level}"
    stage = new_stage(directory / f"{name}.usdc", name)
    friction = world_friction(tile.whole.site.body, Options()).rock
    seed = tile.whole.site.seed
    for population, tint, some in grouped(rocks, rock_tints(rocks.id, seed)):
        path = f"/{name}/visual_{population}_{tint}"
        levels = far[some.prototype]
        define_instancer(stage, path, some, tile.whole, levels, shared=_SHARED)
        place = f"/{name}/Looks/rock_{population}_{tint}"
        look = define_rock_look(
            stage, place, tile.whole, population, tint, friction, shared=_SHARED
        )
        bind(stage.GetPrimAtPath(path), look)
    save(stage)


def _write_tile(path: Path, anchor: Array, names: list[str]) -> None:
    """Write the layer that puts a tile to its place and offers its levels of detail."""
    stage = new_stage(path, _TILE)
    prim = stage.GetDefaultPrim()
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(*anchor.tolist()))
    variants = prim.GetVariantSets().AddVariantSet("lod")
    for n, level in enumerate(LEVELS):
        name = names[min(n, len(names) - 1)]  # a small tile's coarsest stands for coarser ones
        variants.AddVariant(level)
        variants.SetVariantSelection(level)
        with variants.GetVariantEditContext():
            for part in ("ground", "rocks"):
                child = UsdGeom.Xform.Define(stage, f"/{_TILE}/{part}").GetPrim()
                child.GetPayloads().AddPayload(f"./{part}_{name}.usdc")
    variants.SetVariantSelection(names[0])
    save(stage)


def begin_tiles(world: World, directory: Path, *, options: Options) -> None:
    """Write what all tiles share: shapes of rocks, pictures of them and of the soil's relief."""
    require_pebbles(world.site, smallest=options.pebbles_min_m, within=options.pebbles_within_m)
    assets = directory / "assets"
    assets.mkdir(exist_ok=True)
    shapes = enumerate(world.library.prototypes if options.close_within_m > 0.0 else ())
    close = {number for number, shape in shapes if shape.close is not None}
    write_library(world.library, assets, close=close, turned=True)
    for population in range(len(world.field.populations)):
        write_png(assets / f"rock_{population}.png", rock_texture(world, population, tinted=True))
    write_rock_maps(world, assets)
    write_sky(world, assets)
    if world.appearance.detail:
        write_png(assets / DETAIL, image_rows(world.appearance.detail.normals))


def join_tiles(tiled: TiledSite, directory: Path, *, options: Options) -> tuple[str, ...]:
    """Write world.usda and what lies beyond the site; returns what is lost."""
    path, horizon = directory / "world.usda", tiled.world.horizon
    stage = new_stage(path, ROOT, kind=Kind.Tokens.assembly)
    define_world(stage, tiled.world, options.lights)
    if shown := options.horizon and horizon is not None:
        write_horizon(horizon, tiled.world.appearance.detail, directory / "assets")
        define_parts(stage, "Horizon", ["horizon"])
    pebbles = _write_pebbles(tiled, directory / "assets", options)
    if pebbles:
        define_parts(stage, "Pebbles", [*pebbles])
    group = UsdGeom.Xform.Define(stage, f"/{ROOT}/Tiles").GetPrim()
    Usd.ModelAPI(group).SetKind(Kind.Tokens.group)
    layer = stage.GetRootLayer()
    del stage, group
    parent = layer.GetPrimAtPath(f"/{ROOT}/Tiles")
    with Sdf.ChangeBlock():
        for tile in tiled.tiles:
            place = f"{tile.row:03}_{tile.column:03}"
            prim = Sdf.PrimSpec(parent, f"tile_{place}", Sdf.SpecifierDef, "Xform")
            prim.payloadList.prependedItems = [Sdf.Payload(f"{tile.folder}/tile.usda")]
            # Pebbles lie on the finest ground: above and below a coarser one.
            finest = f"pebbles_{place}" in pebbles
            prim.variantSelections["lod"] = [*LEVELS][0 if finest else -1]
    layer.Save()
    count, wanted = sum(pebbles.values()), options.pebbles_min_m > 0.0
    told = [pebbles_loss(count, options.pebbles_within_m)] * wanted
    return (*_losses(tiled, options), *told, *horizon_losses(horizon, shown=shown))


def _write_pebbles(tiled: TiledSite, assets: Path, options: Options) -> dict[str, int]:
    """Write a layer for the pebbles of each tile; how many each has."""
    found = {}
    smallest, within = options.pebbles_min_m, options.pebbles_within_m
    for name, world, pebbles in tile_pebbles(tiled, smallest=smallest, within=within):
        write_pebbles(world, pebbles, assets, name=name)
        found[name] = len(pebbles)
    return found


def _losses(tiled: TiledSite, options: Options) -> list[str]:
    step = tiled.grid.step(tiled.site.spacing)
    worst = {
        name: max(tile.figures["errors"].get(name, 0.0) for tile in tiled.tiles) for name in LEVELS
    }
    far = ", ".join(f"{name} {worst[name]:.2g} m" for name in LEVELS)
    pebbly = ", but those with pebbles" if options.pebbles_min_m > 0.0 else ""
    return [
        f"The ground's coordinates are rounded to {1e6 * step:.3g} µm.",
        f"Levels of detail are off by up to: {far}; rocks smaller than half a cell of a level are "
        "not in it, and nothing but its ground can be touched.",
        f"world.usda shows all tiles at their coarsest{pebbly}: choose the variant `lod` = `full` "
        "of those that a rover drives on.",
        *untiled_losses(close=options.close_within_m > 0.0),
        *collision_losses(tiled.shapes),
    ]
