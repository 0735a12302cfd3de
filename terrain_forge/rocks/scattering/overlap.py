"""Which rocks overlap, seen from above: an exact test of their plan outlines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, over_chunks, remembered
from terrain_forge.model import RockField, RockLibrary, RockPrototype, World, merge, rotations
from terrain_forge.rocks.embedding.outline import convex_hull


class Overlaps(NamedTuple):
    """The overlaps of a world, in pairs of ids."""

    scattered: list[tuple[int, int]]
    """Pairs of which at least one rock was not listed by the user."""
    listed: list[tuple[int, int]]
    """Pairs of listed rocks, which lie as they are listed."""


def find_overlaps(world: World, *, lists: Sequence[str]) -> Overlaps:
    """Overlapping pairs in which a rock of the world's window takes part.

    Args:
        world: The world; rocks that reach into its window count too.
        lists: Names of the populations that the user listed rock by rock.
    """
    everyone = merge(world.field, world.neighbours)
    own = set(world.field.id.tolist()) if len(world.neighbours) else None
    chosen = [name in lists for name in everyone.populations]
    listed = set(everyone.id[np.array(chosen, np.bool_)[everyone.population]].tolist())
    pairs = overlapping_pairs(everyone, world.library)
    pairs = [pair for pair in pairs if own is None or not own.isdisjoint(pair)]
    return Overlaps(
        scattered=[pair for pair in pairs if not listed.issuperset(pair)],
        listed=[pair for pair in pairs if listed.issuperset(pair)],
    )


def overlapping_pairs(field: RockField, library: RockLibrary) -> list[tuple[int, int]]:
    """Ids of rocks whose plan outlines overlap, the smaller id of a pair first.

    An outline is the convex hull of the whole rock seen from above, buried parts too, so that rocks
    whose outlines are apart are apart themselves. Circles around the centres of mass settle most
    pairs, a line across the line between the centres most others, and the separating axis theorem
    (an edge of one outline parts two convex outlines that are apart) the rest.

    Args:
        field: The rocks.
        library: Their shapes.
    """
    outer = [_corners(prototype) for prototype in library.prototypes]
    largest = np.array([np.linalg.norm(v, axis=1).max() for v in outer])
    rocks = _Rocks(
        centre=field.position[:, :2].copy(),
        plan=rotations(field)[:, :2] * field.scale[:, None, None],
        prototype=field.prototype,
        vertices=np.concatenate(outer),
        first_vertex=np.cumsum([0, *map(len, outer)]),
    )
    radius = largest[field.prototype] * field.scale
    order = np.argsort(rocks.centre[:, 0] - radius, kind="stable")
    centre, radius = rocks.centre[order], radius[order]
    near = np.empty((_circles(centre, radius, np.empty((0, 2), np.int64)), 2), np.int64)
    _circles(centre, radius, near)
    near = order[near]
    overlap = np.zeros(len(near), np.bool_)
    over_chunks(_overlap, len(near), near, rocks, overlap)
    found = np.sort(field.id[near[overlap]], axis=1)
    return sorted((int(one), int(other)) for one, other in found)


@remembered
def _corners(prototype: RockPrototype) -> Array:
    """The corners of a shape's convex hull, which are all that an outline can have."""
    from scipy.spatial import ConvexHull

    vertices = prototype.meshes[0].vertices
    return np.asarray(vertices[ConvexHull(vertices).vertices])


class _Rocks(NamedTuple):
    """The rocks' shapes and how each is seen from above."""

    centre: Array
    """East and north of the centres of mass [m], shape [rocks, 2]."""
    plan: Array
    """From a prototype's axes to east and north [m], shape [rocks, 2, 3]."""
    prototype: NDArray[np.int32]
    vertices: Array
    """The prototypes' outer vertices, one prototype after the other."""
    first_vertex: NDArray[np.int64]


@kernel
def _circles(centre, radius, pairs):  # type: ignore[no-untyped-def]
    """Number of pairs of circles, west to east, that meet; `pairs` takes as many as it holds."""
    count = 0
    for i in range(len(radius)):
        east = centre[i, 0] + radius[i]
        j = i + 1
        while j < len(radius) and centre[j, 0] - radius[j] <= east:
            dx, dy = centre[j, 0] - centre[i, 0], centre[j, 1] - centre[i, 1]
            limit = radius[i] + radius[j]
            if dx * dx + dy * dy <= limit * limit:
                if count < len(pairs):
                    pairs[count, 0], pairs[count, 1] = i, j
                count += 1
            j += 1
    return count


@kernel
def _overlap(first, last, pairs, rocks, overlap):  # type: ignore[no-untyped-def]
    for n in range(first, last):
        a, b = pairs[n, 0], pairs[n, 1]
        dx = rocks.centre[b, 0] - rocks.centre[a, 0]
        dy = rocks.centre[b, 1] - rocks.centre[a, 1]
        if _support(rocks, a, dx, dy) + _support(rocks, b, -dx, -dy) < dx * dx + dy * dy:
            continue
        one, other = _outline(rocks, a, 0.0, 0.0), _outline(rocks, b, dx, dy)
        overlap[n] = not (_parts(one, other) or _parts(other, one))


@inner
def _support(rocks, rock, x, y):  # type: ignore[no-untyped-def]
    """How far a rock reaches from its centre along a direction, times the direction's length."""
    plan, shape = rocks.plan[rock], rocks.prototype[rock]
    a, b = x * plan[0, 0] + y * plan[1, 0], x * plan[0, 1] + y * plan[1, 1]
    c = x * plan[0, 2] + y * plan[1, 2]
    farthest = -np.inf
    for v in range(rocks.first_vertex[shape], rocks.first_vertex[shape + 1]):
        p, q, r = rocks.vertices[v]
        farthest = max(farthest, a * p + b * q + c * r)
    return farthest


@inner
def _outline(rocks, rock, x, y):  # type: ignore[no-untyped-def]
    """Convex plan outline of a rock whose centre is moved to a place, counter-clockwise."""
    plan, shape = rocks.plan[rock], rocks.prototype[rock]
    first, last = rocks.first_vertex[shape], rocks.first_vertex[shape + 1]
    points = np.empty((last - first, 2))
    for n in range(last - first):
        p, q, r = rocks.vertices[first + n]
        points[n, 0] = plan[0, 0] * p + plan[0, 1] * q + plan[0, 2] * r + x
        points[n, 1] = plan[1, 0] * p + plan[1, 1] * q + plan[1, 2] * r + y
    return convex_hull(points)


@inner
def _parts(one, other):  # type: ignore[no-untyped-def]
    """Whether an edge of one convex outline has all of the other beyond it."""
    for n in range(len(one)):
        x, y = one[n, 0], one[n, 1]
        following = n + 1 if n + 1 < len(one) else 0
        out_x, out_y = one[following, 1] - y, x - one[following, 0]
        nearest = np.inf
        for m in range(len(other)):
            nearest = min(nearest, (other[m, 0] - x) * out_x + (other[m, 1] - y) * out_y)
        if nearest > 0.0:
            return True
    return False
