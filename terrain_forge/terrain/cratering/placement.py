"""Where craters lie: a Poisson process for each octave of diameters, the same in every window.

The lattice of an octave goes on for ever around the site's centre, so that craters reach in from
outside as they do anywhere. A crater is addressed by its octave, its cell and its number there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    inlined,
    kernel,
    mix,
    poisson,
    rectangle_distance,
    uniform,
    uniforms_at,
    zigzag,
)
from terrain_forge.terrain.cratering.degradation import REACH
from terrain_forge.terrain.cratering.population import Population

Rectangle = tuple[float, float, float, float]
"""West, south, east, north [m]."""

_CELL = 16.0
"""Side of a cell over the smallest diameter of its octave."""
_EAST, _NORTH, _SIZE, _AGE = range(4)


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
    """All craters of a population with an address that may show in an area, whatever their age."""
    drawn, table = [], population.table
    for octave, low, high in population.octaves:
        side = _CELL * 2.0**octave
        reach = 0.5 * REACH * min(high, population.diameters[1])
        grown = np.add(area, (-reach, -reach, reach, reach))
        first, last = (np.floor(end / side).astype(np.int64) for end in (grown[:2], grown[2:]))
        most, least = population.number(np.array([low, high]))
        address = np.uint64(mix(key, zigzag(octave)))
        ids, xy, numbers = _place_octave(address, first, last, side, most, least, table.number)
        drawn.append((ids, xy, _sizes(numbers, table.diameter, table.number)))
    ids, xy, diameter = (np.concatenate(column) for column in zip(*drawn, strict=True))
    smallest, largest = population.diameters
    kept = rectangle_distance(xy, area) < 0.5 * REACH * diameter
    kept &= (diameter >= smallest) & (diameter <= largest)
    ids, diameter = ids[kept], diameter[kept]
    chronology, age = population.chronology, population.production.age_ga
    gathered = uniforms_at(ids, _AGE) * population.part(diameter) * float(chronology.number(age))
    ages = age_of(gathered, age, chronology.burst, chronology.rate, chronology.steady)
    return Drawn(id=ids, xy=xy[kept], diameter=diameter, age=ages)


def expected_craters(population: Population, area: Rectangle) -> float:
    """Expected number of craters that may show in an area [m]."""
    west, south, east, north = area
    smallest, largest = population.diameters
    total = 0.0
    for _, low, high in population.octaves:
        low, high = max(low, smallest), min(high, largest)
        reached = (east - west + REACH * high) * (north - south + REACH * high)
        total += population.density(low, high) * reached
    return total


@kernel
def _place_octave(key, first, last, side, most, least, kept):  # type: ignore[no-untyped-def]
    """Addresses, places and numbers N(≥D) of the craters of a rectangle of cells.

    Those whose number is beyond the ends of `kept`, which falls, are left out.
    """
    mean = (most - least) * side * side
    total = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            cell = mix(mix(key, zigzag(i)), zigzag(j))
            for k in range(poisson(mix(mix(cell, 0), 0), mean)):
                total += kept[-1] <= _number(mix(cell, k + 1), most, least) <= kept[0]
    address, xy, number = np.empty(total, np.uint64), np.empty((total, 2)), np.empty(total)
    n = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            cell = mix(mix(key, zigzag(i)), zigzag(j))
            for k in range(poisson(mix(mix(cell, 0), 0), mean)):
                one = mix(cell, k + 1)
                wanted = _number(one, most, least)
                if kept[-1] <= wanted <= kept[0]:
                    address[n], number[n] = one, wanted
                    xy[n, 0] = (i + uniform(mix(one, _EAST))) * side
                    xy[n, 1] = (j + uniform(mix(one, _NORTH))) * side
                    n += 1
    return address, xy, number


@inlined
def _number(address, most, least):  # type: ignore[no-untyped-def]
    """N(≥D) of a crater, evenly drawn."""
    return most - uniform(mix(address, _SIZE)) * (most - least)


@kernel
def _sizes(wanted, diameter, number):  # type: ignore[no-untyped-def]
    """Diameters of numbers N(≥D) by inversion of the table."""
    found = np.empty(len(wanted))
    for n in range(len(wanted)):
        low, high = 0, len(number) - 1
        while high - low > 1:  # the last diameter whose number is not below the wanted one
            middle = (low + high) // 2
            if number[middle] >= wanted[n]:
                low = middle
            else:
                high = middle
        share = np.log(number[low] / wanted[n]) / np.log(number[low] / number[high])
        share = min(max(share, 0.0), 1.0)
        found[n] = diameter[low] * (diameter[high] / diameter[low]) ** share
    return found


@kernel
def age_of(number, oldest, burst, rate, steady):  # type: ignore[no-untyped-def]
    """Ages [10⁹ years] at which a chronology has reached numbers [1/km²]; none above `oldest`.

    Newton's method from above, where a convex rising function never overshoots.
    """
    ages = np.empty(len(number))
    for n in range(len(number)):
        age = min(number[n] / steady, oldest)
        for _ in range(60):
            grown = burst * np.exp(rate * age)
            step = (grown - burst + steady * age - number[n]) / (rate * grown + steady)
            if step <= 1e-13 * age:
                break
            age -= step
        ages[n] = max(age, 0.0)
    return ages
