"""Rocks beyond a world's border, for cameras and lidars, by the recipe's laws."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable, stage_key, uniforms
from terrain_forge.model import Bounds, Mesh, RockLibrary, Site
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.shapes.simplification import simplify

_MOST_VERTICES = 12_000
"""Rocks are drawn, those that look largest from the border first, until they have about as many."""
_SMALLEST = 0.1
"""Rocks below this diameter are not drawn [m]."""
_NEAR = 10.0
"""Distance from the border at which an eye is thought to stand [m]."""
_STRIPS = 12
_ANGLES = portable.power(2.0, np.arange(-320, 1) / 16.0)
"""Smallest diameters of drawn rocks over their distance from that eye, to choose from."""
_STEPS = 257
_DRAWS = 6
_LEVELS = (0.05, 0.25)
"""Diameters over their distance from that eye from which on rocks are drawn with the coarsest of
their shape's meshes, and with the next finer; smaller ones have `_FEWEST` corners."""
_FEWEST = 12
_FOOT = 0.4
"""Where the ground under a rock is looked at, as a part of its diameter from its middle."""
_FOOTING = 0.1
"""Part of its height by which a rock is sunk more, so that no daylight shows under it."""


class RocksBeyond(NamedTuple):
    """Rocks as one mesh."""

    mesh: Mesh
    """All of them, in the world frame [m]."""
    population: NDArray[np.int64]
    """Index of the population that each vertex is of, shape [vertices]."""
    draw: Array
    """A draw of 0 to 1 of each vertex's rock, for its tone, shape [vertices]."""
    number: int
    """How many rocks they are."""


class _Shape(NamedTuple):
    """A rock of plan diameter 1 that stands on z = 0."""

    vertices: Array
    faces: NDArray[np.int32]
    height: float

    @classmethod
    def of(cls, mesh: Mesh) -> _Shape:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        wide = 0.5 * float(high[0] - low[0] + high[1] - low[1])
        middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2])
        return cls((mesh.vertices - middle) / wide, mesh.faces, float(high[2] - low[2]) / wide)


def rocks_beyond(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    bounds: Bounds,
    width: float,
    reach: float,
    height_at: Callable[[Array, Array], Array],
) -> RocksBeyond:
    """Rocks in a belt around a world, as many as the populations' laws say.

    The farther from the border, the larger are the smallest, so that no line shows where the small
    ones end. They lie anywhere (Poisson): clusters, craters, images of density, zones and lists are
    of the site alone. They may touch each other.

    Args:
        site: The site.
        populations: The recipe's.
        library: The shapes.
        bounds: West, south, east, north edge of the world [m].
        width: Of the belt [m].
        reach: How far from the border there is ground [m]; no rock lies over its end.
        height_at: Height of the ground beyond at points east and north [m].
    """
    shapes = [_shape_levels(prototype.meshes) for prototype in library.prototypes]
    corners = np.mean([[len(level.vertices) for level in shape] for shape in shapes], axis=0)
    strips = _strips(populations, bounds, width, corners)
    vertices, faces, population, draw = [np.empty((0, 3))], [_NO_FACES], [_NO], [np.empty(0)]
    count = first = 0
    for number, spec in enumerate(populations):
        each = [_draw(site, spec, strip, bounds, n, reach) for n, strip in enumerate(strips)]
        drawn, away = np.concatenate(each), np.repeat([s.inner for s in strips], [*map(len, each)])
        foot = _FOOT * drawn[:, 2]
        around = [height_at(drawn[:, 0] + a * foot, drawn[:, 1] + b * foot) for a, b in _AROUND]
        ground = np.min(around, axis=0)
        which = np.minimum((drawn[:, 3] * len(shapes)).astype(np.int64), len(shapes) - 1)
        fineness = np.searchsorted(_LEVELS, drawn[:, 2] / (_NEAR + away), side="right")
        which = which * len(corners) + fineness
        for index in np.unique(which).tolist():
            chosen, shape = drawn[which == index], shapes[index // len(corners)]
            shape = shape[index % len(corners)]
            points = _placed(chosen, shape, spec, ground[which == index])
            starts = first + np.arange(len(chosen))[:, None, None] * points.shape[1]
            vertices.append(points.reshape(-1, 3))
            faces.append((starts + shape.faces).reshape(-1, 3))
            population.append(np.full(len(vertices[-1]), number))
            draw.append(np.repeat(chosen[:, 5], points.shape[1]))
            first += len(vertices[-1])
        count += len(drawn)
    return RocksBeyond(
        mesh=Mesh(vertices=np.concatenate(vertices), faces=np.concatenate(faces)),
        population=np.concatenate(population),
        draw=np.concatenate(draw),
        number=count,
    )


def _shape_levels(meshes: tuple[Mesh, ...]) -> tuple[_Shape, ...]:
    """A shape with few corners, with more, and with most."""
    levels = simplify(meshes[-1], _FEWEST), meshes[-1], meshes[max(len(meshes) - 2, 0)]
    return tuple(map(_Shape.of, levels))


class _Strip(NamedTuple):
    """A part of the belt all around."""

    inner: float
    outer: float
    """Its distances from the border [m]."""
    area: float
    """[m²]."""
    least: float
    """Diameter of the smallest rocks that are drawn in it [m]."""


def _strips(
    populations: tuple[PopulationSpec, ...], bounds: Bounds, width: float, corners: Array
) -> list[_Strip]:
    """The belt's strips with no more corners expected than are drawn."""
    west, south, east, north = bounds
    edges = width * (np.arange(_STRIPS + 1.0) / _STRIPS) ** 2
    inner, outer = edges[:-1], edges[1:]
    areas = 2.0 * (outer - inner) * (east - west + north - south + 2.0 * (outer + inner))

    finer = (_NEAR + inner)[:, None] * np.array([*_LEVELS, np.inf])

    def least(angle: float) -> Array:
        return np.asarray(np.maximum(angle * (_NEAR + inner), _SMALLEST))

    def too_many(angle: float) -> bool:
        sizes = least(angle)[:, None]
        edges = np.concatenate([sizes, np.maximum(finer, sizes)], axis=1)
        expected = 0.0
        for spec in populations:
            above = spec.size_frequency.cumulative_number(np.clip(edges, *spec.diameters))
            each = areas[:, None] * (above[:, :-1] - above[:, 1:])
            expected += float((each * corners).sum())
        return expected > _MOST_VERTICES

    chosen = _ANGLES[bisect_left(_ANGLES[:-1], True, key=lambda angle: not too_many(angle))]
    table = inner.tolist(), outer.tolist(), areas.tolist(), least(chosen).tolist()
    return [*map(_Strip, *table)]


def _between(spec: PopulationSpec, least: float) -> tuple[float, float]:
    low, high = spec.diameters
    return min(max(low, least), high), high


def _draw(
    site: Site, spec: PopulationSpec, strip: _Strip, bounds: Bounds, number: int, reach: float
) -> Array:
    """East, north, diameter [m], and three draws of 0 to 1, of each rock, shape [rocks, 6]."""
    low, high = _between(spec, strip.least)
    mean = strip.area * spec.density(low, high)
    key = stage_key(site.seed, f"horizon/{spec.name}/{number}")
    count = int(mean + uniforms(key, 1)[0])
    if not count or high <= low:
        return np.empty((0, _DRAWS))
    drawn = uniforms(key, 1 + _DRAWS * count)[1:].reshape(count, _DRAWS)
    sizes = portable.geomspace(low, high, _STEPS)
    law = spec.size_frequency
    above = law.cumulative_number(sizes)
    wanted = above[-1] + drawn[:, 2] * (above[0] - above[-1])
    size = np.interp(wanted, above[::-1], sizes[::-1])
    x, y = _around_bounds(drawn[:, :2], strip, bounds)
    west, south, east, north = bounds
    away = np.maximum(np.maximum(west - x, x - east), np.maximum(south - y, y - north))
    room = np.minimum(away, reach - away)
    return np.asarray(np.column_stack([x, y, size, drawn[:, 3:]])[room > 0.75 * size])


def _around_bounds(draws: Array, strip: _Strip, bounds: Bounds) -> tuple[Array, Array]:
    """Places spread evenly over a strip, of draws of 0 to 1, shape [places, 2]."""
    west, south, east, north = bounds
    deep = strip.inner + (strip.outer - strip.inner) * draws[:, 1]
    # In turn along the south, east, north and west, each with the corner at its end.
    wide, high = east - west + strip.inner + strip.outer, north - south + strip.inner + strip.outer
    along = draws[:, 0] * 2.0 * (wide + high)
    side = np.searchsorted([wide, wide + high, 2.0 * wide + high], along, side="right")
    begin = np.array([0.0, wide, wide + high, 2.0 * wide + high])[side]
    far = along - begin - strip.inner
    x = np.choose(side, [west + far, east + deep, east - far, west - deep])
    y = np.choose(side, [south - deep, south + far, north + deep, north - far])
    return x, y


def _placed(drawn: Array, shape: _Shape, spec: PopulationSpec, ground: Array) -> Array:
    """Vertices of rocks of one shape that are sunk into the ground, shape [rocks, vertices, 3]."""
    x, y, size = drawn[:, 0], drawn[:, 1], drawn[:, 2]
    low, high = spec.buried_fraction
    buried = _FOOTING + low + drawn[:, 4] * (high - low)
    bottom = ground - buried * size * shape.height
    half = portable.tan(np.pi * drawn[:, 5])[:, None]
    cosine, sine = (1.0 - half * half) / (1.0 + half * half), 2.0 * half / (1.0 + half * half)
    local = shape.vertices * size[:, None, None]
    return np.stack(
        [
            x[:, None] + cosine * local[:, :, 0] - sine * local[:, :, 1],
            y[:, None] + sine * local[:, :, 0] + cosine * local[:, :, 1],
            bottom[:, None] + local[:, :, 2],
        ],
        axis=-1,
    )


_NO = np.empty(0, np.int64)
_NO_FACES = np.empty((0, 3), np.int32)
_AROUND = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
