"""The rasters: what each shows at the nodes of the ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.geometry import grid_normals
from terrain_forge.model import Heightfield, Site, World, merge
from terrain_forge.truth import rock_rasters

from .options import Product


@dataclass(frozen=True, kw_only=True)
class Raster:
    """A raster and what it means."""

    grid: NDArray[Any]
    """Values at the nodes, shape [rows, columns] or, of colours, [rows, columns, 3]; rows run
    north."""
    units: str
    """Their unit; empty for none."""
    description: str
    """What they are."""
    nodata: float | None = None
    """The value that means "nothing here"."""


class Products:
    """The rasters of a world, made when they are asked for.

    Args:
        world: The world.
        above_datum: Whether heights count from the body's datum, not from the world's z = 0.
    """

    def __init__(self, world: World, *, above_datum: bool) -> None:
        self._world = world
        self._above_datum = above_datum

    def raster(self, product: Product) -> Raster:
        """The raster of that name."""
        make: dict[Product, Callable[[], Raster]] = {
            "elevation": self._elevation,
            "surface_with_rocks": self._surface_with_rocks,
            "rock_id": self._rock_id,
            "slope": self._slope,
            "hillshade": self._hillshade,
            "orthoimage": self._orthoimage,
        }
        return make[product]()

    def _elevation(self) -> Raster:
        return self._heights(self._world.ground.elevation, "height of the bare ground")

    def _surface_with_rocks(self) -> Raster:
        return self._heights(self._top[0], "height of the highest surface, rocks included")

    def _rock_id(self) -> Raster:
        what = "id of the rock on top, -1 where there is none"
        return Raster(grid=self._top[1], units="", description=what, nodata=-1)

    def _slope(self) -> Raster:
        up = self._normals[..., 2].astype(np.float64)
        steepness = np.degrees(np.arccos(np.minimum(up, 1.0))).astype(np.float32)
        return Raster(grid=steepness, units="degree", description="slope of the bare ground")

    def _hillshade(self) -> Raster:
        """255 times the cosine of the angle between the ground's normal and the Sun."""
        light = self._normals @ self._world.lighting.towards_sun
        shade = np.rint(255 * np.maximum(light, 0.0)).astype(np.uint8)
        return Raster(grid=shade, units="", description="bare ground lit by the Sun, no shadows")

    def _orthoimage(self) -> Raster:
        ids, rocks = self._top[1], merge(self._world.field, self._world.neighbours)
        image = self._world.appearance.ground_rgb.copy()
        covered = ids >= 0
        rows = np.searchsorted(rocks.id, ids[covered])
        image[covered] = self._world.appearance.rock_rgb[rocks.population[rows]]
        return Raster(grid=image, units="", description="sRGB colour seen from above, unlit")

    @cached_property
    def _top(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        return rock_rasters(self._world)

    @cached_property
    def _normals(self) -> NDArray[np.float32]:
        ground = self._world.ground
        return grid_normals(ground, ground).reshape(*ground.shape, 3)

    def _heights(self, z: NDArray[np.float32], description: str) -> Raster:
        if self._above_datum:
            z = above_datum(z, self._world.ground, self._world.site)
            description += ", above the datum"
        return Raster(grid=z, units="m", description=description)


def above_datum(z: NDArray[np.float32], ground: Heightfield, site: Site) -> NDArray[np.float32]:
    """Heights above the body's datum [m] of heights in the world at the ground's nodes [m]."""
    east, north = site.slope
    plane = site.datum_height + east * ground.east + (north * ground.north)[:, None]
    return (z + plane).astype(np.float32)
