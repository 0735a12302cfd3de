"""The exposed diameter of many resting rocks, each from the few points that can decide it.

A rock stands upright on its tangent plane, so what of it is exposed depends on the plane's height
alone, and how it is seen from above on a tilt of at most `MAX_TILT`. For each of many brackets of
that height this keeps the vertices that are the outermost ones in some direction that such a tilt
can make level, and the edges that cross the plane where its cut is outermost; and once more what
can decide on the gentle tilts that most rocks have, which is less than half as much. Directions are
sampled so closely that 96 % of all diameters are exact, and the others off by 0.1 % at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, kernel_threads, remembered, worker_threads
from terrain_forge.model import RockPrototype
from terrain_forge.rocks.embedding.outline import MAX_TILT, edges, exposed_diameter, mean_width

DEEPEST = 0.9
"""Largest part of a rock's extent below its tangent plane that exposures are known for."""

_BRACKETS = 36
_THINNEST = 5e-4
_AZIMUTHS = 120
_ELEVATIONS = 25
_TILTS = 2  # gentle, up to a third of `MAX_TILT`, and any
_GENTLE = np.cos(MAX_TILT / 3.0)
_BURIALS = np.linspace(0.0, DEEPEST, 10)
_UPRIGHT = np.eye(3)
_UP = (0.0, 0.0, 1.0)


class Exposure(NamedTuple):
    """What decides the exposed diameters of prototypes."""

    low: Array
    """Lowest vertex of each prototype, shape [prototypes]."""
    span: Array
    """Height of each prototype, shape [prototypes]."""
    vertices: Array
    """Vertices that can be outermost, prototype by prototype, on gentle tilts, then on any, bracket
    by bracket from the lowest, shape [vertices, 3]."""
    first_vertex: NDArray[np.int64]
    """Where the vertices of each bracket begin, shape [prototypes · 2 · brackets + 1]."""
    edges: Array
    """Both ends of the edges whose crossings can be outermost, shape [edges, 6]."""
    first_edge: NDArray[np.int64]
    """Where the edges of each bracket begin, shape [prototypes · 2 · brackets + 1]."""
    upright: Array
    """Exposed diameter of each prototype on level ground, buried by 0 to `DEEPEST` in even steps,
    shape [prototypes, steps]."""


def exposure(prototypes: Sequence[RockPrototype]) -> Exposure:
    """What decides the exposed diameters of prototypes, of which there may be none."""
    with worker_threads(kernel_threads()) as pool:
        found = list(pool.map(_outermost, prototypes))
    vertices = [np.empty((0, 3)), *(rows for points, _ in found for rows in points)]
    crossings = [np.empty((0, 6)), *(rows for _, lines in found for rows in lines)]
    heights = [prototype.meshes[0].vertices[:, 2] for prototype in prototypes]
    return Exposure(
        low=np.array([height.min() for height in heights]),
        span=np.array([np.ptp(height) for height in heights]),
        vertices=np.concatenate(vertices),
        first_vertex=np.cumsum([*map(len, vertices)]),
        edges=np.concatenate(crossings),
        first_edge=np.cumsum([*map(len, crossings)]),
        upright=np.array([*map(_upright, prototypes)]).reshape(-1, len(_BURIALS)),
    )


@remembered
def _outermost(prototype: RockPrototype) -> tuple[list[Array], list[Array]]:
    """Vertices, and edges by their two ends, that can be outermost, by tilt and bracket."""
    mesh = prototype.meshes[0]
    points = mesh.vertices[np.argsort(-mesh.vertices[:, 2], kind="stable")]
    lines = mesh.vertices[edges(mesh)].reshape(-1, 6)
    low, span = points[-1, 2], points[0, 2] - points[-1, 2]
    borders = low + span * np.linspace(0.0, DEEPEST, _BRACKETS + 1)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    elevation = np.linspace(-MAX_TILT, MAX_TILT, _ELEVATIONS)[:, None]
    level = np.cos(elevation)
    parts = np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation))
    # Directions that a tilt of up to `MAX_TILT` can make level.
    directions = np.stack([part.ravel() for part in parts], axis=-1)
    marked = _outermost_vertices(points, borders, directions)
    crossed = _outermost_crossings(points, lines, np.union1d(points[:, 2], borders), borders)
    return [points[row] for row in marked], [lines[row] for row in crossed]


@remembered
def _upright(prototype: RockPrototype) -> list[float]:
    points, lines = prototype.meshes[0].vertices.copy(), edges(prototype.meshes[0])
    levels = points[:, 2].min() + np.ptp(points[:, 2]) * _BURIALS
    return [float(exposed_diameter(points, lines, _UPRIGHT, _UP, level)) for level in levels]


@kernel
def _outermost_vertices(points, borders, directions):  # type: ignore[no-untyped-def]
    """Which points, highest first, are outermost of all those above some plane in each bracket.

    First on gentle tilts, then on any, shape [tilts · brackets, points].
    """
    brackets = len(borders) - 1
    marked = np.zeros((_TILTS * brackets, len(points)), dtype=np.bool_)
    for d in range(len(directions)):
        x, y, z = directions[d]
        gentle = x * x + y * y >= _GENTLE * _GENTLE - 1e-9
        largest, outermost, bracket = -np.inf, -1, brackets
        for n in range(len(points)):
            # What is outermost above a bracket counts in it until another point takes over.
            while bracket > 0 and points[n, 2] < borders[bracket]:
                bracket -= 1
                marked[bracket, outermost] |= gentle
                marked[brackets + bracket, outermost] = True
            along = x * points[n, 0] + y * points[n, 1] + z * points[n, 2]
            if along > largest:
                largest, outermost = along, n
                if bracket < brackets:
                    marked[bracket, n] |= gentle
                    marked[brackets + bracket, n] = True
    return marked


@kernel
def _outermost_crossings(points, lines, heights, borders):  # type: ignore[no-untyped-def]
    """Which lines cross some plane of each bracket at an outermost point of its cut.

    Cuts run between `heights`, which ascend: those of the vertices, since each changes which lines
    are cut, and the borders of the brackets. On gentle tilts, which come first, only those count
    that are not behind a vertex above the plane, `points` from the highest.
    """
    brackets = len(borders) - 1
    marked = np.zeros((_TILTS * brackets, len(lines)), dtype=np.bool_)
    cut, line = np.empty((len(lines), 2)), np.empty(len(lines), dtype=np.int64)
    beyond, above = np.full(_AZIMUTHS, -np.inf), 0
    lean = np.sqrt(1.0 - _GENTLE * _GENTLE) / _GENTLE
    thinnest = _THINNEST * (heights[-1] - heights[0])
    over, bracket = heights[-1], brackets
    for n in range(len(heights) - 2, -1, -1):
        if over - heights[n] < thinnest:
            continue
        level = 0.5 * (over + heights[n])
        over = heights[n]
        while above < len(points) and points[above, 2] >= level:
            for a in range(_AZIMUTHS):
                x, y = np.cos(2.0 * np.pi * a / _AZIMUTHS), np.sin(2.0 * np.pi * a / _AZIMUTHS)
                along = x * points[above, 0] + y * points[above, 1] - lean * points[above, 2]
                beyond[a] = max(beyond[a], along)
            above += 1
        while bracket > 0 and level < borders[bracket]:
            bracket -= 1
        if bracket == brackets:
            continue
        found = 0
        for e in range(len(lines)):
            if (lines[e, 2] >= level) != (lines[e, 5] >= level):
                cut[found, 0], cut[found, 1] = _crossing(lines[e], level)
                line[found] = e
                found += 1
        for a in range(_AZIMUTHS):
            x, y = np.cos(2.0 * np.pi * a / _AZIMUTHS), np.sin(2.0 * np.pi * a / _AZIMUTHS)
            largest, outermost = -np.inf, 0
            for c in range(found):
                along = x * cut[c, 0] + y * cut[c, 1]
                if along > largest:
                    largest, outermost = along, c
            marked[bracket, line[outermost]] |= largest - lean * level >= beyond[a]
            marked[brackets + bracket, line[outermost]] = True
    return marked


@inner
def _crossing(line, level):  # type: ignore[no-untyped-def]
    """Where a line crosses a level, in the prototype's x and y."""
    part = (level - line[2]) / (line[5] - line[2])
    return line[0] + part * (line[3] - line[0]), line[1] + part * (line[4] - line[1])


@inner
def upright_width(exposure, p, level):  # type: ignore[no-untyped-def]
    """Exposed diameter of a prototype on level ground, roughly."""
    steps = exposure.upright.shape[1] - 1
    place = (level - exposure.low[p]) / (exposure.span[p] * DEEPEST) * steps
    n = min(max(int(place), 0), steps - 1)
    part = min(place - n, 1.0)
    return (1.0 - part) * exposure.upright[p, n] + part * exposure.upright[p, n + 1]


@inner
def exposed_width(exposure, p, axes, upright, level):  # type: ignore[no-untyped-def]
    """Exposed diameter of a prototype, turned as `plan_axes` has it, above a level of its z.

    `upright` is the cosine of its tilt.
    """
    place = (level - exposure.low[p]) / (exposure.span[p] * DEEPEST) * _BRACKETS
    bracket = (p * _TILTS + (upright < _GENTLE)) * _BRACKETS
    bracket += min(max(int(place), 0), _BRACKETS - 1)
    first, last = exposure.first_vertex[bracket], exposure.first_vertex[bracket + 1]
    begin, end = exposure.first_edge[bracket], exposure.first_edge[bracket + 1]
    points = np.empty((last - first + end - begin + 1, 2))
    found = 0
    for n in range(first, last):
        x, y, z = exposure.vertices[n]
        points[found, 0] = axes[0] * x + axes[1] * y + axes[2] * z
        points[found, 1] = axes[3] * x + axes[4] * y + axes[5] * z
        found += z >= level
    for n in range(begin, end):
        if (exposure.edges[n, 2] >= level) != (exposure.edges[n, 5] >= level):
            x, y = _crossing(exposure.edges[n], level)
            points[found, 0] = axes[0] * x + axes[1] * y + axes[2] * level
            points[found, 1] = axes[3] * x + axes[4] * y + axes[5] * level
            found += 1
    return mean_width(points[:found])
