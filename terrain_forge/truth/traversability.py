"""Traversability as truth: slope, steps and cost for the recipe's rover, as GeoTIFF and ROS map."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import image_rows
from terrain_forge.model import Heightfield, Site, Trajectory, World, merge
from terrain_forge.paths import (
    IMPASSABLE,
    UNKNOWN,
    Traversability,
    survey_path,
    traversability,
)
from terrain_forge.truth.tables import columns_of
from terrain_forge.writers import write_geotiff, write_table

OCCUPIED, FREE = 0.65, 0.196
"""Thresholds of darkness as map_saver writes them: above the first a cell is occupied, below the
second it is free."""
BLACK, GREY, WHITE = 0, 205, 254
"""Pixels of occupied, unknown and free cells, as map_saver writes them."""
RAW_UNKNOWN = 255
"""Pixel of an unknown cell in mode `raw`, where 0 to 100 are costs."""
_FINEST = {"slope": 2.0**-8, "step": 2.0**-13, "cost": 2.0**-10}
"""What the rasters' values are rounded to [deg, m, 1], since noise does not compress."""


def write_traversability(
    world: World, truth: Path, rated: Traversability | None = None
) -> list[Path]:
    """Write the rasters, the map and what each path meets into the folder `truth`.

    Slope [deg], step [m] and cost (0 to 1, where the rover cannot be) are GeoTIFFs of the ground's
    nodes, -1 where the border is too near. A window whose site goes on beyond it does not know the
    cost within reach of what may stand there.

    Returns:
        The files; none for a rover without wheels.
    """
    if not world.rover.wheels:
        return []
    field = rated or rate_world(world)
    files = write_rasters(field, truth, ground=world.ground, site=world.site)
    files += write_map(field, truth / "map")
    whole = [(slice(None), world, field)]
    return files + [write_surroundings(path, whole, truth / "paths") for path in world.trajectories]


def write_rasters(
    field: Traversability,
    truth: Path,
    *,
    ground: Heightfield,
    site: Site,
    part: tuple[slice, slice] = (slice(None), slice(None)),
    cloud_optimized: bool = False,
) -> list[Path]:
    """Write slope, step and cost of a part of a field, which are the nodes of a ground."""
    rasters = {
        "slope": (np.where(field.slope < 0.0, field.slope, np.degrees(field.slope)), "deg",
                  "slope of the plane under the rover's footprint"),
        "step": (field.step, "m", "step of ground and rocks within a wheel's reach"),
        "cost": (field.cost, "", "cost for the rover's centre, 1 where it cannot be"),
    }  # fmt: skip
    files = []
    for name, (grid, units, description) in rasters.items():
        files.append(truth / f"{name}.tif")
        finest = np.float32(_FINEST[name])
        write_geotiff(
            files[-1],
            np.rint(grid[part] / finest) * finest,
            world_ground=ground,
            site=site,
            units=units,
            nodata=UNKNOWN,
            description=description,
            cloud_optimized=cloud_optimized,
        )
    return files


def rate_world(world: World) -> Traversability:
    """What a world's ground and rocks mean to its rover."""
    part, whole = world.window, world.site.window
    return traversability(
        ground=world.ground,
        rocks=merge(world.field, world.neighbours),
        library=world.library,
        rover=world.rover,
        cut_sides=(
            part.column > 0,
            part.row > 0,
            part.column + part.columns < whole.columns,
            part.row + part.rows < whole.rows,
        ),
    )


def write_map(field: Traversability, folder: Path) -> list[Path]:
    """Write two maps as Nav2's and ROS 1's map_server read them; returns their files.

    map.yaml tells free, occupied and unknown cells (mode `trinary`), cost.yaml costs of 0 to 100
    and unknown cells (mode `raw`). One cell per node, the first image row north.
    """
    folder.mkdir(exist_ok=True)
    unknown, barred = field.cost < 0.0, field.cost >= IMPASSABLE
    cells = np.select([unknown, barred], [GREY, BLACK], WHITE)
    costs = np.where(unknown, RAW_UNKNOWN, np.rint(100.0 * field.cost))
    west, south = (edge - 0.5 * field.spacing for edge in field.origin)
    files = []
    for name, mode, values in (("map", "trinary", cells), ("cost", "raw", costs)):
        pixels: NDArray[np.uint8] = image_rows(values.astype(np.uint8))
        rows, columns = pixels.shape
        image, text = folder / f"{name}.pgm", folder / f"{name}.yaml"
        image.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes())
        text.write_text(
            f"image: {image.name}\nmode: {mode}\nresolution: {field.spacing!r}\n"
            f"origin: [{west!r}, {south!r}, 0.0]\nnegate: 0\n"
            f"occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n",
            encoding="utf-8",
        )
        files += [image, text]
    return files


def write_surroundings(
    path: Trajectory,
    parts: Iterable[tuple[slice, World, Traversability]],
    folder: Path,
) -> Path:
    """Write NAME.csv for a path: what the rover meets at its samples; returns the file.

    Columns: time, place, tilt of the ground, step under the wheels, clearance of the rover's centre
    and gap of its rectangle to what it does not go over (at most a little more than it needs), and
    cost. Each part of the path's samples comes with the world around it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = [_meetings(path, part, world, field) for part, world, field in parts]
    figures = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    file = folder / f"{path.name}.csv"
    write_table(file, columns_of(tuple(figures), figures.values(), "%.4f"))
    return file


def _meetings(
    path: Trajectory, part: slice, world: World, field: Traversability
) -> dict[str, NDArray[np.float64]]:
    """What the rover meets at the samples of a part of a path."""
    met = survey_path(
        path, ground=world.ground, obstacles=field.obstacles, rover=world.rover, part=part
    )
    place = path.position[met.sample, :2]
    column, row = np.rint((place - field.origin) / field.spacing).astype(np.int64).T
    return {
        "time_s": path.time[met.sample],
        "x_m": place[:, 0],
        "y_m": place[:, 1],
        "tilt_deg": np.degrees(met.tilt),
        "step_m": met.step,
        "clearance_m": field.clearance[row, column],
        "gap_m": met.gap,
        "cost": field.cost[row, column],
    }
