"""A site in tiles as 3D Tiles 1.1: a tileset over GLBs, for viewers on the web.

    OUT/glb/tileset.json                     boxes in boxes, down to the tiles
    OUT/glb/tileset_ROW_COLUMN.json          parts of it, where there are many tiles
    OUT/glb/pebbles_ROW_COLUMN.glb           pebbles near the paths, on demand, in that frame
    OUT/glb/close_ROW_COLUMN.glb             the finest level of a tile near a path
    OUT/glb/horizon.glb                      what lies beyond the site, in the tileset's frame
    OUT/tiles/ROW/COLUMN/glb/LEVEL.glb       sixteenth, quarter, full: each takes the other's place

Contents count from their tile's anchor; the tile's `transform` puts them into the site's frame,
whose z axis is up, as 3D Tiles have it. OGC 22-025r4, 3D Tiles Specification 1.1.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    ClosePatch,
    GroundLevel,
    bake_site_tile,
    close_loss,
    close_patches,
    close_pixel,
    coarse_shape,
    coloured_parts,
    grid_texture_coordinates,
    ground_levels,
    grouped,
    horizon_losses,
    level_normals,
    level_of_detail,
    lightest_rock_colour,
    pebbles_loss,
    rocks_box,
    rocks_error,
    shifted,
    tile_anchor,
)
from terrain_forge.model import (
    CLOSE,
    CLOSE_MIN_M,
    BuiltTile,
    Horizon,
    Mesh,
    RockField,
    Tile,
    TiledSite,
    TileGrid,
    World,
)
from terrain_forge.rocks import rocks_near_paths, seen_close, tiles_near_paths
from terrain_forge.writers import Gltf, encode_png

from .ground import Z_UP_TO_Y_UP, SharedParts, add_tangents, matt, patched
from .options import Options
from .pebbles import write_pebbles
from .rocks import node_texts, rock_meshes
from .tileset import Box, write_tileset

LEVELS = {"full": 1, "quarter": 4, "sixteenth": 16}
"""Names of the levels of detail, and cells of the ground to one of theirs, each way."""
HORIZON = "horizon.glb"
_NONE = np.empty(0, np.int32)


def export_tile(tile: Tile, directory: Path, *, grid: TileGrid, options: Options) -> dict[str, Any]:
    """Write a tile's levels of detail; returns its place, its levels' errors and their box."""
    anchor = tile_anchor(tile, grid)
    local = shifted(tile.world, anchor)
    picture = image_rows(bake_site_tile(tile, grid, options.texture_pixels).rgb)
    shapes = tile.whole.library.prototypes
    errors: dict[str, float] = {}
    boxes: list[Box] = []
    names = {stride: name for name, stride in LEVELS.items()}
    for level in ground_levels(tile, grid, tuple(names)):
        rocks, far = local.field, level.stride > 1
        shown = rocks.diameter >= 0.5 * level.stride * tile.ground.spacing * far
        if far:
            details = [len(shape.meshes) - 1 for shape in shapes]
            meshes = [shape.meshes[n] for shape, n in zip(shapes, details, strict=True)]
        else:
            details = [level_of_detail(shape, options.outline_error) for shape in shapes]
            meshes = [coarse_shape(shape, options.outline_error) for shape in shapes]
        drawn = np.array(details, np.int64)[rocks.prototype]
        off = rocks_error(rocks, shapes, details=drawn, shown=shown)
        errors[names[level.stride]] = level.error + off
        path = directory / f"{names[level.stride]}.glb"
        boxes.append(
            _write_level(
                path, tile, local, level, rocks.select(shown), meshes,
                picture=_means(picture, level.stride),
            )
        )  # fmt: skip
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    return {
        "anchor": anchor.tolist(),
        "errors": errors,
        "box": [low.tolist(), high.tolist()],
    }


def _means(picture: NDArray[np.uint8], step: int) -> NDArray[np.uint8]:
    """The picture with a pixel for each square of them, as far as they are whole."""
    rows, columns = (max(size // step, 1) for size in picture.shape[:2])
    if step == 1 or min(picture.shape[:2]) < step:
        return picture
    part = picture[: rows * step, : columns * step].astype(np.uint32)
    sums = part.reshape(rows, step, columns, step, 3).sum(axis=(1, 3))
    return np.asarray((sums // step**2).astype(np.uint8))


def _write_level(
    path: Path,
    tile: Tile,
    local: World,
    level: GroundLevel,
    rocks: RockField,
    shapes: list[Mesh],
    *,
    picture: NDArray[np.uint8],
    patches: Sequence[ClosePatch] = (),
    near: NDArray[np.int32] = _NONE,
    close: NDArray[np.int32] = _NONE,
) -> Box:
    """Write a level of a tile as GLB; returns the box of its vertices.

    The finest one has `patches` of its ground near paths, and as nodes of their own, with maps, the
    rocks with ids in `near`, by the close meshes of their shapes those in `close`.
    """
    shape = tile.ground.shape
    boxes = [_box(level.vertices)]
    with TemporaryFile(dir=path.parent) as binary:
        gltf = Gltf(binary)
        texture = gltf.add_texture(encode_png(picture), tiles=False)
        material = gltf.add("materials", matt("regolith", texture=texture))
        normals = level_normals(tile, level)
        primitive = gltf.add_primitive(
            level.vertices,
            normals,
            -1 if patches else gltf.add_indices(level.faces),  # each piece has its own
            grid_texture_coordinates(*shape)[level.nodes],
        )
        primitive["material"] = material
        if patches:
            primitive["attributes"]["TANGENT"] = add_tangents(gltf, normals)
        primitives = patched(primitive, patches, gltf, shape=shape, name="ground")
        gltf.add("meshes", {"name": "ground", "primitives": primitives})
        nodes: list[dict[str, Any]] = [{"name": "ground", "mesh": 0}]
        fine = np.isin(rocks.id, near)
        boxes += _add_merged(gltf, nodes, rocks.select(~fine), shapes, local)
        single = rocks.select(fine)
        if len(single):
            levels = np.where(np.isin(single.id, close), CLOSE, 0)
            meshes = rock_meshes(local, single, gltf, levels)
            boxes.append(rocks_box(single, tile.whole.library))
            nodes += json.loads(f"[{','.join(node_texts(single, meshes))}]")
        _write_asset(gltf, path, nodes)
    return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)


def _add_merged(
    gltf: Gltf, nodes: list[dict[str, Any]], rocks: RockField, shapes: list[Mesh], local: World
) -> list[Box]:
    """Add rocks as one mesh or a few for each population, and their nodes; returns their boxes."""
    boxes = []
    for population, some in grouped(rocks):
        rgb = lightest_rock_colour(local, population).tolist()
        parts = coloured_parts(some, shapes, local)
        for number, (vertices, normals, faces, colours) in enumerate(parts):
            name = f"rocks_{rocks.populations[population]}{f'_{number}' if number else ''}"
            places = vertices.astype(np.float32)
            piece = gltf.add_primitive(places, normals, gltf.add_indices(faces))
            piece["attributes"]["COLOR_0"] = gltf.add_colours(colours)
            piece["material"] = gltf.add("materials", matt(name, rgb=rgb))
            mesh = gltf.add("meshes", {"name": name, "primitives": [piece]})
            nodes.append({"name": name, "mesh": mesh})
            boxes.append(_box(places))
    return boxes


def _write_asset(gltf: Gltf, path: Path, nodes: list[dict[str, Any]]) -> None:
    """Write meshes of nodes whose z axis is up."""
    root = {"rotation": Z_UP_TO_Y_UP, "children": list(range(1, 1 + len(nodes)))}
    gltf.write(
        path,
        nodes=map(json.dumps, [root, *nodes]),
        scene=0,
        scenes=[{"nodes": [0]}],
    )


def _box(vertices: NDArray[Any]) -> Box:
    return vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)


def join_tiles(tiled: TiledSite, directory: Path, *, options: Options) -> tuple[str, ...]:
    """Write tileset.json, and what lies beyond the site; returns what is lost."""
    horizon = tiled.world.horizon
    if shown := options.horizon and horizon is not None:
        _write_horizon(horizon, directory / HORIZON)
    near = _write_near(tiled, directory, options)
    by_place = {(tile.row, tile.column): near.tiles.get(tile.number, tile) for tile in tiled.tiles}
    write_tileset(by_place, tiled.grid, directory)
    errors: dict[str, float] = {}
    for tile in tiled.tiles:
        for name, error in tile.figures["errors"].items():
            errors[name] = max(errors.get(name, 0.0), error)
    told = ", ".join(f"{name} {error:.2g} m" for name, error in errors.items())
    losses = [
        f"Each level's geometric error is stated; at most: {told}. It is that of heights and of "
        "rocks' outlines, not of colours.",
        "3D Tiles know no physics.",
        f"Soil{' away from paths' if near.tiles else ''} has no map of fine normals.",
        f"{_merged(options) if near.tiles else 'Rocks'} are merged per tile, without names and "
        "maps, each of one colour with dust on top.",
        *([close_loss(near.pixel, options.close_within_m)] if near.pixel else []),
        "The tileset lies in the site's own frame, not on a globe.",
        *horizon_losses(horizon, shown=shown),
    ]
    if shown:
        losses.append(f"It is in {HORIZON}, in the tileset's frame; viewers frame all of that.")
    if options.pebbles_min_m > 0.0:
        beside = " They are in files beside the tileset." if near.pebbles else ""
        losses.append(f"{pebbles_loss(near.pebbles, options.pebbles_within_m)}{beside}")
    return tuple(losses)


def _merged(options: Options) -> str:
    """Which rocks are no nodes of their own."""
    within, smallest = options.close_within_m, _smallest_node(options)
    return f"Rocks farther than {within:g} m from paths, and those below {smallest:g} m,"


def _smallest_node(options: Options) -> float:
    """Diameter of the smallest rocks that are nodes of their own near paths [m]."""
    return min(options.instances_min_m, CLOSE_MIN_M)


@dataclass
class _Near:
    """What tiles have near paths."""

    tiles: dict[int, BuiltTile] = field(default_factory=dict)
    """Those with a finest level of their own, by number."""
    pebbles: int = 0
    pixel: float = 0.0
    """The largest of the ground's pictures near paths [m]; 0 without any."""


def _write_near(tiled: TiledSite, directory: Path, options: Options) -> _Near:
    """Write what tiles have near paths, which they were made without."""
    near, close = _Near(), options.close_within_m
    tiles = tiles_near_paths(
        tiled, close=close, smallest=options.pebbles_min_m, within=options.pebbles_within_m
    )
    for built, tile, pebbles in tiles:
        if len(pebbles):  # for viewers to add
            write_pebbles(tile.world, pebbles, directory / f"pebbles_{built.place}.glb")
        near.pebbles += len(pebbles)
        name = f"close_{built.place}.glb"
        found = _write_close(tile, tiled.grid, directory / name, options)
        if found:
            (low, high), fine = found
            west, east = built.figures["box"]
            box = [np.minimum(low, west).tolist(), np.maximum(high, east).tolist()]
            figures = {**built.figures, "box": box, "contents": {"full": name}}
            near.tiles[tile.number] = replace(built, figures=figures)
            near.pixel = max(near.pixel, fine * close_pixel(tile.whole, close))
    return near


def _write_close(
    tile: Tile, grid: TileGrid, path: Path, options: Options
) -> tuple[Box, bool] | None:
    """Write a tile's finest level as a camera near a path asks for, if it has anything for that.

    Returns:
        Its box, and whether its ground has pictures of its own.
    """
    within = options.close_within_m
    patches = tuple(close_patches(tile, within=within, largest=options.texture_pixels))
    near = rocks_near_paths(tile.world, smallest=_smallest_node(options), within=within)
    if not patches and not near.size:
        return None
    local = shifted(tile.world, tile_anchor(tile, grid))
    shapes = [coarse_shape(one, options.outline_error) for one in tile.whole.library.prototypes]
    box = _write_level(
        path, tile, local, next(ground_levels(tile, grid, (1,))), local.field, shapes,
        picture=image_rows(bake_site_tile(tile, grid, options.texture_pixels).rgb),
        patches=patches, near=near, close=seen_close(tile.world, within=within),
    )  # fmt: skip
    return box, bool(patches)


def _write_horizon(horizon: Horizon, path: Path) -> None:
    """Write what lies beyond the site, which a viewer adds to the tileset as it is."""
    with TemporaryFile(dir=path.parent) as binary:
        gltf = Gltf(binary)
        piece = SharedParts(gltf, None).beyond(horizon)
        gltf.add("meshes", {"name": "horizon", "primitives": [piece]})
        _write_asset(gltf, path, [{"name": "horizon", "mesh": 0}])
