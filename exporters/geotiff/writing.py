"""The GeoTIFF export from first to last."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import MinLen
from numpy.typing import NDArray

from terrain_forge.base import Idle, Spec, portable, refuse_twice
from terrain_forge.geometry import grid_normals, with_horizon_loss
from terrain_forge.model import ExportReport, Heightfield, Site, Tile, TileGrid, World, merge
from terrain_forge.truth import disjoint, rock_rasters
from terrain_forge.writers import write_geotiff

from .joining import OVERVIEW, overview_nodes
from .products import Product, told_of


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the GeoTIFF export."""

    bytes_each: ClassVar[tuple[float, float]] = (12, 0)
    """About how many bytes it writes for each node of the ground and each rock."""
    kind: Literal["geotiff"] = "geotiff"
    """The exporter, where the export's folder has another name."""
    products: Annotated[tuple[Product, ...], MinLen(1)] = (
        *("elevation", "surface_with_rocks", "rock_id"),
        *("slope", "hillshade", "orthoimage"),
    )
    """The rasters to write, each into a file of its name: heights of the bare ground; heights of
    the highest surface, rocks included; id of the rock on top, -1 where there is none; slope of the
    bare ground in degrees; the bare ground lit by the recipe's Sun, without shadows; colours of
    ground and rocks as seen from above."""
    heights: Literal["world", "datum"] = "world"
    """`world` writes z of the world; `datum` heights above the body's datum: the datum height and
    the plane that levelling took away are added."""
    cloud_optimized: bool = False
    """Write cloud-optimised GeoTIFFs (COG), with blocks and overviews."""

    def idle(self) -> Iterator[Idle]:
        """The heights of rasters that hold none."""
        if not any(told_of(product)["units"] == "m" for product in self.products):
            yield Idle("heights", "no product holds heights")

    def __post_init__(self) -> None:
        refuse_twice(self.products, ("products",))


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write each product as PRODUCT.tif, on the ground's nodes and in the site's local CRS."""
    largest = 0.0
    for product, grid in _rasters(world, world.ground, options):
        grid = _write(product, grid, world.ground, world.site, directory, options)
        if told_of(product)["units"] == "m":
            largest = max(largest, float(np.abs(grid).max()))
    files = tuple(Path(f"{product}.tif") for product in sorted(options.products))
    report = ExportReport(files=files, losses=_losses(world, options, largest))
    return with_horizon_loss(report, world.horizon, shown=False)


def export_tile(tile: Tile, directory: Path, *, grid: TileGrid, options: Options) -> dict[str, Any]:
    """Write each product of a tile as a COG without the nodes that the next tiles have.

    Beside them lies what the tile shows of the whole site's overview.
    """
    ground, own = disjoint(tile)
    options = replace(options, cloud_optimized=True)
    window = tile.world.window
    rows = overview_nodes(grid.rows, grid, first=window.row, count=ground.shape[0])
    columns = overview_nodes(grid.columns, grid, first=window.column, count=ground.shape[1])
    seen = {}
    for product, values in _rasters(tile.world, tile.whole.ground, options):
        written = _write(product, values[own], ground, tile.whole.site, directory, options)
        seen[product] = written[np.ix_(rows, columns)]
    np.savez(directory / OVERVIEW, allow_pickle=False, **seen)
    return {}


def _write(
    product: str,
    grid: NDArray[Any],
    ground: Heightfield,
    site: Site,
    directory: Path,
    options: Options,
) -> NDArray[Any]:
    """Write a product; returns its values as they were written."""
    told = told_of(product, options.heights)
    if told["units"] == "m" and options.heights == "datum":
        east, north = site.slope
        plane = site.datum_height + east * ground.east
        plane = plane + (north * ground.north)[:, None]
        grid = (grid + plane).astype(np.float32)
    write_geotiff(
        directory / f"{product}.tif",
        grid,
        world_ground=ground,
        site=site,
        **told,
        cloud_optimized=options.cloud_optimized,
    )
    return grid


def _rasters(
    world: World, whole: Heightfield, options: Options
) -> Iterator[tuple[str, NDArray[Any]]]:
    """The products at the ground's nodes, rows run north; colours are a third dimension.

    Slopes are those of the `whole` ground that the world's is a part of.
    """
    ground = world.ground
    top = cache(lambda: rock_rasters(world))
    normals = cache(lambda: grid_normals(ground, whole).reshape(*ground.shape, 3))

    def slope() -> NDArray[np.float32]:  # [degrees]
        east, north, up = np.moveaxis(normals().astype(np.float64), -1, 0)
        # Not by the cosine: float32 near 1 has no slopes between 0 and 0.02 degrees.
        return np.degrees(portable.arctan2(np.sqrt(east**2 + north**2), up)).astype(np.float32)

    def hillshade() -> NDArray[np.uint8]:  # cosine of the angle between normal and Sun
        light = portable.product(normals(), world.lighting.towards_sun)
        return np.rint(255 * np.maximum(light, 0.0)).astype(np.uint8)

    make = {
        "elevation": lambda: ground.elevation,
        "surface_with_rocks": lambda: top()[0],
        "rock_id": lambda: top()[1],
        "slope": slope,
        "hillshade": hillshade,
        "orthoimage": lambda: _orthoimage(top()[1], world),
    }
    for product in options.products:
        yield product, make[product]()


def _orthoimage(ids: NDArray[np.int32], world: World) -> NDArray[np.uint8]:
    """Colours of the ground and, where a rock is on top, of its population."""
    rocks, image = merge(world.field, world.neighbours), world.appearance.ground_rgb.copy()
    covered = ids >= 0
    rows = np.searchsorted(rocks.id, ids[covered])
    image[covered] = world.appearance.rock_rgb[rocks.population[rows]]
    return image


def _losses(world: World, options: Options, largest: float) -> tuple[str, ...]:
    """What rasters do not say."""
    lost = ": overhangs, masses, and which rocks are dynamic or cannot be touched are lost"
    losses = [
        f"Rasters hold one height per place{lost if len(world.field) else ''}; programs that "
        "interpolate between nodes otherwise than by the two triangles of a cell read other "
        "heights there."
    ]
    if options.heights == "datum":
        losses.append(
            "Heights above the datum are float32: rounded by up to "
            f"{500 * np.spacing(np.float32(largest)):.2g} mm."
        )
    if not world.site.georeferenced:
        losses.append("The site has no place on its body: the files have no CRS.")
    return tuple(losses)
