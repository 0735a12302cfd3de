"""The truth bundle: everything that is known of a world, in formats that anything reads."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.model import World
from terrain_forge.truth.craters import write_craters
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.size_frequency import write_size_frequency
from terrain_forge.truth.tables import write_rocks
from terrain_forge.truth.traversability import write_traversability
from terrain_forge.writers import write_geotiff


def write_truth(world: World, directory: Path) -> list[Path]:
    """Write the ground, its rocks and the verification of them into `directory`/truth.

    Returns:
        The files.
    """
    truth = directory / "truth"
    truth.mkdir(parents=True, exist_ok=True)
    ground, site = world.ground, world.site
    top, rock_id = rock_rasters(world)

    surface = truth / "surface.tif"
    write_geotiff(
        surface, ground.elevation, world_ground=ground, site=site, description="bare ground"
    )
    surface_with_rocks = truth / "surface_with_rocks.tif"
    write_geotiff(
        surface_with_rocks, top, world_ground=ground, site=site, description="ground and rocks"
    )
    ids = truth / "rock_id.tif"
    write_geotiff(
        ids, rock_id, world_ground=ground, site=site, units="", nodata=-1,
        description="id of the rock on top, -1 where there is none",
    )  # fmt: skip
    rocks = truth / "rocks.csv"
    write_rocks(world, rocks)
    verification = write_size_frequency(world, truth, rock_id=rock_id)
    craters = write_craters(world, truth)
    rated = write_traversability(world, truth)
    return [surface, surface_with_rocks, ids, rocks, *verification, *craters, *rated]
