"""Cells: how a class of rocks divides the site, and which of them a window depends on.

All that chance gives a rock is hashed by its address: the cell, its number there and what is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import kernel, mix, poisson
from terrain_forge.model import Site

Rectangle = tuple[float, float, float, float]
"""West, south, east, north [m]."""

SIZE, EAST, NORTH, PROTOTYPE, YAW, BURIED, RETRY, KEEP = range(8)
"""What is drawn for a rock: the last word of its address."""

_ROCKS_PER_CELL, _FEWEST_PER_CELL = 200.0, 1e-3
_DIAMETERS_PER_CELL = 40.0
_RADII_PER_CELL = 3.0
_RINGS = 3


@dataclass(frozen=True, kw_only=True)
class Cells:
    """The cells that divide the site for a class of rocks."""

    radius: float
    """Radius [m] of the largest rock's circle."""
    columns: int
    """Cells of the site from west to east."""
    rows: int
    """Cells of the site from south to north."""
    side: tuple[float, float]
    """Size of a cell, east and north [m]."""
    split: int
    """Bins that a cell is cut into each way, of about one rock each."""
    local: bool = False
    """Whether rocks look for a free place around their first one, not all over their cell."""

    @property
    def area(self) -> float:
        """Area of a cell [m²]."""
        return self.side[0] * self.side[1]

    def of(self, xy: NDArray[np.float64], site: Site) -> NDArray[np.int64]:
        """Column and row of the cells that hold places on the site [m], shape [places, 2]."""
        found = np.floor((xy - (site.west, site.south)) / self.side).astype(np.int64)
        return np.clip(found, 0, (self.columns - 1, self.rows - 1))

    def covering(self, area: Rectangle, site: Site) -> Region:
        """The cells that a part of the site [m] touches, and one more around."""
        first = self.of(np.array([area[:2]]), site)[0] - 1
        last = self.of(np.array([area[2:]]), site)[0] + 1
        first, last = np.maximum(first, 0), np.minimum(last, (self.columns - 1, self.rows - 1))
        return Region(*first.tolist(), *(last + 1 - first).tolist())

    def home(
        self, xy: NDArray[np.float64], region: Region, site: Site
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which places [m] lie in a region, ordered by cell, and their cells, row by row."""
        column, row = (self.of(xy, site) - (region.column, region.row)).T
        inside = (column >= 0) & (column < region.columns) & (row >= 0) & (row < region.rows)
        inside &= np.all(np.abs(xy) <= (-site.west, -site.south), axis=1)
        cell, kept = row * region.columns + column, np.flatnonzero(inside)
        kept = kept[np.argsort(cell[kept], kind="stable")]
        return kept, cell[kept]


class Region(NamedTuple):
    """A rectangle of the cells of a class."""

    column: int
    """First cell, from the west."""
    row: int
    """First cell, from the south."""
    columns: int
    """Cells from west to east."""
    rows: int
    """Cells from south to north."""

    def cut(self, grid: NDArray[Any]) -> NDArray[Any]:
        """The region's part of a grid of all cells, shape [rows, columns]."""
        return grid[self.row : self.row + self.rows, self.column : self.column + self.columns]

    def rectangle(self, cells: Cells, site: Site) -> Rectangle:
        """The ground that the cells cover [m]."""
        width, depth = cells.side
        west, south = site.west + self.column * width, site.south + self.row * depth
        return west, south, west + self.columns * width, south + self.rows * depth


def divide(
    site: Site, *, density: float, diameter: float, radius: float, largest: float, local: bool
) -> tuple[Cells, Cells]:
    """The cells for a density [1/m²] of rocks up to a diameter and a circle's radius [m].

    A cell must be wider than two rocks, so that cells of one colour are independent. It is large
    enough for its rocks to find places in it, even where larger rocks crowd it or chance gives it
    more than its share, and no larger, so that a window depends on little around it.

    Args:
        site: The site.
        density: Rocks on a square metre, by the law.
        diameter: Of the largest rock of the class [m].
        radius: Of the largest rock's circle [m].
        largest: Radius [m] of a circle that holds any rock of the site.
        local: As of `Cells`.

    Returns:
        Cells to draw the rocks by, which do not depend on other rocks, and cells to place them in,
        which no rock of the site fills.
    """
    wide = _DIAMETERS_PER_CELL * diameter
    if density * wide**2 > _ROCKS_PER_CELL:
        wide = (_ROCKS_PER_CELL / density) ** 0.5
    elif density * wide**2 < _FEWEST_PER_CELL:  # a few rocks of a micrometre, and cells as small
        wide = (_FEWEST_PER_CELL / density) ** 0.5 if density > 0.0 else max(site.size)
    wider = _RADII_PER_CELL * largest
    drawing = _divide(site, wide, density, radius, local)
    return drawing, drawing if wide >= wider else _divide(site, wider, density, radius, local)


def _divide(site: Site, wide: float, density: float, radius: float, local: bool) -> Cells:
    """Cells of about a width [m] that is made to divide the site evenly."""
    columns, rows = (
        max(min(round(length / wide), int(length / (4.0 * radius))), 1) for length in site.size
    )
    sides = site.size[0] / columns, site.size[1] / rows
    return Cells(
        radius=radius,
        columns=columns,
        rows=rows,
        side=sides,
        split=max(int((density * sides[0] * sides[1]) ** 0.5), 1),
        local=local,
    )


def regions(classes: list[Cells], window: Rectangle, site: Site) -> list[Region]:
    """The cells of each class that the rocks of a window [m] depend on.

    From the smallest class to the largest: what can reach into the window, or into the cells that
    smaller classes need, and around it three more rings of cells, since a cell of the last colour
    depends on its neighbours of the third, these on theirs of the second, these on the first.
    """
    found: list[Region] = []
    needed: list[tuple[Rectangle, float]] = [(window, 0.0)]
    for cells in reversed(classes):
        margins = np.array([radius + cells.radius for _, radius in needed])[:, None]
        areas = np.array([area for area, _ in needed])
        lows, highs = (areas[:, :2] - margins).min(axis=0), (areas[:, 2:] + margins).max(axis=0)
        last = np.array([cells.columns, cells.rows]) - 1
        corner = site.west, site.south
        first = np.clip(np.floor((lows - corner) / cells.side) - _RINGS, 0, last).astype(int)
        end = np.clip(np.floor((highs - corner) / cells.side) + _RINGS, 0, last).astype(int) + 1
        region = Region(*first.tolist(), *(end - first).tolist())
        found.append(region)
        needed.append((region.rectangle(cells, site), cells.radius))
    return found[::-1]


@kernel
def cell_counts(key, means):  # type: ignore[no-untyped-def]
    """Poisson number of rocks in each cell of a class, by their expected numbers, of one shape."""
    rows, columns = means.shape
    counts = np.empty((rows, columns), dtype=np.int64)
    for j in range(rows):
        for i in range(columns):
            counts[j, i] = poisson(mix(mix(mix(key, i), j), 0), means[j, i])
    return counts


@kernel
def region_counts(key, column, row, columns, rows, mean, most):  # type: ignore[no-untyped-def]
    """As `cell_counts` of a region that begins at (column, row), no more than `most` each."""
    counts = np.empty((rows, columns), dtype=np.int64)
    for j in range(rows):
        for i in range(columns):
            cell = mix(mix(key, column + i), row + j)
            counts[j, i] = min(poisson(mix(cell, 0), mean), most)
    return counts


@kernel
def addresses(key, column, row, counts):  # type: ignore[no-untyped-def]
    """Hashed addresses of the rocks of a region of cells that begins at (column, row)."""
    found = np.empty(counts.sum(), dtype=np.uint64)
    n = 0
    for j in range(counts.shape[0]):
        for i in range(counts.shape[1]):
            cell = mix(mix(key, column + i), row + j)
            for k in range(counts[j, i]):
                found[n] = mix(cell, k + 1)
                n += 1
    return found


@kernel
def words(address, what):  # type: ignore[no-untyped-def]
    """Extend each address by what is drawn there."""
    found = np.empty(len(address), dtype=np.uint64)
    for n in range(len(address)):
        found[n] = mix(address[n], what)
    return found
