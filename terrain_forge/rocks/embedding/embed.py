"""How scattered rocks lie on the ground: leaning with it, partly buried, without daylight beneath.

The ground's tangent plane at a rock goes through the ground under its centre of mass; its slope is
that of a least-squares plane through the bare ground on a ring of 0.8 diameters. The rock stands
upright on that plane, sunk into it by its share of burial, which is no less than what the real
ground demands where it falls short of the plane: its foot must reach the ground all around. Only
then is it scaled, so that the part above the plane has the wanted exposed diameter exactly.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import (
    Array,
    checked,
    inner,
    kernel,
    matrix_from_quaternion,
    mix,
    over_chunks,
    portable,
)
from terrain_forge.model import Heightfield, Mesh, RockField, RockLibrary, RockPrototype
from terrain_forge.rocks.embedding.burial import PATTERN, PITCH, SPARSE_PATTERN, shared_out
from terrain_forge.rocks.embedding.exposure import (
    DEEPEST,
    Exposure,
    exposed_width,
    exposure,
    upright_width,
)
from terrain_forge.rocks.embedding.footprint import fits, footprints
from terrain_forge.rocks.embedding.lattice import Lattice, height, lattice, onto
from terrain_forge.rocks.embedding.outline import (
    MAX_BURIED,
    MAX_TILT,
    edges,
    leaning,
    plan_axes,
)
from terrain_forge.rocks.scattering.scatter import Scattered

FOOT = 0.05
"""Height of the loop around a rock's foot that lies below the ground, as a part of its extent."""

_SINKINGS = 4
_EACH = np.int64(1)  # point of a foot is looked at where a rock lies
_EVERY = np.int64(4)  # at the other places; of NumPy's type, lest `_covering` compile for each
_NEGLIGIBLE = 1e-3
_SLACK = 1e-6  # of a rock's extent, far above any rounding
_RING_RADIUS = 0.4
_RING_POINTS = 12


@checked
def embed(
    *,
    scattered: Scattered,
    library: RockLibrary,
    ground: Heightfield,
    density: ArrayLike,
    burial: ArrayLike | None = None,
    bare: Heightfield | None = None,
) -> RockField:
    """Embed rocks in the ground.

    Args:
        scattered: The rocks in plan.
        library: Their shapes.
        ground: Bare ground under all of them, with a margin of `scatter.margin` around the window.
        density: Density of each population's rocks [kg/m³], shape [populations].
        burial: Range from which burial was drawn evenly for each population's static rocks, and
            over which it is to stay even, shape [populations, 2]; NaN where it is as the user says.
            By default it is so for all.
        bare: The ground without the soil that lies at the rocks, of the same nodes, which tells how
            rocks lean and what their surroundings demand; by default `ground`.

    Returns:
        The rocks in the order of `scattered`, all of them fixed and buried; `dynamic` says as there
        which ones are yet to be settled.

    Raises:
        ValueError: if the centre of a rock lies off the ground, or a density is none.
    """
    if np.ma.is_masked(density):
        raise ValueError("densities that are masked: a number for each population")
    given, count = np.asarray(density, np.float64), len(scattered.populations)
    if given.shape != (count,) or not ((given > 0.0) & (given < np.inf)).all():
        raise ValueError(
            f"densities {given.tolist()}: must be {count} above 0, one for each population"
        )
    x, y = scattered.xy[:, 0], scattered.xy[:, 1]
    if not np.all(ground.covers(x, y)):
        raise ValueError(f"rocks lie off the ground (west, south, east, north: {ground.bounds})")
    used, prototype = np.unique(scattered.prototype, return_inverse=True)
    shown = [library.prototypes[n] for n in used]
    # Feet are sampled alike whichever shapes a window has.
    points, elsewhere, everywhere, reach = _feet(library)
    feet = _Feet(points[used], elsewhere[used], everywhere[used], reach[used])
    shapes = exposure(shown), feet
    grids = lattice(ground), lattice(bare or ground)
    ranges = np.full((len(scattered.populations), 2), np.nan) if burial is None else burial
    ranges = np.asarray(ranges, np.float64)[scattered.population]
    ranges[scattered.dynamic] = np.nan
    rocks = _Rocks(
        scattered.id, scattered.xy, scattered.yaw, scattered.buried, ranges, scattered.diameter,
        prototype.astype(scattered.prototype.dtype),
    )  # fmt: skip
    lying = _embed(rocks, np.arange(len(scattered)), shapes, grids, MAX_BURIED)
    _sink_deeper(lying, rocks, shown, shapes, grids)
    unit_volume = np.array([prototype.volume for prototype in library.prototypes])
    volume = unit_volume[scattered.prototype] * lying.scale * lying.scale * lying.scale
    names = ("populations", "id", "population", "prototype", "diameter", "dynamic", "collides")
    same: dict[str, Any] = {name: getattr(scattered, name) for name in names}
    return RockField(
        **same,
        position=np.column_stack([scattered.xy, lying.z]),
        quaternion=lying.quaternion,
        scale=lying.scale,
        height=lying.height,
        buried_fraction=lying.buried,
        volume=volume,
        mass=np.asarray(density, np.float64)[scattered.population] * volume,
    )


class _Rocks(NamedTuple):
    """Rocks that are to be embedded, columns of `Scattered`."""

    id: NDArray[np.int32]
    xy: Array
    yaw: Array
    buried: Array
    range: Array
    """From what to what burial was drawn, NaN where the user says it, shape [rocks, 2]."""
    diameter: Array
    prototype: NDArray[np.int32]


class _Embedded(NamedTuple):
    """How rocks lie."""

    z: Array
    """Height of the centre of mass [m], shape [rocks]."""
    quaternion: Array
    """Rotation, shape [rocks, 4]."""
    scale: Array
    """Size in units of the prototype, shape [rocks]."""
    height: Array
    """Top above the tangent plane [m], shape [rocks]."""
    buried: Array
    """Part of the extent below the tangent plane, shape [rocks]."""


class _Feet(NamedTuple):
    """Points of each prototype that must be below the ground."""

    points: Array
    """Those that are looked at elsewhere come first, shape [prototypes, points, 3]."""
    elsewhere: NDArray[np.int64]
    """How many of a prototype's are looked at elsewhere, shape [prototypes]."""
    everywhere: NDArray[np.int64]
    """How many a prototype has, shape [prototypes]."""
    reach: Array
    """How far a prototype's are from its origin at most, shape [prototypes]."""


def _feet(library: RockLibrary) -> _Feet:
    feet = [foot_of(prototype.meshes[0]) for prototype in library.prototypes]
    longest, count = max(map(len, feet)), np.array([*map(len, feet)])
    points, elsewhere = np.zeros((len(feet), longest, 3)), np.zeros_like(count)
    for n, foot in enumerate(feet):
        sparse = np.unique(np.arange(0, longest, _EVERY) % len(foot))
        order = [*sparse, *np.setdiff1d(np.arange(len(foot)), sparse)]
        points[n, : len(foot)], elsewhere[n] = foot[order], len(sparse)
    reach = np.array([float(portable.norm(foot, axis=-1).max()) for foot in feet])
    return _Feet(points, elsewhere, count, reach)


def foot_of(mesh: Mesh) -> Array:
    """Where a rock's edges are at the height of its foot, all around it, shape [points, 3]."""
    vertices, ends = mesh.vertices, mesh.vertices[edges(mesh)]
    level = vertices[:, 2].min() + FOOT * np.ptp(vertices[:, 2])
    ends = ends[(ends[:, 0, 2] < level) != (ends[:, 1, 2] < level)]
    part = (level - ends[:, 0, 2]) / (ends[:, 1, 2] - ends[:, 0, 2])
    return np.asarray(ends[:, 0] + part[:, None] * (ends[:, 1] - ends[:, 0]))


_Shapes = tuple[Exposure, _Feet]
"""Exposed diameters of the prototypes, and their feet."""
_Grounds = tuple[Lattice, Lattice]
"""The ground, and the bare one."""


def _embed(
    rocks: _Rocks, rows: NDArray[np.int64], shapes: _Shapes, grounds: _Grounds, deepest: float
) -> _Embedded:
    """How some of the rocks lie; daylight buries none deeper than to a part of its extent."""
    count = len(rows)
    lying = _Embedded(np.empty(count), np.empty((count, 4)), *(np.empty(count) for _ in range(3)))
    over_chunks(_embed_some, count, rocks, rows, shapes, grounds, deepest, lying)
    return lying


def _sink_deeper(
    lying: _Embedded,
    rocks: _Rocks,
    prototypes: list[RockPrototype],
    shapes: _Shapes,
    grounds: _Grounds,
) -> None:
    """Bury rocks that would still show daylight deeper, where their footprint has space for it.

    Few rocks on the roughest ground need it. They grow, since less of them is exposed.
    """
    rows = np.flatnonzero(lying.buried >= MAX_BURIED)
    deeper = _embed(rocks, rows, shapes, grounds, DEEPEST)
    supports = footprints(prototypes, rocks.prototype[rows])
    for n, row in enumerate(rows.tolist()):
        prototype = prototypes[rocks.prototype[row]]
        turn = matrix_from_quaternion(deeper.quaternion[n])[:2]
        plan = portable.product(
            deeper.scale[n] / rocks.diameter[row] * prototype.meshes[0].vertices, turn.T
        )
        support = supports[int(rocks.prototype[row])]
        if fits(plan, yaw=rocks.yaw[row], support=support, reach=prototype.reach):
            for column, values in zip(lying, deeper, strict=True):
                column[row] = values[n]


@kernel
def _embed_some(first, last, rocks, rows, shapes, grounds, deepest, lying):  # type: ignore[no-untyped-def]
    (exposure, feet), (ground, bare) = shapes, grounds
    ring = np.empty((_RING_POINTS, 5))  # the last three are room for places and heights
    for k in range(_RING_POINTS):
        angle = 2.0 * np.pi * k / _RING_POINTS
        ring[k, 0], ring[k, 1] = np.cos(angle), np.sin(angle)
    for n in range(first, last):
        rock = rows[n]
        p, diameter, yaw = rocks.prototype[rock], rocks.diameter[rock], rocks.yaw[rock]
        x, y = rocks.xy[rock, 0], rocks.xy[rock, 1]
        low, span = exposure.low[p], exposure.span[p]
        foot = feet.points[p, : feet.everywhere[p]]
        half_turn = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
        plane, upright, turn = _lying(bare, x, y, diameter, half_turn, ring)
        plane = height(ground, x, y), plane[1], plane[2]
        axes = plan_axes(turn)
        burial = rocks.buried[rock]
        if rocks.range[rock, 1] > rocks.range[rock, 0]:
            some = foot[: feet.elsewhere[p]]
            burial = _wanted(rocks, rock, exposure, some, bare, half_turn, ring)
        level = low + burial * span
        size = diameter / exposed_width(exposure, p, axes, upright, level)
        for _ in range(_SINKINGS):  # the deeper a rock, the larger it must be, and its foot wider
            deepest_gap = _largest_gap(ground, feet.reach[p] * size, len(foot) // 4, x, y, plane)
            needed = low + FOOT * span + deepest_gap * upright / size
            if needed > level - _SLACK * span:
                needed = _covering(ground, foot, axes, size, x, y, plane, upright)
            deeper = min((needed - low) / span, deepest)
            if deeper <= burial + _NEGLIGIBLE:
                break
            burial, level = deeper, low + deeper * span
            size = diameter / exposed_width(exposure, p, axes, upright, level)
        for k in range(4):
            lying.quaternion[n, k] = turn[k]
        lying.scale[n] = size
        lying.z[n] = plane[0] - level * size / upright
        lying.height[n] = (low + span - level) * size / upright
        lying.buried[n] = burial


@inner
def _wanted(rocks, rock, exposure, foot, ground, half_turn, ring):  # type: ignore[no-untyped-def]
    """Burial of a rock, given what its surroundings demand; about as much as its place demands."""
    p, diameter = rocks.prototype[rock], rocks.diameter[rock]
    in_row = PATTERN if _RING_RADIUS * diameter > ground.spacing else SPARSE_PATTERN
    places, pitch = in_row * in_row, PITCH * diameter * (PATTERN - 1) / (in_row - 1)
    own = int(mix(np.uint64(rocks.id[rock]), 0) % np.uint64(places))
    shallow, deep = rocks.range[rock, 0], rocks.range[rock, 1]
    low, span = exposure.low[p], exposure.span[p]
    size = diameter / upright_width(exposure, p, low + shallow * span)
    needs = np.empty(places)
    for place in range(places):
        east = pitch * (place % in_row - own % in_row)
        north = pitch * (place // in_row - own // in_row)
        x, y = onto(ground, rocks.xy[rock, 0] + east, rocks.xy[rock, 1] + north)
        plane, upright, turn = _lying(ground, x, y, diameter, half_turn, ring)
        level = _covering(ground, foot, plan_axes(turn), size, x, y, plane, upright)
        needs[place] = max(shallow, min((level - low) / span, MAX_BURIED))
    rank, need = 0, needs[own]
    for place in range(places):
        rank += needs[place] > need
    for place in range(1, places):  # from the largest; np.sort would compile for long
        moved, n = needs[place], place
        while n > 0 and needs[n - 1] < moved:
            needs[n] = needs[n - 1]
            n -= 1
        needs[n] = moved
    return shared_out(needs, rank, rocks.buried[rock], shallow, deep)


@inner
def _lying(ground, x, y, diameter, half_turn, ring):  # type: ignore[no-untyped-def]
    """The tangent plane at a point, the z of its normal, and how a rock is turned on it.

    The plane is told by its height [m] and its rise per metre east and north. The rise is that of
    the least-squares plane through a ring of ground, and at most `MAX_TILT`.
    """
    radius = max(_RING_RADIUS * diameter, ground.spacing)
    xs, ys, zs = ring[:, 2], ring[:, 3], ring[:, 4]
    mean_x = mean_y = 0.0
    for k in range(_RING_POINTS):
        xs[k], ys[k] = onto(ground, x + radius * ring[k, 0], y + radius * ring[k, 1])
        zs[k] = height(ground, xs[k], ys[k])
        mean_x, mean_y = mean_x + xs[k], mean_y + ys[k]
    mean_x, mean_y = mean_x / _RING_POINTS, mean_y / _RING_POINTS
    xx = xy = yy = xz = yz = 0.0
    for k in range(_RING_POINTS):
        east, north = xs[k] - mean_x, ys[k] - mean_y
        xx, xy, yy = xx + east * east, xy + east * north, yy + north * north
        xz, yz = xz + east * zs[k], yz + north * zs[k]
    determinant = xx * yy - xy * xy
    slope_x = (yy * xz - xy * yz) / determinant
    slope_y = (xx * yz - xy * xz) / determinant
    steepness = np.sqrt(slope_x * slope_x + slope_y * slope_y)
    share = min(1.0, np.tan(MAX_TILT) / steepness) if steepness > 0.0 else 1.0
    plane = height(ground, x, y), slope_x * share, slope_y * share
    upright = 1.0 / np.sqrt(1.0 + plane[1] * plane[1] + plane[2] * plane[2])
    return plane, upright, leaning(-plane[1] * upright, -plane[2] * upright, upright, half_turn)


@inner
def _covering(ground, foot, axes, size, x, y, plane, upright):  # type: ignore[no-untyped-def]
    """The level of a prototype that must come down to the plane for its foot to be covered."""
    level = -np.inf
    for n in range(len(foot)):
        u, v, w = size * foot[n, 0], size * foot[n, 1], size * foot[n, 2]
        dx = axes[0] * u + axes[1] * v + axes[2] * w
        dy = axes[3] * u + axes[4] * v + axes[5] * w
        east, north = onto(ground, x + dx, y + dy)
        gap = plane[0] + plane[1] * (east - x) + plane[2] * (north - y)
        gap -= height(ground, east, north)
        level = max(level, foot[n, 2] + gap * upright / size)
    return level


@inner
def _largest_gap(ground, reach, most, x, y, plane):  # type: ignore[no-untyped-def]
    """How far a plane is above the ground within a reach [m] at most; `most` cells are looked at.

    A cell is two triangles, and on a hollow edge between them the higher one counts.
    """
    rows, columns = ground.elevation.shape
    u, v = x / ground.spacing - ground.fraction[0], y / ground.spacing - ground.fraction[1]
    u, v, cells = u - ground.corner[0], v - ground.corner[1], reach / ground.spacing
    west = max(min(int(np.floor(u - cells)), columns - 2), 0)
    east = max(min(int(np.floor(u + cells)), columns - 2), 0)
    south = max(min(int(np.floor(v - cells)), rows - 2), 0)
    north = max(min(int(np.floor(v + cells)), rows - 2), 0)
    if (east - west + 1) * (north - south + 1) > most:
        return np.inf
    gap, rise_x, rise_y = -np.inf, plane[1] * ground.spacing, plane[2] * ground.spacing
    for j in range(south, north + 1):
        low, high = max(v - cells - j, 0.0), min(v + cells - j, 1.0)
        middle_y, half_y = 0.5 * (low + high), 0.5 * (high - low)
        for i in range(west, east + 1):
            low, high = max(u - cells - i, 0.0), min(u + cells - i, 1.0)
            middle_x, half_x = 0.5 * (low + high), 0.5 * (high - low)
            sw, se = np.float64(ground.elevation[j, i]), np.float64(ground.elevation[j, i + 1])
            nw = np.float64(ground.elevation[j + 1, i])
            ne = np.float64(ground.elevation[j + 1, i + 1])
            corner = plane[0] + rise_x * (i - u) + rise_y * (j - v) - sw
            dx, dy = rise_x - (se - sw), rise_y - (ne - se)
            one = corner + dx * middle_x + dy * middle_y + abs(dx) * half_x + abs(dy) * half_y
            dx, dy = rise_x - (ne - nw), rise_y - (nw - sw)
            other = corner + dx * middle_x + dy * middle_y + abs(dx) * half_x + abs(dy) * half_y
            gap = max(gap, min(one, other) if se + nw >= sw + ne else max(one, other))
    return gap
