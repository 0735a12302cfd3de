"""The ground that no rock above a clearance may enter: strips along routes, and circles."""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, inner, kernel, segment_square_distance
from terrain_forge.model import ExclusionZone, Route, Rover, Site, Window

if TYPE_CHECKING:
    from terrain_forge.rocks.populations import ExclusionSpec

_BIN = 1.0
_MAX_BINS = 1000
_LINES_PER_HALF_WIDTH = 25
_MOST_LINES = 200_000


class Corridors(NamedTuple):
    """The corridors of a site, then its exclusion zones, which are kept free alike.

    The corridors' segments are sorted into square bins for fast distances.
    """

    half_width: Array
    """Half the width of each corridor, radius of each exclusion_zone [m], shape [corridors +
    exclusion_zones]."""
    clearance: Array
    """Height that no rock within exceeds [m], shape [corridors + exclusion_zones]."""
    centre: Array
    """East and north of each exclusion_zone's centre [m], shape [exclusion_zones, 2]."""
    segments: Array
    """East and north of both ends [m], shape [segments, 4]."""
    corridor: NDArray[np.int64]
    """Corridor of each segment, shape [segments]."""
    origin: Array
    """South-western corner of the bins [m], shape [2]."""
    bin_size: float
    """Side of a bin [m]."""
    bins: NDArray[np.int64]
    """Columns and rows of bins, shape [2]."""
    first: NDArray[np.int64]
    """Where each bin's segments begin in `members`, row by row, shape [bins + 1]."""
    members: NDArray[np.int64]
    """Segments that touch a bin."""


def exclusion_zones(
    exclusion_zones: tuple[ExclusionSpec, ...], *, routes: tuple[Route, ...], rover: Rover
) -> tuple[ExclusionZone, ...]:
    """The circles that a recipe keeps free, then the starts of routes that have no corridor.

    A start is cleared of all rocks as far as the rover reaches, whichever way it is turned.

    Args:
        exclusion_zones: the recipe's circles.
        routes: all routes of the site.
        rover: who drives them.
    """
    circles = [(one.centre_m, one.radius_m, one.clearance_m) for one in exclusion_zones]
    for route in routes:
        if route.corridor_width == 0.0:
            east, north = route.position[0].tolist()
            circles.append(((east, north), 0.5 * hypot(rover.length, rover.width), 0.0))
    return tuple(
        ExclusionZone(centre=centre, radius=radius, clearance=clearance)
        for centre, radius, clearance in circles
    )


def corridors(site: Site) -> Corridors:
    """The corridors of those routes of a site that have one, and its exclusion zones."""
    kept = [route for route in site.routes if route.corridor_width > 0.0]
    circles = site.exclusion_zones
    pairs = [np.hstack([r.position[:-1], r.position[1:]]) for r in kept]
    segments = np.concatenate(pairs) if pairs else np.zeros((0, 4))
    ends = segments.reshape(-1, 2)
    origin = ends.min(axis=0, initial=np.inf) if len(ends) else np.zeros(2)
    span = ends.max(axis=0) - origin if len(ends) else np.zeros(2)
    bin_size = max(_BIN, float(span.max()) / _MAX_BINS)
    bins = (span // bin_size).astype(np.int64) + 1
    first, members = _sort_into_bins(segments, origin, bin_size, bins)
    return Corridors(
        half_width=np.array(
            [*(0.5 * r.corridor_width for r in kept), *(c.radius for c in circles)]
        ),
        clearance=np.array([c.corridor_clearance for c in kept] + [c.clearance for c in circles]),
        centre=np.array([c.centre for c in circles], np.float64).reshape(-1, 2),
        segments=segments,
        corridor=np.repeat(np.arange(len(kept)), [len(p) for p in pairs]),
        origin=origin,
        bin_size=bin_size,
        bins=bins,
        first=first,
        members=members,
    )


def largest_area(strips: Corridors) -> float:
    """What corridors and exclusion zones cover at most [m²], beyond the site too."""
    steps = strips.segments[:, 2:] - strips.segments[:, :2]
    lengths = np.sqrt((steps * steps).sum(axis=1))
    sides = 2.0 * strips.half_width[strips.corridor] * lengths
    return float(sides.sum() + np.pi * (strips.half_width**2).sum())


def in_corridor(site: Site, xy: Array, *, reach: ArrayLike = 0.0) -> NDArray[np.bool_]:
    """Which points (east, north) [m], shape [points, 2], lie in a corridor or exclusion zone.

    Or come as near to one as their `reach` [m].
    """
    near = np.broadcast_to(np.asarray(reach, np.float64), len(xy)).copy()
    return np.asarray(_inside(corridors(site), np.array(xy, np.float64, order="C"), near))


def corridor_area(site: Site, window: Window) -> float:
    """Area [m²] of a window that lies in a corridor or exclusion zone, overlaps counted once.

    Exact along east, by lines half a fiftieth of a corridor apart along north.
    """
    strips = corridors(site)
    if len(strips.half_width) == 0:
        return 0.0
    east, north = site.axes(window)
    step = float(strips.half_width.min()) / _LINES_PER_HALF_WIDTH
    lines = min(int(np.ceil((north[-1] - north[0]) / step)), _MOST_LINES)
    return float(_area(strips, east[0], east[-1], north[0], north[-1], lines))


def _sort_into_bins(
    segments: Array, origin: Array, size: float, bins: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each bin's segments begin, row by row, and the segments that touch each bin."""
    ends = ((segments.reshape(-1, 2, 2) - origin) // size).astype(np.int64)
    low, high = ends.min(axis=1), np.minimum(ends.max(axis=1), bins - 1)
    span = high - low + 1
    count = span[:, 0] * span[:, 1]
    segment = np.repeat(np.arange(len(segments)), count)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    column = low[segment, 0] + step % span[segment, 0]
    row = low[segment, 1] + step // span[segment, 0]
    touched = row * bins[0] + column
    first = np.searchsorted(np.sort(touched), np.arange(bins[0] * bins[1] + 1))
    return first, segment[np.argsort(touched, kind="stable")]


@inner
def distances(strips, x, y, limit):  # type: ignore[no-untyped-def]
    """Distance [m] of a point to each corridor's middle, at most `limit`, and each zone's."""
    squares = np.empty(len(strips.half_width))
    lanes = len(squares) - len(strips.centre)
    for c in range(len(squares)):
        squares[c] = limit * limit
    for c in range(len(strips.centre)):
        dx, dy = x - strips.centre[c, 0], y - strips.centre[c, 1]
        squares[lanes + c] = dx * dx + dy * dy
    origin, size, bins = strips.origin, strips.bin_size, strips.bins
    i0, i1 = _bin_range(origin[0], size, bins[0], x - limit, x + limit)
    j0, j1 = _bin_range(origin[1], size, bins[1], y - limit, y + limit)
    for j in range(j0, j1):
        for i in range(i0, i1):
            b = j * bins[0] + i
            for m in range(strips.first[b], strips.first[b + 1]):
                s = strips.members[m]
                c = strips.corridor[s]
                squares[c] = min(squares[c], segment_square_distance(strips.segments[s], x, y))
    for c in range(len(squares)):
        squares[c] = np.sqrt(squares[c])
    return squares


@inner
def search_radius(strips, radius):  # type: ignore[no-untyped-def]
    """Distance [m] from which on no corridor matters to a rock of a radius [m]."""
    limit = radius
    for c in range(len(strips.half_width) - len(strips.centre)):
        limit = max(limit, strips.half_width[c] + radius)
    return limit


@inner
def _bin_range(origin, size, count, low, high):  # type: ignore[no-untyped-def]
    """First bin, and one past the last, that an interval of coordinates touches."""
    first, last = np.floor((low - origin) / size), np.floor((high - origin) / size)
    return int(min(max(first, 0), count)), int(min(max(last + 1, 0), count))


@inner
def is_kept_free(strips, x, y, limit, reach):  # type: ignore[no-untyped-def]
    """Whether a place lies within a reach of a corridor or exclusion zone.

    `limit` as of `search_radius`.
    """
    away = distances(strips, x, y, limit)
    for s in range(len(away)):
        if away[s] < strips.half_width[s] + reach:
            return True
    return False


@kernel
def _inside(strips, xy, reach):  # type: ignore[no-untyped-def]
    inside = np.zeros(len(xy), dtype=np.bool_)
    for n in range(len(xy) if len(strips.half_width) else 0):
        limit = search_radius(strips, reach[n])
        inside[n] = is_kept_free(strips, xy[n, 0], xy[n, 1], limit, reach[n])
    return inside


@kernel
def _area(strips, west, east, south, north, lines):  # type: ignore[no-untyped-def]
    step = (north - south) / lines
    widest = search_radius(strips, 0.0)
    lanes = len(strips.half_width) - len(strips.centre)
    most = len(strips.members) + len(strips.centre)
    lows, highs = np.empty(most), np.empty(most)
    length = 0.0
    for line in range(lines):
        y = south + (line + 0.5) * step
        j0, j1 = _bin_range(
            strips.origin[1], strips.bin_size, strips.bins[1], y - widest, y + widest
        )
        count = 0
        for m in range(strips.first[j0 * strips.bins[0]], strips.first[j1 * strips.bins[0]]):
            s = strips.members[m]
            low, high = _chord(strips.segments[s], strips.half_width[strips.corridor[s]], y)
            low, high = max(low, west), min(high, east)
            if low < high:
                count = _insert(lows, highs, count, low, high)
        for c in range(len(strips.centre)):
            offset, radius = y - strips.centre[c, 1], strips.half_width[lanes + c]
            if abs(offset) < radius:
                half = np.sqrt(radius * radius - offset * offset)
                low, high = max(strips.centre[c, 0] - half, west), strips.centre[c, 0] + half
                count = _insert(lows, highs, count, low, min(high, east))
        reached = west
        for n in range(count):
            length += max(highs[n] - max(lows[n], reached), 0.0)
            reached = max(reached, highs[n])
    return length * step


@inner
def _insert(lows, highs, count, low, high):  # type: ignore[no-untyped-def]
    """Enter an interval among those sorted by their low ends; returns how many there are."""
    n = count
    while n > 0 and lows[n - 1] > low:
        lows[n], highs[n] = lows[n - 1], highs[n - 1]
        n -= 1
    lows[n], highs[n] = low, high
    return count + 1


@inner
def _chord(segment, radius, y):  # type: ignore[no-untyped-def]
    """West and east end of the line north = y within `radius` of a segment; infinite if it misses.

    The ends are where segment + sqrt(radius² - s²), a concave function of the place along the
    segment, is largest, s being that place's distance south of the line.
    """
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    offset = y - segment[1]
    length = np.sqrt(dx * dx + dy * dy)
    first, last = 0.0, 1.0
    if dy != 0.0:
        ends = (offset - radius) / dy, (offset + radius) / dy
        first, last = max(first, min(ends)), min(last, max(ends))
    if first > last or (dy == 0.0 and abs(offset) > radius):
        return np.inf, -np.inf
    west, east = np.inf, -np.inf
    for side in (-1.0, 1.0):
        if dy != 0.0:
            best = (offset + side * radius * dx / length * np.sign(dy)) / dy
        else:
            best = 1.0 if side * dx > 0.0 else 0.0
        part = min(max(best, first), last)
        south = offset - part * dy
        half = np.sqrt(max(radius * radius - south * south, 0.0))
        west = min(west, segment[0] + part * dx - half)
        east = max(east, segment[0] + part * dx + half)
    return west, east
