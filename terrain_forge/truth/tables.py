"""The table of all rocks, truth/rocks.csv."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array
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
    is visual-only); dynamic and solid, 1 where it can be pushed or touched.
    """
    rocks, shapes = world.field, world.library.prototypes
    names = np.array([quoted(name) for name in rocks.populations], dtype=object)
    columns = [
        Column(name="id", values=rocks.id, form="%d"),
        Column(name="population", values=names[rocks.population], form="%s"),
        Column(name="prototype", values=rocks.prototype, form="%d"),
        *_columns(("x_m", "y_m", "z_m"), rocks.position.T, "%.7f"),
        *_columns(("qw", "qx", "qy", "qz"), rocks.quaternion.T, "%.10f"),
        Column(name="diameter_m", values=rocks.diameter, form="%.7f"),
        Column(name="height_m", values=rocks.height, form="%.7f"),
        Column(name="buried_fraction", values=rocks.buried_fraction, form="%.7f"),
        Column(name="volume_m3", values=rocks.volume, form="%.9g"),
        Column(name="mass_kg", values=rocks.mass, form="%.9g"),
    ]
    if world.site.georeferenced:
        lonlat = geographic(world.site, rocks.position[:, 0], rocks.position[:, 1])
        columns += _columns(("lon_deg", "lat_deg"), lonlat, "%.10f")
    extents = np.array([np.ptp(shape.meshes[0].vertices, axis=0) for shape in shapes])
    axes = extents.reshape(-1, 3)[rocks.prototype] * rocks.scale[:, None]
    parts = np.array([len(shape.hulls) for shape in shapes], np.int64)[rocks.prototype]
    columns += [
        *_columns(("a_m", "b_m", "c_m"), axes.T, "%.7f"),
        Column(name="collision_parts", values=parts * rocks.collides, form="%d"),
        Column(name="dynamic", values=rocks.dynamic, form="%d"),
        Column(name="collides", values=rocks.collides, form="%d"),
    ]
    write_table(path, columns)


def geographic(site: Site, east: Array, north: Array) -> tuple[Array, Array]:
    """Longitudes and latitudes [deg] of points [m] of a georeferenced site on its ellipsoid."""
    from rasterio.crs import CRS
    from rasterio.warp import transform

    local = CRS.from_wkt(site.crs)
    parameters: dict[str, Any] = local.to_dict()
    figure = {name: parameters[name] for name in _FIGURE if name in parameters}
    ellipsoidal = CRS.from_dict({"proj": "longlat", "no_defs": True, **figure})
    longitude, latitude = transform(local, ellipsoidal, east, north)
    return np.asarray(longitude), np.asarray(latitude)


_FIGURE = ("R", "a", "b", "rf", "ellps", "datum")
"""The PROJ parameters that give the figure of the body."""


def _columns(names: tuple[str, ...], values: Any, form: str) -> list[Column]:
    return [Column(name=n, values=v, form=form) for n, v in zip(names, values, strict=True)]
