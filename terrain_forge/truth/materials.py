"""Which material the ground is where, as a raster of classes and a table."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.model import TileGrid, Window, World
from terrain_forge.writers import write_geotiff

MATERIALS = "materials.csv"
"""The table of the ground's materials."""
_SHARE = "share"


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
    raster, table, classes = folder / "material.tif", folder / MATERIALS, looks.material[part]
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


def merge_materials(tables: Iterable[tuple[Path, Window]], grid: TileGrid, path: Path) -> None:
    """Write the table of a site's materials from those of its tiles, with the cells of each."""
    rows: list[dict[str, str]] = []
    shares, whole = np.zeros(0), 0
    for table, window in tables:
        with table.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        nodes = math.prod(grid.nodes(window))
        own = np.rint(nodes * np.array([float(row[_SHARE]) for row in rows]))
        shares, whole = own if whole == 0 else shares + own, whole + nodes
    for row, share in zip(rows, shares, strict=True):
        row[_SHARE] = f"{share / whole:.6f}"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
