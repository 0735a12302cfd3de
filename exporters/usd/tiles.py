"""A site in tiles: per tile a payload whose levels of detail are variants, one stage over all.

OUT/usd/world.usda                 a prim with a payload per tile, and what they share
OUT/usd/assets/close_ROW_COLUMN.usda a tile near a path, over that in its folder
OUT/tiles/ROW/COLUMN/usd/tile.usda the variants `lod` of a tile: `full`, `quarter`, `sixteenth`;
                                   of a level that a small tile has not, its coarsest
"""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from terrain_forge.base import Array, image_rows
from terrain_forge.geometry import (
    GroundLevel,
    bake_site_tile,
    close_loss,
    close_patches,
    close_pixel,
    coarse_shape,
    collision_losses,
    detail_placement,
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
)
from terrain_forge.model import (
    BuiltTile,
    RockField,
    Tile,
    TiledSite,
    TileGrid,
    World,
    world_friction,
)
from terrain_forge.rocks import seen_close, tiles_near_paths
from terrain_forge.scene import rock_tints
from terrain_forge.writers import write_png, write_texture

from .ground import (
    DETAIL,
    LOOK,
    bind_faces,
    empty_materials,
    ground_friction,
    label_craters,
    shown_craters,
    touch_ground,
    write_horizon,
    write_patches,
)
from .layer import (
    ROOT,
    define_mesh,
    define_st,
    label,
    make_collider,
    new_layer,
    new_stage,
    save,
    set_conventions,
)
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
_FINEST = "full"
_NONE = np.empty(0, np.int32)


def export_tile(tile: Tile, directory: Path, *, grid: TileGrid, options: Options) -> dict[str, Any]:
    """Write a tile's levels of detail and tile.usda; returns its place and the levels' errors."""
    anchor = tile_anchor(tile, grid)
    local = Tile(
        number=tile.number, world=shifted(tile.world, anchor), whole=shifted(tile.whole, anchor)
    )
    picture = bake_site_tile(tile, grid, options.texture_pixels).rgb
    write_png(directory / "ground.png", image_rows(picture))
    shapes = tile.whole.library.prototypes
    levels = np.array([level_of_detail(shape, options.outline_error) for shape in shapes], np.int64)
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
            _write_finest_rocks(local, directory, f"rocks_{name}", options=options, shared=_SHARED)
            continue
        _write_far_rocks(local, rocks.select(shown), farthest, directory, name)
    _write_tile(directory / "tile.usda", anchor, list(errors))
    return {"anchor": anchor.tolist(), "errors": errors}


def _write_finest_rocks(
    tile: Tile,
    directory: Path,
    name: str,
    *,
    options: Options,
    shared: str,
    close: NDArray[np.int32] = _NONE,
) -> None:
    """Write a tile's rocks as `write_rocks` does."""
    shapes = tile.whole.library.prototypes
    coarse = [coarse_shape(shape, options.outline_error) for shape in shapes]
    levels = np.array([level_of_detail(shape, options.outline_error) for shape in shapes], np.int64)
    write_rocks(
        tile, directory, coarse=coarse, levels=levels, close=close, options=options, name=name,
        shared=shared,
    )  # fmt: skip


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
    friction: float | None = world_friction(tile.whole.site.body, options).ground
    if level.stride == 1:
        friction = touch_ground(
            stage, mesh, level.vertices, level.faces, tile=tile, options=options
        )
        label_craters(mesh, ground, shown_craters(tile.world))
    else:
        make_collider(mesh, UsdPhysics.Tokens.none)
    label(mesh.GetPrim(), "ground")
    look = f"/{name}/{LOOK}"
    material = define_textured(stage, look, "./ground.png", friction, wrap="clamp")
    if level.stride == 1 and (detail := tile.whole.appearance.detail):
        scale, offset = detail_placement(ground, detail)
        add_normal_map(stage, look, f"{_SHARED}/{DETAIL}", scale=scale, offset=offset)
    bind(mesh.GetPrim(), material)
    if level.stride == 1:
        bind_faces(stage, mesh, tile)
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
    assets = directory / "assets"
    assets.mkdir(exist_ok=True)
    shapes = enumerate(world.library.prototypes if options.close_within_m > 0.0 else ())
    close = {number for number, shape in shapes if shape.close is not None}
    write_library(world.library, assets, close=close, turned=True)
    for population in range(len(world.field.populations)):
        texture = rock_texture(world, population, tinted=True)
        write_texture(assets / f"rock_{population}.png", texture)
    write_rock_maps(world, assets)
    if world.appearance.detail:
        write_png(assets / DETAIL, image_rows(world.appearance.detail.normals))


def join_tiles(tiled: TiledSite, directory: Path, *, options: Options) -> tuple[str, ...]:
    """Write world.usda, its sky and what lies beyond the site; returns what is lost."""
    path, horizon = directory / "world.usda", tiled.world.horizon
    stage = new_stage(path, ROOT, kind=Kind.Tokens.assembly)
    define_world(stage, tiled.world, options.lights)
    highest = max(tile.height[1] for tile in tiled.tiles)
    write_sky(tiled.world, directory / "assets", highest=highest)
    if shown := options.horizon and horizon is not None:
        write_horizon(horizon, tiled.world.appearance.detail, directory / "assets")
        define_parts(stage, "Horizon", ["horizon"])
    near = _write_near(tiled, directory / "assets", options)
    pebbles = {place: part.pebbles for place, part in near.items() if part.pebbles}
    if pebbles:
        define_parts(stage, "Pebbles", [f"pebbles_{place}" for place in pebbles])
    group = UsdGeom.Xform.Define(stage, f"/{ROOT}/Tiles").GetPrim()
    Usd.ModelAPI(group).SetKind(Kind.Tokens.group)
    layer = stage.GetRootLayer()
    del stage, group
    parent = layer.GetPrimAtPath(f"/{ROOT}/Tiles")
    with Sdf.ChangeBlock():
        for tile in tiled.tiles:
            prim = Sdf.PrimSpec(parent, f"tile_{tile.place}", Sdf.SpecifierDef, "Xform")
            part = near.get(tile.place, _Near(file=f"{tile.folder}/tile.usda"))
            prim.payloadList.prependedItems = [Sdf.Payload(part.file)]
            # Pebbles lie on the finest ground: above and below a coarser one.
            prim.variantSelections["lod"] = [*LEVELS][0 if tile.place in near else -1]
    layer.Save()
    count, wanted = sum(pebbles.values()), options.pebbles_min_m > 0.0
    told = [pebbles_loss(count, options.pebbles_within_m)] * wanted
    return (*_losses(tiled, near, options), *told, *horizon_losses(horizon, shown=shown))


class _Near(NamedTuple):
    """What is there of a tile near paths."""

    file: str
    """The tile's layer, as seen from world.usda."""
    pebbles: int = 0
    pixel: float = 0.0
    """Of the ground's pictures near paths [m]; 0 without any."""


def _write_near(tiled: TiledSite, assets: Path, options: Options) -> dict[str, _Near]:
    """Write what tiles have near paths, which they were made without; by their places."""
    found, close = {}, options.close_within_m
    tiles = tiles_near_paths(
        tiled, close=close, smallest=options.pebbles_min_m, within=options.pebbles_within_m
    )
    for built, tile, pebbles in tiles:
        place, file, pixel = built.place, f"{built.folder}/tile.usda", 0.0
        if len(pebbles):
            write_pebbles(tile.world, pebbles, assets, name=f"pebbles_{place}")
        if parts := _write_close(built, tile, assets, options):
            file = f"./assets/close_{place}.usda"
            pixel = close_pixel(tile.whole, close) * ("ground" in parts)
            _write_close_tile(assets / f"close_{place}.usda", f"../{built.folder}", parts)
        if len(pebbles) or parts:
            found[place] = _Near(file, len(pebbles), pixel)
    return found


def _write_close(built: BuiltTile, tile: Tile, assets: Path, options: Options) -> dict[str, str]:
    """Write the finest level of a tile as a camera near a path asks for; its new parts' files."""
    parts, within = dict[str, str](), options.close_within_m
    patches = close_patches(tile, within=within, largest=options.texture_pixels)
    if first := next(patches, None):
        name = f"close_ground_{built.place}"
        whole = f"ground_{_FINEST}"
        stage = new_stage(assets / f"{name}.usdc", whole)
        mesh = UsdGeom.Mesh.Define(stage, f"/{whole}/surface")
        empty_materials(mesh, tile)
        friction = ground_friction(tile, options)
        looks = write_patches(stage, chain([first], patches), assets, name, friction)
        bind_faces(stage, mesh, tile, looks)
        layer = stage.GetRootLayer()
        del stage, mesh
        layer.subLayerPaths.append(f"../{built.folder}/{whole}.usdc")  # not read here
        layer.Save()
        parts["ground"] = f"./{name}.usdc"
    close = seen_close(tile.world, within=within)
    if close.size:
        anchor = np.array(built.figures["anchor"])
        local = Tile(
            number=tile.number, world=shifted(tile.world, anchor), whole=shifted(tile.whole, anchor)
        )
        name = f"close_rocks_{built.place}"
        _write_finest_rocks(local, assets, name, close=close, options=options, shared=".")
        parts["rocks"] = f"./{name}.usdc"
    return parts


def _write_close_tile(path: Path, folder: str, parts: dict[str, str]) -> None:
    """Write a tile's layer over that in its folder, with other parts of its finest level."""
    stage = Usd.Stage.Open(new_layer(path), Usd.Stage.LoadNone)
    set_conventions(stage)
    layer = stage.GetRootLayer()
    del stage
    layer.subLayerPaths.append(f"{folder}/tile.usda")
    layer.defaultPrim = _TILE
    prim = Sdf.PrimSpec(layer, _TILE, Sdf.SpecifierOver)
    finest = Sdf.VariantSpec(Sdf.VariantSetSpec(prim, "lod"), _FINEST)
    for part, file in parts.items():
        child = Sdf.PrimSpec(finest.primSpec, part, Sdf.SpecifierOver)
        child.payloadList.explicitItems = [Sdf.Payload(file)]
    layer.Save()


def _losses(tiled: TiledSite, near: dict[str, _Near], options: Options) -> list[str]:
    step = tiled.grid.step(tiled.site.spacing)
    worst = {
        name: max(tile.figures["errors"].get(name, 0.0) for tile in tiled.tiles) for name in LEVELS
    }
    far = ", ".join(f"{name} {worst[name]:.2g} m" for name in LEVELS)
    apart = ", but those near paths" if near else ""
    pixels = {part.pixel for part in near.values()} - {0.0}
    return [
        f"The ground's coordinates are rounded to {1e6 * step:.3g} µm.",
        f"Levels of detail are off by up to: {far}; rocks smaller than half a cell of a level are "
        "not in it, and nothing but its ground can be touched.",
        f"world.usda shows all tiles at their coarsest{apart}: choose the variant `lod` = `full` "
        "of those that a rover drives on.",
        *([close_loss(max(pixels), options.close_within_m)] if pixels else []),
        *collision_losses(tiled.shapes),
    ]
