"""The truth bundle: everything that is known of a world, in formats that anything reads."""

from __future__ import annotations

import csv
from functools import partial
from pathlib import Path

import numpy as np

from terrain_forge.model import World
from terrain_forge.truth.craters import write_craters
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.size_frequency import write_size_frequency
from terrain_forge.truth.tables import write_rocks
from terrain_forge.truth.traversability import write_traversability
from terrain_forge.writers import write_geotiff


def _write_materials(world: World, truth: Path) -> list[Path]:
    """Write which material the ground is where, and what the materials are; none without any."""
    looks = world.appearance
    if looks.material is None:
        return []
    raster, table = truth / "material.tif", truth / "materials.csv"
    write_geotiff(
        raster,
        looks.material,
        world_ground=world.ground,
        site=world.site,
        units="",
        description="material of the ground",
        classes=[(material.name, material.rgb) for material in looks.materials],
    )
    count = np.bincount(looks.material.reshape(-1), minlength=len(looks.materials))
    with table.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["class", "name", "kind", "friction", "share"])
        for n, one in enumerate(looks.materials):
            share = f"{count[n] / looks.material.size:.6f}"
            rows.writerow([n, one.name, one.kind, f"{one.friction:g}", share])
    return [raster, table]


def write_truth(world: World, directory: Path, *, figures: bool = True) -> list[Path]:
    """Write the ground, its rocks and the verification of them into `directory`/truth.

    Args:
        world: The world.
        directory: Where `truth` is made.
        figures: Whether to draw the verification too.

    Returns:
        The files.
    """
    truth = directory / "truth"
    truth.mkdir(parents=True, exist_ok=True)
    top, rock_id = rock_rasters(world)
    files = [truth / f"{name}.tif" for name in ("surface", "surface_with_rocks", "rock_id")]
    write = partial(write_geotiff, world_ground=world.ground, site=world.site)
    write(files[0], world.ground.elevation, description="bare ground")
    write(files[1], top, description="ground and rocks")
    about = "id of the rock on top, -1 where there is none"
    write(files[2], rock_id, units="", nodata=-1, description=about)
    files += _write_materials(world, truth)
    rocks = truth / "rocks.csv"
    write_rocks(world, rocks)
    verification = write_size_frequency(world, truth, rock_id=rock_id, figure=figures)
    craters = write_craters(world, truth)
    rated = write_traversability(world, truth)
    return [*files, rocks, *verification, *craters, *rated]
