"""Clusters of rocks: the parent points of a Thomas process, and the rocks that each of them has.

Thomas 1949, doi:10.1093/biomet/36.1-2.18; as a point process: Illian et al. 2008, Statistical
Analysis and Modelling of Spatial Point Patterns, §6.3. Parents are a Poisson process of their own,
addressed on a lattice that begins at the site's south-western corner, and reach beyond the site, so
that it is as dense at its border as within.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, kernel, mix, poisson, uniform, zigzag
from terrain_forge.model import Site
from terrain_forge.rocks.arrangement import Clustered

TRUNCATION = 4.0
"""No rock is farther from its parent than this many standard deviations (1 in 3000 would be)."""
MAX_CLUSTERS = 2**20
"""Parents of a population; more of them look like no clusters at all."""

_PARENTS_PER_CELL = 16.0
_RANGE, _ANGLE = 1, 2


class Parents(NamedTuple):
    """The parent points of a population, those off the site too whose rocks may lie on it."""

    xy: Array
    """East and north [m], shape [parents, 2]."""
    address: NDArray[np.uint64]
    """Hashed address, shape [parents]."""


def parents(arrangement: Clustered, *, site: Site, key: np.uint64, where: Key = ()) -> Parents:
    """All parents, by their population's key, whose rocks may lie on the site.

    Raises:
        RecipeError: if they are too many; `where` is the population's place in the recipe.
    """
    reach = TRUNCATION * arrangement.radius_m
    low = np.array([site.west, site.south]) - reach
    high = -low
    count = arrangement.clusters_per_m2 * float(np.prod(high - low))
    if count > MAX_CLUSTERS:
        raise RecipeError(
            f"{count:.3g} clusters on the site and {reach:g} m around it, at most "
            f"{MAX_CLUSTERS:.3g}",
            key=(*where, "arrangement", "clusters_per_m2"),
        )
    side = (_PARENTS_PER_CELL / arrangement.clusters_per_m2) ** 0.5
    corner = np.array([site.west, site.south])
    first = np.floor((low - corner) / side).astype(np.int64)
    last = np.floor((high - corner) / side).astype(np.int64)
    own = np.uint64(mix(key, 0))
    xy, address = _draw_parents(own, first, last, corner, side, _PARENTS_PER_CELL)
    near = np.all((xy >= low) & (xy <= high), axis=1)
    return Parents(xy=xy[near], address=address[near])


@kernel
def _draw_parents(key, first, last, corner, side, mean):  # type: ignore[no-untyped-def]
    total = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            total += poisson(mix(mix(mix(key, zigzag(i)), zigzag(j)), 0), mean)
    xy, address = np.empty((total, 2)), np.empty(total, dtype=np.uint64)
    n = 0
    for j in range(first[1], last[1] + 1):
        for i in range(first[0], last[0] + 1):
            cell = mix(mix(key, zigzag(i)), zigzag(j))
            for k in range(poisson(mix(cell, 0), mean)):
                address[n] = mix(cell, k + 1)
                xy[n, 0] = corner[0] + (i + uniform(mix(address[n], 0))) * side
                xy[n, 1] = corner[1] + (j + uniform(mix(address[n], 1))) * side
                n += 1
    return xy, address


@kernel
def numbers(address, key, mean):  # type: ignore[no-untyped-def]
    """Poisson number of rocks of a size class that each parent has, shape [parents]."""
    counts = np.zeros(len(address), dtype=np.int64)
    for p in range(len(address)):
        counts[p] = poisson(mix(mix(mix(key, address[p]), 0), 0), mean)
    return counts


@kernel
def offspring(found, counts, key, radius):  # type: ignore[no-untyped-def]
    """Rocks of some parents, in order: addresses, and places [m] of shape [rocks, 2].

    `radius` is the standard deviation of their distance from the parent, east and north [m].
    """
    total = counts.sum()
    address, xy = np.empty(total, dtype=np.uint64), np.empty((total, 2))
    held = 1.0 - np.exp(-0.5 * TRUNCATION * TRUNCATION)
    n = 0
    for p in range(len(counts)):
        parent = mix(mix(key, found.address[p]), 1)
        for k in range(counts[p]):
            address[n] = mix(parent, k)
            away = radius * np.sqrt(-2.0 * np.log(1.0 - held * uniform(mix(address[n], _RANGE))))
            angle = 2.0 * np.pi * uniform(mix(address[n], _ANGLE))
            xy[n, 0] = found.xy[p, 0] + away * np.cos(angle)
            xy[n, 1] = found.xy[p, 1] + away * np.sin(angle)
            n += 1
    return address, xy
