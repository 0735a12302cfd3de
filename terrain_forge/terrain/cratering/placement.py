"""Where craters lie: a Poisson process for each octave of diameters, the same in every window.

The lattice of an octave goes on for ever around the site's centre, so that craters reach in from
outside as they do anywhere. A crater is addressed by its octave, its cell and its number there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.kernels import kernel
from terrain_forge.seeds import mix, poisson, uniform, zigzag
from terrain_forge.terrain.cratering.chronology import age_of
from terrain_forge.terrain.cratering.degradation import REACH
from terrain_forge.terrain.cratering.population import Population

Array = NDArray[np.float64]
Rectangle = tuple[float, float, float, float]
"""West, south, east, north [m]."""

_CELL = 16.0
"""Side of a cell over the smallest diameter of its octave."""
_EAST, _NORTH, _SIZE, _AGE = range(4)
_BATCH = 256.0


class Drawn(NamedTuple):
    """Craters that chance has made."""

    id: NDArray[np.uint64]
    """Hashed address, shape [craters]."""
    xy: Array
    """East and north of the centre [m], shape [craters, 2]."""
    diameter: Array
    """Diameter [m], shape [craters]."""
    age: Array
    """Age [10⁹ years], shape [craters]."""


def draw_craters(population: Population, *, key: np.uint64, area: Rectangle) -> Drawn:
    """All craters of a population that may show in an area, whatever their age.

    Args:
        population: How many of which size.
        key: Address of the population.
        area: The ground that is asked about [m].
    """
    parts = []
    for octave, low, high in population.octaves:
        side, reach = _CELL * 2.0**octave, 0.5 * REACH * high
        grown = np.add(area, (-reach, -reach, reach, reach))
        first, last = (
            np.floor(corner / side).astype(np.int64) for corner in (grown[:2], grown[2:])
        )
        mean = population.density(low, high) * side**2
        parts.append(_draw_octave(np.uint64(mix(key, zigzag(octave))), first, last, side, mean))
    numbers = [len(found) for found, _ in parts]
    ids, xy = (np.concatenate(column) for column in zip(*parts, strict=True))
    ends = np.array([population.number(np.array(c[1:])) for c in population.octaves])
    most, least = (np.repeat(column, numbers) for column in ends.T)
    diameter, part = _draw_sizes(ids, most, least, *population.table)
    chronology, age = population.chronology, population.production.age_ga
    gathered = _uniforms(ids, _AGE) * part * float(chronology.number(age))
    ages = age_of(gathered, age, chronology.burst, chronology.rate, chronology.steady)
    near = _near(xy, 0.5 * REACH * diameter, np.array(area))
    return Drawn(id=ids[near], xy=xy[near], diameter=diameter[near], age=ages[near])


def expected_craters(population: Population, area: Rectangle) -> float:
    """Expected number of craters that may show in an area [m]."""
    west, south, east, north = area
    return sum(
        population.density(low, high)
        * (east - west + REACH * high)
        * (north - south + REACH * high)
        for _, low, high in population.octaves
    )


def _near(xy: Array, reach: Array, area: Array) -> NDArray[np.bool_]:
    """Which circles touch an area."""
    away = np.maximum(np.maximum(area[:2] - xy, xy - area[2:]), 0.0)
    found: NDArray[np.bool_] = np.hypot(away[:, 0], away[:, 1]) < reach
    return found


@kernel
def _draw_octave(key, first, last, side, mean):  # type: ignore[no-untyped-def]
    """Addresses and places of the craters of a rectangle of cells."""
    total = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            total += _count(mix(mix(key, zigzag(i)), zigzag(j)), mean)
    address, xy = np.empty(total, dtype=np.uint64), np.empty((total, 2))
    n = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            cell = mix(mix(key, zigzag(i)), zigzag(j))
            for k in range(_count(cell, mean)):
                address[n] = mix(cell, k + 1)
                xy[n, 0] = (i + uniform(mix(address[n], _EAST))) * side
                xy[n, 1] = (j + uniform(mix(address[n], _NORTH))) * side
                n += 1
    return address, xy


@kernel
def _count(cell, mean):  # type: ignore[no-untyped-def]
    """Poisson number of a cell, as a sum of such numbers where exp would underflow."""
    batches = int(np.ceil(mean / _BATCH))
    count = 0
    for b in range(batches):
        count += poisson(mix(mix(cell, 0), b), mean / batches)
    return count


@kernel
def _draw_sizes(address, most, least, diameter, number, part):  # type: ignore[no-untyped-def]
    """Diameters by inversion of the table, and the part that is left of each size."""
    found, left = np.empty(len(address)), np.empty(len(address))
    for n in range(len(address)):
        wanted = most[n] - uniform(mix(address[n], _SIZE)) * (most[n] - least[n])
        low, high = 0, len(number) - 1
        while high - low > 1:  # the last diameter whose number is not below the wanted one
            middle = (low + high) // 2
            if number[middle] >= wanted:
                low = middle
            else:
                high = middle
        share = np.log(number[low] / wanted) / np.log(number[low] / number[high])
        share = min(max(share, 0.0), 1.0)
        found[n] = diameter[low] * (diameter[high] / diameter[low]) ** share
        left[n] = part[low] + share * (part[high] - part[low])
    return found, left


@kernel
def _uniforms(address, what):  # type: ignore[no-untyped-def]
    drawn = np.empty(len(address))
    for n in range(len(address)):
        drawn[n] = uniform(mix(address[n], what))
    return drawn
