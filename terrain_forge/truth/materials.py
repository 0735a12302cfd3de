"""Which material the ground is where, as a raster of classes and a table."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.model import World
from terrain_forge.writers import write_geotiff


def write_materials(
    world: World,
    folder: Path,
    *,
    ground: Any = None,
    part: tuple[slice, slice] = (slice(None), slice(None)),
) -> list[Path]:
    """Write material.tif and materials.csv; none where the recipe has no materials.

    Args:
        world: The world.
        folder: Where to.
        ground: The ground of a `part` of the nodes, of which a tile's rasters are.
        part: Rows and columns of it.

    Returns:
        The files.
    """
    looks = world.appearance
    if looks.material is None:
        return []
    raster, table, classes = folder / "material.tif", folder / "materials.csv", looks.material[part]
    write_geotiff(
        raster,
        classes,
        world_ground=world.ground if ground is None else ground,
        site=world.site,
        units="",
        description="material of the ground",
        classes=[(material.name, material.rgb) for material in looks.materials],
        cloud_optimized=ground is not None,
    )
    count = np.bincount(classes.reshape(-1), minlength=len(looks.materials))
    with table.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["class", "name", "kind", "friction", "share"])
        for n, one in enumerate(looks.materials):
            share = f"{count[n] / classes.size:.6f}"
            rows.writerow([n, one.name, one.kind, f"{one.friction:g}", share])
    return [raster, table]
