"""The table of all rocks, truth/rocks.csv, and columns that tables share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path

import numpy as np

from terrain_forge.base import Array
from terrain_forge.dtm import geographic_crs, transform
from terrain_forge.model import Site, World
from terrain_forge.writers import Column, quoted, write_table


def write_rocks(world: World, path: Path) -> None:
    """Write one row per rock whose centre lies in the window, ordered by id.

    World frame, SI units. x, y, z is the centre of mass; qw, qx, qy, qz turns the prototype's axes
    into the world's; diameter_m is the exposed plan diameter (mean of the largest width of the plan
    outline and the width across it); height_m is the top above the ground's tangent plane.
    Longitude (east, -180 to 180) and latitude follow where the site is georeferenced; latitude is
    that of the body's ellipsoid. Then, always: a_m, b_m, c_m, the rock's extents along its
    prototype's x, y and z axes; collision_parts, how many convex parts stand in for it (0 where it
    is visual-only); dynamic and collides, 1 where it can be pushed or touched.
    """
    write_table(path, rock_columns(world, quoted))


def rock_columns(world: World, word: Callable[[str], str]) -> list[Column]:
    """The columns of `write_rocks`, names of populations as `word` writes them."""
    rocks, shapes = world.field, world.library.prototypes
    names = np.array([word(name) for name in rocks.populations], dtype=object)
    stored = [f for f in fields(rocks) if "column" in f.metadata]
    columns = [
        Column(name="id", values=rocks.id, form="%d"),
        Column(name="population", values=names[rocks.population], form="%s"),
        Column(name="prototype", values=rocks.prototype, form="%d"),
        *columns_of(("x_m", "y_m", "z_m"), rocks.position.T, "%.7f"),
        *columns_of(("qw", "qx", "qy", "qz"), rocks.quaternion.T, "%.10f"),
        *(
            Column(
                name=f.metadata["column"], values=getattr(rocks, f.name), form=f.metadata["form"]
            )
            for f in stored
        ),
    ]
    extents = np.array([np.ptp(shape.meshes[0].vertices, axis=0) for shape in shapes])
    axes = extents.reshape(-1, 3)[rocks.prototype] * rocks.scale[:, None]
    parts = np.array([len(shape.hulls) for shape in shapes], np.int64)[rocks.prototype]
    return [
        *columns,
        *lonlat_columns(world.site, rocks.position[:, :2]),
        *columns_of(("a_m", "b_m", "c_m"), axes.T, "%.7f"),
        Column(name="collision_parts", values=parts * rocks.collides, form="%d"),
        Column(name="dynamic", values=rocks.dynamic, form="%d"),
        Column(name="collides", values=rocks.collides, form="%d"),
    ]


def lonlat_columns(site: Site, xy: Array) -> list[Column]:
    """Longitudes and latitudes [deg] of points [m] on the ellipsoid of a georeferenced site."""
    if not site.georeferenced:
        return []
    lonlat = transform(site.crs, geographic_crs(site.crs), *xy.T)
    return columns_of(("lon_deg", "lat_deg"), lonlat, "%.10f")


def columns_of(names: tuple[str, ...], values: Iterable[Array], form: str) -> list[Column]:
    """Columns of numbers that are written alike."""
    return [Column(name=n, values=v, form=form) for n, v in zip(names, values, strict=True)]
