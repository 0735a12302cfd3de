"""How densely rocks lie around craters: the sum over those whose rocks reach a place.

A grid knows which craters reach each of its cells, so that a place asks a few of them and not all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel

RIM_FALL = 0.7
"""Distance [crater radii] over which the density of a crater's rocks falls to 1/e outside its rim.

This and the next three: synthterrain (NASA Ames); no publication is known."""
FARTHEST = 2.0
"""Distance of a crater's farthest rocks from its centre [crater radii]."""
INTERIOR = 0.05
"""Density of rocks within a crater over that at its rim."""
LIFETIME = 4.0
"""Age of a crater that has no rocks left [10⁹ years]."""

_FINEST, _EACH = 1024, 64
"""Cells of the grid each way, and cells that know of a crater on the mean, at most."""


class Throwers(NamedTuple):
    """The craters of some populations, and where their rocks lie."""

    crater: Array
    """East, north, radius [m], strength and largest diameter [m], shape [craters, 5]."""
    first: NDArray[np.int64]
    """Where a population's craters begin, shape [populations + 1]."""
    bounds: Array
    """West, south, east, north edge of the grid [m], shape [4]."""
    cells: int
    """Its rows and columns."""
    entry: NDArray[np.int64]
    """Where the craters that reach a cell begin in `reaching`, row by row, shape
    [populations, cells² + 1]."""
    reaching: NDArray[np.int64]
    """Craters by population and cell, in their own order, shape [entries]."""


def throwers(tables: list[Array], bounds: Array) -> Throwers:
    """Craters by where their rocks lie.

    Args:
        tables: Of each population the rows of `Throwers.crater`.
        bounds: West, south, east, north edge of all that will be asked for [m], shape [4].
    """
    crater = np.concatenate([np.zeros((0, 5)), *tables])
    first = np.cumsum([0, *map(len, tables)])
    cells = int(np.clip(len(crater) ** 0.5, 1, _FINEST))
    while True:
        entry = _count_reaching(crater, first, bounds, cells)
        if cells == 1 or entry[-1, -1] <= _EACH * len(crater):
            break
        cells //= 2
    return Throwers(
        crater=crater,
        first=first,
        bounds=bounds,
        cells=cells,
        entry=entry,
        reaching=_list_reaching(crater, first, bounds, cells, entry),
    )


@kernel
def densities(thrown, xy):  # type: ignore[no-untyped-def]
    """`density_around` of the first population's smallest rocks at places [m], shape [places]."""
    found = np.empty(len(xy))
    for n in range(len(xy)):
        found[n] = density_around(thrown, 0, xy[n, 0], xy[n, 1], 0.0)
    return found


@inner
def density_around(thrown, population, x, y, diameter):  # type: ignore[no-untyped-def]
    """Density of a population's rocks of a diameter at a place [m], over that of its law."""
    found = 0.0
    column, row = _cell(x, y, thrown.bounds, thrown.cells)
    cell = row * thrown.cells + column
    for n in range(thrown.entry[population, cell], thrown.entry[population, cell + 1]):
        east, north, radius, strength, largest = thrown.crater[thrown.reaching[n]]
        if diameter <= largest:
            away = np.sqrt((x - east) * (x - east) + (y - north) * (y - north)) / radius
            found += strength * profile(away)
    return found


@inner
def profile(away):  # type: ignore[no-untyped-def]
    """Density of rocks at a distance in crater radii, over that at the rim."""
    if away <= 1.0:
        return INTERIOR
    return np.exp((1.0 - away) / RIM_FALL) if away <= FARTHEST else 0.0


@inner
def _cell(x, y, bounds, cells):  # type: ignore[no-untyped-def]
    """Column and row of the cell that holds a place, the outermost ones for those beyond."""
    column = int(np.floor((x - bounds[0]) / (bounds[2] - bounds[0]) * cells))
    row = int(np.floor((y - bounds[1]) / (bounds[3] - bounds[1]) * cells))
    return min(max(column, 0), cells - 1), min(max(row, 0), cells - 1)


@inner
def _reached(one, bounds, cells):  # type: ignore[no-untyped-def]
    """First and last column, first and last row that a crater's rocks reach, rounding included."""
    reach = FARTHEST * one[2] * (1.0 + 1e-9)
    first = _cell(one[0] - reach, one[1] - reach, bounds, cells)
    last = _cell(one[0] + reach, one[1] + reach, bounds, cells)
    return first[0], last[0], first[1], last[1]


@kernel
def _count_reaching(crater, first, bounds, cells):  # type: ignore[no-untyped-def]
    """`Throwers.entry`."""
    entry = np.zeros((len(first) - 1, cells * cells + 1), np.int64)
    total = 0
    for population in range(len(first) - 1):
        for n in range(first[population], first[population + 1]):
            west, east, south, north = _reached(crater[n], bounds, cells)
            for row in range(south, north + 1):
                for column in range(west, east + 1):
                    entry[population, row * cells + column + 1] += 1
        for cell in range(cells * cells + 1):
            total += entry[population, cell]
            entry[population, cell] = total
    return entry


@kernel
def _list_reaching(crater, first, bounds, cells, entry):  # type: ignore[no-untyped-def]
    """`Throwers.reaching`."""
    reaching, place = np.empty(entry.max() if entry.size else 0, np.int64), entry.copy()
    for population in range(len(first) - 1):
        for n in range(first[population], first[population + 1]):
            west, east, south, north = _reached(crater[n], bounds, cells)
            for row in range(south, north + 1):
                for column in range(west, east + 1):
                    cell = row * cells + column
                    reaching[place[population, cell]] = n
                    place[population, cell] += 1
    return reaching
