"""How well a map shows the ground and its rocks: errors of its points, and a landing site's score.

The score is that of the Lunar Autonomy Challenge (2025): a grid of 0.15 m, whose true heights are
means of 16 rays from above, whose cells hold a rock if one of these meets it. A cell is right
within 0.05 m, rocks are judged by F1, and what was not mapped is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Progress, silent
from terrain_forge.evaluation.map_files import MapPoints
from terrain_forge.evaluation.score import Spread, spread
from terrain_forge.model import World
from terrain_forge.scene import GROUND, MISSED, open_scene

CELL, RIGHT = 0.15, 0.05
"""Size of a cell, and the error within which its height is right [m]."""
POINTS = 300.0
"""What the challenge gives for a whole map, and as many for all rocks."""
_RAYS = 4
"""Rays of a cell each way."""
_MOST = 20_000_000
"""Cells of a grid."""

Area = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class SiteGrid:
    """What is true of the cells of a landing site."""

    area: Area
    """West, south, east, north [m]."""
    cell: float
    """Size of a cell [m]."""
    height: Array
    """Mean height of what is seen from above [m], shape [rows, columns]; rows run north."""
    rock: NDArray[np.bool_]
    """Which cells hold a rock, shape [rows, columns]."""


@dataclass(frozen=True, kw_only=True)
class MapScore:
    """How well a map shows a site."""

    name: str
    """The map's."""
    area: Area
    """West, south, east, north of what was scored [m]."""
    cell: float
    """Size of a cell [m]."""
    points: int
    """Its points within the area."""
    outside: int
    """Its points elsewhere."""
    bias: float | None
    """Mean of its heights over the ground where no rock is [m]."""
    vertical: Spread | None
    """Distances to the ground below or above where no rock is [m]."""
    on_rocks: int
    """Its points in cells that hold a rock, of which the two above say nothing."""
    cells: int
    """Cells of the area."""
    mapped: float
    """Part of them that has a height, 0 to 1."""
    right: float
    """Part of all cells whose height is right, 0 to 1: the challenge's figure for the map."""
    cell_errors: Spread | None
    """Errors of the heights of mapped cells [m]."""
    rocks: int
    """Cells that hold a rock."""
    precision: float | None
    """Part of the flagged cells that hold one; None without flags."""
    recall: float | None
    """Part of the cells with a rock that are flagged; None without flags."""
    f1: float | None
    """Their harmonic mean: the challenge's figure for rocks; None without flags or rocks."""

    @property
    def challenge(self) -> tuple[float, float]:
        """Points of the challenge, for the map and for rocks, of 300 each."""
        return POINTS * self.right, POINTS * (self.f1 or 0.0)


def site_grid(
    world: World, *, area: Area | None = None, cell: float = CELL, progress: Progress = silent
) -> SiteGrid:
    """The true heights and rock flags of a grid.

    Args:
        world: The world.
        area: West, south, east, north [m]; the whole site by default.
        cell: Size of a cell [m].
        progress: Told of the share that is done.

    Raises:
        DataError: for an area that is empty, or not within the site.
    """
    bounds = world.ground.bounds
    west, south, east, north = area or bounds
    if not cell > 0.0:
        raise DataError(f"cells of {cell:g} m: must be larger than 0")
    inside = west >= bounds[0] and south >= bounds[1] and east <= bounds[2] and north <= bounds[3]
    columns, rows = (
        int((high - low) / cell + 1e-6) if inside else 0
        for low, high in ((west, east), (south, north))
    )
    if min(columns, rows) < 1 or columns * rows > _MOST:
        told = ", ".join(f"{value:g}" for value in bounds)
        raise DataError(
            f"area {west:g}, {south:g}, {east:g}, {north:g}, cells of {cell:g} m: must be west, "
            f"south, east, north within the site ({told}), of 1 to {_MOST:,} cells"
        )
    within = (np.arange(_RAYS) + 0.5) / _RAYS
    heights = np.zeros((rows, columns))
    rock = np.zeros((rows, columns), np.bool_)
    x = west + cell * (np.arange(columns)[:, None] + within).ravel()
    top = float(world.ground.elevation.max()) + 100.0
    with open_scene(world) as scene:
        for row in range(rows):
            progress("site", row / rows)
            y = south + cell * (row + within)
            places = np.stack(np.broadcast_arrays(x, y[:, None], top), axis=-1).reshape(-1, 3)
            hits = scene.cast(places, (0.0, 0.0, -1.0), coherent=True)
            met = hits.rock.reshape(_RAYS, columns, _RAYS)
            z = np.where(hits.rock == MISSED, np.nan, top - hits.distance.astype(np.float64))
            heights[row] = z.reshape(_RAYS, columns, _RAYS).mean(axis=(0, 2))
            rock[row] = (met > GROUND).any(axis=(0, 2))
    return SiteGrid(
        area=(west, south, west + columns * cell, south + rows * cell), cell=cell, height=heights,
        rock=rock,
    )  # fmt: skip


def score_map(world: World, found: MapPoints, grid: SiteGrid | None = None) -> MapScore:
    """Compare a map in the world's frame with the world.

    Where several points lie in a cell, its height is their mean, and it is flagged if most are.

    Args:
        world: The world.
        found: The map.
        grid: What is true; by default that of the whole site.
    """
    grid = grid or site_grid(world)
    rows, columns = grid.rock.shape
    west, south, *_ = grid.area
    cells = np.floor((found.position[:, :2] - (west, south)) / grid.cell + 1e-9)
    inside = ((cells >= 0) & (cells < (columns, rows))).all(axis=1)
    places = found.position[inside]
    column, row = cells[inside].astype(np.int64).T
    number = row * columns + column
    count = np.bincount(number, minlength=rows * columns)
    mapped = count > 0
    height = np.full(rows * columns, np.nan)
    total = np.bincount(number, places[:, 2], minlength=rows * columns)
    height[mapped] = total[mapped] / count[mapped]
    errors = np.abs(height - grid.height.ravel())
    off = _over_ground(world, places, grid.rock[row, column])
    flags: dict[str, float | None] = {"precision": None, "recall": None, "f1": None}
    if found.rock is not None:
        votes = np.bincount(number, found.rock[inside], minlength=rows * columns)
        flags = _judged(votes > 0.5 * count, grid.rock.ravel())
    return MapScore(
        name=found.name,
        area=grid.area,
        cell=grid.cell,
        points=len(places),
        outside=int((~inside).sum()),
        bias=float(off.mean()) if len(off) else None,
        vertical=spread(np.abs(off)),
        on_rocks=int(grid.rock[row, column].sum()),
        cells=rows * columns,
        mapped=float(mapped.mean()),
        right=float((errors < RIGHT).mean()),
        cell_errors=spread(errors[np.isfinite(errors)]),
        rocks=int(grid.rock.sum()),
        **flags,
    )


def _over_ground(world: World, places: Array, on_rock: NDArray[np.bool_]) -> Array:
    """How far points are over the ground [m], those in cells with a rock left out."""
    there = places[~on_rock]
    there = there[world.ground.covers(there[:, 0], there[:, 1])]
    return np.asarray(there[:, 2] - world.ground.height_at(there[:, 0], there[:, 1]))


def _judged(said: NDArray[np.bool_], true: NDArray[np.bool_]) -> dict[str, float | None]:
    """Precision, recall and F1 of flags; None where there is nothing to judge."""
    right, told, there = int((said & true).sum()), int(said.sum()), int(true.sum())
    return {
        "precision": right / told if told else None,
        "recall": right / there if there else None,
        "f1": 2.0 * right / (told + there) if there else None,
    }
