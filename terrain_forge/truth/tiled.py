"""The truth of a tile of a site that is built in tiles."""

from __future__ import annotations

import json
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import OutputError
from terrain_forge.model import Tile, World
from terrain_forge.truth.materials import write_materials
from terrain_forge.truth.merging import count_rocks
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.tables import rock_columns, write_rocks
from terrain_forge.truth.traversability import rate_world, write_rasters
from terrain_forge.writers import write_geotiff


def write_tile_truth(
    tile: Tile, folder: Path, *, parquet: bool
) -> tuple[dict[str, Any], NDArray[np.int32]]:
    """Write surface, rock on top, slope, step, cost, materials, rocks; returns counts, and ids.

    Rasters hold the tile's nodes but those of its northern and eastern border, which the next
    tiles have; at the site's own border all.
    """
    folder.mkdir()
    world = tile.world
    top, rock_id = rock_rasters(world)
    ground, own = disjoint(tile)
    write = partial(write_geotiff, world_ground=ground, site=world.site, cloud_optimized=True)
    write(folder / "surface_with_rocks.tif", top[own], description="ground and rocks")
    about = "id of the rock on top, -1 where there is none"
    write(folder / "rock_id.tif", rock_id[own], units="", nodata=-1, description=about)
    write_materials(world, folder, ground=ground, part=own)
    if world.rover.wheels:
        _write_traversability(tile, folder, ground, own)
    write_rocks(world, folder / "rocks.csv")
    if parquet:
        write_parquet(world, folder / "rocks.parquet")
    return count_rocks(world, rock_id), rock_id


def _write_traversability(tile: Tile, folder: Path, ground: Any, own: tuple[slice, slice]) -> None:
    """Write slope, step and cost as the whole site has them: what lies around the tile counts."""
    inner, outer = tile.world.window, tile.whole.window
    part = tuple(
        slice(cells.start + shift, cells.stop + shift)
        for cells, shift in zip(
            own, (inner.row - outer.row, inner.column - outer.column), strict=True
        )
    )
    write_rasters(
        rate_world(tile.whole),
        folder,
        ground=ground,
        site=tile.world.site,
        part=(part[0], part[1]),
        cloud_optimized=True,
    )


def disjoint(tile: Tile) -> tuple[Any, tuple[slice, slice]]:
    """The ground's nodes that no other tile's rasters have, and where they are in the tile's."""
    whole, window = tile.whole.site.window, tile.world.window
    rows, columns = (
        cells + (first + cells == all_cells)
        for first, cells, all_cells in (
            (window.row, window.rows, whole.rows),
            (window.column, window.columns, whole.columns),
        )
    )
    ground = tile.ground.cut(column=0, row=0, columns=columns - 1, rows=rows - 1)
    return ground, (slice(0, rows), slice(0, columns))


def require_parquet() -> None:
    """Refuse what cannot be written.

    Raises:
        OutputError: if pyarrow is not installed.
    """
    try:
        import_module("pyarrow.parquet")
    except ImportError:
        raise OutputError(
            "tiles.parquet needs pyarrow: pip install 'terrain-forge[parquet]', or leave it out"
        ) from None


def write_parquet(world: World, path: Path) -> None:
    """Write the columns of rocks.csv as GeoParquet 1.1, with places as points in the site's CRS."""
    arrow: Any = import_module("pyarrow")
    parquet: Any = import_module("pyarrow.parquet")
    rocks, site = world.field, world.site
    points = np.empty(len(rocks), [("order", "u1"), ("kind", "<u4"), ("x", "<f8"), ("y", "<f8")])
    points["order"], points["kind"] = 1, 1
    points["x"], points["y"] = rocks.position[:, :2].T
    columns: dict[str, Any] = {
        column.name: arrow.array(column.values.tolist(), arrow.string())
        if column.values.dtype == object
        else column.values
        for column in rock_columns(world, str)
    }
    size = points.dtype.itemsize
    raw = [points[n : n + 1].tobytes() for n in range(len(points))]
    columns["geometry"] = arrow.array(raw, arrow.binary())
    assert all(len(one) == size for one in raw)
    primary: dict[str, Any] = {"encoding": "WKB", "geometry_types": ["Point"], "crs": _crs(site)}
    if len(rocks):
        xy = rocks.position[:, :2]
        primary["bbox"] = [*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist()]
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": primary}}
    table = arrow.table(columns).replace_schema_metadata({"geo": json.dumps(geo)})
    parquet.write_table(table, path, compression="zstd")


def _crs(site: Any) -> Any:
    """The site's CRS as PROJJSON; None where it has no place."""
    from rasterio.crs import CRS

    return CRS.from_wkt(site.crs).to_dict(projjson=True) if site.crs else None
