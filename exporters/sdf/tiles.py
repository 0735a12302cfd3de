"""A site in tiles: a model per tile, and a world whose levels load them as a rover comes near.

    OUT/sdf/world.sdf                 includes all tiles, with a level for each
    OUT/sdf/rock_shapes/              what the single rocks of all tiles share
    OUT/sdf/close_ROW_COLUMN/         the model of a tile near a path, in the other's place
    OUT/tiles/ROW/COLUMN/sdf/         the model of a tile

All is found by one resource path, the site's folder: `model://tiles/000/001/sdf`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from terrain_forge.exporters.sdf import rocks

from terrain_forge.geometry import (
    bake_site_tile,
    coarse_shape,
    collision_losses,
    horizon_losses,
    shifted,
    tile_anchor,
)
from terrain_forge.model import Tile, TiledSite, TileGrid, World, world_friction
from terrain_forge.rocks import seen_close
from terrain_forge.writers import Lines, element, file_name, leaves

from .model import Model
from .options import Options
from .scenery import write_world
from .writing import ground_surface, write_horizon

_SHAPES = "rock_shapes"
_HEADROOM = 20.0
"""What a level's box reaches above and below a tile's ground [m]."""


def _model(folder: Path, address: str, name: str, options: Options) -> Model:
    classic = options.flavour == "classic"
    return Model(
        folder=folder, classic=classic, version=options.version, address=address, called=name
    )


def _shapes(folder: Path, name: str, options: Options) -> Model:
    return _model(folder / _SHAPES, f"{name}/{_SHAPES}", _SHAPES, options)


def begin_tiles(world: World, directory: Path, *, options: Options) -> None:
    """Write the shapes and pictures of rocks that all tiles share."""
    shapes = _shapes(directory, directory.name, options)
    rocks.write_shapes(world, shapes, close=options.close_within_m > 0.0)


def export_tile(tile: Tile, directory: Path, *, grid: TileGrid, options: Options) -> dict[str, Any]:
    """Write a tile's model; returns where it lies and how large it is."""
    address = f"{grid.folder(tile.number)}/{directory.name}"
    return _write_tile(tile, directory, address, grid, directory.name, options)


def _write_tile(
    tile: Tile, folder: Path, address: str, grid: TileGrid, site: str, options: Options
) -> dict[str, Any]:
    """Write a tile's model into a folder of that address; `site` is that of what tiles share."""
    anchor, step = tile_anchor(tile, grid), grid.step(tile.ground.spacing)
    world, whole = (_rounded(one, step) for one in (tile.world, tile.whole))
    fixed = world.replace(field=world.field.replace(dynamic=np.zeros(len(world.field), np.bool_)))
    local = Tile(number=0, world=shifted(fixed, anchor), whole=shifted(whole, anchor))
    row, column = grid.place(tile.number)
    name = f"{file_name(whole.site.name)}_{row:03}_{column:03}"
    model = _model(folder, address, name, options)
    friction = world_friction(whole.site.body, options)
    library = whole.library.prototypes
    coarse = [coarse_shape(shape, options.outline_error) for shape in library]
    texture = bake_site_tile(tile, grid, options.texture_pixels)
    ground = ground_surface(local, texture, model, options, name="ground")
    shared = _shapes(folder, site, options)
    close = frozenset(seen_close(tile.world, within=options.close_within_m).tolist())
    links = [
        element("link", *ground, name="ground"),
        rocks.write_tile(local, model, friction.rock, coarse, options, close=close, shapes=shared),
    ]
    model.write(title=f"{whole.site.name}: tile {row}, {column}", links=links)
    west, south, east, north = tile.ground.bounds
    height = float(np.ptp(tile.ground.elevation)) + 2.0 * _HEADROOM
    return {
        "name": name,
        "anchor": anchor.tolist(),
        "size": [east - west, north - south, height],
        "dynamic": int(np.count_nonzero(tile.field.dynamic)),
    }


def _rounded(world: World, step: float) -> World:
    """The world with heights that are whole steps."""
    heights = np.rint(world.ground.elevation.astype(np.float64) / step) * step
    return world.replace(ground=world.ground.replace(elevation=heights.astype(np.float32)))


def join_tiles(tiled: TiledSite, directory: Path, *, options: Options) -> tuple[str, ...]:
    """Write world.sdf and what lies beyond the site; returns what is lost."""
    name, horizon = file_name(tiled.site.name), tiled.world.horizon
    includes: list[Lines] = []
    levels: list[Lines] = []
    # gz-sim loads what a performer's box meets: from half a tile away, so that its sensors see it.
    width = tiled.grid.cells * tiled.site.spacing
    around = np.array([width, width, 0.0])
    close = _write_close(tiled, directory, options)
    for tile in tiled.tiles:
        told = tile.figures
        place = close.get(tile.number, tile.folder.removeprefix("../"))
        pose = (*told["anchor"], 0, 0, 0)
        uri = leaves(uri=f"model://{place}", name=told["name"], pose=pose)
        includes.append(element("include", *uri))
        box = element("geometry", element("box", *leaves(size=told["size"] + around)))
        level = f"level_{tile.place}"
        more = leaves(buffer=0.125 * width, ref=told["name"])
        levels.append(element("level", *leaves(pose=pose), box, *more, name=level))
    if shown := options.horizon and horizon is not None:
        address = f"{directory.name}/horizon"
        beyond = _model(directory / "horizon", address, f"{name}_horizon", options)
        write_horizon(horizon, beyond, title=f"{tiled.site.name}: horizon", options=options)
        includes.append(
            element(
                "include",
                *leaves(uri=f"model://{address}", name=beyond.name, pose=(0, 0, 0, 0, 0, 0)),
            )
        )
    plugin = element("plugin", *levels, name="gz::sim", filename="dummy")
    model = _model(directory, "", name, options)
    write_world(
        directory / "world.sdf", tiled.world, name=name, models=[model],
        movers=[*includes, plugin], included=False,
    )  # fmt: skip
    return (*_losses(tiled, options), *horizon_losses(horizon, shown=shown))


def _write_close(tiled: TiledSite, directory: Path, options: Options) -> dict[int, str]:
    """Write the models of tiles whose rocks are seen from close by; their places, by number."""
    places, within = dict[int, str](), options.close_within_m
    for built, tile in tiled.near_paths(within):
        close = tile.field.select(np.isin(tile.field.id, seen_close(tile.world, within=within)))
        if rocks.is_single(close, options.individual_min_m).any():
            folder = directory / f"close_{built.place}"
            places[tile.number] = f"{directory.name}/{folder.name}"
            folder.mkdir(exist_ok=True)
            _write_tile(tile, folder, places[tile.number], tiled.grid, directory.name, options)
    return places


def _losses(tiled: TiledSite, options: Options) -> list[str]:
    step = tiled.grid.step(tiled.site.spacing)
    losses = [
        f"Heights are rounded to {1e6 * step:.3g} µm.",
        "Levels load and unload tiles only where gz-sim runs with `--levels` and knows a performer:"
        " name the rover's model by the service /world/NAME/level/set_performer.",
        *collision_losses(tiled.shapes),
    ]
    if tiled.shapes:
        losses.append(f"Rocks below {options.individual_min_m:g} m are merged per tile.")
    if dynamic := sum(tile.figures["dynamic"] for tile in tiled.tiles):
        losses.append(f"{dynamic} dynamic rocks are fixed: a level cannot keep what was pushed.")
    return losses
