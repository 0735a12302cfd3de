"""The truth bundle: everything that is known of a world, in formats that anything reads."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from terrain_forge.base import checked
from terrain_forge.model import World
from terrain_forge.paths import Traversability
from terrain_forge.truth.craters import write_craters
from terrain_forge.truth.materials import write_materials
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.size_frequency import write_size_frequency
from terrain_forge.truth.tables import write_rocks
from terrain_forge.truth.traversability import write_traversability
from terrain_forge.writers import write_geotiff


@checked
def write_truth(
    world: World,
    directory: Path,
    *,
    figures: bool = True,
    rated: Traversability | None = None,
) -> list[Path]:
    """Write the ground, its rocks and the verification of them into `directory`/truth.

    Args:
        world: The world.
        directory: Where `truth` is made.
        figures: Whether to draw the verification too.
        rated: What `rate_world` says of it, where that is known.

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
    files += write_materials(world, truth)
    rocks = truth / "rocks.csv"
    write_rocks(world, rocks)
    verification = write_size_frequency(world, truth, rock_id=rock_id, figure=figures)
    craters = write_craters(world, truth)
    maps = write_traversability(world, truth, rated)
    return [*files, rocks, *verification, *craters, *maps]
