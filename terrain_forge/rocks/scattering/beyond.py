"""Rocks beyond a world's border: simple shapes for the eye and for lidars, by the recipe's laws."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable, stage_key, uniforms
from terrain_forge.model import Bounds, Mesh, RockLibrary, Site
from terrain_forge.rocks.populations import PopulationSpec

_MOST = 800
"""Rocks that are drawn at most: the largest ones."""
_SMALLEST = 0.1
"""Rocks below this diameter are not drawn [m]."""
_STEPS = 257
_DRAWS = 6
_FOOT = 0.4
"""Where the ground under a rock is looked at, as a part of its diameter from its middle."""
_FOOTING = 0.1
"""Part of its height by which a rock is sunk more, so that no daylight shows under it."""
_UPRIGHT = 1.6
"""Height of a simple shape, which has no lower half, over that of the upper half."""
_LUMPS = 0.2
"""By which part of its distance from the middle a corner may lie farther out or in."""
_CORNERS = 0.92
"""How far out the corners of the simple shape lie, as a part of the shape's own extent there."""


class RocksBeyond(NamedTuple):
    """Rocks as one mesh."""

    mesh: Mesh
    """All of them, in the world frame [m]."""
    population: NDArray[np.int64]
    """Index of the population that each vertex is of, shape [vertices]."""
    tone: Array
    """How much lighter or darker than its population each vertex is, shape [vertices]."""
    number: int
    """How many rocks they are."""


def rocks_beyond(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    bounds: Bounds,
    width: float,
    height_at: Callable[[Array, Array], Array],
) -> RocksBeyond:
    """The largest rocks in a belt around a world, as many as the populations' laws say.

    They lie anywhere (Poisson): clusters, craters, images of density, zones and lists are of the
    site alone. They may touch each other.

    Args:
        site: The site.
        populations: The recipe's.
        library: The shapes.
        bounds: West, south, east, north edge of the world [m].
        width: Of the belt [m].
        height_at: Height of the ground beyond at points east and north [m].
    """
    west, south, east, north = bounds
    area = (east - west + 2.0 * width) * (north - south + 2.0 * width)
    belt = area - (east - west) * (north - south)
    least = _least(populations, belt)
    shapes = [simple_shape(p.meshes[-1].vertices) for p in library.prototypes]
    vertices, faces, population, tone = [np.empty((0, 3))], [_FACES[:0]], [_NO], [np.empty(0)]
    count = 0
    for number, spec in enumerate(populations):
        drawn = _draw(site, spec, least, area, bounds, width)
        if not len(drawn):
            continue
        shape = np.minimum((drawn[:, 3] * len(shapes)).astype(np.int64), len(shapes) - 1)
        jitter = uniforms(stage_key(site.seed, f"horizon/{spec.name}/shape"), len(drawn) * _EACH)
        lumps = 1.0 + _LUMPS * (2.0 * jitter.reshape(-1, _EACH, 1) - 1.0)
        points = _placed(drawn, np.array(shapes)[shape] * lumps, spec, height_at)
        first = (count + np.arange(len(drawn)))[:, None, None] * _EACH
        vertices.append(points.reshape(-1, 3))
        faces.append((first + _FACES).reshape(-1, 3))
        population.append(np.full(points.shape[0] * points.shape[1], number))
        tone.append(np.repeat(0.75 + 0.5 * drawn[:, 5], points.shape[1]))
        count += len(drawn)
    return RocksBeyond(
        mesh=Mesh(vertices=np.concatenate(vertices), faces=np.concatenate(faces)),
        population=np.concatenate(population),
        tone=np.concatenate(tone),
        number=count,
    )


def _least(populations: tuple[PopulationSpec, ...], area: float) -> float:
    """Diameter [m] above which no more rocks are expected than are drawn."""
    largest = max((spec.diameters[1] for spec in populations), default=_SMALLEST)
    sizes = portable.geomspace(_SMALLEST, max(largest, 1.001 * _SMALLEST), _STEPS)
    expected = [
        sum(area * spec.density(*_between(spec, size)) for spec in populations)
        for size in sizes.tolist()
    ]
    return float(sizes[min(int(np.sum(np.array(expected) > _MOST)), len(sizes) - 1)])


def _between(spec: PopulationSpec, least: float) -> tuple[float, float]:
    low, high = spec.diameters
    return min(max(low, least), high), high


def _draw(
    site: Site, spec: PopulationSpec, least: float, area: float, bounds: Bounds, width: float
) -> Array:
    """East, north, diameter [m], and three draws of 0 to 1, of each rock, shape [rocks, 6]."""
    low, high = _between(spec, least)
    mean = area * spec.density(low, high)
    key = stage_key(site.seed, f"horizon/{spec.name}")
    count = int(mean + uniforms(key, 1)[0])
    if not count or high <= low:
        return np.empty((0, _DRAWS))
    drawn = uniforms(key, 1 + _DRAWS * count)[1:].reshape(count, _DRAWS)
    sizes = portable.geomspace(low, high, _STEPS)
    law = spec.size_frequency
    above = np.array([float(law.cumulative_number(size)) for size in sizes.tolist()])
    wanted = above[-1] + drawn[:, 2] * (above[0] - above[-1])
    size = np.interp(wanted, above[::-1], sizes[::-1])
    west, south, east, north = bounds
    x = west - width + drawn[:, 0] * (east - west + 2.0 * width)
    y = south - width + drawn[:, 1] * (north - south + 2.0 * width)
    away = np.maximum(np.maximum(west - x, x - east), np.maximum(south - y, y - north))
    clear = (away > 0.75 * size) & (away < width)
    return np.asarray(np.column_stack([x, y, size, drawn[:, 3:]])[clear])


def _placed(
    drawn: Array, shapes: Array, spec: PopulationSpec, height_at: Callable[[Array, Array], Array]
) -> Array:
    """Vertices of rocks that are sunk into the ground, shape [rocks, vertices, 3]."""
    x, y, size = drawn[:, 0], drawn[:, 1], drawn[:, 2]
    foot = _FOOT * size
    around = [height_at(x + a * foot, y + b * foot) for a, b in _AROUND]
    low, high = spec.buried_fraction
    tall = size * np.ptp(shapes[:, :, 2], axis=1)
    buried = _FOOTING + low + drawn[:, 4] * (high - low)
    bottom = np.min(around, axis=0) - buried * tall
    half = portable.tan(np.pi * drawn[:, 5])[:, None]
    cosine, sine = (1.0 - half * half) / (1.0 + half * half), 2.0 * half / (1.0 + half * half)
    local = shapes * size[:, None, None]
    lowest = local[:, :, 2].min(axis=1)
    return np.stack(
        [
            x[:, None] + cosine * local[:, :, 0] - sine * local[:, :, 1],
            y[:, None] + sine * local[:, :, 0] + cosine * local[:, :, 1],
            (bottom - lowest)[:, None] + local[:, :, 2],
        ],
        axis=-1,
    )


def simple_shape(vertices: Array) -> Array:
    """A shape of 13 corners, open below, about as wide and high as another, of plan diameter 1."""
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    out = ((vertices - middle)[:, None, :] * _DIRECTIONS).sum(axis=-1).max(axis=0)
    corners = _CORNERS * out[:, None] * _DIRECTIONS
    wide = 0.5 * float(np.ptp(corners[:, 0]) + np.ptp(corners[:, 1]))
    return np.asarray(corners / wide * (1.0, 1.0, _UPRIGHT))


def _sphere() -> tuple[Array, NDArray[np.int32]]:
    """Corners and faces of the upper half of an octahedron whose edges are halved once."""
    corners = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]
    points = [np.array(corner, np.float64) for corner in corners]
    faces, middles = [], dict[tuple[int, ...], int]()

    def between(a: int, b: int) -> int:
        pair = tuple(sorted((a, b)))
        if pair not in middles:
            middles[pair] = len(points)
            points.append((points[a] + points[b]) * 0.5**0.5)
        return middles[pair]

    ring = (0, 2, 1, 3, 0)
    for a, b in pairwise(ring):
        u, v, w = between(a, b), between(b, 4), between(4, a)
        faces += [(a, u, w), (u, b, v), (w, v, 4), (u, v, w)]
    return np.array(points), np.array(faces, np.int32)


_DIRECTIONS, _FACES = _sphere()
_EACH = len(_DIRECTIONS)
_NO = np.empty(0, np.int64)
_AROUND = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
